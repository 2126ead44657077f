"""All of a scene that another engine must know, as plain numbers."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal.export.law import Contact, Stiffness
from granulcal.export.mark import plain
from granulcal.export.mesh import triangles
from granulcal.export.points import ENDINGS
from granulcal.export.walls import Body, require_still, walls_of
from granulcal.pours.scene import Scene

__all__ = ["Body", "Contact", "Setup", "Stiffness", "require_funnel_in_place"]

Array = NDArray[np.float64]

# Half width of the space in which grains are followed [m]: at least, and at most beyond the start.
_LEAST_WIDTH, _FARTHEST = 0.8, 4.0
# A ball that rolls without sliding slows down by 5/7 mu_r g.
_ROLLING_LOSS = 5.0 / 7.0
_FALLEN = 0.25
# What no engine's file can say, by path in the scene: of the grains, and of a pour of them.
_NOT_ROUND = ("grains.shape", "effects.clump")
_REFUSED = ("periodic", "outflow", "intruder", "bed", *_NOT_ROUND)
_POSE = ("x", "y", "lean_x", "lean_y")


@dataclass(frozen=True, kw_only=True)
class Setup:
    """A pour.

    Attributes:
        name: of the scene, without characters that are code or markup somewhere.
        centres, radii: the grains at the start [m], shapes (n, 3) and (n,).
        density: of a grain [kg/m^3].
        gravity: acceleration [m/s^2].
        grains, ground: laws between grains, and with the plane z = 0.
        walls: all other walls.
        horizon: when the pour ends at the latest [s].
        earliest: nothing rests before the grains have fallen [s].
        half_width: of the space about the axis in which grains are followed: start, walls, and
            as far as a grain rolls until the horizon, at most 4 m [m].
        left_out: what the scene has and no other engine is told, a phrase each.
    """

    name: str
    centres: Array
    radii: Array
    density: float
    gravity: tuple[float, float, float]
    grains: Contact
    ground: Contact
    walls: tuple[Body, ...]
    horizon: float
    earliest: float
    half_width: float
    left_out: tuple[str, ...]

    @classmethod
    def of(cls, scene: Scene, seed: int = 0) -> "Setup":
        """Returns the pour of a scene with a seed.

        Raises:
            ValueError: the scene has grains that are not round or are clumps, moving or meshed
                walls, a period, an outflow, an intruder or a bed.
        """
        table = scene.to_dict()
        _refuse(scene.name, table, _REFUSED)
        require_still(table)
        return cls._of(scene, table, seed)

    @classmethod
    def of_material(cls, scene: Scene) -> "Setup":
        """Returns what a material needs of a scene: its grains, and what they touch at rest.

        A drum that turns or a hopper that runs out has a material as any scene has, though its pour
        is none that another engine is told.

        Raises:
            ValueError: the scene has grains that are not round or are clumps.
        """
        table = scene.to_dict()
        _refuse(scene.name, table, _NOT_ROUND)
        return cls._of(scene, table, 0)

    @classmethod
    def of_bed(cls, scene: Scene, kind: str, seed: int = 0) -> "Setup":
        """Returns what a bed of a scene's grains needs, in one of `bed.FORMATS`.

        Tables of points know no engine: whatever walls a pour has had, its grains can be viewed.

        Raises:
            ValueError: points of grains with a shape; of other formats as `of`.
        """
        if kind not in ENDINGS:
            return cls.of(scene, seed)
        table = scene.to_dict()
        if "shape" in table["grains"]:
            raise ValueError(
                f"{scene.name}: `grains.shape` is not in a {kind} of points; Pour.vertices() has the "
                "bodies' corners"
            )
        if kind == "csv":
            # What is read as grains elsewhere; the others are for viewing.
            _refuse(scene.name, table, _NOT_ROUND)
        return cls._of(scene, table, seed)

    @classmethod
    def _of(cls, scene: Scene, table: dict[str, Any], seed: int) -> "Setup":
        grains = Contact.of(table["material"])
        ground = Contact.of(table.get("ground", {}).get("material", {}), grains)
        walls = walls_of(table, grains)
        centres, radii = scene.start(seed)
        gravity = tuple(float(g) for g in table["gravity"])
        fall = float(np.sqrt(2.0 * centres[:, 2].max() / max(np.linalg.norm(gravity), 1e-9)))
        return cls(
            name=plain(scene.name),
            centres=centres,
            radii=radii,
            density=float(table["grains"]["density"]),
            gravity=(gravity[0], gravity[1], gravity[2]),
            grains=grains,
            ground=ground,
            walls=tuple(walls),
            horizon=float(table["end"]["horizon"]),
            earliest=max(_FALLEN, fall),
            half_width=_half_width(
                table,
                centres,
                float(radii.max()),
                walls,
                min(grains.rolling_friction, ground.rolling_friction),
            ),
            left_out=tuple(_left_out(table)),
        )

    @property
    def smallest(self) -> float:
        """Radius of the smallest grain [m]."""
        return float(self.radii.min())

    @property
    def has_sizes(self) -> bool:
        """Whether the grains differ in size."""
        return bool(np.ptp(self.radii) > 0.0)

    @property
    def gravity_line(self) -> str:
        """The fix of LAMMPS and LIGGGHTS for gravity; nothing where there is none."""
        g = float(np.linalg.norm(self.gravity))
        if g == 0.0:
            return ""
        direction = " ".join(f"{c / g:.9g}" for c in self.gravity)
        return f"fix           gravity all gravity {g:.9g} vector {direction}"

    @property
    def effective_radius(self) -> float:
        """R_eff of two of the smallest grains, R / 2 [m]."""
        return 0.5 * self.smallest

    @property
    def top(self) -> float:
        """A height that nothing exceeds [m]."""
        return float(self.centres[:, 2].max() + 10 * self.radii.max())

    def stiffness(self, young: float | None = None) -> Stiffness:
        """Returns stiffness and time step for an elastic engine."""
        return Stiffness.of(self.smallest, self.density, young)


def require_funnel_in_place(scene: Scene) -> None:
    """Refuses a funnel that hangs beside its place or leans: the grains' start follows it alone.

    Raises:
        ValueError: names the offset or the angle.
    """
    pose = scene.to_dict().get("effects", {}).get("funnel", {})
    moved = [f"{name} = {pose[name]:g}" for name in _POSE if pose.get(name, 0.0) != 0.0]
    if moved:
        raise ValueError(
            f"{scene.name}: `effects.funnel` has {', '.join(moved)}, and a funnel is exported in its "
            f"place alone: {', '.join(_POSE)} must be 0"
        )


def _refuse(name: str, table: dict[str, Any], paths: tuple[str, ...]) -> None:
    for path in paths:
        *places, key = path.split(".")
        if key in (table.get(places[0], {}) if places else table):
            raise ValueError(f"{name}: `{path}` has no counterpart in other engines' files")


def _half_width(
    table: dict[str, Any], centres: Array, radius: float, walls: list[Body], rolling: float
) -> float:
    """Returns the half width of a space that holds start and walls, and how far grains roll [m]."""
    gravity = np.array(table["gravity"], float)
    g = float(np.linalg.norm(gravity))
    speed = float(np.sqrt(2.0 * g * centres[:, 2].max()))
    # Where gravity is not along z, grains may roll for ever.
    loss = _ROLLING_LOSS * g * rolling - float(np.hypot(*gravity[:2]))
    stops = speed**2 / (2.0 * loss) if loss > 0 else np.inf
    rolled = min(speed * float(table["end"]["horizon"]), stops, _FARTHEST)
    # A plane has no end, and a mesh is in no pour that is exported.
    shapes = [body.shape for body in walls if body.shape["kind"] not in ("plane", "mesh")]
    ends = [np.abs(triangles(shape).vertices[:, :2]).max() for shape in shapes]
    farthest = max([np.abs(centres[:, :2]).max() + rolled, *ends])
    return float(max(_LEAST_WIDTH, farthest + 2.0 * radius))


def _left_out(table: dict[str, Any]) -> list[str]:
    # Radii that differ are written with the grains.
    found = [f"effects.{name}" for name in table.get("effects", {}) if name != "polydispersity"]
    known = {field.name for field in fields(Contact)}
    found += [f"material.{name}" for name in table["material"] if name not in known]
    if "observe" in table:
        found.append("observe (what is seen on the way)")
    return found
