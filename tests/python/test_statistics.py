"""The statistics against numpy, scipy and dcor, and against what the registry declares of them."""

import warnings
from functools import cache
from types import SimpleNamespace
from typing import Any, cast

import dcor
import numpy as np
import pytest
from scipy import optimize, stats

import granulcal as gc
from granulcal.calibrate import calibrate
from granulcal.demo import measured_data
from granulcal.pours.statistics import DIAGNOSTIC_NAMES, NAMES, REGISTRY

_SHAPES = ("heap", "ring", "crater", "lattice", "heavy", "blob", "streak")
_PER_SHAPE = 150
_MIN_DF, _MAX_DF = 1, 100


def _disc(rng: np.random.Generator, n: int, radius: float) -> tuple[np.ndarray, np.ndarray]:
    r, angle = radius * np.sqrt(rng.random(n)), 2 * np.pi * rng.random(n)
    return r * np.cos(angle), r * np.sin(angle)


def _random_set(shape: str, seed: int) -> np.ndarray:
    """One random set of 3 to 600 points, every 50th one of 1500, shape (n, 3)."""
    rng = np.random.default_rng([_SHAPES.index(shape), seed])
    n = int(np.exp(rng.uniform(np.log(3), np.log(600))))
    n = 1500 if seed % 50 == 49 else n
    if shape == "heap":
        x, y = _disc(rng, n, 0.05)
        z = 0.02 * (1 - np.hypot(x, y) / 0.05) + 0.001 * rng.random(n)
    elif shape == "ring":
        r, angle = rng.normal(0.05, 0.008, n), 2 * np.pi * rng.random(n)
        x, y, z = r * np.cos(angle), r * np.sin(angle), 0.004 + 0.004 * rng.random(n)
    elif shape == "crater":
        x, y = _disc(rng, n, 0.06)
        z = 0.003 + 0.01 * np.exp(-(((np.hypot(x, y) - 0.04) / 0.01) ** 2))
    elif shape == "lattice":
        i, side = np.arange(n), int(np.ceil(np.sqrt(n)))
        x, y, z = 0.004 * (i % side), 0.004 * (i // side), 0.004 * (1.0 + i % 3)
    elif shape == "heavy":
        x, y = 0.01 * rng.standard_t(2, n), 0.01 * rng.standard_t(2, n)
        z = 0.002 * (1 + rng.pareto(3, n))
    elif shape == "blob":
        x, y = rng.normal(0.1, 0.02, n), rng.normal(-0.2, 0.01, n)
        z = rng.exponential(0.005, n)
    else:
        x = 0.2 * rng.random(n)
        y, z = 0.3 * x + 0.001 * rng.normal(size=n), 0.01 * rng.random(n)
    return np.stack([x, y, z], axis=1)


def _random_sets(every: int = 1) -> list[tuple[str, np.ndarray]]:
    chosen = [(shape, seed) for shape in _SHAPES for seed in range(_PER_SHAPE)][::every]
    return [(f"{shape} {seed}", _random_set(shape, seed)) for shape, seed in chosen]


@cache
def _measured_sets() -> list[tuple[str, np.ndarray]]:
    """The measured heaps and craters, down-sampled to about a thousand points."""
    folder = measured_data()
    paths = sorted(folder.glob("granular-impact-kinect/data/*.npz")) if folder else []
    sets = []
    for path in paths:
        if not path.stem.startswith("plane"):
            formation = gc.Recording.open(path).formation(border_px=6, downsample=3)
            sets.append((path.stem, formation.points))
    return sets


def _closed_forms(points: np.ndarray) -> dict[str, float]:
    x, y, z = points.T
    x, y = x - x.mean(), y - y.mean()
    r = np.hypot(x, y)
    return {
        "max_z": z.max(),
        "mean_z": z.mean(),
        "sd_z": z.std(),
        "max_r": r.max(),
        "mean_r": r.mean(),
        "sd_x": x.std(),
        "sd_y": y.std(),
        "sd_r": r.std(),
        "iqr_x": stats.iqr(x),
        "iqr_y": stats.iqr(y),
        "iqr_r": stats.iqr(r),
        "kurtosis_r": stats.kurtosis(r),
        "dcor_r_z": dcor.distance_correlation(r, z, method="naive"),
    }


def _assert_closed_forms(name: str, points: np.ndarray) -> None:
    found = gc.statistics(points)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Equal radii have no kurtosis in scipy.
        expected = _closed_forms(points)
    for statistic, value in expected.items():
        got, where = found[statistic], f"{statistic} of {name}, {len(points)} points"
        if statistic == "kurtosis_r":
            assert not np.isfinite(value) or abs(got - value) <= 1e-10 * max(abs(value), 1), where
        elif statistic == "dcor_r_z":
            # The square is what is computed: near 0 the root magnifies the rounding of both sides.
            assert abs(got**2 - value**2) <= 1e-10 * value**2 + 1e-13, where
        else:
            # Ranges of points that are equal but for rounding are rounding.
            rounding = 1e-15 * np.abs(points).max()
            assert abs(got - value) <= 1e-10 * abs(value) + rounding, where


def test_closed_forms_of_a_thousand_random_sets_equal_numpy_scipy_and_dcor():
    sets = _random_sets()
    assert len(sets) >= 1000
    for name, points in sets:
        _assert_closed_forms(name, points)


def test_closed_forms_of_measured_sets_equal_numpy_scipy_and_dcor():
    sets = _measured_sets()
    if not sets:
        pytest.skip("measured maps are absent: set GRANULCAL_DATA to their folder")
    assert len(sets) >= 40
    for name, points in sets:
        assert len(points) >= 30, name
        _assert_closed_forms(name, points)


def _search(objective, bounds, *, integrality=None):
    return optimize.differential_evolution(objective, bounds, rng=np.random.default_rng(1))


def _scipy_fits(r: np.ndarray, *, search: bool) -> list[tuple[float, ...]]:
    """scipy's chi fits that lie within the bounds: from its own start, and by global search."""
    fits = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        own = stats.chi.fit(r)
        if _MIN_DF <= own[0] <= _MAX_DF:
            fits.append(own)
        if search:
            span = np.ptp(r)
            bounds = {
                "df": (_MIN_DF, _MAX_DF),
                "loc": (r.min() - 20 * span, r.min()),
                "scale": (0.01 * span, 10 * span),
            }
            fits.append(tuple(stats.fit(stats.chi, r, bounds, optimizer=_search).params))
    return fits


def _likelihood(r: np.ndarray, fit: tuple[float, ...]) -> float:
    with np.errstate(divide="ignore"):
        df, shift, scale = fit
        if df == 1:  # 0 ln 0 at the smallest radius.
            return float(stats.halfnorm.logpdf(r, loc=shift, scale=scale).sum())
        return float(stats.chi.logpdf(r, df, loc=shift, scale=scale).sum())


def _assert_most_likely(name: str, points: np.ndarray, *, search: bool) -> int:
    """Holds our chi fit against scipy's; returns how many answers there were."""
    found = gc.statistics(points)
    r = np.hypot(*(points[:, :2] - points[:, :2].mean(axis=0)).T)
    if np.ptp(r) <= 1e-9 * r.max():
        return 0
    ours = _likelihood(r, (found["chi_df"], found["chi_shift"], found["chi_scale"]))
    fits = _scipy_fits(r, search=search)
    for fit in fits:
        theirs = _likelihood(r, fit)
        # Our radii and numpy's differ by rounding.
        assert ours >= theirs - 1e-8 * max(abs(theirs), 1), f"{name}: {ours} < {theirs}, {fit}"
    return len(fits)


def test_the_chi_fit_is_never_less_likely_than_scipys_own():
    compared = sum(
        _assert_most_likely(name, points, search=False) for name, points in _random_sets(every=11)
    )
    assert compared >= 10


@pytest.mark.slow
def test_the_chi_fit_is_never_less_likely_than_scipys_on_every_set():
    compared = 0
    for i, (name, points) in enumerate(_random_sets() + _measured_sets()):
        # The global search takes half a second: every fourth random set, every measured one.
        search = i % 4 == 0 or i >= len(_SHAPES) * _PER_SHAPE
        compared += _assert_most_likely(name, points, search=search)
    assert compared >= 250


@pytest.mark.parametrize("offset", [1.0, 1e3, 1e6])
def test_an_offset_of_everything_costs_no_digits(offset):
    rng = np.random.default_rng(5)
    grid = 2.0**-33  # Sums with the offset are exact, so that the same set is described.
    points = np.round(np.stack((*_disc(rng, 2000, 0.05), rng.random(2000)), axis=1) / grid) * grid
    here, there = gc.statistics(points), gc.statistics(points + np.array([offset, -offset, 0]))
    for name in NAMES:
        digits = 1e-6 if name.startswith("chi") else 1e-12
        assert there[name] == pytest.approx(here[name], rel=digits), name


def _ring(n: int, radius: float) -> np.ndarray:
    angle = 2 * np.pi * np.arange(n) / n
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(n, 0.004)], axis=1)


