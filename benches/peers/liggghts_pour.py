"""Pours rows of rows.py in LIGGGHTS and appends the piles to liggghts.csv; what is there is kept.

    python benches/peers/liggghts_pour.py --rows P B --seeds 4
    python benches/peers/liggghts_pour.py --rows P B --seeds 4 --rolling epsd2

`liggghts.py` says what LIGGGHTS' contact is. The funnel is a mesh of 64 sides.
"""

import argparse
from pathlib import Path

import liggghts
import numpy as np
from lammps_contact import DENSITY, RADIUS, Elastic, Law
from pile import HALF_WIDTH, measure
from pile_file import append, done, is_at_rest, start
from rows import rows

RESULTS = Path(__file__).parent / "liggghts.csv"
HORIZON = 3.0
"""When a pour ends at the latest [s]."""
MESH = Path(__file__).parents[2] / "examples/funnel.stl"
"""The funnel [mm], binary: 80 bytes of text, the number of triangles, the triangles."""
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def funnel() -> np.ndarray:
    """Returns the triangles of the funnel [m], shape (t, 3, 3)."""
    return 1e-3 * np.fromfile(MESH, TRIANGLE, offset=84)["corners"].astype(float)


def worst_overlap(looks: list[np.ndarray]) -> float:
    """Returns the deepest overlap of two grains at a look, over the diameter [-]."""
    from scipy.spatial import cKDTree

    nearest = 2 * RADIUS
    for look in looks:
        pairs = cKDTree(look[:, :3]).query_pairs(2 * RADIUS, output_type="ndarray")
        apart = np.linalg.norm(look[pairs[:, 0], :3] - look[pairs[:, 1], :3], axis=1)
        nearest = min(nearest, apart.min(initial=nearest))
    return 1.0 - nearest / (2 * RADIUS)


def pour(law: Law, elastic: Elastic, seed: int, rolling_model: str) -> dict[str, float]:
    """Returns what a pour ends with: lengths in mm over centres (max z: the top), times in s."""
    what = liggghts.Input(
        centres=start(seed),
        radius=RADIUS,
        density=DENSITY,
        law=law,
        young=elastic.young,
        dt=elastic.dt,
        triangles=funnel(),
        half_width=HALF_WIDTH,
        top=0.45,
        horizon=HORIZON,
        rolling=rolling_model,
    )
    looks, cpu = liggghts.pour(what, lambda time, look: is_at_rest(time, look[:, 3:]))
    end = looks[-1][:, :3]
    return {
        "rest_s": (len(looks) - 1) * liggghts.LOOK,
        "cpu_s": cpu,
        **measure(end),
        "worst_overlap": worst_overlap(looks),
        "lost": 2000 - len(end),
    }


def main() -> None:
    """Pours what was asked for and is not there yet."""
    laws = rows()
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", nargs="+", choices=laws, default=["P", "B"])
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--young", type=float, default=1e7, help="Young's modulus [Pa]")
    parser.add_argument("--rolling", choices=liggghts.ROLLING, default="epsd")
    options = parser.parse_args()
    elastic = Elastic(young=options.young)
    for seed in range(1, options.seeds + 1):
        for name in options.rows:
            key = (name, options.rolling, f"{options.young:g}", str(seed))
            if key in done(RESULTS):
                continue
            result = pour(laws[name], elastic, seed, options.rolling)
            append(RESULTS, key, result)


if __name__ == "__main__":
    main()
