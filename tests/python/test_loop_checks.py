"""Checks of a verdict, on a linear simulator: pairs, fresh pours, the correction, the tables."""

import math
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from granulcal.loop import ConditionPours, Design, Effect, Surrogate, Thresholds, trace
from granulcal.loop.check.checks import calibrated
from granulcal.loop.check.confirm import confirm
from granulcal.loop.check.correction import Correction, corrections
from granulcal.loop.check.coverage import Coverage, calibrate, needed_stretch
from granulcal.loop.check.standing import stand
from granulcal.loop.check.trivial import LINE, TrivialRow
from granulcal.loop.effects.library import by_name
from granulcal.loop.pours.replicates import REPLICATES, seeds_of_replicates
from granulcal.loop.report.tables import candidates, conditions, residuals, write_tables
from granulcal.loop.task import Condition
from granulcal.loop.test.distance import compare
from granulcal.loop.test.refit import interval

Array = NDArray[np.float64]

RULES = Thresholds(replicates=300, replicates_after=100, refits=2)
PLACES = (0.0, 0.5, 1.0)
SIZE = 5


@dataclass(frozen=True)
class Linear:
    """x = A (2 u - 1) + psi D (1 + c) + alien (1 + c) + noise."""

    design: Design
    slopes: Array
    direction: Array
    alien: Array

    def pours(
        self, u: float, c: float, psi: float, count: int, generator: Any, alien: float = 0.0
    ) -> Array:
        mean = (2 * u - 1) * self.slopes + (1 + c) * (psi * self.direction + alien * self.alien)
        return mean + 0.3 * generator.standard_normal((count, SIZE))

    def observe(self, u: float, psi: float, seed: int, alien: float = 0.0) -> list[ConditionPours]:
        generator = np.random.default_rng(seed)
        return [
            ConditionPours.of(f"{c:g}", [c], self.pours(u, c, psi, 4, generator, alien))
            for c in PLACES
        ]


@pytest.fixture(scope="module")
def linear() -> Linear:
    generator = np.random.default_rng(3)
    slopes, direction, alien = generator.standard_normal((3, SIZE))
    design = Design(("a",), ("height",), (Effect("tilt.x"),))
    return Linear(design, slopes, direction, alien)


@pytest.fixture(scope="module")
def surrogate(linear: Linear) -> Surrogate:
    generator = np.random.default_rng(0)
    u, c, psi = generator.random(260), generator.random(260), np.zeros(260)
    psi[200:] = generator.random(60)
    x = np.concatenate([linear.pours(*row, 1, generator) for row in zip(u, c, psi, strict=True)])
    names = [f"s{i}" for i in range(SIZE)]
    rows = u[:, None], c[:, None], psi[:, None]
    return Surrogate.fit(linear.design, *rows, x, names=names, features=4)


def normal(mean: float, sd: float) -> Array:
    at = np.linspace(-1, 1, 2001)
    return np.stack([at, -0.5 * ((at - mean) / sd) ** 2])


def test_a_stretched_normal_is_wider_by_its_stretch() -> None:
    curve = normal(0.1, 0.05)
    for stretch in (1.0, 2.0, 3.0):
        low, high = interval(curve, 0.95, stretch)
        assert (low, high) == pytest.approx(
            (0.1 - 1.96 * 0.05 * stretch, 0.1 + 1.96 * 0.05 * stretch), abs=2e-3
        )
    assert needed_stretch(curve, 0.15, 0.95) == 1.0
    # Five standard deviations off: 5 / 1.96 = 2.55, the next tenth.
    assert needed_stretch(curve, 0.35, 0.95) == pytest.approx(2.6)
    assert math.isinf(needed_stretch(curve, 0.999, 0.95))


def test_pairs_stretch_an_interval_that_is_too_short(linear: Linear, surrogate: Surrogate) -> None:
    found = trace(surrogate, linear.observe(0.4, 0.6, 1), RULES)
    assert found.verdict.kind == "EFFECT"
    model = found.model_of(found.best)

    def honest(b: int, theta: Array, psi: float) -> list[ConditionPours]:
        return linear.observe(float(theta[0]), psi, 100 + b)

    def biased(b: int, theta: Array, psi: float) -> list[ConditionPours]:
        # A simulator that does two standard deviations more than the surrogate knows of.
        return linear.observe(float(theta[0]), psi + 0.5 * width, 100 + b)

    width = float(np.diff(model.intervals[0])[0])
    plain = calibrate(surrogate, model, honest, RULES, count=20)
    wide = calibrate(surrogate, model, biased, RULES, count=20)
    assert plain is not None and wide is not None
    assert plain.pairs == wide.pairs == 20
    assert plain.held >= 16 and plain.stretch < 2 and abs(plain.error) < 0.25 * width
    assert wide.held <= 14 and wide.stretch > plain.stretch and wide.error > 0.25 * width
    assert np.diff(wide.interval) > np.diff(plain.interval) >= width - 1e-9
    # Too few pairs to read 95 % from: the whole prior.
    few = calibrate(surrogate, model, honest, RULES, count=10)
    assert few is not None and few.interval.tolist() == [0.0, 1.0] and math.isinf(few.stretch)
    assert calibrate(surrogate, model, lambda *_: None, RULES, count=3) is None


