"""The loop's statistics against a linear-Gaussian simulator, where everything is known."""

import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from granulcal.errors import ObservationError, TrainingDataError
from granulcal.loop import (
    ConditionPours,
    Design,
    Discrepancy,
    Effect,
    Surrogate,
    Thresholds,
    compare,
    next_experiment,
    power,
    trace,
)
from granulcal.loop.check.trivial import Group, trivial_rows
from granulcal.loop.effects.design import cube_from_normal, normal_from_cube
from granulcal.loop.surrogate.baseline import fit_base
from granulcal.loop.surrogate.blocks import fit_blocks
from granulcal.loop.surrogate.stacked_means import StackedMeans
from granulcal.loop.surrogate.transform import Transform
from granulcal.loop.test.distance import noise_free_square
from granulcal.loop.test.refit import fit_pair, fit_single
from granulcal.loop.test.residual_test import residual_test
from granulcal.loop.test.score import Scores

Array = NDArray[np.float64]

RULES = Thresholds(replicates=400, replicates_after=200, refits=4)
CONDITIONS = (0.0, 0.5, 1.0)


@dataclass(frozen=True)
class Linear:
    """x = A (2 u - 1) + psi D (1 + c) + noise; the last row of D is in no library."""

    design: Design
    slopes: Array
    directions: Array
    root: Array

    @classmethod
    def make(cls) -> "Linear":
        generator = np.random.default_rng(5)
        size = 8
        slopes = 3 * generator.standard_normal((2, size))
        directions = generator.standard_normal((4, size))
        # The second effect is the first parameter but for a tenth.
        directions[1] = slopes[0] / 2 + 0.1 * directions[1]
        mixing = np.eye(size) + 0.3 * generator.standard_normal((size, size))
        effects = (
            Effect("seen"),
            Effect("mimicked"),
            Effect("signed", is_two_sided=True),
        )
        design = Design(("a", "b"), ("height",), effects)
        return cls(design, slopes, 2 * directions, 0.7 * mixing)

    def simulate(
        self, theta: Array, c: Array, psi: Array, generator: np.random.Generator, alien: float = 0.0
    ) -> Array:
        strengths = np.column_stack([psi, np.full(len(psi), alien)])
        # The effects grow with the condition, which the parameters do not.
        mean = (2 * theta - 1) @ self.slopes + strengths @ self.directions * (0.5 + c)
        return mean + generator.standard_normal(mean.shape) @ self.root.T

    def archive(self, seed: int = 0) -> tuple[Array, Array, Array, Array]:
        generator = np.random.default_rng(seed)
        base, each = 300, 60
        count = base + 3 * each
        theta, c = generator.random((count, 2)), generator.random((count, 1))
        psi = np.zeros((count, 3))
        for k, effect in enumerate(self.design.effects):
            rows = slice(base + k * each, base + (k + 1) * each)
            psi[rows, k] = generator.uniform(effect.low, 1, each)
        return theta, c, psi, self.simulate(theta, c, psi, generator)

    def observe(
        self, theta: Array, psi: Array, seed: int, pours: int = 4, alien: float = 0.0
    ) -> list[ConditionPours]:
        generator = np.random.default_rng([seed, 11])
        found = []
        for c in CONDITIONS:
            rows = np.tile(theta, (pours, 1)), np.full((pours, 1), c), np.tile(psi, (pours, 1))
            x = self.simulate(*rows, generator, alien)
            found.append(ConditionPours.of(f"c = {c:g}", [c], x))
        return found


@pytest.fixture(scope="module")
def toy() -> Linear:
    return Linear.make()


@pytest.fixture(scope="module")
def surrogate(toy: Linear) -> Surrogate:
    return Surrogate.fit(toy.design, *toy.archive(), features=8)


def test_z_scores_invert() -> None:
    u = np.linspace(0.001, 0.999, 31)
    np.testing.assert_allclose(cube_from_normal(normal_from_cube(u)), u, atol=1e-12)


