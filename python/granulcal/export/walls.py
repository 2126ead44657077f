"""The walls of a scene besides the ground, as another engine or a picture is told them."""

from dataclasses import dataclass
from typing import Any

from granulcal.export.law import Contact

__all__ = ["Body", "require_still", "still_walls_of", "walls_of"]


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

    @property
    def path(self) -> str:
        """What messages call it: its path in the scene."""
        return self.name.replace("wall_", "walls.")


def walls_of(table: dict[str, Any], grains: Contact) -> list[Body]:
    """Returns all walls of a scene's tables: the funnel's stem and cone first.

    Args:
        table: of the scene, as `Scene.to_dict` returns it.
        grains: the law of the grains, which counts where a wall states none.
    """
    walls = [*_funnel(table.get("funnel"), grains)]
    for i, wall in enumerate(table.get("walls", [])):
        law = Contact.of(wall.get("material", {}), grains)
        walls.append(Body(f"wall_{i}", wall["shape"], law))
    return walls


def still_walls_of(table: dict[str, Any], grains: Contact) -> list[Body]:
    """Returns the walls that rest and are no meshes."""
    still = {key: value for key, value in table.items() if key not in ("funnel", "walls")}
    if "funnel" in table and _why_not(table["funnel"]) is None:
        still["funnel"] = table["funnel"]
    still["walls"] = [wall for wall in table.get("walls", []) if _why_not(wall) is None]
    return walls_of(still, grains)


def require_still(table: dict[str, Any]) -> None:
    """Refuses walls that move, and meshes.

    Raises:
        ValueError: names the wall.
    """
    funnel = [("funnel", table["funnel"])] if "funnel" in table else []
    walls = ((f"walls.{i}", wall) for i, wall in enumerate(table.get("walls", [])))
    for name, wall in [*funnel, *walls]:
        if (why := _why_not(wall)) is not None:
            raise ValueError(f"{name}: {why}")


def _why_not(wall: dict[str, Any]) -> str | None:
    """Returns why a wall cannot be told, None if it can."""
    kind = wall.get("motion", {}).get("kind", "still")
    if kind != "still":
        return f"motion {kind!r} is not exported; only walls at rest are"
    if wall.get("shape", {}).get("kind") == "mesh":
        return "meshes are not exported; give the engine the file itself"
    return None


def _funnel(table: dict[str, Any] | None, grains: Contact) -> list[Body]:
    if table is None:
        return []
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
