"""LIGGGHTS 3.8: `pair_style gran model hertz tangential history` with rolling friction.

Rolling: `epsd2` limits the moment to mu R_eff F_n, so mu is our mu_r; `epsd` has a dashpot beside it, which
is our rolling_dashpot over how much longer its contacts last, and stops lone grains sooner. Damping: the normal dashpot may pull a parting contact
and then gives the e that it is told, whatever the speed.
"""

from granulcal.export import law
from granulcal.export.mark import signed
from granulcal.export.mesh import stl, triangles
from granulcal.export.setup import Contact, Setup, Stiffness

__all__ = ["ENGINE", "LEAST_YOUNG", "NOTES", "UNEQUAL", "material", "scene", "stiffness"]

ENGINE = "liggghts"
NOTES = (
    "torsional_friction has no counterpart: epsd2 acts on the rotation across the normal alone",
    "tangential_restitution has no counterpart: its tangential dashpot follows the normal one",
    "restitution below 0.05 is written as 0.05, the least that LIGGGHTS takes",
    "round walls are meshes of 64 sides: LIGGGHTS has no cones",
)
UNEQUAL = "the time step is that of the smallest"
"""What of a material is not each grain's own where they differ in size."""
_WORDS = "model hertz tangential history rolling_friction"
_LEAST_RESTITUTION = 0.05
LEAST_YOUNG = 5e6
"""LIGGGHTS refuses softer grains unless told `soft_particles yes` [Pa]."""
# How much farther than they touch grains are neighbours, over the largest radius; most bins of them.
_SKIN, _BINS = 0.25, 2e7
_LOOK, _SLOW, _RESTING = 0.02, 0.01, 0.995


def material(setup: Setup, young: float | None = None) -> str:
    """Returns the lines of a material: type 1 are grains, type 2 the ground, from 3 on the walls."""
    elastic = stiffness(setup, young)
    laws = [setup.grains, setup.ground, *(body.law for body in setup.walls)]
    n = len(laws)

    def pairs(name: str) -> str:
        # What grains do with wall i stands in row 1 and column i; walls never meet.
        return " ".join(f"{_value(laws[max(i, j)], name):.9g}" for i in range(n) for j in range(n))

    kinds = " ".join([f"{elastic.young:.6g}"] * n)
    ratios = " ".join([f"{law.POISSON}"] * n)
    rolling = _rolling(setup)
    dashpot = ""
    if rolling == "epsd":
        name = "coefficientRollingViscousDamping"
        dashpot = f"fix           m6 all property/global {name} peratomtypepair {n} {pairs('rolling_dashpot')}\n"
    table = f"peratomtypepair {n}"
    return f"""\
fix           m1 all property/global youngsModulus peratomtype {kinds}
fix           m2 all property/global poissonsRatio peratomtype {ratios}
fix           m3 all property/global coefficientRestitution {table} {pairs("restitution")}
fix           m4 all property/global coefficientFriction {table} {pairs("sliding_friction")}
fix           m5 all property/global coefficientRollingFriction {table} {pairs("rolling_friction")}
{dashpot}pair_style    gran {_WORDS} {rolling}
pair_coeff    * *
timestep      {elastic.dt:.6g}
"""


def _rolling(setup: Setup) -> str:
    laws = (setup.grains, setup.ground, *(body.law for body in setup.walls))
    return "epsd" if any(each.rolling_dashpot > 0 for each in laws) else "epsd2"


def stiffness(setup: Setup, young: float | None = None) -> Stiffness:
    """Returns stiffness and time step, of `LEAST_YOUNG` where less is asked for."""
    usual = setup.stiffness(young)
    return usual if usual.young >= LEAST_YOUNG else setup.stiffness(LEAST_YOUNG)


def _value(of: Contact, name: str) -> float:
    value = float(getattr(of, name))
    if name == "rolling_dashpot":
        return value / law.pulling_duration(_value(of, "restitution"))
    return max(value, _LEAST_RESTITUTION) if name == "restitution" else value


def scene(setup: Setup, young: float | None = None) -> dict[str, str]:
    """Returns the files of a pour: `liggghts -in in.pour` leaves grains.dump."""
    elastic = stiffness(setup, young)
    w, largest = setup.half_width, float(setup.radii.max())
    look = max(1, round(_LOOK / elastic.dt))
    files = {f"{body.name}.stl": stl(triangles(body.shape), body.name) for body in setup.walls}
    meshes = "\n".join(
        f"fix           {body.name} all mesh/surface file {body.name}.stl type {k}"
        for k, body in enumerate(setup.walls, start=3)
    )
    names = " ".join(body.name for body in setup.walls)
    walls = (
        f"fix           walls all wall/gran {_WORDS} {_rolling(setup)} mesh n_meshes {len(setup.walls)} meshes {names}"
        if setup.walls
        else ""
    )
    grains = "\n".join(
        "create_atoms  1 single {:.9g} {:.9g} {:.9g} units box".format(*centre)
        for centre in setup.centres
    )
    sizes = "\n".join(_sizes(setup))
    files["in.pour"] = f"""\
# {signed(setup.name, ENGINE)}
atom_style    granular
atom_modify   map array
boundary      f f f
newton        off
communicate   single vel yes
units         si
region        space block {-w:g} {w:g} {-w:g} {w:g} {-setup.smallest:g} {setup.top:g} units box
create_box    {2 + len(setup.walls)} space
neighbor      {_SKIN * largest:.6g} bin
neigh_modify  delay 0{_bins(setup)}
{material(setup, young)}
{setup.gravity_line}
{meshes}
{walls}
fix           ground all wall/gran {_WORDS} {_rolling(setup)} primitive type 2 zplane 0.0
{grains}
{sizes}
fix           motion all nve/sphere
# Runs until {100 * _RESTING:g} % of the grains are slower than {100 * _SLOW:g} cm/s.
variable      slow atom "vx*vx + vy*vy + vz*vz < {_SLOW**2:g}"
compute       resting all reduce ave v_slow
thermo        {look}
thermo_style  custom step atoms ke c_resting
thermo_modify lost ignore norm no
run           1
label         again
run           {look}
variable      now equal "step * {elastic.dt:.9g}"
variable      share equal c_resting
if            "(${{now}} > {setup.earliest:.4g}) && (${{share}} > {_RESTING})" then "jump SELF done"
if            "${{now}} > {setup.horizon:g}" then "jump SELF done"
jump          SELF again
label         done
dump          end all custom 1 grains.dump id x y z radius
run           1
"""
    return files


def _bins(setup: Setup) -> str:
    """Returns the word for wider bins of neighbours, where a wide space would have too many."""
    usual = (1.0 + 0.5 * _SKIN) * float(setup.radii.max())
    widest = (4.0 * setup.half_width**2 * setup.top / _BINS) ** (1.0 / 3.0)
    return f" binsize {widest:.6g}" if widest > usual else ""


def _sizes(setup: Setup) -> list[str]:
    if not setup.has_sizes:
        return [
            f"set           group all density {setup.density:g} diameter {2 * setup.smallest:.9g}"
        ]
    return [
        f"set           atom {i} density {setup.density:g} diameter {2 * radius:.9g}"
        for i, radius in enumerate(setup.radii, start=1)
    ]
