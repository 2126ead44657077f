"""Parts that a store holds of an earlier run: kept, made anew, or refused by their URL."""

import tempfile
import warnings
from pathlib import Path

from granulcal import _native
from granulcal.errors import DamagedPartWarning
from granulcal.pours.part_store import PartStore
from granulcal.prior import Prior

__all__ = ["StoredParts"]


class StoredParts:
    """The parts of one batch in a store.

    Args:
        store: where they are.
        batch: takes them.
        folder: of the batch; messages of `batch` name files in it.
        scene: what is poured.
        prior_toml: what is drawn.
        rows: rows in all.
        seed: of the batch.
    """

    def __init__(
        self,
        store: PartStore,
        batch: _native.GatheredBatch,
        folder: Path,
        *,
        scene: _native.Scene,
        prior_toml: str,
        rows: int,
        seed: int,
    ) -> None:
        self.store, self._batch, self._folder = store, batch, folder
        self._scene_toml, self._prior, self._seed = scene.to_toml(), prior_toml, seed
        self._rows = rows

    def take_all(self) -> None:
        """Takes every part that the batch lacks; a short or damaged one stays lacking, to be made.

        Raises:
            ValueError: a part of something else; names its URL.
        """
        for chunk in sorted(self.store.chunks() & set(self._batch.missing())):
            try:
                part = self.store.read(chunk)
            except FileNotFoundError:
                continue
            try:
                self._batch.put(chunk, part)
            except ValueError as error:
                self._refuse_foreign(chunk, part, error)

    def take(self, chunk: int) -> bool:
        """Takes a part that a worker has just written; returns whether the batch lacked it.

        Raises:
            FileNotFoundError: it is not there: the worker's folder of this URL is another one.
            ValueError: it is damaged, or of something else; names its URL.
        """
        try:
            part = self.store.read(chunk)
        except FileNotFoundError:
            raise FileNotFoundError(
                f"{self.store.url_of(chunk)} is not there, but a worker has just written it: the "
                "store must be a folder that the driver and all workers share, or an object store"
            ) from None
        try:
            return self._batch.put(chunk, part)
        except ValueError as error:
            raise ValueError(self._named(chunk, error)) from None

    def _refuse_foreign(self, chunk: int, part: bytes, error: ValueError) -> None:
        """Returns if a part that was not taken may be made anew, else raises."""
        text = self._named(chunk, error)
        with tempfile.TemporaryDirectory(prefix="granulcal-") as place:
            file = Path(place) / "part.parquet"
            file.write_bytes(part)
            try:
                data = _native.Dataset.open(file)
            except ValueError:
                said = f"{text}; its rows are poured again"
                warnings.warn(said, DamagedPartWarning, stacklevel=2)
                return
        if not self._is_short(chunk, data):
            raise ValueError(f"{text}; or use another store, or move this part away") from None

    def _is_short(self, chunk: int, data: _native.Dataset) -> bool:
        """Returns whether a part is of this batch as it was when it was smaller, or was stopped."""
        size = self._batch.chunk_size
        first, wanted = chunk * size, min(size, self._rows - chunk * size)
        numbers = [int(row) for row in data.row]
        return (
            data.scene_toml == self._scene_toml
            and Prior.from_toml(data.prior_toml) == Prior.from_toml(self._prior)
            and data.seed == self._seed
            and all(first <= row < first + size for row in numbers)
            and sum(row < self._rows for row in numbers) < wanted
        )

    def _named(self, chunk: int, error: ValueError) -> str:
        """The message with the part's URL in place of the file that it is not yet."""
        url = self.store.url_of(chunk)
        text = str(error).replace(str(self._folder / self.store.name_of(chunk)), url)
        return text if url in text else f"{url}: {text}"
