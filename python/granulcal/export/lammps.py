"""LAMMPS: `pair_style granular`, `fix wall/gran`, a data file of the grains.

Rolling: `rolling sds k gamma mu` limits a pseudo-force to mu F_n whose moment has the lever R_eff, so
mu is our mu_r. `twisting sds` limits a moment to mu F_n: mu is the length mu_t R_eff. Damping:
`limit_damping` lets go when the force would pull; `coeff_restitution` takes the e that its dashpot
would give if it did not, so the number in the file is not our e.
"""

import numpy as np

from granulcal.export import law
from granulcal.export.mark import MARK, signed
from granulcal.export.setup import Body, Contact, Setup, Stiffness

__all__ = ["ENGINE", "NOTES", "UNEQUAL", "contact", "data", "material", "scene"]

ENGINE = "lammps"
NOTES = (
    "restitution below exp(-2) = 0.135 is reached by a dashpot that pulls (limit_damping is left out)",
    "rolling and torsion are stiff springs with a dashpot up to the limit; ours are rigid up to it",
    "tangential_restitution is 0: the tangential dashpot is critical",
)
UNEQUAL = (
    "torsional lengths, rolling and torsional springs and the time step are those of the smallest"
)
"""What of a material is not each grain's own where they differ in size."""
_ROLLING_RATE, _ROLLING_DAMPING = 0.25, 0.7
# A_r of docs/theory/contact.md, 5/2 (l_i^2 + l_j^2).
_ROLLING_INERTIA = {"pair": 1.25, "wall": 2.5}
# Most bins of neighbours.
_BINS = 3e5
_LOOK, _SLOW, _RESTING = 0.01, 0.01, 0.995


def contact(of: Contact, at: str, stiffness: Stiffness) -> str:
    """Returns the words of a contact at a `pair` or a `wall`, after the style's name."""
    pulls = of.restitution < law.LEAST_WITHOUT_TENSION
    beta = law.damping_ratio(of.restitution, tension=pulls)
    lever = stiffness.radius * (0.5 if at == "pair" else 1.0)
    rate = _ROLLING_RATE / stiffness.dt
    inertia = stiffness.mass / _ROLLING_INERTIA[at]
    k, gamma = inertia * rate**2, 2.0 * _ROLLING_DAMPING * inertia * rate
    words = [
        f"hertz/material {stiffness.young:.6g} {law.nominal_restitution(beta):.9g} {law.POISSON}",
        "tangential mindlin_rescale/force NULL "
        f"{law.critical_tangential_damping(beta):.9g} {of.sliding_friction:.9g}",
        f"rolling sds {k:.9g} {gamma:.9g} {of.rolling_friction:.9g}",
        f"twisting sds {k * lever**2:.9g} {gamma * lever**2:.9g} {of.torsional_length(lever):.9g}",
        "damping coeff_restitution",
    ]
    return " ".join(words if pulls else [*words, "limit_damping"])


def material(setup: Setup, young: float | None = None) -> str:
    """Returns the lines of a material: pair style, its coefficients, the time step."""
    stiffness = setup.stiffness(young)
    return (
        "# before the box: units si; atom_style sphere; newton off; comm_modify vel yes\n"
        f"timestep {stiffness.dt:.6g}\n{_pair(setup, stiffness)}\n"
        f"# at walls: fix NAME all wall/gran granular {contact(setup.ground, 'wall', stiffness)} ...\n"
    )


def _pair(setup: Setup, stiffness: Stiffness) -> str:
    return f"pair_style granular\npair_coeff * * {contact(setup.grains, 'pair', stiffness)}"


def data(setup: Setup) -> str:
    """Returns the grains at the start as a LAMMPS data file, atom_style sphere."""
    return atoms(setup, setup.centres, setup.radii)


def atoms(setup: Setup, centres, radii) -> str:
    """Returns spheres as a LAMMPS data file, atom_style sphere; its box holds all of them."""
    (x_low, y_low, bottom), (x_high, y_high, top) = _box(setup, centres, radii)
    lines = [
        f"LAMMPS data file of {setup.name}, {MARK}: atom_style sphere, units si",
        "",
        f"{len(radii)} atoms",
        "1 atom types",
        "",
        f"{x_low:.9g} {x_high:.9g} xlo xhi",
        f"{y_low:.9g} {y_high:.9g} ylo yhi",
        f"{bottom:.9g} {top:.9g} zlo zhi",
        "",
        "Atoms # sphere",
        "",
    ]
    for i, (centre, radius) in enumerate(zip(centres, radii, strict=True), start=1):
        x, y, z = centre
        lines.append(f"{i} 1 {2 * radius:.9g} {setup.density:g} {x:.9g} {y:.9g} {z:.9g}")
    return "\n".join(lines) + "\n"


def _box(setup: Setup, centres, radii) -> tuple[list[float], list[float]]:
    """Returns the corners of the space of a pour, wider where grains lie outside of it [m]."""
    w = setup.half_width
    reach = np.asarray(radii, float)[:, None]
    low = np.minimum((np.asarray(centres, float) - reach).min(axis=0), [-w, -w, -setup.smallest])
    high = np.maximum((np.asarray(centres, float) + reach).max(axis=0), [w, w, setup.top])
    return low.tolist(), high.tolist()