_RNG = np.random.default_rng(8)
_DEGENERATE = {
    "all equal": np.full((50, 3), 0.2),
    "three points": np.array([[0, 0, 0], [1, 0, 1], [0, 2, 3]]) * 1e-2,
    "three equal points": np.zeros((3, 3)),
    "collinear": np.outer(np.arange(20), [1e-3, 2e-3, 3e-3]),
    "vertical line": np.outer(np.arange(20), [0, 0, 1e-3]),
    "two radii": np.concatenate([_ring(12, 0.03), _ring(12, 0.05)]),
    "one radius": _ring(12, 0.03),
    "huge offset": _RNG.random((100, 3)) * 0.05 + 1e6,
    "one far away": np.concatenate([_RNG.random((999, 3)) * 0.05, [[1e6, -1e6, 1e6]]]),
    "one among equals": np.concatenate([np.zeros((999, 3)), [[0.1, 0, 0.1]]]),
    "tiny": _RNG.random((100, 3)) * 1e-300,
    "huge": _RNG.random((100, 3)) * 1e99,
    "below the ground": -_RNG.random((100, 3)),
}


@pytest.mark.parametrize("name", _DEGENERATE)
def test_degenerate_sets_have_finite_statistics(name):
    points = _DEGENERATE[name]
    found = gc.statistics(points)
    assert np.isfinite(found.paper16).all(), found
    if name in ("all equal", "three equal points"):
        zero = [n for n in NAMES if n not in ("max_z", "mean_z", "chi_df")]
        assert all(abs(found[n]) <= 1e-15 for n in zero), found
        assert found["max_z"] == pytest.approx(found["mean_z"]) and found["chi_df"] == 1
    if name == "collinear":
        assert found["sd_y"] == pytest.approx(2 * found["sd_x"])
    if name == "one radius":
        assert (found["kurtosis_r"], found["dcor_r_z"]) == (0, 0)
        assert found["chi_scale"] == pytest.approx(0, abs=1e-15)
    if np.abs(points).max() < 1e7:
        spacings = (1e-4, 1e-3, 1.0)
        for spacing in spacings:
            diagnostics = gc.diagnostic_statistics(points, grain_diameter=4e-3, spacing=spacing)
            assert np.isfinite(diagnostics.values).all(), diagnostics


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.zeros((2, 3)), "statistics needs at least 3 points, got 2"),
        (np.zeros((0, 3)), "at least 3 points, got 0"),
        (np.array([[0, 0, 0], [0, np.nan, 0], [1, 1, 1.0]]), r"points\[4\] must be finite"),
        (np.array([[0, 0, 0], [0, np.inf, 0], [1, 1, 1.0]]), r"points\[4\] must be finite"),
        (np.array([[0, 0, 0], [0, 1e101, 0], [1, 1, 1.0]]), "point .* must be in"),
    ],
)
def test_what_cannot_be_described_is_named(points, message):
    with pytest.raises(ValueError, match=message):
        gc.statistics(points)
    with pytest.raises(ValueError, match=message):
        gc.diagnostic_statistics(points, grain_diameter=4e-3, spacing=1e-3)


