"""Whether the mean of a surface begins once it stands."""

from pathlib import Path

import pytest

from granulcal.loop.check.steady import drifts
from granulcal.loop.task import FIT, Condition, Task
from granulcal.pours.scene import Scene
from granulcal.prior import Parameter, Prior

DRUM = Path(__file__).parents[2] / "examples" / "drum.toml"
COARSE = {
    "grains.diameter": 5e-3,
    "grains.count": 380,
    "start.spacing": 5.4e-3,
    "preset": "fast",
}
TIMES = {"early": (0.3, 0.7), "late": (2.0, 2.4)}


def asked(scene: Scene, folder: Path) -> Task:
    friction = Parameter(
        path="material.sliding_friction", distribution="uniform", low=0.5, high=0.7
    )
    conditions = []
    for name, (begin, end) in TIMES.items():
        picture = folder / f"{name}.bmp"
        picture.touch()
        at = {"observe.begin": begin, "end.horizon": end}
        conditions.append(Condition(name, at, FIT, (picture,), averaged=True))
    return Task(scene, Prior([friction]), tuple(conditions), (), between=False)


def test_a_mean_that_begins_while_the_drum_is_starting_is_told(tmp_path: Path) -> None:
    (told,) = drifts(asked(Scene.load(DRUM).with_(COARSE), tmp_path))
    assert told.startswith("early: the surface is not steady") and "observe.begin" in told


def test_a_scene_without_a_surface_is_not_poured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("poured")

    monkeypatch.setattr("granulcal.loop.check.steady.simulate", refuse)
    text = Scene.drop(0.02).to_toml() + "\n[observe]\nrate = 50.0\n[observe.front]\ntimes = [0.1]\n"
    assert drifts(asked(Scene.from_toml(text), tmp_path)) == []
