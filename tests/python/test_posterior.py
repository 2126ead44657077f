"""Posterior: densities that integrate to one, draws inside the prior, regions, several pours."""

import inspect
import pickle
import re
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from scipy import stats

import granulcal
from granulcal.bayessim.check.toys import LinearGaussian
from granulcal.bayessim.network.mixture import Mixture
from granulcal.bayessim.posterior.average import NETWORK_ALONE
from granulcal.bayessim.posterior.posterior import MassOutsidePrior, Posterior, PoursDisagree
from granulcal.parameter import Parameter
from granulcal.prior import Prior

BOX = Prior(
    [
        Parameter(path="a.flat", distribution="uniform", low=-2.0, high=3.0),
        Parameter(path="a.log", distribution="log_uniform", low=1e-2, high=10.0),
    ]
)


def random_mixture(seed: int, *, components: int = 3, dimension: int = 2) -> Mixture:
    generator = np.random.default_rng(seed)
    roots = 0.15 * generator.standard_normal((components, dimension, dimension))
    covariances = roots @ roots.transpose(0, 2, 1) + 0.01 * np.eye(dimension)
    weights = generator.dirichlet(np.ones(components))
    means = generator.uniform(-0.1, 1.1, (components, dimension))
    return Mixture.from_covariances(weights, means, covariances)


def unbounded(dimension: int) -> Prior:
    return Prior(
        Parameter(path=f"n.{i}", distribution="normal", mean=0.0, sd=1.0) for i in range(dimension)
    )


def test_mixture_matches_scipy():
    mixture = random_mixture(1, dimension=3)
    density = Posterior.from_mixture(unbounded(3), mixture).density
    u = np.random.default_rng(0).standard_normal((40, 3))
    expected = sum(
        w * stats.multivariate_normal(m, c).pdf(u)
        for w, m, c in zip(mixture.weights, mixture.means, mixture.covariances, strict=True)
    )
    np.testing.assert_allclose(density.log_prob(u), np.log(expected), rtol=1e-9)


def test_mixture_draws_have_the_mixture_moments():
    mixture = random_mixture(3)
    draws = Posterior.from_mixture(unbounded(2), mixture).density.sample(40_000, 0)
    np.testing.assert_allclose(draws.mean(axis=0), mixture.weights @ mixture.means, atol=0.01)


@pytest.mark.parametrize("seed", range(4))
def test_density_in_own_units_integrates_to_one(seed: int):
    posterior = Posterior.from_mixture(BOX, random_mixture(seed))
    # Cell centres, even in the value and (for accuracy only) in the logarithm of the second one.
    flat = np.linspace(-2, 3, 401)
    edges = np.geomspace(1e-2, 10, 401)
    flat, flat_width = 0.5 * (flat[1:] + flat[:-1]), np.diff(flat)
    log, log_width = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    theta = np.stack(np.meshgrid(flat, log, indexing="ij"), axis=-1).reshape(-1, 2)
    cells = np.outer(flat_width, log_width).ravel()
    # Tolerance: the quasi-Monte Carlo mass inside the bounds.
    assert np.exp(posterior.log_prob(theta)) @ cells == pytest.approx(1.0, abs=5e-3)


def test_never_outside_the_bounds():
    mixture = Mixture.from_covariances(
        np.array([0.5, 0.5]),
        np.array([[0.0, 1.0], [1.3, -0.2]]),
        np.tile(0.3 * np.eye(2), (2, 1, 1)),
    )
    posterior = Posterior.from_mixture(BOX, mixture)
    theta = posterior.sample(5000, seed=1)
    low, high = BOX.bounds.T
    assert np.all((theta >= low) & (theta <= high))
    assert np.all(np.isfinite(posterior.log_prob(theta)))
    outside = [[-2.1, 1.0], [0.0, 20.0], [0.0, -1.0]]
    assert np.all(posterior.log_prob(outside) == -np.inf)
    for point in (posterior.mean(), posterior.mode()):
        assert np.all((point >= low) & (point <= high))


