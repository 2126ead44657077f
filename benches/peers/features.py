"""The statistics beside numpy, scipy and dcor, the depth image beside Open3D, in one run.

    make bench-features

which gives it an environment of its own, as Open3D brings packages that disturb pytest.

Times are processor times of this process, medians over turns in which the two sides alternate, so
that a busy machine slows both. Open3D's ray caster is asked for one thread.
"""

import argparse
import platform
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import dcor
import numpy as np
import open3d
import scipy
from scipy import stats

import granulcal as gc

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts"))
from bench_table import machine, seconds, table

GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))
GRAINS, RADIUS = 2000, 0.002
HEIGHT, FIELD, PIXELS = 0.29, 0.58, 1920


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=10_000)
    parser.add_argument("--turns", type=int, default=7, help="times that each side is measured")
    parser.add_argument("--resolution", type=int, default=10, help="of Open3D's spheres")
    options = parser.parse_args()
    versions = {
        "Python": platform.python_version(),
        **{m.__name__: m.__version__ for m in (gc, np, scipy, dcor, open3d)},
    }
    print(machine())
    print(", ".join(f"{name} {version}" for name, version in versions.items()), end="\n\n")
    rows = [("", "granulcal", "peer", "peer / granulcal", "agreement")]
    rows += statistics_rows(cone(options.points), options.turns)
    rows += image_rows(options.resolution, options.turns)
    print(table(rows))


def spiral(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns x, y and the share of the disc's area within each point of a sunflower spiral."""
    i = np.arange(count)
    share = i / count
    return (
        0.06 * np.sqrt(share) * np.cos(GOLDEN_ANGLE * i),
        0.06 * np.sqrt(share) * np.sin(GOLDEN_ANGLE * i),
        share,
    )


def cone(count: int) -> np.ndarray:
    """Returns the rough cone of benches/statistics.rs."""
    x, y, share = spiral(count)
    roughness = 0.002 * np.sin(12.9898 * np.arange(count))
    return np.stack([x, y, 0.02 * (1 - share) + roughness], axis=1)


def heap() -> np.ndarray:
    """Returns the centres of benches/raster.rs."""
    x, y, share = spiral(GRAINS)
    return np.stack([x, y, RADIUS + 0.02 * (1 - share)], axis=1)


def compare(
    ours: Callable[[], object], theirs: Callable[[], object], turns: int
) -> tuple[str, str, str]:
    """Returns both processor times and their ratio as they stand in the table."""
    ours(), theirs()  # numba compiles, memory is fetched.
    ours_s, theirs_s = (
        np.median(times)
        for times in zip(*((cpu(ours), cpu(theirs)) for _ in range(turns)), strict=True)
    )
    return seconds(ours_s), seconds(theirs_s), f"{theirs_s / ours_s:.1f}"


def cpu(call: Callable[[], object]) -> float:
    """Returns the processor time of a call, which is repeated for at least 20 ms."""
    start, calls = time.process_time(), 0
    while (spent := time.process_time() - start) < 0.02:
        call()
        calls += 1
    return spent / calls


def statistics_rows(points: np.ndarray, turns: int) -> list[tuple[str, ...]]:
    """Returns the rows of the statistics."""
    x, y, z = points.T
    r = np.hypot(x - x.mean(), y - y.mean())
    found, expected = gc.statistics(points), closed_forms(points)
    worst = max(abs(found[name] / value - 1) for name, value in expected.items())
    likelihood = [
        stats.chi.logpdf(r, *fit).sum()
        for fit in (
            [found["chi_df"], found["chi_shift"], found["chi_scale"]],
            bounded_chi(r),
        )
    ]
    all_16 = compare(
        lambda: gc.statistics(points),
        lambda: (closed_forms(points), stats.chi.fit(r)),
        turns,
    )
    without = compare(lambda: gc.statistics(points), lambda: closed_forms(points), turns)
    n = len(points)
    return [
        (f"16 statistics of {n} points, scipy's chi.fit", *all_16, ""),
        ("the same, peer without a chi fit", *without, f"{worst:.0e} relative, of 13"),
        (
            "the same, peer with the bounded chi fit only",
            *compare(lambda: gc.statistics(points), lambda: bounded_chi(r), 1),
            f"{likelihood[0] - likelihood[1]:+.1e} in ln likelihood",
        ),
        (
            "the same, peer with dcor only",
            *compare(lambda: gc.statistics(points), lambda: dcor.distance_correlation(r, z), turns),
            "",
        ),
    ]


def closed_forms(points: np.ndarray) -> dict[str, float]:
    """Returns 13 of the 16 statistics by numpy, scipy and dcor."""
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
        "dcor_r_z": dcor.distance_correlation(r, z),
    }


