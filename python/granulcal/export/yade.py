"""YADE: FrictMat and Hertz-Mindlin with moments (`Law2_ScGeom_MindlinPhys_Mindlin`, includeMoment).

Rolling: the moment is limited to eta F_n times the mean of the two reference radii, R for two equal
grains, so eta = mu_r / 2. A facet counts as a sphere of twice the radius: the mean is 1.5 R, and the
limit at walls is 0.75 mu_r R where ours is mu_r R. Restitution: `en` follows Thornton et al. 2013, for a
contact that ends when its force is zero, as ours does.
"""

import json

from granulcal.export.mark import signed
from granulcal.export.mesh import triangles
from granulcal.export.setup import Setup

__all__ = ["ENGINE", "NOTES", "UNEQUAL", "material", "scene"]

ENGINE = "yade"
NOTES = (
    "rolling friction at walls is 0.75 of ours: YADE takes one eta, and a facet for a sphere of twice the radius",
    "torsional_friction has no counterpart: the twisting spring has no limit, so it is left out (ktwist = 0)",
    "walls have the grains' restitution: en is of the functor, not of a pair of materials",
    "friction is that of the smoother of two materials: a wall rougher than the grains is as smooth as they are",
    "tangential_restitution has no counterpart: es follows en",
    "round walls are meshes of 64 sides",
)
UNEQUAL = (
    "rolling friction of two has half of the mean of their radii as lever, which is more than R_eff; "
    "the rolling spring and the time step are those of the smallest"
)
"""What of a material is not each grain's own where they differ in size."""
_RATE = 0.25


def material(setup: Setup, young: float | None = None) -> str:
    """Returns the lines of a material."""
    stiffness = setup.stiffness(young)
    # The stiff rolling spring of the LAMMPS export: angular rate 0.25 / dt at the inertia A_r = 5/4.
    lever = 0.5 * stiffness.radius
    krot = stiffness.mass / 1.25 * (_RATE / stiffness.dt) ** 2 * lever**2
    grains = setup.grains
    return f"""\
grain = O.materials.append(FrictMat(young={stiffness.young:.6g}, poisson=0.25, density={setup.density:g},
                                    frictionAngle={grains.friction_angle:.9g}, label="grain"))
contact = Ip2_FrictMat_FrictMat_MindlinPhys(en={max(grains.restitution, 0.01):.9g}, krot={krot:.6g}, ktwist=0.0,
                                            eta={0.5 * grains.rolling_friction:.9g})
law = Law2_ScGeom_MindlinPhys_Mindlin(includeMoment=True)
O.dt = {0.5 * stiffness.dt:.6g}
"""


def scene(setup: Setup, young: float | None = None) -> dict[str, str]:
    """Returns the files of a pour: `yade -n -x pour.py` leaves grains.csv."""
    walls = []
    for body in setup.walls:
        mesh = triangles(body.shape)
        faces = [
            [list(map(float, corner)) for corner in mesh.vertices[face]] for face in mesh.faces
        ]
        walls.append({"angle": body.law.friction_angle, "facets": faces})
    grains = [
        [*map(float, centre), float(radius)]
        for centre, radius in zip(setup.centres, setup.radii, strict=True)
    ]
    table = {
        "file": signed(setup.name, ENGINE),
        "grains": grains,
        "walls": walls,
        "ground": setup.ground.friction_angle,
    }
    w, stiffness = setup.half_width, setup.stiffness(young)
    script = f"""\
\"\"\"{signed(setup.name, ENGINE)}; it leaves grains.csv: yade -n -x pour.py\"\"\"

import json
import os

from yade import *

table = json.load(open("pour.json"))
{material(setup, young)}

def wall(angle):
    return O.materials.append(FrictMat(young={stiffness.young:.6g}, poisson=0.25,
                                       density={setup.density:g}, frictionAngle=angle))


# The ground as two facets, and not a Wall, whose rolling friction would be half of ours.
w = {w}
ground = wall(table["ground"])
for corners in ([(-w, -w, 0), (w, -w, 0), (w, w, 0)], [(-w, -w, 0), (w, w, 0), (-w, w, 0)]):
    O.bodies.append(facet(corners, material=ground))
for each in table["walls"]:
    made = wall(each["angle"])
    for corners in each["facets"]:
        O.bodies.append(facet([Vector3(c) for c in corners], material=made))
grains = [O.bodies.append(sphere(Vector3(x, y, z), r, material=grain)) for x, y, z, r in table["grains"]]
O.engines = [
    ForceResetter(),
    InsertionSortCollider([Bo1_Sphere_Aabb(), Bo1_Facet_Aabb()], verletDist={0.2 * setup.smallest:.6g}),
    InteractionLoop([Ig2_Sphere_Sphere_ScGeom(), Ig2_Facet_Sphere_ScGeom()], [contact], [law]),
    NewtonIntegrator(damping=0.0, gravity={setup.gravity}),
]
while O.time < {setup.horizon:g}:
    O.run(max(1, round(0.02 / O.dt)), wait=True)
    slow = sum(O.bodies[i].state.vel.norm() < 0.01 for i in grains)
    if O.time > {setup.earliest:.4g} and slow > 0.995 * len(grains):
        break
with open("grains.csv", "w") as out:
    out.write("x,y,z,radius\\n")
    for i in grains:
        out.write(",".join("%.9g" % v for v in (*O.bodies[i].state.pos, O.bodies[i].shape.radius)) + "\\n")
# YADE's own end waits for its viewers.
os._exit(0)
"""
    return {"pour.py": script, "pour.json": json.dumps(table)}
