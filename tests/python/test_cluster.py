"""Batches on Ray: the rows of a local run bit for bit, whoever is killed on the way.

Ray runs in processes of the tests' own: it warns, and it leaves threads behind.
"""

import errno
import importlib.util
import pickle
import re
import shutil
import signal
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import granulcal as gc
from granulcal import _native
from granulcal.pours.cluster import spread_over
from granulcal.pours.kept_pours import KeptPours
from granulcal.pours.part_store import PartStore
from granulcal.pours.stored_parts import StoredParts

pytest.importorskip("ray")

ROWS = 112
COMMON = f"""
import sys
import granulcal as gc
scene = gc.Scene.drop(0.01, count=25)
prior = gc.Prior.default()
ROWS, OUT = {ROWS}, sys.argv[1]
"""
KILL = """
import os, pathlib, signal

def is_ours(pid):
    while pid > 1:
        if pid == os.getpid():
            return True
        pid = int(pathlib.Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])
    return False

def kill_a_worker(named):
    for place in pathlib.Path("/proc").glob("[0-9]*"):
        try:
            words, pid = (place / "cmdline").read_text(), int(place.name)
            if words.startswith(named) and is_ours(pid):
                os.kill(pid, signal.SIGKILL)
                return True
        except OSError:
            pass
    return False
"""
THREE_NODES = (
    COMMON
    + KILL
    + """
import ray
from ray.cluster_utils import Cluster
cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
nodes = [cluster.add_node(num_cpus=1) for _ in range(2)]
ray.init(address=cluster.address, log_to_driver=False, logging_level="ERROR")
assert ray.cluster_resources()["CPU"] == 3
done = []

def watch(total, resumed, made, *left_out):
    if made and not done and kill_a_worker("ray::_make_part"):
        done.append("worker")
    if done and made >= 16 * (len(done) + 1) and nodes:
        cluster.remove_node(nodes.pop(), allow_graceful=False)
        done.append("node")

gc.generate(scene, prior, ROWS, seed=5, out=OUT, ray=cluster.address, progress=watch)
print(*done)
ray.shutdown()
cluster.shutdown()
"""
)
AT_ONCE = (
    COMMON
    + KILL
    + """
import numpy as np
from pathlib import Path
from granulcal.loop.pours.forward import Forward
from granulcal.pours.cluster import Cluster, spread_over
from granulcal.pours.kept_pours import KeptPours
theta, folder, killed = prior.sample(60, seed=3), Path(OUT), []
scene = scene.with_({"grains.count": 150})
folder.mkdir()

def watch(kept):
    if not killed and kill_a_worker("ray::_one"):
        killed.append(kept)

with spread_over(Cluster("local")):
    spread = KeptPours(scene, prior, folder / "spread.json", progress=watch)(theta, 0)
    loop = Forward(folder / "spread", 2).pours(scene, range(8))
here = KeptPours(scene, prior, folder / "here.json")(theta, 0)
assert np.array_equal(spread, here, equal_nan=True)
assert np.array_equal(loop, Forward(folder / "here", 2).pours(scene, range(8)))
import ray
print(len(killed), ray.is_initialized())
"""
)
ONE_NODE = (
    COMMON
    + """
import ray
def watch(total, resumed, made, *left_out):
    print(resumed, made, flush=True)
cluster = gc.Cluster("local", store=sys.argv[2])
gc.generate(scene, prior, ROWS, seed=5, out=OUT, ray=cluster, progress=watch)
"""
)


@pytest.fixture(scope="module")
def whole() -> gc.Dataset:
    scene = gc.Scene.drop(0.01, count=25)
    return gc.generate(scene, gc.Prior.default(), ROWS, seed=5, progress=False)


def same(data: gc.Dataset, whole: gc.Dataset) -> bool:
    """Whether the rows are the same, but for the time that they took."""
    columns, others = data.columns(), whole.columns()
    assert columns.keys() == others.keys()
    return all(
        np.array_equal(columns[name], others[name], equal_nan=columns[name].dtype.kind == "f")
        for name in columns
        if name != "cpu_s"
    )


@pytest.mark.skipif(sys.platform != "linux", reason="workers are found in /proc")
def test_a_worker_and_two_of_three_nodes_are_killed(whole: gc.Dataset, tmp_path: Path) -> None:
    out = tmp_path / "rows"
    command = [sys.executable, "-c", THREE_NODES, str(out)]
    told = subprocess.run(command, capture_output=True, text=True, timeout=500)
    assert told.returncode == 0, told.stderr[-3000:]
    # Ray tells of the dead among it.
    assert "worker node node" in told.stdout.splitlines(), told.stdout[-2000:]
    assert same(gc.Dataset.load(out), whole)