def _all_values(points: np.ndarray, unit: float = 1.0) -> dict[str, float]:
    diagnostics = gc.diagnostic_statistics(
        points, grain_diameter=4e-3 * unit, spacing=1.5e-3 * unit
    )
    return {**gc.statistics(points).to_dict(), **diagnostics.to_dict()}


def test_the_registry_lists_both_families_in_order():
    assert tuple(s.name for s in REGISTRY) == NAMES + DIAGNOSTIC_NAMES
    assert len(NAMES) == 16
    assert len(set(NAMES + DIAGNOSTIC_NAMES)) == len(REGISTRY)
    turning = {s.name for s in REGISTRY if s.family == "paper16" and s.rotation != "invariant"}
    assert turning == {"sd_x", "sd_y", "iqr_x", "iqr_y"}
    assert all("turns with the axes" in s.doc for s in REGISTRY if s.rotation == "axis")


def test_statistics_are_a_mapping_of_names_that_iterates_over_values():
    found = gc.statistics([[0.05, 0, 0.004], [0, 0.05, 0.004], [-0.05, 0, 0.005]])
    assert "max_z" in found and "max_y" not in found
    # Values and what is no name are not in it.
    assert found["max_z"] not in found and np.zeros(3) not in found and None not in found
    assert dict(found) == found.to_dict() and list(found.keys()) == list(NAMES)
    assert list(found) == list(found.to_dict().values())


