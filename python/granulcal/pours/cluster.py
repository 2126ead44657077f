"""A batch on a Ray cluster: a task makes a part of 16 rows, the driver gathers the parts.

A row depends on scene, prior, seed and its number alone, so that it does not matter where it is
made, nor whether it is made twice: the first part of a chunk is kept. Ray starts a task again whose
worker or node is gone; what the driver has gathered is on its disk, and a driver that is started
again asks for what is missing.
"""

import contextlib
import socket
import statistics
import tempfile
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from granulcal import _native
from granulcal.pours.awaited import Awaited
from granulcal.pours.losses import Losses
from granulcal.pours.part_store import PartStore
from granulcal.pours.stored_parts import StoredParts

if TYPE_CHECKING:
    from granulcal.engines import Engine

__all__ = [
    "AHEAD",
    "RETRIES",
    "Cluster",
    "LostResultError",
    "cluster_asked",
    "cluster_in_use",
    "connected",
    "cores_of",
    "gather",
    "refuse_engine",
    "result_of",
    "spread_over",
]

AHEAD = 2
"""Tasks for each core, so that none waits for the driver."""
# Tasks that take this many medians are made a second time on a core that has nothing to do.
_STRAGGLES = 3.0
_LEAST_STRAGGLE_S = 20.0
RETRIES = 20
"""Workers that are killed under the same part so often are not killed by chance."""


# How long an address may take to answer [s].
_PATIENCE_OF_ADDRESS_S = 20.0


class LostResultError(Exception):
    """A task has to be asked for again."""


@dataclass(frozen=True)
class Cluster:
    """Where the pours are made.

    Attributes:
        address: of the cluster as `ray.init` takes it; `local` starts one on this machine.
        store: URL of a folder of parts that workers write and the driver reads, for example
            s3://bucket/run; None: parts come back through Ray.
    """

    address: str = "auto"
    store: str | None = None

    def of_batch(self, scene_toml: str, prior_toml: str, seed: int) -> "Cluster":
        """Returns the cluster with a folder in its store for one batch of a job of several.

        Parts are named by their numbers alone: those of two batches would be taken for each other.
        """
        if self.store is None:
            return self
        batch = _native.hash_bytes(f"{scene_toml}\n{prior_toml}\n{seed}".encode())
        return replace(self, store=f"{self.store.rstrip('/')}/batch-{batch}")


_in_use: Cluster | None = None
_is_connection_ours = False


@contextlib.contextmanager
def spread_over(cluster: Cluster | None) -> Iterator[None]:
    """Lets all batches of pours use a cluster; None for this machine's threads."""
    global _in_use
    before, _in_use = _in_use, cluster
    try:
        yield
    finally:
        _in_use = before
        if before is None:
            _disconnect()


def cluster_in_use() -> Cluster | None:
    """Returns the cluster of the job that runs, None for this machine's threads."""
    return _in_use


def cluster_asked(ray: "str | Cluster | None") -> Cluster | None:
    """Returns the cluster of an argument `ray`: an address, a cluster, or None for the job's.

    Raises:
        TypeError: something else.
    """
    if ray is None:
        return cluster_in_use()
    if not isinstance(ray, str | Cluster):
        raise TypeError(f"ray must be the address of a cluster, a str, or None, got {ray!r}")
    return Cluster(ray) if isinstance(ray, str) else ray


def refuse_engine(engine: "Engine | None") -> None:
    """Refuses another engine where a cluster pours.

    Raises:
        ValueError: there is one.
    """
    if engine is not None:
        raise ValueError(f"a cluster pours with granulcal alone, not with the engine {engine.name}")


def connected() -> Any:
    """Returns ray, connected to the job's cluster until the job ends, unless it is connected.

    Raises:
        ModuleNotFoundError: ray is not installed.
        ConnectionError: there is no cluster at the address.
    """
    global _is_connection_ours
    import ray

    cluster = cluster_in_use()
    if cluster is None or ray.is_initialized():
        return ray
    quiet = {"log_to_driver": False, "logging_level": "ERROR", "include_dashboard": False}
    if cluster.address != "local":
        del quiet["include_dashboard"]
        _require_listener(cluster.address)
    ray.init(address=cluster.address, **quiet)
    _is_connection_ours = True
    return ray


def _require_listener(address: str) -> None:
    """Refuses HOST:PORT at which nobody listens, for which Ray would wait ten minutes.

    Raises:
        ConnectionError: nobody answers there.
    """
    if address in ("auto", "local"):
        return
    host, mark, port = address.removeprefix("ray://").rpartition(":")
    if not mark or not port.isdecimal():
        raise ConnectionError(
            "the address of a Ray cluster must be auto, local, HOST:PORT or ray://HOST:PORT, "
            f"got {address!r}"
        )
    try:
        socket.create_connection(
            (host.strip("[]"), int(port)), timeout=_PATIENCE_OF_ADDRESS_S
        ).close()
    except (OSError, OverflowError) as error:
        raise ConnectionError(f"no Ray cluster answers at {address}: {error}") from error


def cores_of(cluster: Cluster) -> int:
    """Returns how many pours a cluster makes at once, at least 1.

    Raises:
        ModuleNotFoundError: ray is not installed.
        ConnectionError: there is no cluster at the address.
    """
    with spread_over(cluster):
        return _cores(connected())


def _cores(ray: Any) -> int:
    return max(1, int(ray.cluster_resources().get("CPU", 1)))


def _disconnect() -> None:
    """Ends the connection that `connected` has made."""
    global _is_connection_ours
    if _is_connection_ours:
        import ray

        ray.shutdown()
        _is_connection_ours = False