def test_left_out_residuals_are_those_of_fits_without_the_row() -> None:
    generator = np.random.default_rng(0)
    x, scale = generator.standard_normal((40, 3)), np.full(40, 1.0)
    y = x @ np.array([1.0, -2.0, 0.5]) + 0.3 * generator.standard_normal(40)
    fit = fit_blocks(x, y, scale, [slice(0, 3)], x.T @ x)
    others = np.arange(40) != 7
    plain = np.linalg.lstsq(x[others], y[others], rcond=None)[0]
    # The prior is wide here, so that least squares is what it comes to.
    assert fit.left_out[7] == pytest.approx(y[7] - x[7] @ plain, abs=0.01)


def test_a_block_without_a_trace_shrinks_to_nothing() -> None:
    generator = np.random.default_rng(1)
    x = generator.standard_normal((200, 8))
    y = x[:, :3] @ np.array([1.0, -1.0, 2.0]) + 0.5 * generator.standard_normal(200)
    fit = fit_blocks(x, y, np.ones(200), [slice(0, 3), slice(3, 8)], x.T @ x)
    free = np.linalg.lstsq(x, y, rcond=None)[0]
    assert np.linalg.norm(fit.coefficients[3:]) < 0.5 * np.linalg.norm(free[3:])
    np.testing.assert_allclose(fit.coefficients[:3], [1, -1, 2], atol=0.15)


@pytest.mark.parametrize("kind", ["identity", "log", "reciprocal"])
def test_the_transform_makes_noise_normal(kind: str) -> None:
    generator = np.random.default_rng(2)
    features = np.column_stack([np.ones(400), generator.random(400)])
    y = 1 + features[:, 1] + 0.4 * generator.standard_normal(400)
    x = {"identity": y, "log": np.exp(y), "reciprocal": 1 / (4 - y)}[kind]
    # A few beyond the end would be negative.
    found = Transform.choose(np.abs(x), features)
    assert found.kind == kind
    assert found(np.abs(x)).std() == pytest.approx(1)


def test_what_runs_off_to_its_bound_is_no_outlier() -> None:
    # Degrees of freedom of a chi distribution where radii are nearly normal.
    generator = np.random.default_rng(4)
    share = np.clip(0.7 + 0.15 * generator.standard_normal(600), 0.05, 1.0)
    found = Transform.choose(1 / share, np.ones((600, 1)))
    near, far = found(np.array([4.9, 100.0]))
    assert 0 < far - near < 2
    assert found.inverse(np.array([99.0])) == pytest.approx(found.width)


def test_the_surrogate_finds_mean_and_noise(toy: Linear, surrogate: Surrogate) -> None:
    generator = np.random.default_rng(3)
    theta, c = generator.random((50, 2)), generator.random((50, 1))
    psi = np.zeros((50, 3))
    psi[:, 0] = 0.8
    many = [
        surrogate.standardise(
            toy.simulate(np.tile(t, (80, 1)), np.tile(h, (80, 1)), np.tile(p, (80, 1)), generator)
        )
        for t, h, p in zip(theta, c, psi, strict=True)
    ]
    means, spreads = np.mean(many, axis=1), np.std(many, axis=1)
    error = surrogate.mean(theta, c, psi) - means
    assert np.sqrt(np.mean(error**2)) < 0.35 * np.mean(spreads)
    assert np.mean(surrogate.scale(theta, c, psi) / spreads) == pytest.approx(1, abs=0.08)
    # Statistics are whitened: what one pour scatters has no correlation on the axes.
    assert np.abs(surrogate.correlation - np.diag(np.diag(surrogate.correlation))).max() < 0.2
    assert surrogate.lack.max() < 0.15


def test_what_the_features_cannot_follow_counts_as_error(toy: Linear) -> None:
    theta, c, psi, x = toy.archive()
    x = x + 3 * np.sign(np.sin(14 * theta[:, :1])) * np.eye(8)[0]
    rough = Surrogate.fit(toy.design, theta, c, psi, x, features=4)
    assert rough.lack.max() > 0.2


