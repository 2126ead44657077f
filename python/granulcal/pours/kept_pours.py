"""Pours of one run that are kept one by one in one document, and never made twice.

A document that people and other programs read, and that is refused where it is damaged or of
something else: a budget of pours is paid for once. Groups of pours that nobody reads, and that are
made again where a file is damaged, are those of `store.py`.
"""

import contextlib
import hashlib
import json
import math
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal import _native
from granulcal.cores import cores
from granulcal.documents import ListOf, Mapping, Maybe, Number, Table, Text, Whole, read_json
from granulcal.engines.in_use import engine_in_use, law_of_pours
from granulcal.files import write_beside
from granulcal.pours.at_once import at_once
from granulcal.pours.cluster import cluster_in_use, refuse_engine
from granulcal.pours.forward import scene_at
from granulcal.pours.left_out import LeftOut
from granulcal.pours.made_for import SCHEMA as MADE_FOR
from granulcal.pours.made_for import MadeFor
from granulcal.pours.one_run import OneRun
from granulcal.pours.scene import Scene
from granulcal.pours.simulate import Pour, simulate
from granulcal.pours.statistics import NAMES, statistics
from granulcal.pours.status import NO_GRAINS, UNUSABLE
from granulcal.prior import Prior

if TYPE_CHECKING:
    from granulcal.engines import Engine

__all__ = ["KeptPours"]

Array = NDArray[np.float64]

_POUR = Table(
    {"theta": ListOf(Number(), least=1), "status": Text(), "x": Maybe(ListOf(Maybe(Number())))},
    {"cpu_s": Number()},
)
_SCHEMA = Table(
    {"key": Text(), "pours": Mapping(_POUR)},
    {"names": ListOf(Text()), "hash": Text(), "law": Whole(), "made_for": MADE_FOR},
)
# Seeds of pours of one run; data sets' are hashes, and reports' begin at 9000.
_FIRST_SEED = 40_000_000
# Longest time for which finished pours are in memory alone [s].
_KEEP_EVERY_S = 2.0