def test_pairs_have_the_errors_that_a_fit_allows_for(linear: Linear) -> None:
    # A declared clock does what the effect does: pairs without one would all be held.
    clock = Effect("clock", is_two_sided=True, nuisance_sd=0.1)
    both = replace(linear, design=Design(("a",), ("height",), (*linear.design.effects, clock)))
    generator = np.random.default_rng(0)
    u, c, psi = generator.random(320), generator.random(320), np.zeros((320, 2))
    psi[200:260, 0], psi[260:, 1] = generator.random(60), generator.uniform(-1, 1, 60)
    x = np.concatenate(
        [
            both.pours(a, b, s + 0.9 * t, 1, generator, 0.1 * t)
            for a, b, (s, t) in zip(u, c, psi, strict=True)
        ]
    )
    surrogate = Surrogate.fit(both.design, u[:, None], c[:, None], psi, x, features=4)
    found = trace(surrogate, both.observe(0.4, 0.6, 1), RULES)
    model = found.model_of(found.best)
    pairs = calibrate(
        surrogate, model, lambda b, at, s: both.observe(float(at[0]), s, 100 + b), RULES, count=40
    )
    assert pairs is not None and 30 <= pairs.held < 40 and 1 < pairs.stretch < 2


def test_pairs_are_for_a_single_named_effect(linear: Linear, surrogate: Surrogate) -> None:
    nothing = trace(surrogate, linear.observe(0.4, 0.0, 2), RULES)
    none: Any = None
    assert calibrated(none, surrogate, nothing, 20) is None


def test_fresh_pours_confirm_the_fit_or_not(linear: Linear, surrogate: Surrogate) -> None:
    found = trace(surrogate, linear.observe(0.4, 0.6, 1), RULES)
    fit = found.model_of(found.best).fit
    u, psi = float(found.best.theta[0]), float(found.best.best_strengths[0])
    p = [confirm(surrogate, fit, linear.observe(u, psi, 300 + i)) for i in range(20)]
    assert np.mean(np.array(p) < 0.05) <= 0.2 and np.median(p) > 0.1
    assert confirm(surrogate, fit, linear.observe(u, psi, 300, alien=0.7)) < 0.01


def test_the_correction_takes_out_what_no_effect_explains(
    linear: Linear, surrogate: Surrogate
) -> None:
    observed = linear.observe(0.4, 0.0, 5, alien=1.5)
    found = trace(surrogate, observed, RULES)
    generator = np.random.default_rng(9)
    u = float(found.base.theta[0])
    rows = [
        (
            f"{c:g}",
            np.array([c]),
            linear.pours(0.4, c, 0.0, 8, generator, 1.5),
            linear.pours(u, c, 0.0, 8, generator),
        )
        for c in (*PLACES, 0.75)
    ]
    done = corrections(surrogate, found, rows, surrogate.names)
    assert [one.label for one in done] == ["0", "0.5", "1", "0.75"]
    for one in done:
        assert one.after is not None and one.after < 0.4 * one.before and not one.refused
    _, _, measured, simulated = rows[0]
    beyond = ("far", np.array([1.6]), measured, simulated)
    far = corrections(surrogate, found, [beyond], surrogate.names)
    assert far[0].after is None and "outside the tested conditions" in far[0].refused


ROW = TrivialRow(LINE, ("1",), np.array([3.0]), 3.0, 2.0, (1.0, 3.0))


