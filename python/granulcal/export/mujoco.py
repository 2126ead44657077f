"""MuJoCo: MJCF with free spheres, elliptic cones of six dimensions, a stiff contact.

Rolling and torsion: friction coefficients 4 to 6 of a contact of condim 6 are lengths [m], mu R_eff. Of two
geoms the larger counts, so the grains carry mu_r R / 2 and the ground and walls mu_r R. Restitution: a
direct `solref` (-stiffness, -damping) at impedance one is a unilateral spring and dashpot per unit of
effective mass, whose dashpot cannot pull: docs/export.md. Of two geoms the larger damping counts. A wall
whose own would be lost so, smoother than the grains or with more rebound, has the higher `priority`.
"""

import math

from granulcal.export import law
from granulcal.export.mark import signed
from granulcal.export.mesh import triangles
from granulcal.export.setup import Contact, Setup

__all__ = ["ENGINE", "NOTES", "UNEQUAL", "material", "mjcf", "scene"]

ENGINE = "mujoco"
NOTES = (
    "tangential_restitution has no counterpart: friction in MuJoCo never gives back",
    "a pair takes the larger friction and the smaller restitution of its two geoms, or those of the higher priority, "
    "which ground and walls have in a scene that are smoother than the grains or bounce more",
    "a geom of which nothing is said has MuJoCo's own friction of 1, which counts then: what lies below the grains is to "
    'have class="grain_ground"',
    "friction is regularised: a heap creeps by impratio, which is 10 here",
    "round walls are rings of 24 boxes: MuJoCo's meshes are convex",
    "walls are 4 mm thick: outside a box or a round wall, grains touch it 4 mm farther out",
)
UNEQUAL = (
    "the class `grain`, the ground and the walls have rolling and torsional lengths of the smallest; in a "
    "scene and a bed every grain has those of its own radius, and of two the larger count"
)
"""What of a material is not each grain's own where they differ in size."""
_DT = 1e-4
# Pyramidal cones, MuJoCo's own, let grains slide aslant with two thirds of the friction.
_CONE = 'cone="elliptic" impratio="10"'
# Time of an impact over the time step: fewer steps would not resolve the dashpot.
_STEPS = 20
_SIDES = 24
_THICKNESS = 2e-3


def solref(restitution: float) -> tuple[float, float]:
    """Returns stiffness [1/s^2] and damping [1/s] of an impact that lasts 20 time steps."""
    beta = law.damping_ratio(restitution, tension=False, overdamped=True)
    # Half a period of the undamped spring; an overdamped one lets go later.
    omega = math.pi / (_STEPS * _DT)
    return omega**2, 2.0 * beta * omega


def _friction(of: Contact, lever: float) -> str:
    slide = of.sliding_friction
    return f"{slide:.6g} {of.torsional_length(lever):.6g} {of.rolling_length(lever):.6g}"


def _words(of: Contact, setup: Setup) -> str:
    """Returns what the ground's and a wall's geom says of its contacts with grains."""
    k, b = solref(of.restitution)
    inner, outer = setup.effective_radius, setup.smallest
    grains = setup.grains
    is_lost = (
        of.sliding_friction < grains.sliding_friction
        or of.restitution > grains.restitution
        or of.rolling_length(outer) < grains.rolling_length(inner)
        or of.torsional_length(outer) < grains.torsional_length(inner)
    )
    first = 'priority="1" ' if is_lost else ""
    return f'{first}condim="6" friction="{_friction(of, outer)}" solref="{-k:.6g} {-b:.6g}" solimp="0.99 0.99 0.001"'


def material(setup: Setup, young: float | None = None) -> str:
    """Returns options and defaults of the grains' and the ground's geoms as MJCF to include.

    `solref` is of that time step, and friction of these cones.
    """
    del young
    ground = f'<default class="grain_ground"><geom {_words(setup.ground, setup)}/></default>'
    return (
        f'<mujocoinclude>\n  <option timestep="{_DT:g}" {_CONE}/>\n'
        f"  <default>\n    {_grain(setup)}\n    {ground}\n  </default>\n</mujocoinclude>\n"
    )


def _grain(setup: Setup) -> str:
    k, b = solref(setup.grains.restitution)
    return (
        f'<default class="grain"><geom type="sphere" condim="6" density="{setup.density:g}" '
        f'friction="{_friction(setup.grains, setup.effective_radius)}" '
        f'solref="{-k:.6g} {-b:.6g}" solimp="0.99 0.99 0.001"/></default>'
    )


def mjcf(setup: Setup) -> str:
    """Returns the whole pour as MJCF."""
    walls = []
    for body in setup.walls:
        words = f'{_words(body.law, setup)} rgba=".6 .6 .7 .3"'
        walls += [f"    {geom.format(words=words)}" for geom in _boxes(body.shape, body.path)]
    grains = []
    for i, (centre, size) in enumerate(zip(setup.centres, setup.radii, strict=True)):
        x, y, z = centre
        own = f' friction="{_friction(setup.grains, 0.5 * size)}"' if setup.has_sizes else ""
        grains.append(
            f'    <body name="grain{i}" pos="{x:.9g} {y:.9g} {z:.9g}"><freejoint/>'
            f'<geom class="grain" size="{size:.9g}"{own}/></body>'
        )
    gravity = " ".join(f"{g:.9g}" for g in setup.gravity)
    return "\n".join(
        [
            f"<!-- {signed(setup.name, ENGINE)} -->",
            f'<mujoco model="{setup.name}">',
            f'  <option timestep="{_DT:g}" gravity="{gravity}" {_CONE} '
            'integrator="implicitfast" solver="Newton" iterations="20" jacobian="sparse"/>',
            '  <size memory="512M"/>',
            f"  <default>{_grain(setup)}</default>",
            "  <worldbody>",
            '    <light pos="0 0 1"/>',
            f'    <geom name="ground" type="plane" size="1 1 .01" {_words(setup.ground, setup)}/>',
            *walls,
            *grains,
            "  </worldbody>",
            "</mujoco>",
            "",
        ]
    )


