"""Data sets: many pours of one scene under a prior, on disk and in memory."""

from __future__ import annotations

import tempfile
import warnings
from collections import Counter
from collections.abc import Callable
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from granulcal import _native
from granulcal.engines.in_use import engine_in_use, required
from granulcal.errors import OtherLawWarning, UnverifiedDataWarning
from granulcal.pours.cluster import Cluster, cluster_asked, gather, refuse_engine
from granulcal.pours.left_out import LeftOut
from granulcal.pours.scene import Scene, require_scene
from granulcal.pours.statistics import DIAGNOSTIC_NAMES, NAMES
from granulcal.pours.status import NO_GRAINS, UNUSABLE
from granulcal.prior import Prior, require_prior
from granulcal.progress import ProgressLine
from granulcal.whole import check_seed, check_whole

if TYPE_CHECKING:
    from granulcal.engines import Engine

__all__ = ["Dataset", "generate"]

Array = NDArray[np.float64]

# Who opened Parquet by one of these names would not find it.
_OTHER_TABLES = (".csv", ".tsv", ".txt", ".json", ".xlsx", ".feather", ".npy", ".npz")


class Dataset:
    """Parameters and statistics of many pours, one row each.

    Made by `generate` or read by `load`. Columns of `theta` are in the parameters' own units,
    columns of `x` are the statistics that the scene observes, or the paper's 16 where it observes
    none, in their units.

    Attributes:
        path: the folder or file it was read from.
        theta: the parameters that vary, shape (n, p).
        theta_names: their paths in the scene.
        x: the statistics, shape (n, s); NaN for what could not be seen.
        x_names: their names.
        paper16: the paper's statistics, shape (n, 16); NaN where no grains were in view.
        observed: the statistics that the scene observes, shape (n, k).
        observed_names: their names.
        diagnostics: the diagnostic statistics, shape (n, 43); NaN where no grains were in view, and
            in data sets that were made before there were any.
        diagnostic_names: their names.
        status: how each pour ended.
        seed: seed of each pour, shape (n,).
        row: index of each pour, shape (n,).
        health: penetration, residuals, energy, losses and times of each pour, by name.
    """

    def __init__(self, native: _native.Dataset, path: Path, rows: int | None = None) -> None:
        self._native = native
        self.path = path
        # Wherever whoever opens it again stands, and of a longer batch no more than this has.
        self._place, self._rows = path.absolute(), rows
        self.row = native.row
        self.theta = native.theta
        self.theta_names: tuple[str, ...] = tuple(native.theta_names)
        self.paper16 = native.x
        self.observed = native.observed
        self.observed_names: tuple[str, ...] = tuple(native.observed_names)
        observes = len(self.observed_names) > 0
        self.x = self.observed if observes else self.paper16
        self.x_names: tuple[str, ...] = self.observed_names if observes else NAMES
        self.diagnostics = native.diagnostics
        self.diagnostic_names: tuple[str, ...] = DIAGNOSTIC_NAMES
        self.status: NDArray[np.str_] = np.array(native.status, dtype=np.str_)
        self.seed = native.pour_seed
        self.health = native.health
        self.scene_toml = native.scene_toml
        """The scene before the prior's parameters were set, as TOML."""
        self.base_seed = native.seed
        """Seed of the whole data set."""
        self.version = native.version
        """Version of granulcal that made it."""
        self.law = native.law
        """Number of the law that the pours follow; 0 for another simulator, None if unknown."""

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Dataset:
        """Returns the data set in a folder that `generate` made, or in one Parquet file.

        Raises:
            FileNotFoundError: there is no such folder or file.
            ValueError: it is there but no data set, or damaged; the message says where.
        """
        native = _native.Dataset.open(path)
        if native.unverified:
            warnings.warn(
                f"{native.unverified} files of {path} are of an earlier version without hashes of "
                "their rows: damage in them cannot be found",
                UnverifiedDataWarning,
                stacklevel=2,
            )
        if native.other_law is not None:
            warnings.warn(f"{path} was {native.other_law}", OtherLawWarning, stacklevel=2)
        return cls(native, Path(path))

    def save(self, path: str | PathLike[str]) -> None:
        """Writes all rows, with scene, prior and versions, as one Parquet file.

        Raises:
            ValueError: the name ends as that of a table of another kind.
        """
        if Path(path).suffix.lower() in _OTHER_TABLES:
            raise ValueError(
                f"{path}: a data set is saved as Parquet: let the name end in .parquet, or write "
                "another table of to_pandas() or columns()"
            )
        self._native.write(path)

    @cached_property
    def prior(self) -> Prior:
        """The prior that the parameters were drawn from."""
        return Prior.from_toml(self._native.prior_toml)

    @cached_property
    def scene(self) -> Scene:
        """The scene before the prior's parameters were set."""
        return Scene.from_toml(self.scene_toml)

    @property
    def missing(self) -> int:
        """Rows that are missing of those asked for: of a batch that was stopped, or a shard."""
        return self._native.missing

    @property
    def is_usable(self) -> NDArray[np.bool_]:
        """Which pours are healthy, left the funnel and show every statistic of `x`, shape (n,)."""
        return ~np.isin(self.status, (*UNUSABLE, NO_GRAINS)) & np.isfinite(self.x).all(axis=1)

    @property
    def left_out(self) -> LeftOut:
        """How many pours are not usable, by why."""
        return LeftOut.of(self.status.tolist(), self.is_usable.tolist())

    def status_counts(self) -> dict[str, int]:
        """Returns how many pours ended in each status."""
        return dict(sorted(Counter(self.status.tolist()).items()))

    def columns(self) -> dict[str, NDArray[Any]]:
        """Returns every column by name, in the order of the Parquet file."""
        theta = {name: self.theta[:, i] for i, name in enumerate(self.theta_names)}
        x = {name: self.paper16[:, i] for i, name in enumerate(NAMES)}
        named = {
            **dict(zip(self.diagnostic_names, self.diagnostics.T, strict=True)),
            **dict(zip(self.observed_names, self.observed.T, strict=True)),
        }
        keys = {"row": self.row, **theta, "seed": self.seed, "status": self.status}
        return {**keys, **self.health, **x, **named}

    def to_pandas(self) -> Any:
        """Returns a pandas DataFrame of all columns.

        Raises:
            ModuleNotFoundError: pandas is not installed.
        """
        try:
            import pandas  # pyright: ignore[reportMissingImports]
        except ModuleNotFoundError as error:
            told = "pandas is not installed: pip install pandas; columns() is the same as arrays"
            raise ModuleNotFoundError(told, name=error.name) from None
        return pandas.DataFrame(self.columns())

    def __len__(self) -> int:
        return len(self.theta)

    def __reduce__(self) -> tuple[Any, ...]:
        # To another process goes where it lies.
        return _opened, (self._place, self._rows)

    def _repr_html_(self) -> str:
        from granulcal.html import page

        rows: dict[str, object] = {"pours": len(self), **self.status_counts()}
        rows |= {
            name: f"{low:.3g} to {high:.3g}"
            for name, low, high in zip(
                self.theta_names, self.theta.min(axis=0), self.theta.max(axis=0), strict=True
            )
        }
        return page(f"Dataset of {self.scene.name}", rows)

    def __repr__(self) -> str:
        counts = ", ".join(f"{n} {status}" for status, n in self.status_counts().items())
        return f"Dataset({len(self)} pours: {counts}; {', '.join(self.theta_names)})"


