"""What a posterior takes for known: the numbers that nobody inferred, and that may be wrong."""

from collections.abc import Iterator
from typing import Any

from granulcal.documents import parse_toml
from granulcal.pours.scene import Material
from granulcal.prior import Prior

__all__ = ["assumed"]

# Of a material the numbers that every scene states; the others where they are not the solver's own.
_MAIN = ("sliding_friction", "rolling_friction", "restitution")
_SOLVERS_OWN = vars(Material(sliding_friction=0.0, rolling_friction=0.0, restitution=0.0))
# Of other tables; a scene without a funnel lets go from a height of its start.
_NUMBERS = (
    ("grains", ("count", "volume", "diameter", "density")),
    ("funnel", ("height", "stem_radius")),
    ("start", ("height",)),
)
_UNITS = {
    "volume": " m3",
    "diameter": " m",
    "density": " kg/m3",
    "height": " m",
    "stem_radius": " m",
}


def assumed(scene_toml: str | None, prior: Prior) -> str:
    """Returns one line of what an inference took for known.

    Args:
        scene_toml: the scene as `Scene.to_toml` writes it; None where nobody knows it.
        prior: what it fixes is named first; what it leaves free is not assumed.

    Returns:
        Such as `assumed: material.restitution 0.4 (fixed), grains.count 500, grains.diameter 0.005
        m, ... and the rest of the scene mine`; empty if nothing is known.
    """
    told = [f"{_said(path, value)} (fixed)" for path, value in prior.fixed.items()]
    rest = ""
    if scene_toml is not None:
        scene = _tables(scene_toml)
        named = {parameter.path for parameter in prior.parameters}
        told += [_said(path, value) for path, value in _of_scene(scene) if path not in named]
        rest = f"the rest of the scene {scene.get('name', '')}".strip()
    line = ", ".join(told)
    both = " and ".join(part for part in (line, rest) if part)
    return f"assumed: {both}" if both else ""


def _tables(scene_toml: str) -> dict[str, Any]:
    """The tables of a scene; none of a damaged text, which no posterior depends on."""
    try:
        return parse_toml(scene_toml.encode(), "scene")
    except ValueError:
        return {}


def _of_scene(scene: dict[str, Any]) -> Iterator[tuple[str, float | str]]:
    """The numbers of a scene that a posterior leans on, by path, and the kind of a shape."""
    material = _table(scene, "material")
    others = tuple(name for name in material if name not in _MAIN)
    changed = tuple(name for name in others if material[name] != _SOLVERS_OWN.get(name))
    for table, names in (("material", _MAIN + changed), *_NUMBERS):
        found = _table(scene, table)
        for name in names:
            # Unequal grains are a table of numbers.
            if isinstance(found.get(name), int | float):
                yield f"{table}.{name}", found[name]
    kind = _table(_table(scene, "grains"), "shape").get("kind")
    if isinstance(kind, str):
        yield "grains.shape", kind


def _table(tables: dict[str, Any], name: str) -> dict[str, Any]:
    found = tables.get(name)
    return found if isinstance(found, dict) else {}


def _said(path: str, value: float | str) -> str:
    number = value if isinstance(value, str) else f"{value:.6g}"
    return f"{path} {number}{_UNITS.get(path.rpartition('.')[2], '')}"
