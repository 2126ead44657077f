"""Newton (Warp): bodies of the XPBD solver.

Rolling and torsional friction of a shape are lengths [m], mu R_eff; of two shapes the mean counts, so
the ground carries 2 mu_r R - mu_r R / 2 = 1.5 mu_r R for a pair limit of mu_r R. Restitution is Newton's
e, of two shapes the mean, where `enable_restitution` is on.
"""

from granulcal.export.mark import signed
from granulcal.export.places import places
from granulcal.export.setup import Contact, Setup

__all__ = ["ENGINE", "NOTES", "UNEQUAL", "material", "notes", "scene"]

ENGINE = "newton"
NOTES = (
    "XPBD solves by a few sweeps: friction and restitution are approached, not met",
    "the solver by itself lets nothing bounce: SolverXPBD(model, enable_restitution=True)",
    "of two shapes the mean counts: what lies below the grains is to have the config `ground`, for that of which nothing "
    "is said has a friction of 1",
    "tangential_restitution has no counterpart",
    "round walls are meshes of 64 sides",
)
UNEQUAL = "rolling and torsional lengths are those of the smallest"
"""What of a material is not each grain's own where they differ in size."""
_DT = 5e-4


def _config(
    name: str, of: Contact, lever: float, density: float, grains: "Contact | None", own: float
) -> str:
    """Returns the lines of a shape; `grains` and `own` are what the other of the two carries."""

    def partner(value: float, other: float) -> float:
        # The mean of the two is what the contact must have.
        return value if grains is None else max(2.0 * value - other, 0.0)

    mu = partner(of.sliding_friction, grains.sliding_friction if grains else 0.0)
    e = partner(of.restitution, grains.restitution if grains else 0.0)
    roll = partner(of.rolling_length(lever), grains.rolling_length(own) if grains else 0.0)
    twist = partner(of.torsional_length(lever), grains.torsional_length(own) if grains else 0.0)
    return (
        f"{name} = newton.ModelBuilder.ShapeConfig(density={density:g}, mu={mu:.9g}, restitution={e:.9g},\n"
        f"    mu_rolling={roll:.9g}, mu_torsional={twist:.9g})\n"
    )


def notes(setup: Setup) -> list[str]:
    """Returns what of this pour Newton cannot be told: a contact below half of the grains' own."""
    inside = _lengths(setup.grains, setup.effective_radius)
    found = []
    for name, of in [("ground", setup.ground), *((b.name, b.law) for b in setup.walls)]:
        asked = _lengths(of, setup.smallest)
        low = [word for word, value in asked.items() if 2.0 * value < inside[word]]
        if low:
            found.append(
                f"{name}: {', '.join(low)} is half of the grains' own, and not less: Newton takes the "
                "mean of two shapes, and none is below 0"
            )
    return found


def _lengths(of: Contact, lever: float) -> dict[str, float]:
    """Returns the numbers of a contact that Newton takes the mean of."""
    return {
        "sliding_friction": of.sliding_friction,
        "restitution": of.restitution,
        "rolling_friction": of.rolling_length(lever),
        "torsional_friction": of.torsional_length(lever),
    }


def material(setup: Setup, young: float | None = None) -> str:
    """Returns the lines of a material: the grains', and the ground's that makes the mean right."""
    del young
    own = setup.effective_radius
    grain = _config("grain", setup.grains, own, setup.density, None, 0.0)
    return grain + _config("ground", setup.ground, setup.smallest, 0.0, setup.grains, own)


def scene(setup: Setup, young: float | None = None) -> dict[str, str]:
    """Returns the files of a pour: `python pour.py` leaves grains.csv."""
    own, wide = setup.effective_radius, setup.smallest
    laws = "".join(
        _config(f"wall_{i}", body.law, wide, 0.0, setup.grains, own)
        for i, body in enumerate(setup.walls)
    )
    names = ", ".join(f"wall_{i}" for i in range(len(setup.walls)))
    script = f"""\
\"\"\"{signed(setup.name, ENGINE)}; it leaves grains.csv: python pour.py\"\"\"
{"".join(f"# {note}" + chr(10) for note in notes(setup))}
import json

import newton
import numpy as np
import warp as wp

table = json.load(open("pour.json"))
{material(setup)}{laws}
builder = newton.ModelBuilder(gravity={setup.gravity})
builder.rigid_gap = {0.5 * setup.smallest:.6g}
builder.add_ground_plane(cfg=ground)
for mesh, law in zip(table["walls"], [{names}]):
    shape = newton.Mesh(np.array(mesh["vertices"], np.float32), np.array(mesh["faces"], np.int32).ravel())
    builder.add_shape_mesh(-1, mesh=shape, cfg=law)
for centre, radius in zip(table["centres"], table["radii"]):
    body = builder.add_body(xform=wp.transform(wp.vec3(*centre), wp.quat_identity()))
    builder.add_shape_sphere(body, radius=radius, cfg=grain)
model = builder.finalize()
solver = newton.solvers.SolverXPBD(model, iterations=8, enable_restitution=True)
one, two, control = model.state(), model.state(), model.control()
contacts, time, dt = model.contacts(), 0.0, {_DT:g}
while time < {setup.horizon:g}:
    for _ in range(40):
        one.clear_forces()
        model.collide(one, contacts)
        solver.step(one, two, control, contacts, dt)
        one, two = two, one
        time += dt
    speed = np.linalg.norm(one.body_qd.numpy()[:, :3], axis=1)
    if time > {setup.earliest:.4g} and (speed < 0.01).mean() > 0.995:
        break
out = np.column_stack([one.body_q.numpy()[:, :3], table["radii"]])
np.savetxt("grains.csv", out, delimiter=",", header="x,y,z,radius", comments="", fmt="%.9g")
"""
    return {"pour.py": script, "pour.json": places(setup, ENGINE)}
