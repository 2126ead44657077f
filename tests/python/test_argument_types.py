"""What is given in place of what is asked for is refused by the argument's name."""

import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import granulcal as gc
from granulcal.bayessim.arrays import as_real
from granulcal.bayessim.check.toys import LinearGaussian
from granulcal.bayessim.posterior.posterior import Posterior
from granulcal.design.ring import Ring
from granulcal.errors import PriorError
from granulcal.pours.statistics import ObservedStatistics, Statistics

DEPTH = np.full((4, 4), 0.5, np.float32)
LENS = {"fx": 10.0, "fy": 10.0, "cx": 2.0, "cy": 2.0}
CAMERA = gc.Camera.overhead(height=0.3, field_width=0.2, pixels=4)


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
        (lambda: gc.Prior(3), "parameters must be a list of Parameter objects, got 3"),  # pyright: ignore
        (lambda: gc.Prior.default().sample("a"), "n must be a whole number, got 'a'"),  # pyright: ignore
        # A number is a file that is open already: standard input would be waited for.
        (lambda: gc.Prior.load(0), "expected str, bytes or os.PathLike object, not int"),  # pyright: ignore
        (
            lambda: gc.Camera.overhead(height="a", field_width=0.2, pixels=4),  # pyright: ignore
            "height must be a number, got 'a'",
        ),
        (lambda: CAMERA.tilted(x_deg="a"), "x_deg must be a number, got 'a'"),  # pyright: ignore
        (lambda: pickle.dumps(CAMERA), "a Camera stays in its process: make it again there"),
        (
            lambda: pickle.dumps(gc.Recording.from_depth(DEPTH, **LENS)),
            "a Recording stays in its process: hand over its path",
        ),
        (
            lambda: gc.Recording.from_depth(DEPTH, **{**LENS, "fx": "a"}),  # pyright: ignore
            "fx must be a number, got 'a'",
        ),
        (
            lambda: gc.Recording.from_depth(DEPTH > 0, **LENS),
            "depth must be an array of real numbers, got dtype bool",
        ),
        (
            lambda: gc.Recording.from_depth(DEPTH, **LENS).doubts("funnel", gc.Prior.default()),  # pyright: ignore
            "scene must be a Scene, as Scene.load reads it, got 'funnel'",
        ),
        (
            lambda: gc.Recording.from_depth(DEPTH, **LENS).doubts(gc.Scene.drop(0.1), "default"),  # pyright: ignore
            "prior must be a Prior, as Prior.load reads it, got 'default'",
        ),
        (
            lambda: gc.diagnostic_statistics(np.eye(3), grain_diameter="a", spacing=1e-3),  # pyright: ignore
            "grain_diameter must be a number, got 'a'",
        ),
        (
            lambda: gc.diagnostic_statistics(
                np.eye(3),
                grain_diameter=4e-3,
                spacing=1e-3,
                pour_axis=3,  # pyright: ignore
            ),
            r"pour_axis must be two numbers \(x, y\) \[m\], got 3",
        ),
        (
            lambda: gc.Material(
                sliding_friction=np.array([0.5]),  # pyright: ignore
                rolling_friction=0.1,
                restitution=0.5,  # pyright: ignore
            ),
            r"sliding_friction must be a number, got array",
        ),
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
    with pytest.raises(ValueError, match=r"fx must be in pixels, .* is it in millimetres"):
        gc.Recording.from_depth(DEPTH, **{**LENS, "fx": 1e-3, "fy": 1e-3})
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


def test_numbers_that_no_camera_has_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="y_deg must be finite, got nan"):
        CAMERA.tilted(y_deg=float("nan"))
    with pytest.raises(ValueError, match="the file must be a plain file, found a folder"):
        gc.Camera.load(tmp_path, height=0.4)
    colours = np.zeros((20, 30, 3), np.float32)
    with pytest.raises(ValueError, match=r"depth must have shape .*, got \(20, 30, 3\)"):
        gc.Recording.from_depth(colours, **LENS)


def test_a_pour_axis_is_whatever_holds_two_numbers() -> None:
    points = np.random.default_rng(0).random((30, 3))
    found = [
        gc.diagnostic_statistics(points, grain_diameter=0.1, spacing=0.02, pour_axis=axis)  # pyright: ignore
        for axis in ((0.5, 0.5), [0.5, 0.5], np.array([0.5, 0.5]))
    ]
    assert np.array_equal(found[0], found[1]) and np.array_equal(found[0], found[2])


def test_what_is_no_statistics_is_named_with_what_would_do(tmp_path: Path) -> None:
    toy = LinearGaussian.random(bounded=True)
    pour = gc.simulate(gc.Scene.drop(0.02, count=5), seed=1)
    for given, told in (
        (pour, r"got Pour: give its statistics\(\)"),
        (tmp_path / "a.png", "got the path or word '.*a.png': open it first"),
        (None, "got NoneType"),
        ({}, "got dict"),
    ):
        with pytest.raises(TypeError, match=f"x_obs must be an array of real numbers, {told}"):
            as_real("x_obs", given)
    posterior = toy.posterior(toy.simulate(1)[1][0])
    with pytest.raises(TypeError, match="extra must be a Posterior, got 3"):
        posterior.pair_plot(extra=3)  # pyright: ignore[reportArgumentType]
    with pytest.raises(ValueError, match="must be a file to write, found a folder"):
        posterior.pair_plot(tmp_path)
    assert not tmp_path.with_suffix(".png").exists()