def result_of(ray: Any, reference: Any) -> Any:
    """Returns what a task has made.

    Raises:
        Exception: what granulcal said on the worker, not the worker's trace of it.
        LostResultError: it is lost: its workers were killed more often than Ray starts them again,
            or it went with its node.
    """
    try:
        return ray.get(reference)
    except ray.exceptions.RayTaskError as error:
        raise error.cause if isinstance(error.cause, Exception) else error from None
    except (ray.exceptions.RayError, OSError) as error:
        raise LostResultError(str(error)) from error


def gather(
    scene: _native.Scene,
    prior_toml: str,
    folder: Path,
    *,
    rows: int,
    seed: int,
    resume: bool,
    cluster: Cluster,
    chunk: int | None = None,
    report: Callable[..., object] | None = None,
) -> tuple[int, int, int, int, int, int]:
    """Brings every part that `folder` lacks from a cluster; returns the counts of the batch.

    Args:
        scene: what is poured.
        prior_toml: what is drawn.
        folder: of the batch; made where it is absent.
        rows: rows in all.
        seed: of the batch.
        resume: keep what is in the folder; else a folder with rows is refused.
        cluster: where the pours are made.
        chunk: rows of a part in a folder that is new; the default is 16.
        report: called with (total, resumed, made, unhealthy, jammed, without grains
            in view).

    Raises:
        ModuleNotFoundError: ray is not installed.
        ConnectionError: there is no cluster at the address.
        ValueError: a store that is no URL, a folder or a part in the store made from something
            else, or a worker with another granulcal.
    """
    import ray

    store = None if cluster.store is None else PartStore(cluster.store)
    batch = _native.GatheredBatch(
        scene, prior_toml, folder, rows=rows, seed=seed, resume=resume, chunk=chunk
    )
    try:
        stored = None
        if store is not None:
            stored = StoredParts(
                store,
                batch,
                folder,
                scene=scene,
                prior_toml=prior_toml,
                rows=rows,
                seed=seed,
            )
            stored.take_all()
        if batch.missing():
            with spread_over(cluster):
                connected()
                order = (scene.to_toml(), prior_toml, rows, seed, batch.chunk_size, batch.chunks)
                _Gathering(ray, batch, order, stored, report).run()
        return batch.counts()
    finally:
        batch.close()


def _make_part(
    scene_toml: str,
    prior_toml: str,
    rows: int,
    seed: int,
    chunk_size: int,
    chunks: int,
    chunk: int,
    store: str | None,
) -> bytes | None:
    """Makes one part on a worker; returns its bytes, or None once they are in the store."""
    scene = _native.Scene.from_toml(scene_toml)
    with tempfile.TemporaryDirectory(prefix="granulcal-") as place:
        _native.generate(
            scene,
            prior_toml,
            place,
            rows=rows,
            seed=seed,
            threads=1,
            resume=True,
            progress=None,
            shard=(chunk, chunks),
            chunk=chunk_size,
        )
        part = (Path(place) / f"part-{chunk:06}.parquet").read_bytes()
    if store is None:
        return part
    PartStore(store).write(chunk, part)
    return None


@dataclass
class _Task:
    chunk: int
    since: float
    is_second: bool


class _Gathering:
    """The driver's loop."""

    def __init__(
        self,
        ray: Any,
        batch: _native.GatheredBatch,
        order: tuple[str, str, int, int, int, int],
        stored: StoredParts | None,
        report: Callable[..., object] | None,
    ) -> None:
        self.ray, self.batch, self.order = ray, batch, order
        self.awaited, self.losses = Awaited(ray), Losses(ray)
        self.stored, self.report = stored, report
        self.remote = ray.remote(num_cpus=1, max_retries=RETRIES)(_make_part)
        self.waiting = deque(batch.missing())
        self.tasks: dict[Any, _Task] = {}
        self.took: list[float] = []

    def run(self) -> None:
        """Submits, waits and gathers until no chunk is missing."""
        try:
            while self.batch.missing():
                self._submit()
                for reference in self.awaited.done(self.tasks):
                    self._take(reference)
                if self.report is not None:
                    self.report(*self.batch.counts())
        finally:
            for reference in self.tasks:
                self.ray.cancel(reference, force=True)

    def _submit(self) -> None:
        cores = _cores(self.ray)
        while self.waiting and len(self.tasks) < AHEAD * cores:
            self._start(self.waiting.popleft(), is_second=False)
        if self.waiting or not self.took or len(self.tasks) >= cores:
            return
        late = max(_LEAST_STRAGGLE_S, _STRAGGLES * statistics.median(self.took))
        twice = {task.chunk for task in self.tasks.values() if task.is_second}
        for task in list(self.tasks.values()):
            is_late = time.monotonic() - task.since > late
            if is_late and task.chunk not in twice and len(self.tasks) < cores:
                self._start(task.chunk, is_second=True)
                twice.add(task.chunk)

    def _start(self, chunk: int, *, is_second: bool) -> None:
        store = None if self.stored is None else self.stored.store.url
        reference = self.remote.remote(*self.order, chunk, store)
        self.tasks[reference] = _Task(chunk, time.monotonic(), is_second)

    def _take(self, reference: Any) -> None:
        task = self.tasks.pop(reference)
        try:
            part = result_of(self.ray, reference)
        except LostResultError as error:
            if task.chunk in self.batch.missing():
                self.losses.count(task.chunk, error)
                self.waiting.append(task.chunk)
            return
        is_new = (
            self.batch.put(task.chunk, part)
            if self.stored is None
            else self.stored.take(task.chunk)
        )
        if is_new:
            self.took.append(time.monotonic() - task.since)
        for other, same in list(self.tasks.items()):
            if same.chunk == task.chunk:
                del self.tasks[other]
                self.ray.cancel(other, force=True)
