"""A folder of parts at a URL: a shared path or an object store, by fsspec.

The parts are those of a batch's data set, on their way from a worker to the folder of the driver,
which alone keeps them: no second store of pours.
"""

import contextlib
import errno
import uuid
from typing import Any

__all__ = ["PartStore"]

_NAME = "part-{:06}.parquet"


class PartStore:
    """Parts that workers write and the driver reads, each whole or absent.

    Args:
        url: folder as fsspec takes it, for example s3://bucket/run or file:///shared/run.

    Raises:
        ModuleNotFoundError: fsspec, or what it needs for this kind of URL, is not installed.
        ValueError: no such kind of URL; the message says what is allowed.
    """

    def __init__(self, url: str) -> None:
        import fsspec  # pyright: ignore[reportMissingImports]
        from fsspec.implementations.local import (  # pyright: ignore[reportMissingImports]
            LocalFileSystem,
        )

        allowed = "a folder's URL as fsspec takes it, as file:///shared/run or s3://bucket/run"
        if not url:
            raise ValueError(f"the store must be {allowed}, got an empty text")
        try:
            found: tuple[Any, str] = fsspec.core.url_to_fs(url)
        except (ValueError, TypeError, AttributeError) as error:
            # Kinds that stand on another one, such as dir://, fail as their program does.
            raise ValueError(f"the store must be {allowed}, got {url!r}: {error}") from None
        except ImportError as error:
            raise ModuleNotFoundError(
                f"the store {url!r} needs another package: {error}; none of granulcal's extras has "
                "it: pip install it for the driver and for all workers"
            ) from None
        self._files, self._root = found[0], found[1].rstrip("/")
        # A worker need not stand where the driver does, from where a path is named, nor be at home
        # there: `~/run`, `run` and `file://run` would be other folders on it.
        is_relative = isinstance(found[0], LocalFileSystem) and not url.startswith("file:///")
        self.url = self._root if is_relative else url

    def chunks(self) -> set[int]:
        """Returns the numbers of the parts that are there."""
        if not self._files.exists(self._root):
            return set()
        names = [path.rpartition("/")[2] for path in self._files.ls(self._root, detail=False)]
        begin, end = _NAME.split("{:06}")
        named = [name for name in names if name.startswith(begin) and name.endswith(end)]
        numbers = [name[len(begin) : -len(end)] for name in named]
        return {int(number) for number in numbers if number.isdigit()}

    def read(self, chunk: int) -> bytes:
        """Returns the bytes of a part."""
        return self._files.cat_file(self._path(chunk))

    def write(self, chunk: int, part: bytes) -> None:
        """Writes a part beside its place and moves it there; a second one is the same.

        Raises:
            OSError: it cannot be written; names its URL.
        """
        beside = f"{self._path(chunk)}.{uuid.uuid4().hex}.tmp"
        try:
            self._files.makedirs(self._root, exist_ok=True)
            self._files.pipe_file(beside, part)
            self._files.mv(beside, self._path(chunk))
        except OSError as error:
            # A half one would take the room of a full store, and one more with every trial.
            with contextlib.suppress(Exception):
                self._files.rm_file(beside)
            url, why = self.url_of(chunk), f"cannot write: {error.strerror or error}"
            raise OSError(error.errno or errno.EIO, why, url) from error

    @staticmethod
    def name_of(chunk: int) -> str:
        """Returns the name of a part's file, in the store and in the folder of its batch."""
        return _NAME.format(chunk)

    def url_of(self, chunk: int) -> str:
        """Returns the URL of a part, for messages."""
        return f"{self.url.rstrip('/')}/{self.name_of(chunk)}"

    def _path(self, chunk: int) -> str:
        return f"{self._root}/{self.name_of(chunk)}"