def closed(linear: Linear, surrogate: Surrogate, psi: float) -> Any:
    """What the tables need of a closed loop."""
    found = trace(surrogate, linear.observe(0.4, psi, 1), RULES)
    generator = np.random.default_rng(4)
    measured, before, after = (
        [linear.pours(0.4, c, s, 4, generator) for c in PLACES] for s in (psi, 0.0, psi)
    )
    names = [f"{c:g}" for c in PLACES]
    fit = compare(names, measured, before, after, np.ones(SIZE), draws=50)
    recordings = tuple(Path(f"{i}") for i in range(4))
    library = by_name(["tilt.x"])
    named = found.verdict.kind == "EFFECT"
    task = SimpleNamespace(
        conditions=[
            SimpleNamespace(name=f"{c:g}", at={"height": c}, recordings=recordings) for c in PLACES
        ],
        library=library,
        effect=lambda name: library[0],
    )
    return SimpleNamespace(
        task=task,
        trace=found,
        verdict=found.verdict,
        standing=stand(found.verdict, RULES, confirmed=0.5, trivial=[ROW]),
        power=found.power,
        fit=fit,
        sealed=None,
        corrections=(Correction("0", 2.0, 0.5), Correction("1", 2.0, None, "too far")),
        calibrated=Coverage(0, np.array([0.4, 0.8]), 1.5, 15, 20, 0.0) if named else None,
    )


def test_the_tables_say_what_the_report_says(linear: Linear, surrogate: Surrogate) -> None:
    told = closed(linear, surrogate, 0.6)
    first, _, last = conditions(told)
    assert (first["condition"], first["height"], first["use"], first["pours"]) == ("0", 0, "fit", 4)
    assert first["square_before"] == told.fit.before[0].square
    assert first["square_after_low"] <= first["square_after"] <= first["square_after_high"]
    assert (first["square_line"], last["square_line"]) == (None, 3.0)
    assert first["square_nearest"] is None
    assert first["scaled_square_corrected"] == 0.5 and last["scaled_square_corrected"] is None
    (row,) = candidates(told)
    assert row["effect"] == "tilt.x" and row["is_named"] and row["is_calibrated"]
    # A tilt of 0.09 rad is full strength; the interval is that of the pairs.
    assert (row["psi_low"], row["psi_high"]) == (0.4, 0.8)
    assert row["value_low"] == pytest.approx(0.4 * 0.09) and row["path"] == "effects.tilt.x"
    assert row["value"] == pytest.approx(0.09 * row["psi"]) and abs(row["psi"] - 0.6) < 0.2
    left = residuals(told)
    assert len(left) == 3 * SIZE
    before, after = (sum(r[k] ** 2 for r in left) for k in ("before", "after"))
    assert after < 0.5 * before
    # Of an effect whose direction is not known no strength is told, though one was computed.
    unknown = replace(told.power, kappa=np.array([np.nan]))
    assert np.isfinite(unknown.detectable[0])
    assert unknown.to_dict()["detectable_strength"] == [None]
    told.power = unknown
    assert np.isnan(candidates(told)[0]["detectable_before"])
    # What the model's own pours give is beside the fit's.
    assert row["value_of_pours"] is None
    own = SimpleNamespace(strengths=np.array([0.7]), intervals=np.array([[0.5, 0.9]]))
    told.standing = SimpleNamespace(own=own)
    of_pours = candidates(told)[0]
    assert of_pours["value_of_pours"] == pytest.approx(0.7 * 0.09)
    assert of_pours["value_of_pours_high"] == pytest.approx(0.8 * 0.09)
    # A residual test that did not reject has no refits, and the model before is the one after.
    none = closed(linear, surrogate, 0.0)
    assert candidates(none)[0]["psi"] is None
    assert all(r["before"] == r["after"] for r in residuals(none))


def test_tables_are_parquet(linear: Linear, surrogate: Surrogate, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    told = closed(linear, surrogate, 0.6)
    paths = write_tables(told, tmp_path)
    assert [path.name for path in paths] == [
        "conditions.parquet",
        "candidates.parquet",
        "residuals.parquet",
    ]
    table = parquet.read_table(tmp_path / "conditions.parquet").to_pylist()
    assert table == [{k: row.get(k) for k in table[0]} for row in conditions(told)]
    assert sorted(p.suffix for p in tmp_path.iterdir()) == [".parquet"] * 3


def test_tables_without_their_library_say_what_to_install(
    linear: Linear, surrogate: Surrogate, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(ModuleNotFoundError, match=r"pip install 'granulcal\[report\]'"):
        write_tables(closed(linear, surrogate, 0.6), tmp_path)
    assert not list(tmp_path.iterdir())


def test_conditions_have_seeds_of_their_own() -> None:
    """The same seed under two of them begins with the same places of the grains."""
    one, other = (Condition(name, {}, "fit", ()) for name in ("4 cm", "8 cm"))
    seeds = [set(seeds_of_replicates(each, 5)) for each in (one, other)]
    assert len(seeds[0]) == len(seeds[1]) == REPLICATES and not seeds[0] & seeds[1]
    assert seeds_of_replicates(one, 5) == seeds_of_replicates(Condition("4 cm", {}, "fit", ()), 5)
    assert max(seeds_of_replicates(one, 2**31)) < 2**63