def test_the_driver_is_killed_and_started_again(whole: gc.Dataset, tmp_path: Path) -> None:
    out, store = tmp_path / "rows", f"file://{tmp_path / 'store'}"
    command = [sys.executable, "-c", ONE_NODE, str(out), store]
    made = 0
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as driver:
        assert driver.stdout is not None
        for line in driver.stdout:
            made = int(line.split()[1])
            if made:
                break
        driver.send_signal(signal.SIGKILL)
    assert 0 < made < ROWS
    again = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert again.returncode == 0, again.stderr[-3000:]
    lines = again.stdout.splitlines()
    assert not lines or int(lines[0].split()[0]) >= 16
    assert same(gc.Dataset.load(out), whole)
    # What is in the store is not made again, whatever became of the folder.
    assert PartStore(store).chunks() == set(range(ROWS // 16))
    for part in out.iterdir():
        part.unlink()
    third = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert third.returncode == 0 and third.stdout == f"0 {ROWS}\n", third.stderr[-3000:]
    assert same(gc.Dataset.load(out), whole)


@pytest.mark.skipif(sys.platform != "linux", reason="workers are found in /proc")
def test_pours_one_by_one_are_those_of_threads_whoever_is_killed(tmp_path: Path) -> None:
    command = [sys.executable, "-c", AT_ONCE, str(tmp_path / "pours")]
    told = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert told.returncode == 0, told.stderr[-3000:]
    assert "1 False" in told.stdout.splitlines(), told.stdout[-2000:]


def test_an_address_where_nobody_listens_is_refused_at_once(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    scene, prior = gc.Scene.drop(0.01, count=5), gc.Prior.default()
    with pytest.raises(ConnectionError, match=f"no Ray cluster answers at 127.0.0.1:{port}"):
        gc.generate(scene, prior, 2, out=tmp_path / "rows", ray=f"127.0.0.1:{port}")


def test_pours_of_another_engine_are_not_spread(tmp_path: Path) -> None:
    engine = gc.engines.CallableEngine(lambda scene, seed: np.zeros((1, 3)), name="none")
    scene, prior = gc.Scene.drop(0.01, count=5), gc.Prior.default()
    pours = KeptPours(scene, prior, tmp_path / "pours.json", engine=engine)
    with (
        spread_over(gc.Cluster("local")),
        pytest.raises(ValueError, match="granulcal alone, not with the engine none"),
    ):
        pours(prior.sample(2, seed=1), 0)


def test_an_engine_does_not_go_with_a_cluster(tmp_path: Path) -> None:
    engine = gc.engines.CallableEngine(lambda scene, seed: np.zeros((1, 3)), name="none")
    with pytest.raises(ValueError, match="pours with granulcal alone, not with the engine none"):
        gc.generate(
            gc.Scene.drop(0.01, count=5),
            gc.Prior.default(),
            2,
            out=tmp_path / "rows",
            engine=engine,
            ray="local",
        )
    assert not (tmp_path / "rows").exists()


def stored(parts: Path, store: Path) -> Path:
    """Copies the parts of a data set into a store."""
    store.mkdir()
    for part in parts.glob("part-*.parquet"):
        shutil.copy(part, store)
    return store


def test_a_larger_batch_goes_on_with_a_store_that_has_short_and_damaged_parts(
    tmp_path: Path,
) -> None:
    """Each had ended the command, and named a file of the folder that was not there."""
    scene, prior = gc.Scene.drop(0.01, count=25), gc.Prior.default()
    gc.generate(scene, prior, 36, seed=5, out=tmp_path / "before", progress=False)
    store = stored(tmp_path / "before", tmp_path / "store")
    (store / "part-000001.parquet").write_bytes(b"")
    (tmp_path / "scene.toml").write_text(scene.to_toml())
    words = [sys.executable, "-m", "granulcal.cli", "generate", str(tmp_path / "scene.toml")]
    words += ["default", "-n", "48", "--seed", "5", "-q", "--ray", "local"]
    words += ["-o", str(tmp_path / "rows"), "--ray-store", store.as_uri()]
    told = subprocess.run(words, capture_output=True, text=True, timeout=300)
    assert told.returncode in (0, 3), told.stderr[-3000:]
    url = f"{store.as_uri()}/part-000001.parquet"
    lines = [line for line in told.stderr.splitlines() if line.startswith("warning: ")]
    assert len(lines) == 1 and lines[0].startswith(f"warning: {url} is truncated, damaged or no")
    assert lines[0].endswith("; its rows are poured again")
    whole = gc.generate(scene, prior, 48, seed=5, progress=False)
    assert same(gc.Dataset.load(tmp_path / "rows"), whole)
    # The store is whole now, and no cluster is asked.
    cluster = gc.Cluster("nowhere:1", store=store.as_uri())
    again = gc.generate(
        scene, prior, 48, seed=5, out=tmp_path / "again", progress=False, ray=cluster
    )
    assert same(again, whole)


def test_a_part_of_something_else_is_refused_by_its_url(tmp_path: Path) -> None:
    scene, prior = gc.Scene.drop(0.01, count=25), gc.Prior.default()
    gc.generate(scene, prior, 20, seed=5, out=tmp_path / "before", progress=False)
    store = stored(tmp_path / "before", tmp_path / "store")
    path = "material.restitution"
    other = gc.Prior([gc.Parameter(path=path, distribution="uniform", low=0.2, high=0.3)])
    cases = (
        (scene.with_({"grains.count": 26}), prior, 5, "scene.grains.count is 25, but 26 is given"),
        (scene, other, 5, "the prior is"),
        (scene, prior, 6, "the seed is 5, but 6 is given"),
    )
    # Of a short part, too, what it is of counts before its length.
    for number in (0, 1):
        url = re.escape(f"{store.as_uri()}/part-{number:06}.parquet")
        for case, (scene_of, prior_of, seed, why) in enumerate(cases):
            cluster = gc.Cluster("nowhere:1", store=f"{store.as_uri()}/")
            with pytest.raises(ValueError, match=f"^{url}: {why}.*use another store, or move"):
                gc.generate(
                    scene_of,
                    prior_of,
                    40,
                    seed=seed,
                    out=tmp_path / f"rows-{number}-{case}",
                    progress=False,
                    ray=cluster,
                )
        (store / f"part-{number:06}.parquet").unlink()


def test_a_part_that_a_worker_left_damaged_is_told_by_its_url(tmp_path: Path) -> None:
    scene, prior = gc.Scene.drop(0.01, count=5), gc.Prior.default()
    batch = _native.GatheredBatch(
        scene.native, prior.to_toml(), tmp_path / "rows", rows=4, seed=1, resume=True
    )
    store = PartStore((tmp_path / "store").as_uri())
    work = {"scene": scene.native, "prior_toml": prior.to_toml(), "rows": 4, "seed": 1}
    parts = StoredParts(store, batch, tmp_path / "rows", **work)
    store.write(0, b"PAR1 and no more")
    with pytest.raises(ValueError, match=f"^{re.escape(store.url_of(0))} is truncated"):
        parts.take(0)
    batch.close()


def test_a_store_that_is_named_by_a_path_is_the_drivers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A worker had written its parts below the folder that it stands in."""
    (tmp_path / "worker").mkdir()
    monkeypatch.chdir(tmp_path)
    store = PartStore("parts")
    monkeypatch.chdir(tmp_path / "worker")
    PartStore(store.url).write(0, b"a part")
    assert store.chunks() == {0} and store.read(0) == b"a part"
    for url in ("memory://run", (tmp_path / "parts").as_uri()):
        assert PartStore(url).url == url


def test_a_part_on_a_cluster_has_as_many_rows_as_asked(tmp_path: Path) -> None:
    out = tmp_path / "rows"
    words = ["generate", "drop", "default", "-n", "5", "--chunk", "2", "--preset", "fast", "-q"]
    words += ["--set", "grains.count=5", "--ray", "local", "-o", str(out)]
    command = [sys.executable, "-m", "granulcal.cli", *words]
    told = subprocess.run([*command, "--dry-run"], capture_output=True, text=True, timeout=300)
    assert told.returncode == 0 and "at most 5 pours" in told.stdout, told.stderr[-3000:]
    assert not out.exists()
    told = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert told.returncode in (0, 3), told.stderr[-3000:]
    assert len(list(out.glob("part-*.parquet"))) == 3
    assert gc.Dataset.load(out).scene.preset == "fast"


def test_a_store_by_a_short_name_is_the_same_folder_on_a_worker(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Workers had made a folder named `~`, or one below where they stand."""
    (tmp_path / "worker").mkdir()
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    for url in ("~/parts", "file://parts", "file:parts", "file://~/parts"):
        monkeypatch.chdir(tmp_path)
        store = PartStore(url)
        monkeypatch.chdir(tmp_path / "worker")
        PartStore(store.url).write(7, url.encode())
        assert store.chunks() == {7} and store.read(7) == url.encode()
    assert not list((tmp_path / "worker").iterdir())
    assert PartStore("~/parts").url == str(tmp_path / "home" / "parts")


def test_a_store_that_the_workers_do_not_share_is_told(tmp_path: Path) -> None:
    """Only the name of a file had been told, and not what was the matter with it."""
    scene, prior = gc.Scene.drop(0.01, count=5), gc.Prior.default()
    batch = _native.GatheredBatch(
        scene.native, prior.to_toml(), tmp_path / "rows", rows=4, seed=1, resume=True
    )
    work = {"scene": scene.native, "prior_toml": prior.to_toml(), "rows": 4, "seed": 1}
    # As the driver sees what a worker has written to a memory of its own.
    store = PartStore("memory://nobody-has-written-here")
    parts = StoredParts(store, batch, tmp_path / "rows", **work)
    url = re.escape("memory://nobody-has-written-here/part-000000.parquet")
    with pytest.raises(FileNotFoundError, match=f"^{url} is not there.*all workers share"):
        parts.take(0)
    batch.close()


def test_batches_of_one_job_have_folders_of_their_own_in_its_store(tmp_path: Path) -> None:
    """The second batch of `close-loop --ray-store` had been refused by the parts of the first."""
    scene, prior = gc.Scene.drop(0.01, count=25), gc.Prior.default()
    cluster = gc.Cluster("nowhere:1", store=f"{(tmp_path / 'store').as_uri()}/")
    (tmp_path / "store").mkdir()
    made = {}
    for seed in (5, 6):
        made[seed] = gc.generate(
            scene, prior, 20, seed=seed, out=tmp_path / f"{seed}", progress=False
        )
        of_batch = cluster.of_batch(scene.to_toml(), prior.to_toml(), seed).store
        assert of_batch is not None and of_batch.startswith(f"{cluster.store}batch-")
        stored(tmp_path / f"{seed}", Path(of_batch.removeprefix("file://")))
    # All is in the store: no cluster is asked.
    with spread_over(cluster):
        for seed in (5, 6):
            again = gc.generate(
                scene, prior, 20, seed=seed, out=tmp_path / f"again-{seed}", progress=False
            )
            assert same(again, made[seed])
    assert gc.Cluster("nowhere:1").of_batch("", "", 1) == gc.Cluster("nowhere:1")


def test_a_store_of_a_kind_that_cannot_be_is_refused_in_its_words() -> None:
    """It had been an error of the program's own, and an extra that does not help had been named."""
    with pytest.raises(ValueError, match="^the store must be a folder's URL.*got 'dir://run'"):
        PartStore("dir://run")
    if importlib.util.find_spec("s3fs") is None:
        with pytest.raises(ModuleNotFoundError, match="s3fs.*none of granulcal's extras.*pip inst"):
            PartStore("s3://bucket/run")


def stopped_in_the_middle(scene: gc.Scene, prior: gc.Prior, folder: Path) -> list[int]:
    """Makes the parts of a batch that was stopped; returns the rows of the first: it has gaps."""

    class StopError(Exception):
        pass

    def stop(total: int, resumed: int, made: int, *left_out: int) -> None:
        if made >= 6:
            raise StopError

    for seed in range(200):
        shutil.rmtree(folder, ignore_errors=True)
        with pytest.raises(StopError):
            gc.generate(scene, prior, 32, seed=seed, out=folder, threads=8, progress=stop)
        rows = gc.Dataset.load(folder).row.tolist() if any(folder.glob("part-*0.parquet")) else []
        if rows != list(range(len(rows))) and rows[-1] < 16:
            return [seed, *rows]
    raise AssertionError("no row has overtaken another")


def test_a_part_that_was_stopped_is_made_anew_whichever_rows_it_has(tmp_path: Path) -> None:
    """One with gaps had ended the command, as one of something else does."""
    scene = gc.Scene.funnel(0.12).with_({"grains.count": 40})
    prior = gc.Prior.default()
    seed, *rows = stopped_in_the_middle(scene, prior, tmp_path / "before")
    store = PartStore(stored(tmp_path / "before", tmp_path / "store").as_uri())
    batch = _native.GatheredBatch(
        scene.native, prior.to_toml(), tmp_path / "rows", rows=16, seed=seed, resume=True
    )
    work = {"scene": scene.native, "prior_toml": prior.to_toml(), "rows": 16, "seed": seed}
    assert len(rows) < 16
    StoredParts(store, batch, tmp_path / "rows", **work).take_all()
    assert batch.missing() == [0] and not list((tmp_path / "rows").glob("part-*"))
    batch.close()


def test_a_store_without_room_is_named_and_keeps_no_half_part(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The half ones had taken what room there was, and nothing had said where."""
    store = PartStore((tmp_path / "store").as_uri())

    def half(path: str, part: bytes) -> None:
        Path(path).write_bytes(part[:3])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(store._files, "pipe_file", half)
    with pytest.raises(OSError, match="cannot write: No space left") as told:
        store.write(0, b"a part")
    assert told.value.errno == errno.ENOSPC and told.value.filename == store.url_of(0)
    assert not list((tmp_path / "store").iterdir())
    # As it comes back from a worker.
    again = pickle.loads(pickle.dumps(told.value))
    assert (again.filename, again.strerror) == (told.value.filename, told.value.strerror)
    monkeypatch.undo()
    store.write(0, b"a part")
    assert [part.name for part in (tmp_path / "store").iterdir()] == ["part-000000.parquet"]