def test_constants_and_bad_rows_are_left_out_by_name(toy: Linear) -> None:
    theta, c, psi, x = toy.archive()
    x = np.column_stack([x, np.full(len(x), 3.0)])
    x[5, 0] = np.nan
    found = Surrogate.fit(toy.design, theta, c, psi, x, features=4, names=[*"abcdefghi"])
    assert found.dropped == {"i": "constant"}
    assert (found.excluded, found.size) == (1, 8)
    seen = ConditionPours.of("here", [0.5], np.tile(np.append(x[6, :8], 4.0), (2, 1)))
    assert found.beyond([seen]) == ("i at here: 4, archive 3 to 3",)


def test_a_distance_is_of_statistics_that_vary(toy: Linear) -> None:
    # What effects alone change has no noise without them; over a constant no distance can be told.
    theta, c, psi, x = toy.archive()
    hung, still = 1 - psi[:, :1] / 2, np.full((len(x), 1), 7.0)
    made = Surrogate.fit(toy.design, theta, c, psi, np.hstack([x, hung, still]), features=4)
    assert made.dropped == {"x8": "constant in pours without effects", "x9": "constant"}
    np.testing.assert_allclose(made.raw_spread[:8], x[~psi.any(axis=1)].std(axis=0))
    assert made.raw_spread[8:].tolist() == [pytest.approx(hung.std()), np.inf]
    rows = np.hstack([x, hung, still])[:4]
    off = np.add(rows, [*np.zeros(8), hung.std(), 0.0])
    found = compare(["4 cm"], [rows], [off], [rows], made.raw_spread, draws=50)
    assert found.gain == pytest.approx(1)
    assert np.isfinite(found.total_before.error)


def test_bad_input_says_what_would_do(toy: Linear, surrogate: Surrogate) -> None:
    theta, c, psi, x = toy.archive()
    with pytest.raises(TrainingDataError, match="at least 60 usable pours without effects, got 20"):
        Surrogate.fit(toy.design, theta[:20], c[:20], psi[:20], x[:20])
    with pytest.raises(TrainingDataError, match="unit coordinates .0, 1., got 7"):
        Surrogate.fit(toy.design, 7 + 0 * theta, c, psi, x)
    with pytest.raises(ObservationError, match="8.*got .2, 3."):
        StackedMeans.of(surrogate, [ConditionPours.of("here", [0.5], np.zeros((2, 3)))])
    with pytest.raises(ObservationError, match="within the archive's range"):
        StackedMeans.of(surrogate, [ConditionPours.of("here", [1.5], np.zeros((2, 8)))])


@pytest.mark.parametrize("pours", [4, 40])
def test_the_residual_of_a_fit_is_efficient(toy: Linear, surrogate: Surrogate, pours: int) -> None:
    stack = StackedMeans.of(surrogate, toy.observe(np.array([0.3, 0.6]), np.zeros(3), 0, pours))
    local, fit = fit_base(surrogate, stack, 0)
    scores = Scores.of(local, fit, (0, 1, 2))
    white = scores.whiten @ fit.residual
    # At the best fit the slopes pull as hard as the prior: J^T r = v, so M (r + J v) = r.
    np.testing.assert_allclose(scores.slopes.T @ white, fit.v, atol=0.02)
    again = scores.remain((white + scores.slopes @ fit.v)[:, None])[:, 0]
    np.testing.assert_allclose(again, white, atol=1e-3)
    # The truth in prior z-scores, -0.52 and 0.25, is found to within three standard errors: 0.06
    # and 0.02 after four pours at each condition, less than half of that after forty.
    truth = normal_from_cube(np.array([0.3, 0.6]))
    covariance = np.linalg.inv(np.eye(2) + scores.slopes.T @ scores.slopes)
    errors = np.sqrt(np.diag(covariance))
    assert (errors < np.array([0.07, 0.03]) * np.sqrt(4 / min(pours, 16))).all()
    assert (np.abs(fit.v - truth) < 3 * errors).all(), (fit.v, truth, errors)
    cosines = scores.cosines
    np.testing.assert_allclose(np.diag(cosines), 1)
    assert scores.kappa[0] > 0.5
    assert np.isnan(scores.kappa[1]) or scores.kappa[1] < 0.5