def test_mass_far_outside_is_reported_and_still_normalised():
    far = Mixture.from_covariances(np.ones(1), np.array([[1.5, 0.5]]), 0.02 * np.eye(2)[None])
    posterior = Posterior.from_mixture(BOX, far)
    assert isinstance(posterior.warnings[0], MassOutsidePrior)
    u = np.stack(np.meshgrid(*[(np.arange(300) + 0.5) / 300] * 2), axis=-1).reshape(-1, 2)
    assert np.exp(posterior.density.log_prob(u)).mean() == pytest.approx(1.0, abs=0.1)
    assert posterior.sample(100).shape == (100, 2)


def test_draws_repeat_with_their_seed_and_are_the_callers_own():
    posterior, twin = (
        Posterior.from_mixture(BOX, random_mixture(5, components=25)) for _ in range(2)
    )
    first = posterior.sample(50, seed=2)
    np.testing.assert_array_equal(first, twin.sample(50, seed=2))
    assert not np.array_equal(first, posterior.sample(50, seed=3))
    # What the caller does to draws does not come back with the next.
    kept = posterior.sample(50, seed=2)
    first[:] = 0.0
    posterior.sample(50, seed=2)[:] = 0.0
    np.testing.assert_array_equal(posterior.sample(50, seed=2), kept)


def test_region_holds_its_level_and_names_its_intervals():
    posterior = Posterior.from_mixture(BOX, random_mixture(6))
    region = posterior.credible_region(0.8)
    assert np.mean(region.contains(posterior.sample(4000, seed=9))) == pytest.approx(0.8, abs=0.03)
    assert region.contains(posterior.mode())[0]
    low, high = region["a.log"]
    share = np.mean(posterior.sample(4000, seed=8)[:, 1] < low) * 10
    assert share == pytest.approx(1.0, abs=0.3) and low < high
    assert not region.contains([[99.0, 1.0]])[0]
    with pytest.raises(ValueError, match="level must lie between 0 and 1, got 90"):
        posterior.credible_region(90)


def test_mode_and_mean_of_one_normal():
    toy = LinearGaussian.random(seed=3)
    x = toy.simulate(1, seed=5)[1]
    posterior = toy.posterior(x[0])
    normal = toy.normal(x[0])
    exact = toy.prior.from_unconstrained(normal.means)[0]
    spread = 2 * np.sqrt(np.diag(normal.covariances[0]))
    assert np.all(np.abs(posterior.mode() - exact) < 0.02 * spread)
    assert np.all(np.abs(posterior.mean() - exact) < 0.05 * spread)


def test_what_has_no_density_is_refused():
    posterior = Posterior.from_mixture(BOX, random_mixture(7))
    with pytest.raises(ValueError, match="grid must be at least 2, got 1"):
        posterior.marginals(grid=1)
    theta = np.tile(BOX.mean(), (2, 1))
    theta[1, 0] = np.nan
    for density in (posterior.log_prob, posterior.coordinate_log_prob, BOX.log_prob):
        with pytest.raises(ValueError, match=f"{BOX.names[0]} is NaN in row 1"):
            density(theta)
    theta[1, 0] = np.inf
    assert np.isneginf(posterior.log_prob(theta)[1]) and np.isneginf(BOX.log_prob(theta)[1])


def test_marginals_integrate_to_one():
    for parameter, marginal in zip(
        BOX.free, Posterior.from_mixture(BOX, random_mixture(7)).marginals().values(), strict=True
    ):
        coordinate = parameter.to_coordinate(marginal.grid)
        assert np.trapezoid(marginal.density, coordinate) == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("bounded", [False, True])