def _boxes(shape: dict, path: str) -> list[str]:
    """Returns a wall as flat boxes, one for each pair of its triangles; errors name `path`."""
    import numpy as np

    mesh = triangles(shape, sides=_SIDES)
    found = []
    if shape["kind"] in ("cone", "cylinder"):
        half = len(mesh.vertices) // 2 if shape.get("closed", "none") == "none" else _SIDES
        low, high = mesh.vertices[:_SIDES], mesh.vertices[half : half + _SIDES]
        quads = [
            (low[i], low[(i + 1) % _SIDES], high[(i + 1) % _SIDES], high[i]) for i in range(_SIDES)
        ]
        if shape.get("closed", "none") != "none":
            raise ValueError(
                f"{path}: a round wall whose `closed` is {shape['closed']!r} has no MJCF here, only "
                "'none': leave its end to a box or a plane"
            )
    elif shape["kind"] in ("box", "plane"):
        quads = [
            tuple(mesh.vertices[[a[0], a[1], a[2], b[2]]])
            for a, b in zip(mesh.faces[::2], mesh.faces[1::2], strict=True)
        ]
    else:
        raise ValueError(
            f"{path}: a wall of kind {shape['kind']!r} has no MJCF here, only plane, box, cylinder "
            "and cone"
        )
    for a, b, c, d in quads:
        centre = (a + b + c + d) / 4
        along = (b + c - a - d) / 2
        up = (c + d - a - b) / 2
        width = max(np.linalg.norm(b - a), np.linalg.norm(c - d))
        x = along / np.linalg.norm(along)
        normal = np.cross(x, up)
        normal /= np.linalg.norm(normal)
        # The box lies behind the wall, so that its inner face is the wall.
        normal = normal if normal @ _outward(shape, centre) > 0 else -normal
        y = np.cross(normal, x)
        at = centre + normal * _THICKNESS
        rotation = np.column_stack([x, y, normal])
        q = _quaternion(rotation)
        size = f"{0.5 * width:.6g} {0.5 * np.linalg.norm(up):.6g} {_THICKNESS:g}"
        where = " ".join(f"{v:.6g}" for v in at)
        turn = " ".join(f"{v:.9g}" for v in q)
        found.append(f'<geom type="box" pos="{where}" quat="{turn}" size="{size}" {{words}}/>')
    return found


def _outward(shape: dict, at):
    """Returns a direction from a wall's grains to behind it: from an axis, a middle, a plane's side."""
    import numpy as np

    if shape["kind"] == "plane":
        return -np.asarray(shape["normal"], float)
    if shape["kind"] == "box":
        return at - np.mean([shape["min"], shape["max"]], axis=0)
    low, high = np.asarray(shape["from"], float), np.asarray(shape["to"], float)
    axis = (high - low) / np.linalg.norm(high - low)
    return (at - low) - ((at - low) @ axis) * axis


def _quaternion(rotation) -> tuple[float, float, float, float]:
    """Returns w, x, y, z of a rotation matrix."""
    import numpy as np

    # The eigenvector of Bar-Itzhack's matrix of largest eigenvalue.
    r = rotation
    k = np.array(
        [
            [r[0, 0] - r[1, 1] - r[2, 2], 0, 0, 0],
            [r[1, 0] + r[0, 1], r[1, 1] - r[0, 0] - r[2, 2], 0, 0],
            [r[2, 0] + r[0, 2], r[2, 1] + r[1, 2], r[2, 2] - r[0, 0] - r[1, 1], 0],
            [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], np.trace(r)],
        ]
    )
    x, y, z, w = np.linalg.eigh(k / 3)[1][:, -1]
    return float(w), float(x), float(y), float(z)


_RUN = '''\
"""{title}; it pours pour.xml and leaves grains.csv: python pour.py"""

import mujoco
import numpy as np

EARLIEST, HORIZON, LOOK = {earliest:.4g}, {horizon:g}, 0.02
model = mujoco.MjModel.from_xml_path("pour.xml")
data = mujoco.MjData(model)
steps = round(LOOK / model.opt.timestep)
count = model.nbody - 1
while data.time < HORIZON:
    mujoco.mj_step(model, data, steps)
    speed = np.linalg.norm(data.qvel.reshape(count, 6)[:, :3], axis=1)
    # MuJoCo's friction creeps: what is slower than 1 cm/s rests.
    if data.time > EARLIEST and (speed < 0.01).mean() > 0.995:
        break
centres = data.qpos.reshape(count, 7)[:, :3]
radii = model.geom_size[model.geom_bodyid > 0, 0]
table = np.column_stack([centres, radii])
np.savetxt("grains.csv", table, delimiter=",", header="x,y,z,radius", comments="", fmt="%.9g")
'''


def scene(setup: Setup, young: float | None = None) -> dict[str, str]:
    """Returns the files of a pour: `python pour.py` leaves grains.csv."""
    del young
    run = _RUN.format(
        title=signed(setup.name, ENGINE), earliest=setup.earliest, horizon=setup.horizon
    )
    return {"pour.xml": mjcf(setup), "pour.py": run}
