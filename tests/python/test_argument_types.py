"""What is given in place of what is asked for is refused by the argument's name."""

from collections.abc import Callable

import numpy as np
import pytest

import granulcal as gc
from granulcal.bayessim.check.toys import LinearGaussian
from granulcal.bayessim.posterior.posterior import Posterior
from granulcal.design.ring import Ring
from granulcal.errors import PriorError
from granulcal.pours.statistics import ObservedStatistics, Statistics

DEPTH = np.full((4, 4), 0.5, np.float32)
LENS = {"fx": 10.0, "fy": 10.0, "cx": 2.0, "cy": 2.0}


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: gc.Scene.drop("a"), "height must be a number, got 'a'"),  # pyright: ignore
        (lambda: gc.Scene.funnel(None), "height must be a number, got None"),  # pyright: ignore
        (
            lambda: gc.Scene.drop(0.1).with_({"material.sliding_friction": None}),  # pyright: ignore
            "material.sliding_friction must be a number, got None",
        ),
        (lambda: gc.Scene.drop(0.1).with_(3), "changes must be values by path, a dict, got 3"),  # pyright: ignore
        (lambda: Ring("a"), "outer must be a number, got 'a'"),  # pyright: ignore
        (lambda: Ring(0.1, [0.05]), r"inner must be a number, got \[0.05\]"),  # pyright: ignore
        (lambda: gc.Prior.paper(grain_diameter="a"), "grain_diameter must be a number, got 'a'"),  # pyright: ignore
        (lambda: gc.Prior(["a"]), "parameters must be Parameter objects, got 'a' among them"),  # pyright: ignore
        (lambda: gc.Prior.from_toml(3), "text must be the TOML of a prior, a str, got 3"),  # pyright: ignore
        (
            lambda: gc.generate(gc.Scene.drop(0.02), gc.Prior.default(), n=1, ray=3),  # pyright: ignore
            "ray must be the address of a cluster, a str, or None, got 3",
        ),
        (lambda: Posterior(gc.Prior.default(), 3), "density must be the extension's.*got 3"),  # pyright: ignore
        (lambda: Posterior(3, 3), "prior must be a Prior, got 3"),  # pyright: ignore
    ],
)
def test_another_type_is_named(call: Callable[[], object], told: str) -> None:
    with pytest.raises(TypeError, match=told):
        call()


def test_a_level_is_a_number() -> None:
    toy = LinearGaussian.random(bounded=True)
    posterior = toy.posterior(toy.simulate(1)[1][0])
    with pytest.raises(TypeError, match="level must be a number, got '0.9'"):
        posterior.credible_region("0.9")  # pyright: ignore[reportArgumentType]


def test_a_recordings_numbers_are_the_callers() -> None:
    """The column had been refused half a pixel aside, the border by an OverflowError."""
    with pytest.raises(ValueError, match=r"cx \[px\] must be in \[-4\.5, 7\.5\], got 30$"):
        gc.Recording.from_depth(DEPTH, **{**LENS, "cx": 30.0})
    recording = gc.Recording.from_depth(DEPTH, **LENS)
    for name in ("border_px", "plane_seed"):
        with pytest.raises(ValueError, match=rf"{name}: must be a whole number from 0 .*got -1"):
            recording.formation(**{name: -1})  # pyright: ignore[reportArgumentType]


def test_a_range_that_is_wider_than_any_number_is_refused() -> None:
    """Every draw of it had been its upper end."""
    with pytest.raises(PriorError, match="high less low must be finite"):
        gc.Parameter(path="a", distribution="uniform", low=-1e308, high=1e308)


def test_statistics_are_equal_by_value() -> None:
    pour = gc.simulate(gc.Scene.drop(0.02, count=20), seed=1)
    found = pour.statistics()
    assert found == pour.statistics() and hash(found) == hash(pour.statistics())
    assert pour.diagnostic_statistics() == pour.diagnostic_statistics() != found
    assert found != Statistics(found.paper16 + 1e-9) and found != 3
    unseen = ObservedStatistics(np.array([0.0, np.nan]), ("a", "b"))
    same = ObservedStatistics(np.array([-0.0, np.nan]), ("a", "b"))
    assert unseen == same and hash(unseen) == hash(same)
    assert unseen != ObservedStatistics(np.array([0.0, np.nan]), ("a", "c"))
    # With an array it goes entry by entry, as ever.
    assert np.all(found == found.paper16)