def test_what_is_nearest_to_a_residual_is_named(toy: Linear, surrogate: Surrogate) -> None:
    strengths = np.array([0.9, 0.0, 0.0])
    found = trace(surrogate, toy.observe(np.array([0.5, 0.5]), strengths, 3), Thresholds(), seed=1)
    names = [effect.name for effect in surrogate.design.effects]
    # "mimicked" is a parameter but for a tenth: little is left of it that no parameter does.
    assert [name for name, _ in found.nearest] == [names[0], names[2], names[1]]
    cosines = [cosine for _, cosine in found.nearest]
    assert cosines == sorted(cosines, reverse=True) and cosines[-1] >= 0 and cosines[0] <= 1
    assert cosines[0] > 0.9 and cosines[1] < 0.7
    written = found.to_dict()["nearest_effects"]
    assert [one["name"] for one in written] == [name for name, _ in found.nearest]


def test_false_alarms_and_coverage(toy: Linear, surrogate: Surrogate) -> None:
    generator = np.random.default_rng(9)
    p_values, inside = [], 0
    sets = 60
    for seed in range(sets):
        theta = generator.uniform(0.1, 0.9, 2)
        stack = StackedMeans.of(surrogate, toy.observe(theta, np.zeros(3), seed))
        local, fit = fit_base(surrogate, stack, seed)
        scores = Scores.of(local, fit, (0, 1, 2))
        p_values.append(residual_test(local, fit, scores, replicates=300, refits=2, seed=seed).p)
        strength = generator.uniform(0, 1)
        stack = StackedMeans.of(
            surrogate, toy.observe(theta, np.array([strength, 0, 0]), 500 + seed)
        )
        local, fit = fit_base(surrogate, stack, seed)
        model = fit_single(local, stack.means.ravel(), fit, 0, RULES)
        low, high = model.intervals[0]
        inside += low <= strength <= high
    p = np.array(p_values)
    # Binomial(60, .05) exceeds 8 once in 600; a uniform p has its mean within .5 -+ .13.
    assert np.sum(p <= 0.05) <= 8
    assert abs(p.mean() - 0.5) < 0.15
    assert inside >= 50


@pytest.mark.parametrize(
    ("psi", "alien", "kind", "named"),
    [
        ((0.0, 0.0, 0.0), 0.0, "NONE", ()),
        ((0.7, 0.0, 0.0), 0.0, "EFFECT", ("seen",)),
        ((0.0, 0.0, -0.7), 0.0, "EFFECT", ("signed",)),
        ((0.0, 0.0, 0.0), 1.5, "UNEXPLAINED", ()),
        ((0.9, 0.0, 0.9), 0.0, "EFFECTS", ("signed", "seen")),
    ],
)
def test_verdicts(
    toy: Linear,
    surrogate: Surrogate,
    psi: tuple[float, ...],
    alien: float,
    kind: str,
    named: tuple[str, ...],
) -> None:
    observed = toy.observe(np.array([0.4, 0.5]), np.array(psi), 3, 5, alien)
    found = trace(surrogate, observed, RULES, seed=1)
    assert (found.verdict.kind, found.verdict.named) == (kind, named), found.verdict
    for name, strength, interval in zip(
        found.best.effects, found.best.strengths, found.best.intervals, strict=True
    ):
        true = psi[[e.name for e in toy.design.effects].index(name)]
        assert interval[0] <= true <= interval[1]
        assert abs(strength - true) < 0.1
    written = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert written["verdict"]["kind"] == kind
    again = trace(surrogate, observed, RULES, seed=1)
    assert again.to_dict() == found.to_dict()


