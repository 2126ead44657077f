"""Project Chrono, non-smooth contacts (ChContactMaterialNSC): rigid, as ours.

Rolling and spinning friction are lengths [m], mu R_eff; restitution is Newton's e; of two materials the
smaller coefficient counts, so a grain's mu_r R / 2 decides at walls too.
"""

from granulcal.export.mark import signed
from granulcal.export.places import places
from granulcal.export.setup import Contact, Setup

__all__ = ["ENGINE", "NOTES", "UNEQUAL", "material", "notes", "scene"]

ENGINE = "chrono"
NOTES = (
    "rolling and torsional friction at walls are half of ours: of two materials Chrono takes the smaller",
    "friction and restitution of two materials: the smaller, so a wall rougher than the grains is as smooth",
    "a material of which nothing is said has no rolling friction, and the smaller counts: what lies below the grains is "
    "to have the material `ground`",
    "tangential_restitution has no counterpart",
    "round walls are meshes of 64 sides",
)
UNEQUAL = "rolling and torsional lengths are those of the smallest"
"""What of a material is not each grain's own where they differ in size."""
# By itself Chrono lets nothing bounce that is slower than 0.15 m/s [m/s].
_SLOWEST_BOUNCE = 0.01
# Skins of what collides, over the radius; by themselves 3 cm outside and 1 cm inside.
_ENVELOPE, _MARGIN = 0.1, 0.05


def _lines(name: str, of: Contact, lever: float) -> str:
    return f"""\
{name} = chrono.ChContactMaterialNSC()
{name}.SetFriction({of.sliding_friction:.9g})
{name}.SetRollingFriction({of.rolling_length(lever):.9g})
{name}.SetSpinningFriction({of.torsional_length(lever):.9g})
{name}.SetRestitution({of.restitution:.9g})
"""


def notes(setup: Setup) -> list[str]:
    """Returns what a system must be told besides the material, before the first body is made."""
    return [
        "a system by itself lets nothing slower than 0.15 m/s bounce and puts skins of 3 and 1 cm on what "
        f"collides: write system.SetMinBounceSpeed({_SLOWEST_BOUNCE:g}) and, before the first body,",
        *(f"  {line}" for line in _skins(setup)),
    ]


def _skins(setup: Setup) -> list[str]:
    """Returns the lines that make the skins of collision as thin as the grains need."""
    model, radius = "chrono.ChCollisionModel", setup.smallest
    return [
        f"{model}.SetDefaultSuggestedEnvelope({_ENVELOPE * radius:.6g})",
        f"{model}.SetDefaultSuggestedMargin({_MARGIN * radius:.6g})",
    ]


def material(setup: Setup, young: float | None = None) -> str:
    """Returns the lines of a material: the grains', and the ground's."""
    del young
    grain = _lines("grain", setup.grains, setup.effective_radius)
    return grain + _lines("ground", setup.ground, setup.smallest)


def scene(setup: Setup, young: float | None = None) -> dict[str, str]:
    """Returns the files of a pour: `python pour.py` leaves grains.csv."""
    laws = "".join(
        _lines(f"wall_{i}", body.law, setup.smallest) for i, body in enumerate(setup.walls)
    )
    names = ", ".join(f"wall_{i}" for i in range(len(setup.walls)))
    script = f"""\
\"\"\"{signed(setup.name, ENGINE)}; it leaves grains.csv: python pour.py\"\"\"

import json

import pychrono as chrono

table = json.load(open("pour.json"))
{material(setup)}{laws}
system = chrono.ChSystemNSC()
system.SetCollisionSystemType(chrono.ChCollisionSystem.Type_BULLET)
system.SetGravitationalAcceleration(chrono.ChVector3d{setup.gravity})
system.SetSolverType(chrono.ChSolver.Type_APGD)
system.SetMinBounceSpeed({_SLOWEST_BOUNCE:g})
# Before the first body: what is made before has other skins.
{chr(10).join(_skins(setup))}
floor = chrono.ChBodyEasyBox({2 * setup.half_width:.9g}, {2 * setup.half_width:.9g}, 0.1, 1000, False, True, ground)
floor.SetPos(chrono.ChVector3d(0, 0, -0.05))
floor.SetFixed(True)
system.Add(floor)
for mesh, law in zip(table["walls"], [{names}]):
    body = chrono.ChBody()
    body.SetFixed(True)
    surface = chrono.ChTriangleMeshConnected()
    corners = [chrono.ChVector3d(*c) for c in mesh["vertices"]]
    for a, b, c in mesh["faces"]:
        surface.AddTriangle(corners[a], corners[b], corners[c])
    shape = chrono.ChCollisionShapeTriangleMesh(law, surface, True, False, {0.02 * setup.smallest:.6g})
    body.AddCollisionShape(shape)
    body.EnableCollision(True)
    system.Add(body)
grains = []
for centre, radius in zip(table["centres"], table["radii"]):
    body = chrono.ChBodyEasySphere(radius, {setup.density:g}, False, True, grain)
    body.SetPos(chrono.ChVector3d(*centre))
    system.Add(body)
    grains.append(body)
dt = 5e-4
while system.GetChTime() < {setup.horizon:g}:
    for _ in range(40):
        system.DoStepDynamics(dt)
    slow = sum(body.GetPosDt().Length() < 0.01 for body in grains)
    if system.GetChTime() > {setup.earliest:.4g} and slow > 0.995 * len(grains):
        break
with open("grains.csv", "w") as out:
    out.write("x,y,z,radius\\n")
    for body, radius in zip(grains, table["radii"]):
        at = body.GetPos()
        out.write("%.9g,%.9g,%.9g,%.9g\\n" % (at.x, at.y, at.z, radius))
"""
    return {"pour.py": script, "pour.json": places(setup, ENGINE)}