@pytest.mark.parametrize("pours", [2, 10])
def test_product_of_exact_posteriors_is_the_exact_posterior(bounded: bool, pours: int):
    toy = LinearGaussian.random(seed=1, noise=0.5 if bounded else 3.0, bounded=bounded)
    theta = toy.prior.sample(1, seed=4)
    x = toy.simulate_at(np.repeat(theta, pours, axis=0), seed=6)
    exact = toy.posterior(x)
    product = Posterior.from_mixtures(toy.prior, [toy.normal(row) for row in x])
    assert product.warnings == ()
    draws = exact.sample(2000, seed=1)
    # Mean of the log ratio is the divergence of the product from the exact posterior [nat].
    assert abs(np.mean(exact.log_prob(draws) - product.log_prob(draws))) < 0.03
    ours, theirs = product.sample(4000, seed=2), exact.sample(4000, seed=3)
    spread = theirs.std(axis=0)
    assert np.all(np.abs(ours.mean(axis=0) - theirs.mean(axis=0)) < 0.1 * spread)
    np.testing.assert_allclose(ours.std(axis=0), spread, rtol=0.08)


def test_several_pours_of_a_network_are_no_wider_than_its_posteriors():
    # A parameter that leaves no trace: each posterior is a little wider than the prior, so that
    # their product over the prior has no end.
    prior = unbounded(2)
    wide = Mixture.from_covariances(np.ones(1), np.array([[0.3, 0.0]]), np.diag([0.2, 1.3])[None])
    found = Posterior._of(prior, [], [wide] * 5, NETWORK_ALONE, ())
    assert found.warnings == ()
    draws = found.sample(4000, seed=1)
    np.testing.assert_allclose(draws.mean(axis=0), [0.3, 0.0], atol=0.06)
    np.testing.assert_allclose(draws.var(axis=0), [0.2, 1.3], rtol=0.12)


def test_settings_are_all_that_a_scene_is_told():
    fixed = Parameter(path="a.fixed", distribution="fixed", value=0.3)
    posterior = Posterior.from_mixture(Prior([*BOX.free, fixed]), random_mixture(9))
    mode = dict(zip(posterior.names, posterior.mode().tolist(), strict=True))
    assert posterior.settings() == {"a.fixed": 0.3, **mode}
    assert posterior.settings([0.5, 0.2]) == {"a.fixed": 0.3, "a.flat": 0.5, "a.log": 0.2}
    with pytest.raises(ValueError, match="one row"):
        posterior.settings([[0.5, 0.2], [0.5, 0.2]])


def test_pours_that_contradict_each_other_are_reported():
    apart = [
        Mixture.from_covariances(np.ones(1), np.array([[m, m]]), 1e-6 * np.eye(2)[None])
        for m in (0.01, 0.99)
    ]
    found = Posterior.from_mixtures(BOX, apart)
    assert np.all(np.isfinite(found.sample(100)))
    assert any(isinstance(w, PoursDisagree) for w in found.warnings)


def test_pair_plot_is_written(tmp_path):
    posterior = Posterior.from_mixture(BOX, random_mixture(8))
    path = tmp_path / "pairs.png"
    figure = posterior.pair_plot(path, truth=[0.0, 0.5], extra=posterior)
    assert path.stat().st_size > 5000
    assert figure.axes[2].get_yscale() == "log"
    with pytest.raises(ValueError, match="truth must have shape"):
        posterior.pair_plot(truth=[0.0])


def _drawn(path, names, **marks):
    """The figure of a posterior of numbers from 0 to 1, drawn, and where its texts end [px]."""
    parameters = [Parameter(path=n, distribution="uniform", low=0.0, high=1.0) for n in names]
    mixture = Mixture.from_covariances(
        np.ones(1), np.zeros((1, len(names))), np.eye(len(names))[None]
    )
    figure: Any = Posterior.from_mixture(Prior(parameters), mixture).pair_plot(path, **marks)
    figure.canvas.draw()
    found = [text for text in (figure._suptitle, figure._supxlabel) if text is not None]
    return figure, [text.get_window_extent() for text in found], figure._supxlabel.get_text()


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_pair_plot_says_what_it_shows_in_its_own_width(tmp_path, count):
    """The title of one parameter was cut off at both sides, and nothing said what is shaded."""
    names = [f"material.{letter}" for letter in "abc"[:count]]
    title = "OUTSIDE THE MODEL: its best compromise"
    figure, boxes, told = _drawn(tmp_path / "a.png", names, title=title, truth=[0.5] * count)
    width = figure.bbox.width
    assert len(boxes) == 2 and all(box.x0 >= 0 and box.x1 <= width for box in boxes)
    said = " ".join(told.split())
    assert "mode" in said and "Red: the truth" in said and "SI units" in said
    assert ("50 % and 90 %" in said) == (count > 1)