def test_power_grows_with_pours(surrogate: Surrogate) -> None:
    few = power(surrogate, [0.5, 0.5], [[0.0], [1.0]], [2, 2])
    many = power(surrogate, [0.5, 0.5], [[0.0], [1.0]], [20, 20])
    assert (many.detectable < few.detectable).all()
    # What the surrogate does not know does not average away.
    assert (many.detectable > few.detectable / np.sqrt(10)).all()
    json.dumps(many.to_dict(), allow_nan=False)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_pair_says_at_which_end_a_strength_leans(
    toy: Linear, surrogate: Surrogate, sign: int
) -> None:
    seen = toy.observe(np.array([0.5, 0.4]), np.array([0.5, 0.0, 1.3 * sign]), 3)
    stack = StackedMeans.of(surrogate, seen)
    local, base = fit_base(surrogate, stack, 0)
    target = stack.means.ravel()
    alone = fit_single(local, target, base, 0, RULES)
    found = fit_pair(local, target, base, alone.fit, (0, 2), RULES)
    assert found.at_end and found.fit.psi[2] == sign and abs(found.fit.psi[0]) < 0.98


def test_a_nuisance_is_never_found(toy: Linear) -> None:
    effects = (*toy.design.effects[:2], Effect("signed", is_two_sided=True, nuisance_sd=1.0))
    design = Design(toy.design.parameters, toy.design.conditions, effects)
    careful = Surrogate.fit(design, *toy.archive(), features=8)
    observed = toy.observe(np.array([0.4, 0.5]), np.array([0.0, 0.0, -0.7]), 3)
    found = trace(careful, observed, RULES)
    assert found.verdict.kind == "NONE"
    assert found.power.effects == ("seen", "mimicked")


def test_the_next_experiment_is_where_rivals_differ_most(toy: Linear, surrogate: Surrogate) -> None:
    observed = toy.observe(np.array([0.4, 0.5]), np.array([0.3, 0.0, 0.3]), 3, 1)
    found = trace(surrogate, observed, RULES)
    assert set(found.verdict.named) == {"seen", "signed"}
    ranked = next_experiment(surrogate, found, [("low", [0.0]), ("high", [1.0])], pours=10)
    # Effects are three times as large at 1 as at 0; the surrogate's own error takes some of 9.
    assert [one.label for one in ranked] == ["high", "low"]
    assert 4 < ranked[0].gain / ranked[1].gain < 9
    assert all(set(one.rivals) == {"seen", "signed"} for one in ranked)


def test_without_rivals_the_next_experiment_is_where_most_is_learnt(
    toy: Linear, surrogate: Surrogate
) -> None:
    observed = toy.observe(np.array([0.4, 0.5]), np.array([0.7, 0.0, 0.0]), 3)
    found = trace(surrogate, observed, RULES)
    candidates = [("high", [1.0]), ("low", [0.0])]
    ranked = next_experiment(surrogate, found, candidates, pours=10)
    assert [one.label for one in ranked] == ["low", "high"]
    assert all(one.gain == 0 and one.rivals == () and one.theta_gain > 0 for one in ranked)
    forty = next_experiment(surrogate, found, [("low", [0.0])], pours=40)
    assert forty[0].theta_gain > ranked[0].theta_gain


def test_the_correction_holds_where_pours_were(toy: Linear, surrogate: Surrogate) -> None:
    theta = np.array([0.4, 0.5])
    found = trace(surrogate, toy.observe(theta, np.zeros(3), 3, 8, 1.5), RULES)
    correction = Discrepancy.of(found.local, found.base_fit)
    at_tested = np.concatenate([correction.predict([c])[0] for c in CONDITIONS])
    # Where nothing was poured it says so.
    beside = correction.predict([-0.2])[1]
    assert (beside > correction.predict(CONDITIONS[0])[1]).all()
    residual = found.local.in_statistics(found.base_fit.residual)
    assert np.linalg.norm(residual - at_tested) < 0.7 * np.linalg.norm(residual)
    with pytest.raises(ObservationError, match="outside the tested conditions"):
        correction.predict([2.0])


