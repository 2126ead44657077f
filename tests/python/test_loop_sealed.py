"""A name is held against what no fit has seen, and the page's first sentence is true of it."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from granulcal.loop.check.own_errors import has_unknown_errors
from granulcal.loop.check.standing import stand
from granulcal.loop.condition import Condition
from granulcal.loop.report.page import sentence_of
from granulcal.loop.task import FIT, SEALED
from granulcal.loop.test.distance import Improvement, compare
from granulcal.loop.test.thresholds import Thresholds
from granulcal.loop.test.verdict import Verdict

RULES = Thresholds()
EFFECT = Verdict("EFFECT", ("drag",), ("drag",), 0.001, "243 nat above that of no effect")
NONE = Verdict("NONE", (), (), 0.4, "nothing is left")


def error(before: float, after: float, noise: float = 0.1) -> Improvement:
    """Pours that are off by so much in each of four statistics."""
    measured, base, named = (
        off + noise * np.random.default_rng(seed).standard_normal((10, 4))
        for seed, off in enumerate((0.0, before, after))
    )
    return compare(["there"], [measured], [base], [named], np.ones(4), seed=0)


def test_a_name_that_is_farther_off_where_nothing_was_fitted_falls() -> None:
    fitted, farther = error(1.0, 0.2), error(0.5, 1.0)
    assert farther.is_worse and farther.to_dict()["is_worse"]
    found = stand(EFFECT, RULES, confirmed=0.5, error=fitted, sealed=farther)
    assert found.verdict.kind == "UNCONFIRMED" and not found.stands and found.verdict.named == ()
    assert found.verdict.reason.startswith("the fits say EFFECT drag, but at the sealed conditions")
    assert "which no fit has seen, the base model is nearer to the data (D² 1.02, 4.05)" in (
        found.verdict.reason
    )
    assert stand(EFFECT, RULES, confirmed=0.5, error=fitted, sealed=fitted).verdict is EFFECT
    # Of a word that names nothing both models are one.
    assert stand(NONE, RULES, confirmed=0.5, sealed=farther).verdict is NONE


def test_own_errors_of_sealed_recordings_take_no_name_away_but_are_said_first() -> None:
    farther = error(0.5, 1.0)
    found = stand(EFFECT, RULES, confirmed=0.5, sealed=farther, is_sealed_off=True)
    assert (found.verdict.kind, found.verdict.named) == ("EFFECT", ("drag",)) and found.stands
    assert found.verdict.reason.startswith("at the sealed conditions D² is")


def test_a_name_that_takes_nothing_away_where_nothing_was_fitted_says_so_first() -> None:
    # By the noise of these pours it may be nearer or farther off.
    flat = error(0.8, 1.1, noise=1.5)
    before, after = flat.total_before.square, flat.total_after.square
    assert after > before > 0 and not flat.is_worse and not flat.is_improved
    found = stand(EFFECT, RULES, confirmed=0.5, error=error(1.0, 0.2), sealed=flat)
    assert found.verdict.kind == "EFFECT" and found.is_no_nearer
    said = f"at the sealed conditions D² is {after:.3g} with drag and {before:.3g} without"
    assert found.verdict.reason.startswith(said) and "243 nat" in found.verdict.reason
    assert sentence_of(found).endswith("shows that it predicts better where nothing was fitted.")
    several = replace(EFFECT, kind="SET", named=("drag", "bonds"), families=("drag", "bonds"))
    # The model of several that are not told apart is that of the first.
    found = stand(several, RULES, confirmed=0.5, sealed=flat)
    assert found.verdict.reason.startswith(said)
    # What was nothing cannot fall.
    nothing = error(0.0, 0.3, noise=1.5)
    assert nothing.total_before.square < 0 and not nothing.is_worse
    for sealed in (error(1.0, 0.2), nothing, None):
        kept = stand(EFFECT, RULES, confirmed=0.5, sealed=sealed)
        assert kept.verdict is EFFECT and "Nothing shows" not in sentence_of(kept)


@pytest.mark.parametrize(
    "reason",
    [
        {"error": error(0.5, 1.0)},
        {"sealed": error(0.5, 1.0)},
        {"nearer": error(0.5, 1.0)},
        {"confirmed": 0.001},
    ],
)
def test_the_page_blames_no_surrogate_for_another_check(reason: dict[str, Any]) -> None:
    found = stand(EFFECT, RULES, **{"confirmed": 0.5, **reason})
    assert found.verdict.kind == "UNCONFIRMED"
    assert "surrogate" not in sentence_of(found)
    assert ("surrogate is wrong" in found.verdict.reason) == ("confirmed" in reason)


def test_the_page_says_of_the_grains_what_is_known_to_be_theirs() -> None:
    def said(kind: str, *named: str) -> str:
        word = replace(EFFECT, kind=kind, named=named, families=named)
        return sentence_of(stand(word, RULES, confirmed=0.5))

    assert "or something that they do" in said("SET", "diameter", "camera.offset")
    assert "and how they were seen" in said("EFFECTS", "camera.missing", "drag")
    assert "or they were seen otherwise" in said("EFFECT", "camera.y", "tilt.y")
    assert said("EFFECTS", "drag", "diameter").startswith("The grains do something")
    assert said("SET", "camera.x", "camera.y").startswith("Of what was tried it is not the grains")
    # What has no name may be the camera's as well.
    for kind in ("RESIDUAL", "UNEXPLAINED"):
        assert "grains do" not in said(kind)


def test_recordings_of_a_told_session_have_errors_that_are_known() -> None:
    def task(effects: list[Any], session: str, tolerances: Any = None) -> Any:
        conditions = [
            Condition("low", {}, FIT, (Path("a"),), session="monday"),
            Condition("high", {}, SEALED, (Path("b"),), session=session),
        ]
        of = {use: [c for c in conditions if c.use == use] for use in (FIT, SEALED)}
        return cast(
            Any,
            SimpleNamespace(
                conditions=conditions, library=effects, tolerances=tolerances, of=of.__getitem__
            ),
        )

    candidate, clock = SimpleNamespace(nuisance_sd=None), SimpleNamespace(nuisance_sd=0.5)
    assert not has_unknown_errors(task([candidate], ""))
    assert has_unknown_errors(task([candidate, clock], ""))
    assert has_unknown_errors(task([candidate, clock], "tuesday"))
    assert not has_unknown_errors(task([candidate, clock], "monday"))
    assert has_unknown_errors(task([candidate], "", tolerances=object()))