def test_a_pair_plot_names_whose_number_an_axis_has(tmp_path):
    names = ["material.sliding_friction", "funnel.height", "effects.tilt.x"]
    figure, _, _ = _drawn(tmp_path / "a.png", names)
    labels = {axis.get_xlabel() for axis in figure.axes} - {""}
    assert labels == {"sliding friction", "funnel height", "tilt x"}


def test_a_truth_at_the_priors_edge_is_marked_whole_and_one_beyond_it_is_told(tmp_path):
    """At a corner a quarter of the cross was left, and of a truth beyond the axes nothing."""
    names = ["material.a", "material.b"]
    figure, _, told = _drawn(tmp_path / "a.png", names, truth=[1.0, 0.0])
    crosses = [line for line in figure.axes[2].lines if line.get_marker() == "x"]
    assert len(crosses) == 1 and not crosses[0].get_clip_on() and "beyond" not in told
    shaded = [each.get_paths()[0].get_extents() for each in figure.axes[2].collections]
    assert any(box.x0 == 0.0 and box.x1 == 1.0 for box in shaded)
    figure, _, told = _drawn(tmp_path / "b.png", names, truth=[1.5, 0.5])
    assert not [line for line in figure.axes[2].lines if line.get_marker() == "x"]
    assert "The truth lies beyond the axis of a." in " ".join(told.split())


def test_a_posterior_says_what_it_is_and_stays_in_its_process():
    posterior = Posterior.from_mixture(BOX, random_mixture(9))
    low, high = posterior.credible_region(0.9)["a.flat"]
    assert repr(posterior).startswith("Posterior(a.flat ") and f"({low:.3g} to {high:.3g})" in repr(
        posterior
    )
    with pytest.raises(TypeError, match="stays in its process: hand over sample"):
        pickle.dumps(posterior)


def test_a_posterior_counts_its_doubts():
    apart = [
        Mixture.from_covariances(np.ones(1), np.array([[m, m]]), 1e-6 * np.eye(2)[None])
        for m in (0.01, 0.99)
    ]
    found = Posterior.from_mixtures(BOX, apart)
    kinds = ", ".join(dict.fromkeys(type(each).__name__ for each in found.warnings))
    plural = "s" if len(found.warnings) > 1 else ""
    told = f"; {len(found.warnings)} note{plural} in `warnings`: {kinds})"
    assert "PoursDisagree" in kinds and repr(found).endswith(told)


def test_what_the_docstrings_name_is_there():
    documented = inspect.getmembers(Posterior, lambda each: inspect.getdoc(each) is not None)
    for method, each in documented:
        for name in re.findall(r"`granulcal\.(\w+)`", inspect.getdoc(each) or ""):
            assert hasattr(granulcal, name), f"{method} refers to granulcal.{name}"


def test_bad_arguments():
    posterior = Posterior.from_mixture(BOX, random_mixture(9))
    with pytest.raises(ValueError, match="n must be"):
        posterior.sample(-1)
    with pytest.raises(ValueError, match="seed must be at least 0, got -1"):
        posterior.sample(3, seed=-1)
    with pytest.raises(KeyError, match=r"no parameter 'b'; there are a\.flat, a\.log"):
        posterior.credible_region()["b"]
    with pytest.raises(ValueError, match=r"\(rows, 2\)"):
        posterior.log_prob([[1.0, 2.0, 3.0]])
    assert posterior.sample(0).shape == (0, 2)


def test_no_heavy_imports():
    code = (
        "import sys, granulcal.bayessim.posterior.posterior, granulcal.prior\n"
        "import granulcal.bayessim, granulcal.bayessim.check.diagnostics\n"
        "sys.exit(any(m in sys.modules for m in ('torch', 'matplotlib', 'scipy')))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