class KeptPours:
    """Simulator of a scene that keeps every pour in a file, and never makes one twice.

    Args:
        scene: the scene before the prior's parameters are set.
        prior: names the parameters.
        path: the file; rewritten as a whole at most every two seconds, and when a call ends.
        seed: seed of the run.
        threads: pours at once; the default is one for each core.
        progress: called with the number of pours that are kept, after each.
        observed: keep the statistics that the scene observes in place of the paper's 16.
        look: what to keep of a pour in place of both: names, and the function that measures them;
            a ValueError of the function says that too few grains are in view.
        engine: another simulator in place of ours, or of the one in use.
        made_for: the observation that leads the run; a file that states none takes it.

    Raises:
        ValueError: the file is that of another scene, prior, seed, law, engine or observation, or
            is damaged.
        BlockingIOError: another process pours into the file.
    """

    def __init__(
        self,
        scene: Scene,
        prior: Prior,
        path: Path,
        *,
        seed: int = 0,
        threads: int | None = None,
        progress: Callable[[int], None] | None = None,
        observed: bool = False,
        look: tuple[tuple[str, ...], Callable[[Pour], ArrayLike]] | None = None,
        engine: "Engine | None" = None,
        made_for: MadeFor | None = None,
    ) -> None:
        """Reads what is kept already."""
        own = (scene.observed_names, Pour.observed) if observed else (NAMES, Pour.statistics)
        self.x_names, self.look = own if look is None else look
        engine = engine or engine_in_use()
        self.engine = engine
        self.scene, self.prior, self.path, self.seed = scene, prior, path, seed
        self.threads, self.progress = threads or cores(), progress
        text = f"{scene.to_toml()}\n{prior.to_toml()}\n{seed}" + ("\nobserved" if observed else "")
        if look is not None:
            text += f"\n{', '.join(self.x_names)}"
        text += "" if engine is None else f"\n{engine.name}"
        # Another simulator has another law, whatever it is.
        self.law = law_of_pours(scene) if engine is None else 0
        self.made_for = None if made_for is None else made_for.as_dict()
        self.key = hashlib.sha256(text.encode()).hexdigest()
        # Before it is read: what another run writes after that would be lost.
        self._held = OneRun.of(path)
        self.rows: dict[str, dict] = self._read(made_for) if path.exists() else {}

    def __call__(self, theta: Array, first: int) -> Array:
        """Returns the statistics of pours at `theta` (b, p), NaN where there are none, (b, s)."""
        missing = [i for i in range(len(theta)) if not self._is_kept(first + i, theta[i])]
        for i in missing:
            # One at other parameters: it is not counted among those that are kept.
            self.rows.pop(str(first + i), None)
        asked = [(theta[i], _FIRST_SEED + 100_000 * self.seed + first + i) for i in missing]
        if missing and cluster_in_use() is not None:
            refuse_engine(self.engine)
        work = partial(_poured, self.scene, self.prior, self.look, self.engine)
        written = time.monotonic()
        try:
            with contextlib.closing(at_once(work, asked, self.threads)) as rows:
                for place, row in rows:
                    self.rows[str(first + missing[place])] = row
                    if time.monotonic() - written > _KEEP_EVERY_S:
                        self._write()
                        written = time.monotonic()
                    if self.progress is not None:
                        self.progress(len(self.rows))
        finally:
            if missing:
                self._write()
        kept = [self.rows[str(first + i)]["x"] for i in range(len(theta))]
        return np.array([[np.nan] * len(self.x_names) if x is None else x for x in kept], float)

    def kept_of(self, theta: Array) -> int:
        """Returns how many of the pours at `theta` (b, p), from the first on, are kept already."""
        return sum(self._is_kept(i, row) for i, row in enumerate(theta))

    def left_out(self, count: int, needed: Sequence[str] | None = None) -> LeftOut:
        """Returns how many of the first `count` pours that are kept cannot be used, by why.

        Args:
            count: pours.
            needed: names of the statistics that a pour must have; all if None.
        """
        kept = [row for index, row in list(self.rows.items()) if int(index) < count]
        places = [self.x_names.index(name) for name in needed or self.x_names]
        usable = [
            row["x"] is not None and all(row["x"][place] is not None for place in places)
            for row in kept
        ]
        return LeftOut.of([row["status"] for row in kept], usable)

    def _is_kept(self, index: int, theta: Array) -> bool:
        row = self.rows.get(str(index))
        return row is not None and np.allclose(row["theta"], theta, rtol=1e-12, atol=0)

    def _read(self, made_for: MadeFor | None) -> dict[str, dict]:
        document = read_json(self.path, _SCHEMA)
        key, rows = document["key"], document["pours"]
        if document.get("hash") not in (None, _hash(rows)):
            raise ValueError(f"{self.path} is damaged: its pours are not those that were written")
        if document.get("law") != self.law:
            law = document.get("law")
            found = "a law of before laws had numbers" if law is None else f"law {law}"
            raise ValueError(
                f"{self.path} has pours by {found} of the solver, today's is {self.law}: their "
                "statistics must not be mixed; give another folder, or remove the file"
            )
        if key != self.key:
            raise ValueError(
                f"{self.path} has the pours of another scene, prior or seed, or engine; give "
                "another folder, or remove the file"
            )
        stated = document.get("made_for")
        if stated is not None and made_for is not None:
            made_for.require_same(stated, self.path)
        self.made_for = stated or self.made_for
        return rows

    def _write(self) -> None:
        document = {"key": self.key, "law": self.law, "names": self.prior.names}
        document |= {} if self.made_for is None else {"made_for": self.made_for}
        write_beside(
            self.path, json.dumps({**document, "hash": _hash(self.rows), "pours": self.rows})
        )


def _poured(
    base: Scene,
    prior: Prior,
    look: Callable[[Pour], ArrayLike],
    engine: "Engine | None",
    asked: tuple[Array, int],
) -> dict:
    """The row of one pour, by its parameters and seed."""
    theta, seed = asked
    scene = scene_at(base, prior, theta)
    if engine is not None:
        left = engine(scene, seed)
        if not isinstance(left, tuple):
            if look is not Pour.statistics:
                raise ValueError(f"{engine.name} gave points of a surface and no grains")
            x = _numbers(statistics(left))
            return {"theta": theta.tolist(), "status": "at_rest", "x": x}
        pour = Pour(scene.native.pour_of(*left, seed), scene, seed)
    else:
        pour = simulate(scene, seed=seed)
    status, x = pour.status, None
    if status not in UNUSABLE:
        try:
            x = _numbers(look(pour))
        except ValueError:
            status = NO_GRAINS
    row = {"theta": theta.tolist(), "status": status, "x": x}
    # Nobody knows the time of another engine.
    return {**row, "cpu_s": pour.cpu_seconds} if math.isfinite(pour.cpu_seconds) else row


def _numbers(values: ArrayLike) -> list[float | None]:
    """Returns statistics for JSON, None for what could not be seen: it has no NaN."""
    each = np.asarray(values, float).tolist()
    return [value if math.isfinite(value) else None for value in each]


def _hash(rows: dict[str, dict]) -> str:
    return _native.hash_bytes(json.dumps(rows, sort_keys=True).encode())
