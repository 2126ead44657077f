"""Engines in Python: commands and functions of one's own in place of our simulator."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from own_simulators import cone

import granulcal as gc
from granulcal.engines import CallableEngine, CommandEngine, ExportedEngine, engine_named
from granulcal.engines.protocol import FewerGrainsWarning, UnlikeGrainsWarning


def test_a_command_makes_a_pour_with_the_scenes_camera(
    own_simulator: str, small_scene: gc.Scene
) -> None:
    engine = CommandEngine(own_simulator)
    rough = small_scene.with_({"material.sliding_friction": 0.9})
    pour, again = (
        gc.simulate(rough, seed=4, engine=engine),
        gc.simulate(rough, seed=4, engine=engine),
    )
    assert pour.status == "at_rest" and pour.state_hash == again.state_hash
    assert pour.positions.shape == (60, 3) and np.all(pour.radii == 0.002)
    smooth = gc.simulate(
        small_scene.with_({"material.sliding_friction": 0.1}), seed=4, engine=engine
    )
    assert pour.statistics()["max_z"] > smooth.statistics()["max_z"]
    assert np.isnan(pour.health["worst_penetration"])


def test_rows_of_an_engine_are_a_data_set_and_are_not_mixed_with_ours(
    small_scene: gc.Scene, small_prior: gc.Prior, tmp_path: Path
) -> None:
    engine = CallableEngine(cone, name="cones")
    data = gc.generate(small_scene, small_prior, 6, out=tmp_path, progress=False, engine=engine)
    assert data.version == f"{gc.__version__}, pours by cones"
    assert data.is_usable.all() and np.isfinite(data.x).all()
    friction = data.theta[:, data.theta_names.index("material.sliding_friction")]
    expected = [gc.statistics(cone(small_scene.with_({"material.sliding_friction": f}), int(s)))
                ["max_z"] for f, s in zip(friction, data.seed, strict=True)]  # fmt: skip
    assert np.allclose(data.paper16[:, 0], expected)
    more = gc.generate(small_scene, small_prior, 8, out=tmp_path, progress=False, engine=engine)
    assert np.array_equal(more.x[:6], data.x)
    with pytest.raises(ValueError, match="law of the solver is another simulator's"):
        gc.generate(small_scene, small_prior, 8, out=tmp_path, progress=False)


def test_grains_in_another_unit_or_under_the_ground_are_told(small_scene: gc.Scene) -> None:
    def asked(factor: float, lowered: float) -> None:
        def pour(scene: gc.Scene, seed: int) -> tuple[np.ndarray, np.ndarray]:
            centres, radii = scene.start(seed)
            return factor * (centres - [0.0, 0.0, lowered]), factor * radii

        gc.simulate(small_scene, engine=CallableEngine(pour, name="mine"))

    with pytest.warns(
        UnlikeGrainsWarning, match=r"'mine' left grains with a radius of 2 m.*metres"
    ):
        asked(1e3, 0.0)
    with pytest.warns(UnlikeGrainsWarning, match="60 of 60 grains under the ground"):
        asked(1.0, 1.0)
    asked(1.0, 0.0)


def test_what_is_no_engine_is_refused(small_scene: gc.Scene) -> None:
    with pytest.raises(TypeError, match=r"engine_named\('lammps'\)"):
        gc.simulate(small_scene, engine="lammps")  # pyright: ignore[reportArgumentType]
    with pytest.raises(TypeError, match=r"CallableEngine\(function\) makes one"):
        gc.simulate(small_scene, engine=cone)  # pyright: ignore[reportArgumentType]
    with pytest.raises(TypeError, match="material must be a Material, got 3; a seed is seed="):
        gc.simulate(small_scene, 3)  # pyright: ignore[reportArgumentType]
    with pytest.raises(TypeError, match="restitution must be a number, got '0.5'"):
        gc.Material(sliding_friction=0.5, rolling_friction=0.1, restitution="0.5")  # pyright: ignore[reportArgumentType]


def test_the_error_of_a_function_is_the_callers(
    small_scene: gc.Scene, small_prior: gc.Prior, tmp_path: Path
) -> None:
    def broken(scene: gc.Scene, seed: int) -> np.ndarray:
        raise RuntimeError("out of sand")

    with pytest.raises(RuntimeError, match="out of sand") as raised:
        gc.generate(
            small_scene, small_prior, 2, out=tmp_path, progress=False, engine=CallableEngine(broken)
        )
    assert any("for a pour with seed" in note for note in raised.value.__notes__)
    with pytest.raises(ValueError, match=r"shape \(n, 3\), got \(4,\)"):
        CallableEngine(lambda scene, seed: np.zeros(4), name="flat")(small_scene, 1)
    with pytest.raises(ValueError, match="points of a surface and no grains"):
        gc.simulate(small_scene, engine=CallableEngine(cone))


def test_a_command_is_asked_by_nine_coefficients_and_a_whole_count(
    small_scene: gc.Scene, tmp_path: Path
) -> None:
    asked = tmp_path / "asked.json"
    asks = tmp_path / "asks.py"
    asks.write_text(
        "import pathlib, sys\n"
        f"request = pathlib.Path(sys.argv[-1]) / 'request.json'\n"
        f"pathlib.Path({str(asked)!r}).write_text(request.read_text())\n"
        "raise SystemExit('asked')\n"
    )
    with pytest.raises(ValueError, match="ended with 1: asked"):
        CommandEngine(f"{sys.executable} {asks}")(small_scene, 4)
    request = json.loads(asked.read_text())
    assert request["seed"] == 4 and len(request["material"]) == 9
    assert request["grains"] == {"count": 60, "diameter": 0.004, "density": 1300.0}
    assert isinstance(request["grains"]["count"], int)


def test_a_command_that_fails_says_why(small_scene: gc.Scene, tmp_path: Path) -> None:
    failing = tmp_path / "fails.py"
    failing.write_text("raise SystemExit('no licence')")
    with pytest.raises(ValueError, match="ended with 1: no licence"):
        CommandEngine(f"{sys.executable} {failing}")(small_scene, 0)
    failing.write_text("")
    with pytest.raises(ValueError, match="left no grains.npy"):
        CommandEngine(f"{sys.executable} {failing}")(small_scene, 0)
    with pytest.raises(ValueError, match="nonesuch"):
        CommandEngine("nonesuch-engine")(small_scene, 0)


def test_a_command_may_say_what_it_likes(small_scene: gc.Scene, tmp_path: Path) -> None:
    """Bytes that are no UTF-8 had stopped the batch, though the grains were there."""
    loud = tmp_path / "loud.py"
    loud.write_text(
        "import pathlib, sys\nsys.stdout.buffer.write(b'\\xb5 = 0.4\\n')\n"
        "(pathlib.Path(sys.argv[-1]) / 'grains.csv').write_text('x,y,z\\n0,0,0.002\\n')\n"
    )
    with pytest.warns(FewerGrainsWarning):
        centres, _ = CommandEngine(f"{sys.executable} {loud}")(small_scene, 0)
    assert np.asarray(centres).tolist() == [[0.0, 0.0, 0.002]]


def test_engines_are_named(own_simulator: str) -> None:
    assert engine_named(own_simulator).name == own_simulator
    assert engine_named("granulcal.pours.scene:Scene").name == "granulcal.pours.scene:Scene"
    with pytest.raises(ValueError, match="no attribute 'sand'"):
        engine_named("granulcal.pours.scene:sand")
    with pytest.raises(ValueError, match="'lamps' is no command .* did you mean lammps\\?"):
        engine_named("lamps")
    with pytest.raises(ValueError, match="engine must be one of lammps"):
        ExportedEngine("sandbox")


def test_an_engine_of_ones_own_with_fewer_grains_is_warned_of_once(small_scene: gc.Scene) -> None:
    def lossy(scene: gc.Scene, seed: int) -> tuple[np.ndarray, float]:
        return scene.start(seed)[0][:50], 0.002

    engine = CallableEngine(lossy, name="lossy")
    with pytest.warns(FewerGrainsWarning, match="'lossy' left 50 grains of the scene's 60"):
        assert len(gc.simulate(small_scene, engine=engine).radii) == 50
    gc.simulate(small_scene, engine=engine)
