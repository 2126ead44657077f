"""Batches on Ray: the rows of a local run bit for bit, whoever is killed on the way.

Ray runs in processes of the tests' own: it warns, and it leaves threads behind.
"""

import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import granulcal as gc
from granulcal.pours.part_store import PartStore

pytest.importorskip("ray")

ROWS = 112
COMMON = f"""
import sys
import granulcal as gc
scene = gc.Scene.drop(0.01, count=25)
prior = gc.Prior.default()
ROWS, OUT = {ROWS}, sys.argv[1]
"""
THREE_NODES = (
    COMMON
    + """
import os, pathlib, signal, ray
from ray.cluster_utils import Cluster
cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
nodes = [cluster.add_node(num_cpus=1) for _ in range(2)]
ray.init(address=cluster.address, log_to_driver=False, logging_level="ERROR")
assert ray.cluster_resources()["CPU"] == 3
done = []

def is_ours(pid):
    while pid > 1:
        if pid == os.getpid():
            return True
        pid = int(pathlib.Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])
    return False

def kill_a_worker():
    for place in pathlib.Path("/proc").glob("[0-9]*"):
        try:
            words, pid = (place / "cmdline").read_text(), int(place.name)
            if words.startswith("ray::_make_part") and is_ours(pid):
                os.kill(pid, signal.SIGKILL)
                done.append("worker")
                return
        except OSError:
            pass

def watch(total, resumed, made, *left_out):
    if made and not done:
        kill_a_worker()
    if done and made >= 16 * (len(done) + 1) and nodes:
        cluster.remove_node(nodes.pop(), allow_graceful=False)
        done.append("node")

gc.generate(scene, prior, ROWS, seed=5, out=OUT, ray=cluster.address, progress=watch)
print(*done)
ray.shutdown()
cluster.shutdown()
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