def bounded_chi(r: np.ndarray) -> tuple[float, ...]:
    """Returns scipy's most likely chi distribution within our bounds: its global search."""
    span = np.ptp(r)
    bounds = {
        "df": (1, 100),
        "loc": (r.min() - 20 * span, r.min()),
        "scale": (0.01 * span, 10 * span),
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return tuple(stats.fit(stats.chi, r, bounds).params)


def image_rows(resolution: int, turns: int) -> list[tuple[str, ...]]:
    """Returns the rows of the depth image."""
    centres, radii = heap(), np.full(GRAINS, RADIUS)
    camera = gc.Camera.overhead(height=HEIGHT, field_width=FIELD, pixels=PIXELS)
    scene, triangles = sphere_scene(centres, resolution)
    rays = pinhole_rays()

    def cast() -> np.ndarray:
        return scene.cast_rays(rays, nthreads=1)["t_hit"].numpy()

    difference = np.abs(camera.render(centres, radii) - cast())
    most = difference.max()
    agreement = f"{np.median(difference):.0e} m median, {most:.0e} m most"
    return [
        (
            f"{PIXELS} x {PIXELS} px, {GRAINS} grains; {triangles} triangles each there",
            *compare(lambda: camera.render(centres, radii), cast, turns),
            agreement,
        ),
        (
            "the same, peer builds its scene first",
            *compare(
                lambda: camera.render(centres, radii),
                lambda: sphere_scene(centres, resolution)[0].cast_rays(rays, nthreads=1),
                turns,
            ),
            "",
        ),
    ]


def sphere_scene(
    centres: np.ndarray, resolution: int
) -> tuple[open3d.t.geometry.RaycastingScene, int]:
    """Returns spheres as triangles on a square of ground, and the triangles of one sphere."""
    mesh = open3d.geometry.TriangleMesh.create_sphere(RADIUS, resolution)
    corners, faces = np.asarray(mesh.vertices), np.asarray(mesh.triangles)
    vertices = (centres[:, None, :] + corners).reshape(-1, 3).astype(np.float32)
    first = len(corners) * np.arange(len(centres))
    triangles = (first[:, None, None] + faces).reshape(-1, 3).astype(np.uint32)
    scene = open3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(open3d.core.Tensor(vertices), open3d.core.Tensor(triangles))
    ground = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=np.float32)
    scene.add_triangles(
        open3d.core.Tensor(ground),
        open3d.core.Tensor(np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32)),
    )
    return scene, len(faces)


def pinhole_rays() -> open3d.core.Tensor:
    """Returns the rays of the overhead camera, of unit depth, so that a hit's t is its depth."""
    focal = PIXELS * HEIGHT / FIELD
    slope = (np.arange(PIXELS) + 0.5 - PIXELS / 2) / focal
    rays = np.empty((PIXELS, PIXELS, 6), dtype=np.float32)
    rays[..., :3] = (0, 0, HEIGHT)
    rays[..., 3], rays[..., 4], rays[..., 5] = slope[None, :], -slope[:, None], -1
    return open3d.core.Tensor(rays)


if __name__ == "__main__":
    main()
