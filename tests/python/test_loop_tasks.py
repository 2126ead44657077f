"""What a task cannot be asked about is refused by name, before anything is poured."""

import sys
from pathlib import Path

import pytest

import granulcal as gc
from granulcal.errors import ObservationError, TrainingDataError
from granulcal.loop.effects.library import by_name
from granulcal.loop.pours.archive import Archive, ArchivePlan, require_same
from granulcal.loop.task import Task

PRIOR = """
[[parameter]]
path = "material.restitution"
distribution = "uniform"
low = 0.2
high = 0.6
"""


def load(folder: Path, head: str, first: str, second: str, scene: gc.Scene | None = None) -> Task:
    """A task of a falling ball of grains; `first` and `second` is what two conditions state."""
    (folder / "scene.toml").write_text((scene or gc.Scene.drop(0.1, count=100)).to_toml())
    (folder / "prior.toml").write_text(PRIOR)
    text = f'scene = "scene.toml"\nprior = "prior.toml"\n{head}\n'
    for name, at in (("low", first), ("high", second)):
        files = [f"{name}-{i}.png" for i in range(2)]
        for file in files:
            (folder / file).touch()
        text += f'[[conditions]]\nname = "{name}"\nat = {{ {at} }}\nuse = "fit"\n'
        text += f"recordings = {files}\n"
    (folder / "loop.toml").write_text(text)
    return Task.load(folder / "loop.toml")


def test_what_the_conditions_state_is_left_out_of_the_effects_that_nobody_names(
    tmp_path: Path,
) -> None:
    known = ', "grains.count" = 100, "effects.tilt.x" = 0.01'
    found = load(tmp_path, "", LOW + known, HIGH + known).library
    others = load(tmp_path, "", LOW, HIGH).library
    missing = [effect.name for effect in others if effect not in found]
    assert missing == ["tilt.x", "count"]


def test_a_height_is_asked_where_pours_lie_beside_the_conditions(tmp_path: Path) -> None:
    # No pour tells otherwise what a wrong height does, and it would count as tried.
    funnel = gc.Scene.funnel(count=100)
    low, high = '"funnel.height" = 0.05', '"funnel.height" = 0.1'

    def asked(head: str, second: str) -> bool:
        names = [effect.name for effect in load(tmp_path, head, low, second, funnel).library]
        return "height" in names

    assert asked("", high) and asked('effects = ["height"]', high)
    assert not asked("", low) and not asked("between = false", high)
    for head, second, why in (
        ('effects = ["height"]', low, "all conditions state the same: leave it out of effects"),
        ('effects = ["height"]\nbetween = false', high, "between = false has none: leave it out"),
    ):
        with pytest.raises(ObservationError, match=f"effect height needs pours at .*, and {why}"):
            asked(head, second)


def test_the_usual_effects_and_more_are_asked_in_the_order_of_the_library(tmp_path: Path) -> None:
    usual = [effect.name for effect in load(tmp_path, "", LOW, HIGH).library]
    both = load(tmp_path, 'effects = ["clump", "usual", "drag"]', LOW, HIGH)
    assert [effect.name for effect in both.library] == [*usual, "clump"]
    assert "clump" not in [effect.name for effect in both.untried]
    assert "clump" in [effect.name for effect in load(tmp_path, "", LOW, HIGH).untried]
    with pytest.raises(TrainingDataError, match="no effect clumps"):
        load(tmp_path, 'effects = ["usual", "clumps"]', LOW, HIGH)


def test_who_asks_for_a_tilt_asks_where_the_camera_stood(tmp_path: Path) -> None:
    def names(head: str) -> list[str]:
        return [effect.name for effect in load(tmp_path, head, LOW, HIGH).library]

    assert names('effects = ["tilt.x", "drag"]') == ["drag", "tilt.x", "camera.x", "camera.y"]
    assert names('effects = ["camera.y", "tilt.x"]') == ["tilt.x", "camera.y"]
    assert names('effects = ["drag"]') == ["drag"]
    # Pixels without data look like fewer grains.
    assert names('effects = ["count"]') == ["count", "camera.missing"]
    assert names('effects = ["drag"]\nnuisances = { "tilt.x" = 0.01 }') == ["drag", "tilt.x"]
    assert {"camera.x", "camera.y"} < set(names(""))


LOW, HIGH = '"start.height" = 0.03', '"start.height" = 0.1'


