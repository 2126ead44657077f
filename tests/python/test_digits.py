"""Numbers side by side are told apart."""

import numpy as np
import pytest

import granulcal as gc
from granulcal.bayessim.network.mixture import Mixture
from granulcal.bayessim.posterior.posterior import Posterior
from granulcal.commands.parameters import parameters_of, print_parameters
from granulcal.digits import told_apart


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ([0.31234, 0.1, 0.9], ["0.312", "0.1", "0.9"]),
        ([2500.75, 2499.543, 2501.795], ["2500.8", "2499.5", "2501.8"]),
        ([-0.12, -0.11952, -0.12049], ["-0.12", "-0.11952", "-0.12049"]),
        ([7.0, 7.0], ["7", "7"]),
        ([0.0, 0.0], ["0", "0"]),
        ([1.0, float("inf")], ["1", "inf"]),
        ([1e6, 1e6 + 2e-10], ["1000000", "1000000.0000000002"]),
    ],
)
def test_a_narrow_range_has_the_digits_that_it_needs(values: list[float], told: list[str]) -> None:
    assert told_apart(values, least=3) == told


def test_the_posterior_of_a_narrow_prior_says_its_interval(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A height that is known to half a millimetre was 0.12 (0.119 to 0.12)."""
    name = "funnel.height"
    known = gc.Parameter(path=name, distribution="normal", mean=0.12, sd=5e-6)
    prior = gc.Prior([known])
    same = Mixture.from_covariances(np.ones(1), np.zeros((1, 1)), np.ones((1, 1, 1)))
    posterior = Posterior.from_mixture(prior, same)
    low, high = (f"{bound:.6f}" for bound in posterior.credible_region(0.9)[name])
    assert f"({low} to {high}); mode" in repr(posterior)
    print_parameters(parameters_of(posterior))
    assert f"   {low} to {high}\n" in capsys.readouterr().out