@pytest.mark.parametrize("seed", range(12))
def test_every_statistic_behaves_as_its_registry_entry_says(seed):
    rng = np.random.default_rng(seed)
    points = _random_set("heap", 40 + seed)
    points = np.concatenate([points, points[:5] * [2.5, 2.5, 1], rng.random((20, 3)) * 0.02])
    angle, lift, scale = 2 * np.pi * 5 / 24, 0.25, 3.5
    cos, sin = np.cos(angle), np.sin(angle)
    turn = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
    before = _all_values(points)
    moved = _all_values(points + np.array([0.5, -0.25, 0]))
    shuffled = _all_values(rng.permutation(points))
    turned = _all_values(points @ turn)
    scaled = _all_values(points * scale, unit=scale)
    lifted = _all_values(points + np.array([0, 0, lift]))
    for entry in REGISTRY:
        name = entry.name
        rel = 1e-6 if name.startswith("chi") else 1e-10
        value = before[name]
        assert moved[name] == pytest.approx(value, rel=rel, abs=1e-12), name
        assert shuffled[name] == pytest.approx(value, rel=rel, abs=1e-12), name
        assert scaled[name] == pytest.approx(
            value * scale**entry.length_power, rel=rel, abs=1e-12
        ), name
        if entry.lift != "changes":
            rise = lift if entry.lift == "rises" else 0.0
            assert lifted[name] == pytest.approx(value + rise, rel=rel, abs=1e-12), name
        if entry.rotation == "invariant":
            assert turned[name] == pytest.approx(value, rel=rel, abs=1e-12), name
        elif entry.rotation.startswith("mode"):
            pair = [name.replace("_sin_", "_cos_"), name.replace("_cos_", "_sin_")]
            was, now = (complex(*(values[n] for n in pair)) for values in (before, turned))
            order = int(entry.rotation.removeprefix("mode "))
            assert now == pytest.approx(was * np.exp(1j * order * angle), rel=rel, abs=1e-12), name


def test_diagnostic_statistics_of_a_pour_and_of_its_recording_agree(small_scene, tmp_path):
    scene = small_scene.with_({"camera.downsample": 2})
    pour = gc.simulate(scene, seed=3)
    found = pour.diagnostic_statistics()
    assert found.names == list(DIAGNOSTIC_NAMES)
    assert found["count_in_view"] == len(pour.points())
    camera = gc.Camera.overhead(height=0.29, field_width=0.58, pixels=960)
    image, toml = camera.record(pour.positions, pour.radii, tmp_path, depth_unit=1e-5)
    formation = gc.Recording.open(image, camera=toml).formation(height_threshold=1e-3)
    assert formation.spacing == pytest.approx(0.58 / 960, rel=1e-3)
    measured = formation.diagnostic_statistics(grain_diameter=4e-3, pour_axis=(0, 0))
    # The fitted ground is not quite the known one: a grain may touch another through one pixel.
    assert measured["isolated_grains"] == pytest.approx(found["isolated_grains"], rel=0.1)
    assert measured["r_95"] == pytest.approx(found["r_95"], rel=0.02)
    assert abs(measured["mass_cos_1"]) == pytest.approx(abs(found["mass_cos_1"]), abs=0.05)
    with pytest.raises(ValueError, match=r"grain diameter .* got 0"):
        formation.diagnostic_statistics(grain_diameter=0.0)


def test_calibrate_reads_diagnostic_statistics_about_the_axis(small_scene, tmp_path, monkeypatch):
    # As those of the pours that the model was trained on; about the centroid there is no order 1.
    scene = small_scene.with_({"camera.downsample": 2})
    pour = gc.simulate(scene, seed=3)
    camera = gc.Camera.overhead(height=0.29, field_width=0.58, pixels=960)
    image, toml = camera.record(pour.positions, pour.radii, tmp_path, depth_unit=1e-5)
    monkeypatch.setattr("granulcal.calibrate._told", lambda _, __, statistics, **___: statistics)
    names = ["mass_cos_1", "mass_sin_1", "rim_cos_1", "rim_sin_1"]
    told = calibrate(
        cast(Any, SimpleNamespace(scene_toml=scene.to_toml())),
        cast(Any, SimpleNamespace(scene=scene)),
        [gc.Recording.open(image, camera=toml)],
        report=tmp_path / "report.html",
        diagnostics=names,
    )
    known, found = cast(Any, told)[0], pour.diagnostic_statistics()
    assert known[0, 16:] == pytest.approx([found[name] for name in names], abs=0.03)


def test_a_data_set_holds_the_diagnostic_statistics(small_data):
    assert small_data.diagnostics.shape == (80, 43)
    assert np.isfinite(small_data.diagnostics).all()
    assert small_data.diagnostic_names == DIAGNOSTIC_NAMES
    pour = gc.simulate(
        small_data.scene.with_(
            dict(zip(small_data.theta_names, small_data.theta[7].tolist(), strict=True))
        ),
        seed=int(small_data.seed[7]),
    )
    assert np.array_equal(pour.diagnostic_statistics().values, small_data.diagnostics[7])