@pytest.mark.parametrize(
    ("head", "also", "told"),
    [
        ("", ', "material.restitution" = 0.4', "states material.restitution = 0.4, which the pri"),
        ('effects = ["tilt.x"]', ', "effects.tilt.x" = 0', "tilt.x is the number effects.tilt.x, "),
        ('effects = ["count"]', ', "grains.count" = 90', "count is the number grains.count, which"),
        ('effects = ["funnel.lean"]', "", "funnel.lean cannot be 0.1 in this scene: .*a funnel"),
        (
            'nuisances = { "titl.x" = 0.01 }',
            "",
            "loop.toml: nuisances: no effect titl.x .is it tilt",
        ),
        ('nuisances = { "count" = 1000 }', "", "tolerance of count must be at most 25 -, the whol"),
        ('nuisances = { "diameter" = 1.0 }', "", "tolerance of diameter must be at most 0.0004 m"),
        ('nuisances = { "gravity.2" = 1e3 }', "", "gravity.2 must be at most 9.81, the number its"),
        (
            'effects = ["tilt.x", "drag"]\nnuisances = { "tilt.x" = 0.01 }',
            "",
            "tilt.x is in effects and in nuisances",
        ),
        (
            'between = false\neffects = ["drag"]\nnuisances = { "height" = 0.01 }',
            "",
            "nuisance height needs pours at further values of start.height, and between = false",
        ),
    ],
)
def test_what_a_task_cannot_ask_is_named(head: str, also: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=told):
        load(tmp_path, head, LOW + also, HIGH + also)


def test_what_the_prior_fixes_is_no_effect(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Every pour has the fixed number, those of the effect as well.
    fixed = '[[parameter]]\npath = "grains.count"\ndistribution = "fixed"\nvalue = 100\n'
    monkeypatch.setattr(sys.modules[__name__], "PRIOR", PRIOR + fixed)
    for head in ('effects = ["count"]', 'effects = ["drag"]\nnuisances = { "count" = 5 }'):
        with pytest.raises(ObservationError, match="count sets grains.count, which the prior"):
            load(tmp_path, head, LOW, HIGH)
    found = load(tmp_path, "", LOW, HIGH)
    assert "count" not in [effect.name for effect in (*found.library, *found.untried)]


def test_whole_numbers_are_not_drawn_between(tmp_path: Path) -> None:
    counts = '"grains.count" = 60', '"grains.count" = 120'
    with pytest.raises(ValueError, match="grains.count is a whole number.*between = false"):
        load(tmp_path, 'effects = ["drag"]', *counts)
    assert load(tmp_path, 'effects = ["drag"]\nbetween = false', *counts).places


def test_a_height_is_that_of_the_fall_where_nothing_hangs(tmp_path: Path) -> None:
    (height,) = load(tmp_path, 'effects = ["height"]', LOW, HIGH).library
    assert height.shift and height.path == "start.height"
    with pytest.raises(ValueError, match="height is how far funnel.height or start.height"):
        load(tmp_path, 'effects = ["height"]', '"gravity.2" = -9', '"gravity.2" = -8')


def test_a_conditions_own_number_is_a_tolerance_by_its_path(tmp_path: Path) -> None:
    head = 'effects = ["drag"]\nnuisances = { "start.height" = 0.002 }'
    own = load(tmp_path, head, LOW, HIGH).library[-1]
    assert own.shift and own.path == "start.height" and not own.is_shared
    assert own.full == pytest.approx(0.004) and own.nuisance_sd == 0.5
    # Where all state the same, it is off that and not off the scene's.
    same = load(tmp_path, head, LOW, LOW).library[-1]
    assert not same.shift and same.off == 0.03


def test_an_archive_of_other_effects_is_named_and_left(tmp_path: Path) -> None:
    def plan(*names: str) -> ArchivePlan:
        return ArchivePlan(
            scene=gc.Scene.drop(0.1, count=100),
            prior=gc.Prior.from_toml(PRIOR),
            conditions=(),
            library=by_name(names),
            base=4,
            each=4,
        )

    folder = tmp_path / "archive"
    require_same(folder, plan("tilt.x"))
    assert not folder.exists()
    Archive(folder, plan("tilt.x"))
    kept = (folder / "archive.json").read_bytes()
    require_same(folder, plan("tilt.x", "tilt.y"))
    told = "it has tilt.x; this run asks for polydispersity"
    with pytest.raises(TrainingDataError, match=told):
        require_same(folder, plan("polydispersity"))
    assert (folder / "archive.json").read_bytes() == kept
