"""An engine that pours for everything: calibration, kept pours, the loop."""

import sys
from pathlib import Path

import numpy as np
import pytest
from own_simulators import cone

import granulcal as gc
from granulcal.engines import CallableEngine, ExportedEngine


def test_calibration_pours_in_the_engine(
    small_scene: gc.Scene, small_prior: gc.Prior, tmp_path: Path
) -> None:
    from granulcal.pours.kept_pours import KeptPours

    engine = CallableEngine(lambda scene, seed: scene.start(seed), name="not moved")
    theta = small_prior.sample(2, seed=1)
    pours = KeptPours(small_scene, small_prior, tmp_path / "pours.json", engine=engine)
    # Grains that hang where they began: a ball of 60 grains whose lowest point is at 2 cm.
    found = pours(theta, 0)
    assert found.shape == (2, 16) and (found[:, 0] > 0.02).all()
    points = CallableEngine(cone, name="cones")
    with pytest.raises(ValueError, match="another scene, prior or seed"):
        KeptPours(small_scene, small_prior, tmp_path / "pours.json", engine=points)
    seen = KeptPours(small_scene, small_prior, tmp_path / "cones.json", engine=points)(theta, 0)
    assert np.isfinite(seen).all()


def test_the_engine_in_use_pours_for_everything_and_is_told_in_what_is_kept(
    small_scene: gc.Scene, small_prior: gc.Prior, tmp_path: Path
) -> None:
    from granulcal.engines import engine_in_use, pouring_with
    from granulcal.loop.pours.forward import Forward

    hanging = CallableEngine(lambda scene, seed: scene.start(seed), name="not moved")
    forward = Forward(tmp_path / "pours", threads=2)
    ours = forward.pours(small_scene, [1, 2])
    with pouring_with(hanging):
        assert engine_in_use() is hanging
        theirs = forward.pours(small_scene, [1, 2])
        data = gc.generate(small_scene, small_prior, 2, out=tmp_path / "rows", progress=False)
        with pytest.raises(RuntimeError, match="is in use already"), pouring_with(hanging):
            pass
    assert engine_in_use() is None
    assert data.version == f"{gc.__version__}, pours by not moved"
    # Nothing fell, and neither took the pours that the other had kept.
    assert (theirs[:, 0] > 0.02).all() and (ours[:, 0] < 0.02).all()
    assert np.array_equal(forward.pours(small_scene, [1, 2]), ours)
    assert len(list((tmp_path / "pours").iterdir())) == 2


def test_kept_pours_of_two_engines_are_not_mixed(
    small_scene: gc.Scene, small_prior: gc.Prior, tmp_path: Path
) -> None:
    """They had been, where the engine was in use and not given."""
    from granulcal.engines import pouring_with
    from granulcal.pours.kept_pours import KeptPours

    path, theta = tmp_path / "pours.json", small_prior.sample(1, seed=1)
    hanging, lifted = (
        CallableEngine(
            lambda scene, seed, up=up: (scene.start(seed)[0] + [0, 0, up], 0.002), name=name
        )
        for name, up in (("hanging", 0.0), ("lifted", 0.1))
    )
    with pouring_with(hanging):
        KeptPours(small_scene, small_prior, path)(theta, 0)
        assert len(KeptPours(small_scene, small_prior, path).rows) == 1
    with pouring_with(lifted), pytest.raises(ValueError, match="prior or seed, or engine"):
        KeptPours(small_scene, small_prior, path)
    with pytest.raises(ValueError, match="law"):
        KeptPours(small_scene, small_prior, path)


def test_a_loop_does_not_look_for_what_the_engine_cannot_be_told(
    capsys: pytest.CaptureFixture[str],
) -> None:
    from granulcal.commands.close_loop import _told
    from granulcal.engines import pouring_with
    from granulcal.loop.effects.library import by_name
    from granulcal.loop.task import Condition, Task

    pours = tuple(Path(f"{i}.npz") for i in range(3))
    task = Task(
        scene=gc.Scene.funnel(0.04, count=50),
        prior=gc.Prior.default(),
        conditions=(Condition("4 cm", {"funnel.height": 0.04}, "fit", pours),),
        library=by_name(["cohesion.capillary", "diameter", "camera.scale"]),
    )
    assert _told(task) is task
    with pouring_with(ExportedEngine("mujoco", python=sys.executable)):
        assert [effect.name for effect in _told(task).library] == ["diameter", "camera.scale"]
    assert "cohesion.capillary is not looked for" in capsys.readouterr().out
