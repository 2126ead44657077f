"""One pour in LIGGGHTS: its input, and the grains as it writes them.

LIGGGHTS' contact is Hertz and Mindlin with a dashpot each: the normal one realises e whatever the
speed, the tangential one cannot be chosen, and both may pull. Rolling is `epsd`: a spring of
stiffness 2.25 k_n mu_r^2 R_eff^2 up to mu_r R_eff F_n, damped by 0.7 of the critical beside that
limit, or `epsd2`, whose spring has the tangential stiffness and no dashpot; no torsion. A funnel is
a mesh, for LIGGGHTS has no cone.
"""

import resource
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from lammps_contact import POISSON, Law

from granulcal.export.mesh import Mesh, stl

ROLLING = ("epsd", "epsd2")
"""LIGGGHTS' rolling friction with and without a dashpot beside the moment limit."""
DASHPOT = 0.7
"""Of `epsd`, over the critical [-]."""
LOOK = 0.02
"""Time between two checks of rest and overlap [s]."""
LEAST_RESTITUTION = 0.05
"""LIGGGHTS refuses less."""
OPENING = """
atom_style granular
atom_modify map array
boundary f f f
newton off
communicate single vel yes
units si"""
"""The words that every input begins with."""
HEAD = 9
"""Lines before the grains of a look; the fourth has their number."""


@dataclass(frozen=True, kw_only=True)
class Input:
    """All that decides a pour; SI units.

    Attributes:
        centres: of equal spheres at the start, shape (n, 3).
        radius, density: of a sphere.
        law: the contact, the same at ground and funnel but for rolling.
        young, dt: Young's modulus and time step.
        triangles: of the funnel, shape (t, 3, 3).
        half_width, top: of the box; what leaves it is lost.
        horizon: when a pour ends at the latest.
        rolling: one of `ROLLING`.
    """

    centres: np.ndarray
    radius: float
    density: float
    law: Law
    young: float
    dt: float
    triangles: np.ndarray
    half_width: float
    top: float
    horizon: float
    rolling: str

    def stl(self) -> str:
        """Returns the funnel as text of an STL file."""
        corners = self.triangles.reshape(-1, 3)
        return stl(Mesh(corners, np.arange(len(corners)).reshape(-1, 3)), "funnel")

    def script(self) -> str:
        """Returns LIGGGHTS' words: type 1 are grains, type 2 is every wall."""
        law, wide, pairs = self.law, self.half_width, "peratomtypepair 2"
        e = max(law.restitution, LEAST_RESTITUTION)
        rolling = f"{law.rolling_friction:g}" + 3 * f" {law.wall_rolling_friction:g}"
        grains = "\n".join(
            "create_atoms 1 single {:.9g} {:.9g} {:.9g} units box".format(*x) for x in self.centres
        )
        words = f"model hertz tangential history rolling_friction {self.rolling}"
        return f"""{OPENING}
region box block {-wide} {wide} {-wide} {wide} -0.01 {self.top} units box
create_box 2 box
neighbor 0.001 bin
neigh_modify delay 0
fix m1 all property/global youngsModulus peratomtype {self.young} {self.young}
fix m2 all property/global poissonsRatio peratomtype {POISSON} {POISSON}
fix m3 all property/global coefficientRestitution {pairs} {e} {e} {e} {e}
fix m4 all property/global coefficientFriction {pairs} {" ".join([f"{law.sliding_friction}"] * 4)}
fix m5 all property/global coefficientRollingFriction {pairs} {rolling}
fix m6 all property/global coefficientRollingViscousDamping {pairs} {" ".join([f"{DASHPOT}"] * 4)}
pair_style gran {words}
pair_coeff * *
timestep {self.dt}
fix gravity all gravity 9.81 vector 0.0 0.0 -1.0
fix funnel all mesh/surface file funnel.stl type 2
fix walls all wall/gran {words} mesh n_meshes 1 meshes funnel
fix ground all wall/gran {words} primitive type 2 zplane 0.0
{grains}
set group all density {self.density} diameter {2 * self.radius}
fix motion all nve/sphere
thermo_modify lost ignore norm no
dump looks all custom {round(LOOK / self.dt)} looks.txt id x y z vx vy vz
run {round(self.horizon / self.dt)}
"""


def pour(
    what: Input, is_at_rest: Callable[[float, np.ndarray], bool]
) -> tuple[list[np.ndarray], float]:
    """Returns every look up to the first at rest and the processor time [s].

    A look has centres and velocities, (n, 6) [m, m/s].

    Args:
        what: the pour.
        is_at_rest: told the time [s] and a look.
    """
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "funnel.stl").write_text(what.stl())
        (place / "in.pour").write_text(what.script())
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        engine = subprocess.Popen(
            ["liggghts", "-in", "in.pour"], cwd=place, stdout=subprocess.DEVNULL
        )
        looks = []
        for look in _looks(place / "looks.txt", engine):
            looks.append(look)
            if is_at_rest((len(looks) - 1) * LOOK, look):
                engine.kill()
                break
        if engine.wait() not in (0, -signal.SIGKILL):
            raise RuntimeError(f"LIGGGHTS ended with {engine.returncode}")
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return looks, cpu


def _looks(path: Path, engine: subprocess.Popen[bytes]) -> Iterator[np.ndarray]:
    """Yields every look as soon as it is written whole."""
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
        time.sleep(0.2)
