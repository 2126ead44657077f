"""Short names tell parameters apart."""

import numpy as np
import pytest

import granulcal as gc
from granulcal.bayessim import Calibration
from granulcal.bayessim.network.mixture import Mixture
from granulcal.bayessim.posterior.posterior import Posterior
from granulcal.bayessim.training.sequential import Round
from granulcal.short_names import short_names

PATHS = ("material.sliding_friction", "ground.material.sliding_friction")


@pytest.mark.parametrize(
    ("paths", "short"),
    [
        (["material.friction", "start.height"], ["friction", "height"]),
        (
            ["material.friction", "effects.ground.friction", "start.height"],
            ["material.friction", "ground.friction", "height"],
        ),
        # One is the end of the other.
        (["friction", "a.friction"], ["friction", "a.friction"]),
        (["a.b.c", "x.b.c"], ["a.b.c", "x.b.c"]),
        (["a.b", "a.b"], ["b", "b"]),
        ([], []),
    ],
)
def test_names_are_as_short_as_they_can_be(paths: list[str], short: list[str]) -> None:
    assert short_names(paths) == short


def test_what_a_fit_says_tells_parameters_apart_that_end_alike(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The friction of grains and of the ground had one name in the check and in each round."""
    prior = gc.Prior(
        gc.Parameter(path=path, distribution="uniform", low=0.0, high=1.0) for path in PATHS
    )
    normal = Mixture.from_covariances(np.ones(1), np.full((1, 2), 0.5), 0.01 * np.eye(2)[None])
    posterior = Posterior.from_mixture(prior, normal)
    truth = posterior.sample(20, seed=1)
    check = str(Calibration.of(prior, [posterior] * 20, truth, draw_count=200))
    spread = str(Round(1, 4, 40, 40, 100, np.array([0.5, 0.7]), PATHS))
    drawn: list[str] = []
    monkeypatch.setattr("matplotlib.axes.Axes.set_xlabel", lambda _, name: drawn.append(name))
    posterior._repr_html_()
    assert drawn == list(PATHS)
    assert "ranks material.sliding_friction " in check
    assert ", ground.material.sliding_friction " in check
    assert "material.sliding_friction 0.50, ground.material.sliding_friction 0.70" in spread