def _opened(path: Path, rows: int | None) -> Dataset:
    """Returns the data set at a path, of a folder its first `rows` rows if that is a number."""
    if rows is None:
        return Dataset.load(path)
    return Dataset(_native.Dataset.open(path, rows), path, rows)


def _asked(engine: Engine) -> Callable[[_native.Scene, int], Any]:
    """Returns the function that the Rust side calls from its threads."""
    return lambda scene, seed: engine(Scene(scene), seed)


def generate(
    scene: Scene,
    prior: Prior,
    n: int,
    seed: int = 0,
    out: str | PathLike[str] | None = None,
    threads: int | None = None,
    resume: bool = True,
    *,
    progress: bool | Callable[..., object] = True,
    engine: Engine | None = None,
    ray: str | Cluster | None = None,
    chunk: int | None = None,
) -> Dataset:
    """Returns `n` pours with parameters drawn from `prior`, simulating what `out` lacks.

    Row i depends on scene, prior, seed and i alone, so a batch can be stopped (Ctrl-C included),
    continued and extended, on any number of threads, and has the same rows.

    Args:
        scene: what is poured; the prior's parameters are set in it by path.
        prior: what is drawn.
        n: number of pours.
        seed: seed of the draws and of the pours.
        out: folder of the Parquet files; the default is a new temporary folder, which stays.
        threads: pours at once; the default is one for each core. A cluster has one for each of its
            own.
        resume: keep the rows that are in `out` already; else a folder with rows is refused.
        progress: show a line on stderr; or a function of (total, resumed, made, unhealthy,
            jammed, without grains in view), the last three of all rows that are there.
        engine: another simulator in place of ours; docs/engines.md says what it must do.
        ray: address of a Ray cluster that makes the pours, as `ray.init` takes it, or `local`;
            docs/cluster.md.
        chunk: rows of a part, which one task of a cluster makes; the default is 16. A folder that
            has parts already keeps their size.

    Raises:
        TypeError: an argument is of another kind.
        ValueError: a number that is out of its range, a parameter that does not fit the scene, or
            a folder made from something else.
        OSError: the folder cannot be written.
        KeyboardInterrupt: Ctrl-C; finished pours are on disk.

    Examples:
        >>> data = generate(Scene.drop(0.02, count=30), Prior.default(), n=4, progress=False)
        >>> data.theta.shape, data.x.shape
        ((4, 3), (4, 16))
    """
    require_scene(scene)
    engine = required(engine) or engine_in_use()
    require_prior(prior)
    check_whole("n", n, at_least=1)
    check_seed(seed)
    if chunk is not None:
        check_whole("chunk", chunk, at_least=1)
    if threads is not None:
        check_whole("threads", threads, at_least=1)
    cluster = cluster_asked(ray)
    if cluster is not None:
        refuse_engine(engine)
        if ray is None:
            cluster = cluster.of_batch(scene.to_toml(), prior.to_toml(), seed)
    folder = Path(tempfile.mkdtemp(prefix="granulcal-") if out is None else out)
    line = ProgressLine() if progress is True else None
    report = line if line is not None else (progress if callable(progress) else None)
    try:
        if cluster is not None:
            counts = gather(
                scene.native,
                prior.to_toml(),
                folder,
                rows=n,
                seed=seed,
                resume=resume,
                cluster=cluster,
                chunk=chunk,
                report=report,
            )
        else:
            counts = _native.generate(
                scene.native,
                prior.to_toml(),
                folder,
                rows=n,
                seed=seed,
                threads=threads,
                resume=resume,
                progress=report,
                engine=None if engine is None else (engine.name, _asked(engine)),
                chunk=chunk,
            )
        if report is not None:
            report(*counts)
    finally:
        if line is not None:
            line.close()
    return Dataset(_native.Dataset.open(folder, n), folder, n)
