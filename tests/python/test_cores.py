"""A process that may use some of a machine's cores makes no more pours at once."""

import argparse
import os
import subprocess
import sys
from pathlib import Path

import pytest

import granulcal as gc
from granulcal.commands.dry_run import say_how_long
from granulcal.cores import cores
from granulcal.pours import cluster

PINNED = """
import os, sys
from pathlib import Path
os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
import granulcal as gc
from granulcal.cores import cores
from granulcal.pours.kept_pours import KeptPours
kept = KeptPours(gc.Scene.drop(0.01, count=5), gc.Prior.default(), Path(sys.argv[1]))
print(cores(), kept.threads)
"""


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="no process is held to cores")
def test_a_job_that_has_one_core_of_the_machine_pours_once_at_a_time(tmp_path: Path) -> None:
    """It had made as many pours at once as the machine has cores, as in a job of SLURM."""
    command = [sys.executable, "-c", PINNED, str(tmp_path / "pours.json")]
    told = subprocess.run(command, capture_output=True, text=True, timeout=100)
    assert told.stdout == "1 1\n", told.stderr[-3000:]


def test_there_is_one_core_at_least_where_nobody_can_be_held_to_some(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert cores() >= 1
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert cores() == 1


def test_a_dry_run_on_a_cluster_tells_of_its_cores(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """That of `calibrate` had told of this machine's, whether there was a cluster or not."""
    asked = []
    monkeypatch.setattr(cluster, "cores_of", lambda one: asked.append(one) or 64)
    scene, prior = gc.Scene.drop(0.01, count=5), gc.Prior.default()
    options = argparse.Namespace(ray="head:6379", threads=None)
    assert say_how_long(options, scene, prior, 640) == 0
    told = capsys.readouterr().out
    assert told.rstrip().endswith("64 at once") and asked == [cluster.Cluster("head:6379")]
    options.threads = 3
    assert say_how_long(options, scene, prior, 640) == 0
    assert capsys.readouterr().out.rstrip().endswith("3 at once") and len(asked) == 1