def scene(setup: Setup, young: float | None = None) -> dict[str, str]:
    """Returns the files of a pour: `lmp -in in.pour` leaves grains.dump."""
    stiffness = setup.stiffness(young)
    largest = float(setup.radii.max())
    walls = "\n".join(_wall(body, stiffness) for body in setup.walls)
    look = max(1, round(_LOOK / stiffness.dt))
    script = f"""\
# {signed(setup.name, ENGINE)}
units         si
atom_style    sphere
boundary      s s fs
newton        off
comm_modify   vel yes
read_data     pour.data
neighbor      {0.5 * largest:.6g} bin
neigh_modify  delay 0 every 1 check yes binsize {4 * largest:.6g}
{_pair(setup, stiffness)}
{setup.gravity_line}
fix           ground all wall/gran granular {contact(setup.ground, "wall", stiffness)} zplane 0 NULL
{walls}
fix           motion all nve/sphere
timestep      {stiffness.dt:.6g}

# Runs until {100 * _RESTING:g} % of the grains are slower than {100 * _SLOW:g} cm/s.
variable      slow atom "vx*vx + vy*vy + vz*vz < {_SLOW**2:g}"
compute       resting all reduce ave v_slow
thermo        {look}
thermo_style  custom step time atoms ke c_resting
thermo_modify lost ignore
run           0 post no
label         again
# Bins as fine as the grains would be too many where some have rolled far.
variable      bin equal "ternary(lx*ly*lz > {_BINS * (4 * largest) ** 3:.6g}, (lx*ly*lz/{_BINS:g})^(1/3), {4 * largest:.6g})"
neigh_modify  binsize ${{bin}}
run           {look} post no
variable      now equal time
variable      share equal c_resting
if            "(${{now}} > {setup.earliest:.4g}) && (${{share}} > {_RESTING})" then "jump SELF done"
if            "${{now}} > {setup.horizon:g}" then "jump SELF done"
jump          SELF again
label         done
write_dump    all custom grains.dump id x y z radius modify sort id format float %.9g
"""
    return {"in.pour": script, "pour.data": data(setup)}


def _wall(body: Body, stiffness: Stiffness) -> str:
    words = contact(body.law, "wall", stiffness)
    # A region without an open face holds grains inside alone; ours are felt from both sides.
    sides = {"": "", "_out": " side out"} if _is_closed(body) else {"": ""}
    return "\n".join(
        f"region        {body.name}{end} {_region(body)}{side}\n"
        f"fix           {body.name}{end} all wall/gran/region granular {words} "
        f"region {body.name}{end}"
        for end, side in sides.items()
    )


def _is_closed(body: Body) -> bool:
    if body.shape["kind"] == "box":
        return not body.shape.get("open")
    return body.shape.get("closed", "none") == "both"


def _region(body: Body) -> str:
    shape, kind = body.shape, body.shape["kind"]
    if kind in ("cone", "cylinder"):
        axis, (a, b), ends = _along(body)
        closed = shape.get("closed", "none")
        # A region's first end is its low one.
        order = ("from", "to") if ends[0] < ends[1] else ("to", "from")
        faces = enumerate(order, start=1)
        rest = "".join(f" open {i}" for i, end in faces if closed not in (end, "both"))
        low, high = sorted(ends)
        if kind == "cylinder":
            return f"cylinder {axis} {a:g} {b:g} {shape['radius']:.9g} {low:.9g} {high:.9g}{rest}"
        radii = " ".join(f"{shape[f'radius_{end}']:.9g}" for end in order)
        return f"cone {axis} {a:g} {b:g} {radii} {low:.9g} {high:.9g}{rest}"
    if kind == "plane":
        numbers = " ".join(f"{float(x):.9g}" for x in (*shape["point"], *shape["normal"]))
        return f"plane {numbers}"
    if kind == "box":
        sides = ("x_min", "x_max", "y_min", "y_max", "z_min", "z_max")
        pairs = zip(shape["min"], shape["max"], strict=True)
        numbers = " ".join(f"{float(x):.9g}" for pair in pairs for x in pair)
        missing = [f"open {sides.index(name) + 1}" for name in shape.get("open", [])]
        return " ".join(["block", numbers, *missing])
    raise ValueError(
        f"{body.path}: LAMMPS has no wall of kind {kind!r}, only plane, box, cylinder and cone"
    )


def _along(body: Body) -> tuple[str, tuple[float, float], tuple[float, float]]:
    """Returns the axis of a round wall, its place across it, and `from` and `to` along it."""
    begin, end = body.shape["from"], body.shape["to"]
    moving = [k for k in range(3) if abs(end[k] - begin[k]) > 1e-12]
    if len(moving) != 1:
        raise ValueError(
            f"{body.path}: LAMMPS has round walls along x, y or z alone, got one from "
            f"{list(begin)} to {list(end)}"
        )
    k = moving[0]
    across = [float(begin[i]) for i in range(3) if i != k]
    return "xyz"[k], (across[0], across[1]), (float(begin[k]), float(end[k]))
