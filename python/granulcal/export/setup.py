"""All of a scene that another engine must know, as plain numbers."""

import tomllib
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal.export.law import Contact, Stiffness
from granulcal.pours.scene import Scene

__all__ = ["Body", "Contact", "Setup", "Stiffness"]

Array = NDArray[np.float64]

# Walls that are sized for grains leave a little way to roll.
_HALF_WIDTH = 0.8
_FALLEN = 0.25


@dataclass(frozen=True)
class Body:
    """A wall at rest.

    Attributes:
        name: what an engine's file calls it.
        shape: its table in the scene: kind and lengths [m].
        law: of its contacts with grains.
    """

    name: str
    shape: dict[str, Any]
    law: Contact


@dataclass(frozen=True, kw_only=True)
class Setup:
    """A pour.

    Attributes:
        name: of the scene.
        centres, radii: the grains at the start [m], shapes (n, 3) and (n,).
        density: of a grain [kg/m^3].
        gravity: acceleration [m/s^2].
        grains, ground: laws between grains, and with the plane z = 0.
        walls: all other walls.
        horizon: when the pour ends at the latest [s].
        earliest: nothing rests before the grains have fallen [s].
        half_width: of the space about the axis in which grains are followed [m].
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
            ValueError: the scene has moving or meshed walls, a period, an outflow, an intruder
                or a bed.
        """
        table = tomllib.loads(scene.to_toml())
        for key in ("periodic", "outflow", "intruder", "bed"):
            if key in table:
                raise ValueError(
                    f"{scene.name}: `{key}` has no counterpart in other engines' files"
                )
        grains = Contact.of(table["material"])
        ground = Contact.of(table.get("ground", {}).get("material", {}), grains)
        walls = [*_funnel(table.get("funnel"), grains)]
        for i, wall in enumerate(table.get("walls", [])):
            _refuse_motion(f"walls.{i}", wall)
            law = Contact.of(wall.get("material", {}), grains)
            walls.append(Body(f"wall_{i}", wall["shape"], law))
        centres, radii = scene.start(seed)
        gravity = tuple(float(g) for g in table["gravity"])
        fall = float(np.sqrt(2.0 * centres[:, 2].max() / max(np.linalg.norm(gravity), 1e-9)))
        return cls(
            name=scene.name,
            centres=centres,
            radii=radii,
            density=float(table["grains"]["density"]),
            gravity=(gravity[0], gravity[1], gravity[2]),
            grains=grains,
            ground=ground,
            walls=tuple(walls),
            horizon=float(table["end"]["horizon"]),
            earliest=max(_FALLEN, fall),
            half_width=_HALF_WIDTH,
            left_out=tuple(_left_out(table)),
        )

    @property
    def smallest(self) -> float:
        """Radius of the smallest grain [m]."""
        return float(self.radii.min())

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


def _funnel(table: dict[str, Any] | None, grains: Contact) -> list[Body]:
    if table is None:
        return []
    _refuse_motion("funnel", table)
    law = Contact.of(table.get("material", {}), grains)
    tip = float(table["height"])
    neck = tip + float(table["stem_length"])
    rim = neck + float(table["cone_length"])
    stem, wide = float(table["stem_radius"]), float(table["rim_radius"])
    bodies = []
    if neck > tip:
        shape = {"kind": "cylinder", "from": [0, 0, tip], "to": [0, 0, neck], "radius": stem}
        bodies.append(Body("stem", shape, law))
    shape = {
        "kind": "cone",
        "from": [0, 0, neck],
        "to": [0, 0, rim],
        "radius_from": stem,
        "radius_to": wide,
    }
    return [*bodies, Body("cone", shape, law)]


def _refuse_motion(name: str, table: dict[str, Any]) -> None:
    kind = table.get("motion", {}).get("kind", "still")
    if kind != "still":
        raise ValueError(f"{name}: motion {kind!r} is not exported; only walls at rest are")
    if table.get("shape", {}).get("kind") == "mesh":
        raise ValueError(f"{name}: meshes are not exported; give the engine the file itself")


def _left_out(table: dict[str, Any]) -> list[str]:
    found = [f"effects.{name}" for name in table.get("effects", {})]
    known = {field.name for field in fields(Contact)}
    found += [f"material.{name}" for name in table["material"] if name not in known]
    if "observe" in table:
        found.append("observe (what is seen on the way)")
    return found
