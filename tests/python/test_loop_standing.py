"""What may overturn a verdict, and the rows without physics that a name has to beat."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from two_heights import two_heights

from granulcal.cli import main
from granulcal.errors import ObservationError
from granulcal.loop import Design, Effect
from granulcal.loop.check import unseen
from granulcal.loop.check.alarms import of_rows
from granulcal.loop.check.prior_pours import PriorPours, hypercube
from granulcal.loop.check.recentre import Recentred
from granulcal.loop.check.standing import Moved, overturned, stand
from granulcal.loop.check.trivial import LINE, NEAREST, RESIDUAL, Group, line_weights, trivial_rows
from granulcal.loop.check.unseen import Seen, told_unseen
from granulcal.loop.effects.definitions import Definition, check_definitions, definition_inputs
from granulcal.loop.effects.library import by_name
from granulcal.loop.report.page import sentence_of
from granulcal.loop.task import FIT, SEALED, Condition, Task
from granulcal.loop.test.distance import Improvement, compare
from granulcal.loop.test.thresholds import Thresholds
from granulcal.loop.test.verdict import Verdict, families_of
from granulcal.pours.left_out import LeftOut
from granulcal.pours.scene import Scene
from granulcal.prior import Parameter, Prior

RULES = Thresholds()
EFFECT = Verdict("EFFECT", ("drag",), ("drag",), 0.001, "why")
NONE = Verdict("NONE", (), (), 0.4, "nothing is left")


def test_a_straight_line_is_carried_on_and_a_plane_needs_three_places() -> None:
    known = np.array([[0.0], [0.4], [0.4], [1.0]])
    assert line_weights(known, np.array([0.1])) == pytest.approx([0.75, 0.125, 0.125, 0.0])
    # Beyond the outermost two: 1.3 is half a gap of 0.6 farther than 1.0.
    assert line_weights(known, np.array([1.3])) == pytest.approx([0.0, -0.25, -0.25, 1.5])
    assert line_weights(known[1:3], np.array([0.4])) is None
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    at = np.array([0.3, 0.6])
    assert line_weights(corners, at) == pytest.approx([0.1, 0.3, 0.6])
    assert line_weights(corners[:2], at) is None
    # A definition's number is an input, and the same under all conditions.
    defined = np.column_stack([known, np.full(4, 0.7)])
    assert line_weights(defined, np.array([0.1, 0.7])) == pytest.approx([0.75, 0.125, 0.125, 0.0])
    assert line_weights(defined, np.array([0.1, 0.6])) is None


def groups(seed: int, *, offset: float) -> list[Group]:
    """Five conditions: the truth is 3 + c^2, the base model c^2, the named model 3 + c^2 + offset.

    The first statistic bends with the condition; the second is the same everywhere.
    """
    generator = np.random.default_rng(seed)

    def pours(c: float, level: float, count: int) -> np.ndarray:
        mean = np.array([level + 4 * c**2, 1.0])
        return mean + 0.1 * generator.standard_normal((count, 2))

    return [
        Group(
            f"{c:g}", np.array([c]), pours(c, 3.0, 5), pours(c, 0.0, 10), pours(c, 3 + offset, 10)
        )
        for c in (0.0, 0.5, 1.0, 0.25, 0.75)
    ]


def test_rows_without_physics_have_their_known_distance() -> None:
    mean = {name: np.zeros(3) for name in (NEAREST, LINE, RESIDUAL)}
    beaten = []
    for seed in range(30):
        made = groups(seed, offset=0.0)
        rows = trivial_rows(made[:3], made[3:], np.ones(2), draws=200, seed=seed)
        assert [row.name for row in rows] == [NEAREST, LINE, RESIDUAL]
        for row in rows:
            mean[row.name] += [row.squares[0] / 30, row.squares[1] / 30, row.gain / 30]
        beaten.append([row.is_beaten for row in rows])
    # 4 c^2 at 0.25: both neighbours are as near, 0.5 between them as on the line, 0.25 the truth.
    assert mean[LINE][:2] == pytest.approx([0.0625, 0.0625], abs=0.02)
    # At 0.75 the neighbours' mean is 2.5 and the truth 2.25.
    assert mean[NEAREST][:2] == pytest.approx([0.0625, 0.0625], abs=0.02)
    # The base model knows the bend and lacks a constant: nothing is left.
    assert mean[RESIDUAL] == pytest.approx([0.0, 0.0, 0.0], abs=0.02)
    share = np.mean(beaten, axis=0)
    assert share[1] > 0.6 and share[2] < 0.15


def test_a_name_that_leaves_more_than_the_spread_of_all_pours_is_none() -> None:
    def of(off: float) -> Improvement:
        measured, base, after = (
            level + 0.1 * np.random.default_rng(seed).standard_normal((10, 4))
            for seed, level in enumerate((0.0, 3.0, off))
        )
        return compare(["there"], [measured], [base], [after], np.ones(4), seed=0)

    near = stand(EFFECT, RULES, confirmed=0.5, error=of(0.5), size=4)
    assert near.verdict == EFFECT
    far = stand(EFFECT, RULES, confirmed=0.5, error=of(2.0), size=4)
    assert far.verdict.kind == "UNEXPLAINED" and far.verdict.named == ()
    assert "are the conditions' numbers in the scene's units?" in far.verdict.reason


def test_a_name_that_beats_nothing_says_so() -> None:
    made = groups(1, offset=1.0)
    rows = trivial_rows(made[:3], made[3:], np.ones(2))
    # That other rows are nearer is more than that they are not beaten.
    found = stand(EFFECT, RULES, confirmed=0.5, trivial=rows)
    assert all(row.is_nearer and row.to_dict()["is_nearer"] for row in rows)
    assert "nearest condition and straight line and base +" in found.verdict.reason
    assert "are nearer than it" in found.verdict.reason
    told = of_rows(found)
    assert len(told) == 3 and "straight line is nearer to the measurement than" in told[1]
    assert of_rows(stand(NONE, RULES, confirmed=0.5, trivial=rows)) == ()
    first = replace(rows[1], gain_interval=(-1.0, 0.5))
    found = stand(EFFECT, RULES, confirmed=0.5, trivial=[rows[0], first])
    assert found.verdict.reason.endswith(
        "nearest condition is nearer than it; it does not beat straight line"
    )
    rows = [replace(row, gain_interval=(-1.0, 0.5)) for row in rows]
    found = stand(EFFECT, RULES, confirmed=0.5, trivial=rows)
    assert of_rows(found) == ()
    assert found.stands and found.verdict.named == ("drag",)
    assert found.unbeaten == (NEAREST, LINE, RESIDUAL)
    assert "does not beat nearest condition nor straight line nor base +" in found.verdict.reason
    # NONE names nothing, and has nothing to beat.
    assert stand(NONE, RULES, confirmed=0.5, trivial=rows).unbeaten == ()
    assert trivial_rows(made[:3], [], np.ones(2)) == ()


@pytest.mark.parametrize("before", [EFFECT, NONE])
def test_a_wrong_surrogate_takes_every_word_away(before: Verdict) -> None:
    found = stand(before, RULES, confirmed=0.003)
    assert found.verdict.kind == "UNCONFIRMED" and not found.stands
    assert found.verdict.named == () and found.before is before
    assert f"the fits say {before.kind}" in found.verdict.reason and "0.003" in found.verdict.reason
    assert stand(before, RULES, confirmed=float("nan")).verdict.kind == "UNCONFIRMED"
    assert stand(before, RULES, confirmed=0.02).verdict is before
    assert found.to_dict()["verdict_before_checks"] == before.kind


def test_what_the_base_models_own_pours_do_not_leave_is_the_surrogates() -> None:
    def pours(p: float) -> Any:
        return cast(Any, SimpleNamespace(residual_test=SimpleNamespace(p=p), to_dict=dict))

    def word(before: Verdict, p: float) -> Verdict:
        return stand(before, RULES, confirmed=0.5, own=pours(0.5), of_base=pours(p)).verdict

    residual = replace(EFFECT, kind="RESIDUAL", named=(), families=())
    unexplained = replace(residual, kind="UNEXPLAINED")
    for before in (EFFECT, residual, unexplained):
        assert word(before, 0.002) is before
        assert word(before, 0.06).kind == "NONE"
        assert "pours of the base model at its fit leave nothing" in word(before, 0.06).reason
    assert word(residual, 0.03) is residual
    for before in (EFFECT, unexplained):
        found = word(before, 0.03)
        assert (found.kind, found.named) == ("RESIDUAL", ())
    assert word(NONE, 0.001) is NONE
    # Strengths in a report are those of the model that the fits had named, whatever the word.
    own = pours(0.5)
    assert stand(EFFECT, RULES, confirmed=0.5, own=own, of_base=pours(0.06)).own is own
    found = stand(EFFECT, RULES, confirmed=0.005, of_base=pours(0.06))
    assert found.verdict.kind == "UNCONFIRMED"
    assert found.to_dict()["base_pours_p"] == 0.06


def test_what_its_own_pours_leave_takes_a_name_away() -> None:
    def own(p: float) -> Any:
        empty = np.empty(0)
        test = SimpleNamespace(p=p)
        return Recentred(cast(Any, test), empty, np.array([0.4]), np.array([[0.3, 0.5]]), 1.0)

    found = stand(EFFECT, RULES, confirmed=0.5, own=own(0.015))
    assert found.verdict.kind == "UNCONFIRMED" and not found.stands
    assert "its own pours at its fit leave something of the data (p = 0.015)" in (
        found.verdict.reason
    )
    said = found.to_dict()["own_pours"]
    assert said == {"p": 0.015, "strengths": [0.4], "intervals": [[0.3, 0.5]], "step": 1.0}
    assert stand(EFFECT, RULES, confirmed=0.5, own=own(0.03)).verdict is EFFECT
    # NONE names nothing and has the residual test's smaller level.
    assert stand(NONE, RULES, confirmed=0.5, own=own(0.015)).verdict is NONE
    assert stand(NONE, RULES, confirmed=0.5, own=own(0.005)).verdict.kind == "UNCONFIRMED"
    unexplained = Verdict("UNEXPLAINED", (), (), 0.001, "")
    assert stand(unexplained, RULES, confirmed=0.5, own=own(0.001)).verdict is unexplained
    # The base model's pours have left something: no name, but a residual.
    found = stand(EFFECT, RULES, confirmed=0.5, own=own(0.015), of_base=own(0.002))
    assert found.verdict.kind == "RESIDUAL" and not found.verdict.named and found.stands
    assert "as the base model's do (p = 0.002)" in found.verdict.reason
    # Where the surrogate is wrong, or another fit is nearer, that is not known either.
    found = stand(EFFECT, RULES, confirmed=0.001, own=own(0.015), of_base=own(0.002))
    assert found.verdict.kind == "UNCONFIRMED"


def test_a_random_draw_that_is_nearer_than_the_fit_takes_the_word_away() -> None:
    generator = np.random.default_rng(0)
    data, near, far = (m + 0.1 * generator.standard_normal((10, 3)) for m in (0.0, 0.05, 1.0))
    better = compare(["c"], [data], [near], [far], np.ones(3))
    found = stand(NONE, RULES, confirmed=0.5, draws=24, nearer=better)
    assert found.verdict.kind == "UNCONFIRMED"
    assert "a random draw of the model is nearer" in found.verdict.reason
    worse = compare(["c"], [data], [far], [near], np.ones(3))
    assert stand(NONE, RULES, confirmed=0.5, draws=24, nearer=worse).verdict is NONE


def test_a_name_that_is_farther_off_than_the_base_model_falls() -> None:
    generator = np.random.default_rng(0)
    data, near, far = (m + 0.1 * generator.standard_normal((10, 3)) for m in (0.0, 0.05, 1.0))
    worse = compare(["c"], [data], [near], [far], np.ones(3))
    found = stand(EFFECT, RULES, confirmed=0.5, error=worse)
    assert found.verdict.kind == "UNCONFIRMED" and not found.stands
    assert "but the base model is nearer to the data" in found.verdict.reason
    better = compare(["c"], [data], [far], [near], np.ones(3))
    assert stand(EFFECT, RULES, confirmed=0.5, error=better).verdict is EFFECT
    # Of a word that names nothing both models are one.
    assert stand(NONE, RULES, confirmed=0.5, error=worse).verdict is NONE


def test_a_verdict_that_a_definition_overturns_is_none() -> None:
    other = Verdict("EFFECT", ("tilt.x",), ("tilt",), 0.001, "")
    same = Verdict("SET", ("tilt.x", "drag"), ("tilt", "drag"), 0.001, "")
    faint = Verdict("RESIDUAL", (), (), 0.03, "")
    assert overturned(EFFECT, NONE, 0.01) and overturned(EFFECT, other, 0.01)
    assert overturned(EFFECT, faint, 0.01) and not overturned(EFFECT, same, 0.01)
    assert overturned(NONE, EFFECT, 0.01) and not overturned(NONE, faint, 0.01)
    unexplained = Verdict("UNEXPLAINED", (), (), 0.001, "")
    assert overturned(unexplained, NONE, 0.01) and not overturned(unexplained, EFFECT, 0.01)
    found = stand(EFFECT, RULES, confirmed=0.5, moved=[Moved("half cover", NONE)])
    assert found.verdict.kind == "OVERTURNED" and not found.stands
    assert found.verdict.reason == "the fits say EFFECT drag, but NONE under half cover"


def test_the_same_name_by_another_definition_does_not_overturn_it() -> None:
    # There drag and dry cohesion are parallel, and count with the first of the two.
    effects = (Effect("cohesion.dry", family="cohesion"), Effect("drag"))
    design = Design(("mu",), ("height",), effects)
    there = families_of(design, (1,), [(0, 1)])
    assert there == ("cohesion",)
    same = Verdict("EFFECT", ("drag",), there, 0.001, "")
    assert not overturned(EFFECT, same, 0.01) and not overturned(same, EFFECT, 0.01)
    assert stand(EFFECT, RULES, confirmed=0.5, moved=[Moved("half", same)]).verdict is EFFECT


def test_what_no_pour_shows_is_beside_what_nothing_explains() -> None:
    seen = Seen("polydispersity", 43, LeftOut(unhealthy=20), 0.002, 0.137, "above 0.137")
    whole = replace(seen, effect="tilt.x", left_out=LeftOut(), lacks="")
    before = Verdict("UNEXPLAINED", (), (), 0.001, "no one or two effects explain it")
    found = stand(before, RULES, confirmed=0.5, seen=[whole, seen])
    assert found.verdict.kind == "UNEXPLAINED"
    assert "none usable of polydispersity above 0.137, which may still" in found.verdict.reason
    assert "as far as the archive has usable pours" in sentence_of(found, [seen])
    assert "as far as" not in sentence_of(found, [whole])
    assert stand(before, RULES, confirmed=0.5, seen=[whole]).verdict is before
    assert stand(EFFECT, RULES, confirmed=0.5, seen=[seen]).verdict is EFFECT
    (told,) = told_unseen([whole, seen])
    assert "polydispersity: 20 of its 43 pours are left out (20 unhealthy)" in told
    assert seen.to_dict()["left_out"]["unhealthy"] == 20


def test_the_part_of_a_range_without_a_usable_pour_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    numbers = np.linspace(0.0, 0.3, 31)
    usable = numbers < 0.14

    class Part(SimpleNamespace):
        def strengths(self, data: Any, which: Any, effect: Any) -> Any:
            return effect.strength(numbers[which])

    (effect,) = by_name(["polydispersity"])
    numbers *= effect.full / 0.3
    status = np.where(usable, "at_rest", "unhealthy")
    part = Part(name="p", effect=effect.name, count=31, scene=column())
    data = type("Data", (SimpleNamespace,), {"__len__": lambda _: 31})(status=status)
    measures = SimpleNamespace(of_dataset=lambda _: (None, usable))
    monkeypatch.setattr(unseen, "parts_of", lambda _: [part])
    monkeypatch.setattr(unseen.Dataset, "load", lambda _: data)
    monkeypatch.setattr(unseen.Measures, "of", lambda _: measures)
    plan = SimpleNamespace(scene=column(), library=(effect,))
    (seen,) = unseen.seen_of(cast(Any, SimpleNamespace(plan=plan, folder=tmp_path)))
    assert (seen.pours, seen.left_out.unhealthy) == (31, 17)
    assert seen.high == pytest.approx(0.13 * effect.full / 0.3)
    assert seen.lacks == f"above {seen.high:.3g}"
    # What is left out among usable ones leaves no part of the range without.
    usable[:] = np.arange(31) % 2 == 0
    (seen,) = unseen.seen_of(cast(Any, SimpleNamespace(plan=plan, folder=tmp_path)))
    assert seen.lacks == "" and seen.left_out.total == 15


def column() -> Scene:
    text = Scene.funnel(height=0.1).to_toml()
    return Scene.from_toml(
        text + "\n[observe]\nrate = 100.0\n[observe.front]\ntimes = [0.1, 0.2]\nlevel = 0.5\n"
    )


def asked(definitions: tuple[Definition, ...], *, between: bool = True) -> Task:
    prior = Prior(
        [Parameter(path="material.restitution", distribution="uniform", low=0.2, high=0.6)]
    )
    conditions = tuple(
        Condition(
            f"{h:g}", {"funnel.height": h}, use, tuple(Path(f"{h:g}{pour}") for pour in "abc")
        )
        for h, use in ((0.05, FIT), (0.1, FIT), (0.08, SEALED))
    )
    return Task(column(), prior, conditions, (), between=between, definitions=definitions)


def test_definitions_are_inputs_of_the_archive_and_the_first_is_the_verdicts() -> None:
    quarter = Definition("quarter", {"observe.front.level": 0.25})
    half = Definition("half", {"observe.front.level": 0.5}, {"fps": 120.0})
    task = asked((quarter, half))
    assert task.inputs == (("funnel.height", 0.05, 0.1), ("observe.front.level", 0.25, 0.5))
    assert task.at_first().get("observe.front.level") == 0.25
    assert [c.at["observe.front.level"] for c in task.of(FIT)] == [0.25, 0.25]
    (moved, _) = task.under(half, FIT)
    assert moved.at == {"funnel.height": 0.05, "observe.front.level": 0.5}
    assert moved.reading == {"fps": 120.0} and task.conditions[0].reading == {}
    # Copies keep what was stated.
    assert replace(task, between=False).stated == task.stated
    # At the places alone: the places do not hold the definition, which is drawn.
    fixed = asked((quarter, half), between=False)
    assert fixed.places[0] == {"funnel.height": 0.05}
    assert fixed.inputs[-1] == ("observe.front.level", 0.25, 0.5)
    assert definition_inputs((quarter,)) == ()


def test_a_definition_changes_nothing_that_is_poured() -> None:
    with pytest.raises(ObservationError, match="grains.count changes what is poured"):
        check_definitions((Definition("other", {"grains.count": 10.0}),))
    with pytest.raises(ObservationError, match="must state the same numbers"):
        asked((Definition("a"), Definition("b", {"observe.front.level": 0.2})))
    with pytest.raises(ObservationError, match="names of their own, twice: \\['a'\\]"):
        asked((Definition("a"), Definition("a")))
    with pytest.raises(ObservationError, match="has unknown level"):
        Definition.of({"name": "a", "level": 0.2})


def test_random_draws_fill_the_prior_and_the_best_come_first() -> None:
    drawn = hypercube(24, 3, seed=5)
    cells = np.sort((drawn * 24).astype(int), axis=0)
    assert np.array_equal(cells, np.tile(np.arange(24)[:, None], (1, 3)))
    seen = PriorPours(
        ("tilt",), None, np.array([[0.5], [0.2]]), np.array([[0.3], [0.9]]), np.ones(2)
    )
    starts = seen.starts(Design(("a",), (), (Effect("drag"), Effect("tilt"))))
    assert [start.psi.tolist() for start in starts] == [[0.0, 0.3], [0.0, 0.9]]
    assert starts[0].v == pytest.approx([0.0]) and starts[1].v == pytest.approx([-0.8416], abs=1e-3)


@pytest.mark.parametrize("kind", ["NONE", "RESIDUAL", "EFFECT", "SET", "EFFECTS", "UNEXPLAINED"])
def test_a_wrong_surrogate_stands_beside_every_word_and_in_the_exit_code(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    named = ("drag",) if kind in ("EFFECT", "SET", "EFFECTS") else ()
    found = stand(Verdict(kind, named, named, 0.001, "why"), RULES, confirmed=0.001)
    assert found.verdict.kind == "UNCONFIRMED" and not found.stands
    assert f"the fits say {kind}" in found.verdict.reason
    # The exit codes of close-loop, of the studies that close a loop and of predict.
    closed = SimpleNamespace(standing=found)
    monkeypatch.setattr("granulcal.loop.close.close_loop", lambda *_, **__: closed)
    monkeypatch.setattr("granulcal.loop.report.folder.write_report", lambda *_, **__: None)
    monkeypatch.setattr("granulcal.loop.task.Task.load", lambda _: None)
    task = tmp_path / "loop.toml"
    task.write_text("")
    assert main(["close-loop", str(task), "-o", str(tmp_path / "loop")]) == 3
    monkeypatch.setattr("granulcal.experiments.loop_column.reproduce", lambda *_: found.stands)
    assert main(["reproduce", "loop_column", "--out", str(tmp_path), "--data", str(tmp_path)]) == 3
    models = two_heights(Scene.drop(0.02, count=12), "max_z", verdict=found.verdict.kind)
    models.write(tmp_path)
    words = ["predict", str(tmp_path), "--at", "start.height=0.015", "--model", "line"]
    assert main(words) == 3
    assert "UNCONFIRMED" in capsys.readouterr().err
