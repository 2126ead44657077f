"""Gazebo: SDFormat 1.9. Its file formats have no rolling friction; torsion has one, of a patch.

Torsion: a patch of radius a under pressure withstands 3 pi / 16 a mu F_n (SDFormat's `torsional`), so with
a = R the coefficient is 16 mu_t R_eff / (3 pi R).
"""

import math

from granulcal.export.mark import signed
from granulcal.export.mesh import stl, triangles
from granulcal.export.setup import Contact, Setup

__all__ = ["ENGINE", "NOTES", "UNEQUAL", "material", "scene"]

ENGINE = "gazebo"
NOTES = (
    "rolling_friction has no counterpart in SDFormat: grains roll on, heaps come out flatter and wider",
    "tangential_restitution has no counterpart",
    "restitution is of the `bounce` element, which not every physics engine of Gazebo honours",
    "torsional friction at walls is half of ours: of two surfaces the smaller coefficient counts",
    "mu and bounce of two surfaces: the smaller, so a wall rougher than the grains is as smooth as they are",
    "a surface of which nothing is said lets nothing bounce: what lies below the grains is to have that of the ground",
    "round walls are STL meshes of 64 sides",
)
UNEQUAL = "the patch of torsional friction is that of the smallest"
"""What of a material is not each grain's own where they differ in size."""


def _surface(of: Contact, lever: float, radius: float) -> str:
    twist = 16.0 * of.torsional_length(lever) / (3.0 * math.pi * radius)
    mu = f"{of.sliding_friction:.9g}"
    return (
        f"<surface><bounce><restitution_coefficient>{of.restitution:.9g}</restitution_coefficient>"
        "<threshold>0.05</threshold></bounce><friction>"
        f"<torsional><coefficient>{twist:.9g}</coefficient><use_patch_radius>true</use_patch_radius>"
        f"<patch_radius>{radius:.9g}</patch_radius></torsional>"
        f"<ode><mu>{mu}</mu><mu2>{mu}</mu2></ode></friction></surface>"
    )


def material(setup: Setup, young: float | None = None) -> str:
    """Returns the `surface` element of a grain, and beside it, for one root, that of the ground."""
    del young
    ground = _surface(setup.ground, setup.smallest, setup.smallest)
    return f"{_of_grain(setup)}\n<!-- of the ground:\n{ground}\n-->\n"


def _of_grain(setup: Setup) -> str:
    return _surface(setup.grains, setup.effective_radius, setup.smallest)


def scene(setup: Setup, young: float | None = None) -> dict[str, str]:
    """Returns the files of a pour: `gz sim pour.sdf`."""
    del young
    radius = setup.smallest
    surface = _of_grain(setup)
    files, models = {}, []
    for body in setup.walls:
        files[f"{body.name}.stl"] = stl(triangles(body.shape), body.name)
        mesh = f"<geometry><mesh><uri>{body.name}.stl</uri></mesh></geometry>"
        models.append(
            f'<model name="{body.name}"><static>true</static><link name="link">'
            f'<collision name="c">{mesh}{_surface(body.law, radius, radius)}</collision>'
            f'<visual name="v">{mesh}</visual></link></model>'
        )
    for i, (centre, r) in enumerate(zip(setup.centres, setup.radii, strict=True)):
        mass = setup.density * 4.0 / 3.0 * math.pi * r**3
        inertia = 0.4 * mass * r * r
        ball = f"<geometry><sphere><radius>{r:.9g}</radius></sphere></geometry>"
        pose = " ".join(f"{c:.9g}" for c in centre)
        moments = "".join(f"<{k}>{inertia:.6g}</{k}>" for k in ("ixx", "iyy", "izz"))
        models.append(
            f'<model name="grain{i}"><pose>{pose} 0 0 0</pose><link name="link"><inertial>'
            f"<mass>{mass:.6g}</mass><inertia>{moments}</inertia></inertial>"
            f'<collision name="c">{ball}{surface}</collision><visual name="v">{ball}</visual></link></model>'
        )
    # As large as it is drawn; what collides has no end (SDFormat 1.9, plane).
    side = f"{2 * setup.half_width:.9g}"
    plane = f"<geometry><plane><normal>0 0 1</normal><size>{side} {side}</size></plane></geometry>"
    gravity = " ".join(f"{g:.9g}" for g in setup.gravity)
    ground = (
        '<model name="ground"><static>true</static><link name="link"><collision name="c">'
        f"{plane}{_surface(setup.ground, radius, radius)}</collision>"
        f'<visual name="v">{plane}</visual></link></model>'
    )
    body = "\n".join([ground, *models])
    files["pour.sdf"] = (
        f'<?xml version="1.0"?>\n<!-- {signed(setup.name, ENGINE)} -->\n'
        '<sdf version="1.9"><world name="pour">\n'
        f"<gravity>{gravity}</gravity>\n"
        '<physics name="fine" type="ode"><max_step_size>0.0005</max_step_size>'
        "<real_time_factor>0</real_time_factor></physics>\n"
        '<light type="directional" name="sun"><direction>-0.3 0.2 -0.9</direction></light>\n'
        f"{body}\n</world></sdf>\n"
    )
    return files
