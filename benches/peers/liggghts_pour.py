"""Pours rows of rows.py in LIGGGHTS and appends the piles to liggghts.csv; what is there is kept.

    python benches/peers/liggghts_pour.py --rows P B --seeds 4
    python benches/peers/liggghts_pour.py --rows P B --seeds 4 --rolling epsd2

LIGGGHTS' contact is Hertz and Mindlin with a dashpot each: the normal one realises e whatever the
speed, the tangential one cannot be chosen. Rolling is `epsd`: a spring of stiffness
2.25 k_n mu_r^2 R_eff^2 up to mu_r R_eff F_n, damped by 0.7 of the critical, or `epsd2`, whose
spring has the tangential stiffness and no dashpot; no torsion. The funnel is a mesh of 64 sides,
for LIGGGHTS has no cone.
"""

import argparse
import resource
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from lammps_contact import DENSITY, POISSON, RADIUS, Elastic, Law
from pile import HALF_WIDTH, measure
from pile_file import append, done, is_at_rest, start
from rows import rows

RESULTS = Path(__file__).parent / "liggghts.csv"
ROLLING = ("epsd", "epsd2")
"""LIGGGHTS' rolling friction with and without a dashpot beside the moment limit."""

LOOK = 0.02
"""Time between two checks of rest and overlap [s]."""
HORIZON = 3.0
"""When a pour ends at the latest [s]."""
HEAD = 9
"""Lines before the grains of a look; the fourth has their number."""
MESH = Path(__file__).parents[2] / "examples/funnel.stl"
"""The funnel [mm], binary: 80 bytes of text, the number of triangles, the triangles."""
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def funnel() -> str:
    """Returns the funnel as text of an STL file [m], which is what LIGGGHTS reads."""
    corners = 1e-3 * np.fromfile(MESH, TRIANGLE, offset=84)["corners"].astype(float)
    lines = ["solid funnel"]
    for a, b, c in corners:
        normal = np.cross(b - a, c - a)
        lines += ["facet normal {} {} {}".format(*normal / np.linalg.norm(normal)), "outer loop"]
        lines += ["vertex {:.9g} {:.9g} {:.9g}".format(*corner) for corner in (a, b, c)]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid funnel", ""])


def script(law: Law, elastic: Elastic, seed: int, rolling_model: str) -> str:
    """Returns the input: type 1 are grains, type 2 is every wall."""
    pairs = "peratomtypepair 2"
    e = max(law.restitution, 0.05)
    rolling = " ".join(f"{mu:g}" for mu in (law.rolling_friction, *[law.wall_rolling_friction] * 3))
    grains = "\n".join(
        "create_atoms 1 single {:.9g} {:.9g} {:.9g} units box".format(*x) for x in start(seed)
    )
    look = round(LOOK / elastic.dt)
    law_words = f"model hertz tangential history rolling_friction {rolling_model}"
    return f"""
atom_style granular
atom_modify map array
boundary f f f
newton off
communicate single vel yes
units si
region box block {-HALF_WIDTH} {HALF_WIDTH} {-HALF_WIDTH} {HALF_WIDTH} -0.01 0.45 units box
create_box 2 box
neighbor 0.001 bin
neigh_modify delay 0
fix m1 all property/global youngsModulus peratomtype {elastic.young} {elastic.young}
fix m2 all property/global poissonsRatio peratomtype {POISSON} {POISSON}
fix m3 all property/global coefficientRestitution {pairs} {e} {e} {e} {e}
fix m4 all property/global coefficientFriction {pairs} {" ".join([f"{law.sliding_friction}"] * 4)}
fix m5 all property/global coefficientRollingFriction {pairs} {rolling}
fix m6 all property/global coefficientRollingViscousDamping {pairs} 0.7 0.7 0.7 0.7
pair_style gran {law_words}
pair_coeff * *
timestep {elastic.dt}
fix gravity all gravity 9.81 vector 0.0 0.0 -1.0
fix funnel all mesh/surface file funnel.stl type 2
fix walls all wall/gran {law_words} mesh n_meshes 1 meshes funnel
fix ground all wall/gran {law_words} primitive type 2 zplane 0.0
{grains}
set group all density {DENSITY} diameter {2 * RADIUS}
fix motion all nve/sphere
thermo_modify lost ignore norm no
dump looks all custom {look} looks.txt id x y z vx vy vz
run {round(HORIZON / elastic.dt)}
"""


def frames(path: Path, engine: subprocess.Popen[bytes]) -> Iterator[np.ndarray]:
    """Yields positions and velocities of every look as it is written, (n, 6) [m, m/s]."""
    lines: list[str] = []
    written, rest = 0, ""
    while True:
        ended = engine.poll() is not None
        if path.exists():
            with path.open() as file:
                file.seek(written)
                text = file.read()
                written = file.tell()
            *whole, rest = (rest + text).split("\n")
            lines += whole
        while len(lines) >= HEAD and len(lines) >= HEAD + int(lines[3]):
            count = HEAD + int(lines[3])
            yield np.array([line.split()[1:] for line in lines[HEAD:count]], dtype=float)
            lines = lines[count:]
        if ended:
            return
        time.sleep(0.5)


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
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "funnel.stl").write_text(funnel())
        (place / "in.pour").write_text(script(law, elastic, seed, rolling_model))
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        engine = subprocess.Popen(
            ["liggghts", "-in", "in.pour"], cwd=place, stdout=subprocess.DEVNULL
        )
        looks = []
        for look in frames(place / "looks.txt", engine):
            looks.append(look)
            if is_at_rest((len(looks) - 1) * LOOK, look[:, 3:]):
                engine.kill()
                break
        if engine.wait() not in (0, -signal.SIGKILL):
            raise RuntimeError(f"LIGGGHTS ended with {engine.returncode}")
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    end = looks[-1][:, :3]
    return {
        "rest_s": (len(looks) - 1) * LOOK,
        "cpu_s": after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime,
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
    parser.add_argument("--rolling", choices=ROLLING, default="epsd")
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