def test_noise_free_squares_are_unbiased() -> None:
    generator = np.random.default_rng(4)
    shift = np.array([0.5, 0.0, -1.0])
    found = [
        noise_free_square(
            shift + generator.standard_normal((4, 3)), generator.standard_normal((6, 3)), np.ones(3)
        )
        for _ in range(2000)
    ]
    assert np.mean(found) == pytest.approx(1.25, abs=0.1)


def noise_along(shift: float, rows: Sequence[Array]) -> float:
    """Variance of the sum of the means of pours (n, s), along a gap of `shift` in each number."""
    along = [each.sum(axis=1) * shift for each in rows]
    return sum(each.var(ddof=1) / len(each) for each in along)


def width(interval: tuple[float, float]) -> float:
    """From one end to the other."""
    return interval[1] - interval[0]


@pytest.mark.parametrize("measured", [1, 2, 3])
def test_intervals_of_few_pours_are_as_wide_as_their_noise(measured: int) -> None:
    # Two pours drawn again from two scatter by 0.71 of what two fresh ones do.
    generator, shift, places, size = np.random.default_rng(6), 30.0, 8, 4
    labels = [str(place) for place in range(places)]
    pours = [shift + generator.standard_normal((measured, size)) for _ in labels]
    first, second = (
        [at * shift + generator.standard_normal((10, size)) for _ in labels] for at in (0, 2)
    )
    found = compare(labels, pours, first, second, np.ones(size), draws=1200)
    ours = noise_along(shift, first)
    theirs = noise_along(shift, pours) if measured > 1 else 10 * ours
    sd = 2 * np.sqrt(theirs + ours) / places
    assert width(found.total_before.interval) == pytest.approx(2 * 1.96 * sd, rel=0.07)
    # A measured pour moves one square up and the other down.
    sd = 2 * np.sqrt(4 * theirs + ours + noise_along(shift, second)) / places
    assert width(found.gain_interval) == pytest.approx(2 * 1.96 * sd, rel=0.07)


def test_rows_without_physics_have_the_noise_of_few_pours() -> None:
    generator, shift, size = np.random.default_rng(7), 30.0, 4

    def group(gap: float) -> Group:
        pours = (gap + generator.standard_normal((2, size)), *generator.normal(size=(2, 10, size)))
        return Group("", np.zeros(1), *pours)

    fitted, sealed = ([group(gap) for _ in range(8)] for gap in (0.0, shift))
    nearest = trivial_rows(fitted, sealed, np.ones(size))[0]
    # What is measured under the sealed ones moves both squares alike.
    noise = [[g.measured for g in fitted], [g.named for g in sealed]]
    sd = 2 * np.sqrt(sum(noise_along(shift / 8, rows) for rows in noise))
    assert width(nearest.gain_interval) == pytest.approx(2 * 1.96 * sd, rel=0.07)


def test_removed_share_and_its_interval() -> None:
    generator = np.random.default_rng(5)
    pours = [generator.standard_normal((30, 3)) + 2 for _ in range(2)]
    before = [generator.standard_normal((30, 3)) for _ in range(2)]
    after = [generator.standard_normal((30, 3)) + 2 for _ in range(2)]
    found = compare(["a", "b"], pours, before, after, np.ones(3), draws=300)
    assert found.removed == pytest.approx(1, abs=0.1)
    assert found.is_improved and found.is_at_floor
    assert found.removed_interval[0] < found.removed < found.removed_interval[1]
    assert found.total_before.error > found.total_before.floor
    json.dumps(found.to_dict(), allow_nan=False)
    nothing = compare(["a", "b"], pours, after, after, np.ones(3), draws=300)
    assert np.isnan(nothing.removed) and not nothing.is_improved
