"""Prior: its TOML form, its densities, its coordinates, and what it refuses."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from granulcal.cli import main
from granulcal.errors import PriorError
from granulcal.parameter import Parameter
from granulcal.prior import Prior

EVERY_KIND = """
[[parameter]]
path = "material.sliding_friction"
distribution = "uniform"
low = 0.0
high = 1.0

[[parameter]]
path = "material.rolling_friction"
distribution = "log_uniform"
low = 1e-3
high = 1

[[parameter]]
path = "material.restitution"
distribution = "fixed"
value = 0.5

[[parameter]]
path = "scene.start.height"
distribution = "normal"
mean = 0.12
sd = 0.02
low = 0.1
high = 0.2
"""


def table(**keys: object) -> str:
    lines = [f'{k} = "{v}"' if isinstance(v, str) else f"{k} = {v}" for k, v in keys.items()]
    return "[[parameter]]\n" + "\n".join(lines) + "\n"


def test_toml_round_trip():
    prior = Prior.from_toml(EVERY_KIND)
    assert Prior.from_toml(prior.to_toml()) == prior
    assert prior.names == [
        "material.sliding_friction",
        "material.rolling_friction",
        "scene.start.height",
    ]
    assert prior.fixed == {"material.restitution": 0.5}


@given(
    low=st.floats(1e-12, 1e6),
    factor=st.floats(1.001, 1e6),
    kind=st.sampled_from(["uniform", "log_uniform"]),
)
def test_any_range_survives_toml_and_coordinates(low: float, factor: float, kind: str):
    prior = Prior([Parameter(path="a.b", distribution=kind, low=low, high=low * factor)])
    assert Prior.from_toml(prior.to_toml()) == prior
    theta = prior.sample(20, seed=1)
    assert np.all((theta >= low) & (theta <= low * factor))
    back = prior.from_unconstrained(prior.to_unconstrained(theta))
    np.testing.assert_allclose(back, theta, rtol=1e-9)
    assert np.all(np.isfinite(prior.log_prob(theta)))
    assert np.all(np.isfinite(prior.log_prob(prior.bounds.T)))


def test_a_distribution_is_said_as_inspect_says_it(tmp_path, capfd):
    path = tmp_path / "prior.toml"
    kinds = {
        "material.sliding_friction": {"distribution": "uniform", "low": 0.05, "high": 1},
        "material.rolling_friction": {"distribution": "log_uniform", "low": 1e-3, "high": 1.5},
        "material.restitution": {"distribution": "fixed", "value": 0.4},
        "funnel.height": {"distribution": "normal", "mean": 0.08, "sd": 0.004},
        "camera.height": {"distribution": "normal", "mean": 0.3, "sd": 0.01, "low": 0.25},
        "start.base": {"distribution": "normal", "mean": 0, "sd": 1, "low": -0.5, "high": 0.5},
    }
    prior = Prior.from_tables([{"path": path, **kind} for path, kind in kinds.items()])
    path.write_text(prior.to_toml())
    assert main(["inspect", str(path)]) == 0
    told = capfd.readouterr().out.splitlines()
    assert told[: len(kinds)] == [f"{each.path}: {each.in_words}" for each in prior.parameters]
    assert prior.parameters[3].in_words == "normal 0.08 ± 0.004"


def test_log_prob_matches_scipy():
    prior = Prior.from_toml(EVERY_KIND)
    theta = prior.sample(50, seed=3)
    cut = stats.truncnorm((0.1 - 0.12) / 0.02, (0.2 - 0.12) / 0.02, loc=0.12, scale=0.02)
    z = (theta[:, 2] - 0.12) / 0.02
    expected = stats.loguniform.logpdf(theta[:, 1], 1e-3, 1) + stats.truncnorm.logpdf(z, -1, 4)
    np.testing.assert_allclose(prior.log_prob(theta), expected - np.log(0.02), rtol=1e-9)
    np.testing.assert_allclose(prior.mean(), [0.5, 0.999 / math.log(1000), cut.mean()], rtol=1e-9)


def test_shares_below_match_scipy():
    prior = Prior.from_toml(EVERY_KIND)
    theta = prior.sample(50, seed=3)
    cut = stats.truncnorm((0.1 - 0.12) / 0.02, (0.2 - 0.12) / 0.02, loc=0.12, scale=0.02)
    laws = [stats.uniform(), stats.loguniform(1e-3, 1), cut]
    expected = [law.cdf(column) for column, law in zip(theta.T, laws, strict=True)]
    np.testing.assert_allclose(prior.cdf(theta), np.transpose(expected), rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(prior.cdf(theta - 1e3), 0.0)
    np.testing.assert_array_equal(prior.cdf(theta + 1e3), 1.0)
    assert np.all(np.isnan(prior.cdf(np.full((1, 3), np.nan))))


@pytest.mark.parametrize(("low", "high"), [(4.5, None), (None, -4.5), (None, None)])
def test_shares_below_of_tails_match_scipy(low, high):
    prior = Prior(
        [Parameter(path="a.b", distribution="normal", mean=0.0, sd=1.0, low=low, high=high)]
    )
    law = stats.truncnorm(-np.inf if low is None else low, np.inf if high is None else high)
    values = law.ppf([0.1, 0.5, 0.9])
    np.testing.assert_allclose(prior.cdf(values[:, None])[:, 0], law.cdf(values), rtol=1e-8)


def test_samples_follow_the_distributions():
    theta = Prior.from_toml(EVERY_KIND).sample(4000, seed=7)
    cut = stats.truncnorm((0.1 - 0.12) / 0.02, (0.2 - 0.12) / 0.02, loc=0.12, scale=0.02)
    for column, law in zip(theta.T, [stats.uniform(), stats.loguniform(1e-3, 1), cut], strict=True):
        assert stats.kstest(column, law.cdf).pvalue > 1e-3


def test_sampling_is_reproducible():
    prior = Prior.default()
    np.testing.assert_array_equal(prior.sample(10, seed=4), prior.sample(10, seed=4))
    assert not np.array_equal(prior.sample(10, seed=4), prior.sample(10, seed=5))


def test_log_prob_is_minus_infinity_outside():
    prior = Prior.default()
    outside = [[1.1, 0.1, 0.5], [0.5, 1e-4, 0.5], [0.5, -0.1, 0.5], [0.5, 0.0, 0.5]]
    assert np.all(prior.log_prob(outside) == -np.inf)


def test_paper_prior_scales_with_the_grain():
    np.testing.assert_allclose(Prior.paper().bounds[1], [1e-4, 100.0])
    np.testing.assert_allclose(Prior.paper(grain_diameter=0.008).bounds[1], [5e-5, 50.0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (table(path="a", distribution="uniform", low=0, high=1, step=2), "unknown key step"),
        (
            table(path="a", distribution="uniform", low=1, high=1),
            "high must be above low",
        ),
        (table(path="a", distribution="uniform", low=0), "high must be given for this"),
        (
            table(path="a", distribution="log_uniform", low=0, high=1),
            "must be positive for log_uniform",
        ),
        (table(path="a", distribution="uniform", low="nan", high=1), "must be a number"),
        (
            f'[[parameter]]\npath="a"\ndistribution="uniform"\nlow={"9" * 400}\nhigh=1',
            "low must be from -1.8e308",
        ),
        (
            '[[parameter]]\npath="a"\ndistribution="uniform"\nlow=nan\nhigh=1',
            "must be finite, got NaN",
        ),
        (table(path="a", distribution="beta", low=0, high=1), 'fixed, got "beta"'),
        (table(path="a", distribution="normal", mean=0, sd=0), "sd must be positive, got 0"),
        (table(path="a", distribution="normal", mean=0, sd=1, low=9), "mass"),
        (table(path="a", distribution="fixed", value=1), "at least one parameter"),
        (
            table(path="a", distribution="fixed", value=1, low=0),
            "low must be absent",
        ),
        (table(path="a b", distribution="uniform", low=0, high=1), "words joined by dots"),
        (table(distribution="uniform", low=0, high=1), "path must be a string"),
        (table(path="a", distribution="uniform", low=0, high=1) * 2, "repeated: a"),
        ("", "at least one parameter"),
        ("parameter = 3", "list of tables"),
        ("[prior]", "unknown key prior"),
        ("[[parameter", "not valid TOML"),
    ],
)
def test_refuses(text: str, message: str):
    with pytest.raises(PriorError, match=message):
        Prior.from_toml(text)


def test_load_names_the_file(tmp_path):
    path = tmp_path / "prior.toml"
    path.write_text(EVERY_KIND)
    assert Prior.load(path) == Prior.from_toml(EVERY_KIND)
    # As some editors mark their text, and `generate` takes it.
    path.write_text(EVERY_KIND, encoding="utf-8-sig")
    assert Prior.load(path) == Prior.from_toml(EVERY_KIND)
    path.write_text("[[parameter")
    with pytest.raises(PriorError, match=r"prior\.toml"):
        Prior.load(path)
    with pytest.raises(FileNotFoundError):
        Prior.load(tmp_path / "absent.toml")


def test_shapes_are_checked():
    with pytest.raises(ValueError, match=r"theta must have shape \(rows, 3\), got \(2, 2\)"):
        Prior.default().log_prob(np.zeros((2, 2)))
    with pytest.raises(TypeError, match="real numbers"):
        Prior.default().log_prob([["a", "b", "c"]])
