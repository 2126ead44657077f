"""Toys of known posteriors, where inference has gone wrong before; -s prints what comes out."""

import numpy as np
import pytest

import granulcal as gc

pytest.importorskip("torch")


def _prior() -> gc.Prior:
    return gc.Prior(
        [
            gc.Parameter(path=f"theta.{i}", distribution="uniform", low=-1.0, high=1.0)
            for i in range(2)
        ]
    )


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.06, 0.03])
def test_each_of_two_peaks_has_its_mass(noise):
    """x = (theta_0^2, theta_1): the density integrates to one, and draws follow it."""
    prior = _prior()

    def poured(count, seed):
        theta = prior.sample(count, seed)
        mean = np.column_stack([theta[:, 0] ** 2, theta[:, 1]])
        return theta, mean + noise * np.random.default_rng(seed + 1).standard_normal((count, 2))

    model = gc.BayesSim.fit(*poured(400, 1), prior, quiet=True, method="emulated")
    cells = 700
    axis = (np.arange(cells) + 0.5) / cells * 2 - 1
    places = np.stack(np.meshgrid(axis, axis, indexing="ij"), -1).reshape(-1, 2)
    integrals, off = [], []
    for x in poured(40, 9)[1]:
        posterior = model.posterior(x)
        mass = np.exp(posterior.log_prob(places)) * (2 / cells) ** 2
        integrals.append(mass.sum())
        right = mass[places[:, 0] > 0].sum() / mass.sum()
        off.append(np.mean(posterior.sample(20_000, 1)[:, 0] > 0) - right)
    spread, by_draws = np.std(integrals), np.sqrt(np.mean(np.square(off)))
    print(f"noise {noise}: spread of the integral {spread:.3f}, mass of a peak to {by_draws:.3f}")
    assert np.mean(integrals) == pytest.approx(1.0, abs=0.03)
    assert spread < 0.05
    assert by_draws < 0.03


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_several_pours_of_a_material_make_nobody_sure(seed):
    """50 materials, 20 pours each: held-out pours of materials that were seen say little."""
    prior, noise = _prior(), 0.5
    slopes = np.random.default_rng(5).standard_normal((6, 2))

    def seen(theta, seed):
        chance = np.random.default_rng(seed).standard_normal((len(theta), 6))
        return theta @ slopes.T + noise * chance

    theta = np.repeat(prior.sample(50, seed), 20, axis=0)
    model = gc.BayesSim.fit(theta, seen(theta, seed + 3), prior, quiet=True, seed=seed)
    fresh = prior.sample(200, 999)
    check = model.check(fresh, seen(fresh, 77))
    print(f"seed {seed}: {model.summary.choice.splitlines()[0]}; {check}")
    assert np.mean(check.coverage.truth_levels <= 0.9) > 0.85


def test_round_off_of_what_never_changed_is_no_alarm():
    """One unit in the last place had been outside of every model, and another statistic blamed."""
    prior, noise, still = _prior(), 0.5, 3.7
    slopes = np.random.default_rng(5).standard_normal((4, 2))

    def poured(count, seed):
        theta = prior.sample(count, seed)
        chance = np.random.default_rng(seed + 1).standard_normal((count, 4))
        x = theta @ slopes.T + noise * chance
        return theta, np.column_stack([x, np.full(count, still)])

    model = gc.BayesSim.fit(*poured(200, 1), prior, quiet=True, method="emulated")
    for x in poured(20, 9)[1]:
        found = model.misfit(x)
        for off in (np.spacing(still), 1e-14, -1e-10):
            assert model.misfit(x + np.array([0, 0, 0, 0, off])).p_value == found.p_value
        other = model.misfit(x + np.array([0, 0, 0, 0, 0.1]))
        assert not other.is_inside and other.statistics[0].name == "statistic_4"
