"""The floors of a crate: which module stands where, and which arrows would go up."""

import tomllib
from dataclasses import dataclass
from pathlib import Path

from graph import Arrows


@dataclass(frozen=True)
class Floor:
    """Modules that stand side by side."""

    name: str
    modules: tuple[str, ...]


def floors_of(crate: Path) -> list[Floor]:
    """Returns the floors of `floors.toml`, from the ground up."""
    text = (crate / "floors.toml").read_text(encoding="utf-8")
    found = tomllib.loads(text)["floor"]
    return [Floor(each["name"], tuple(each["modules"])) for each in found]


def by_module(arrows: Arrows) -> Arrows:
    """Returns the arrows between modules, a folder one with its file, without the root."""
    found: Arrows = {}
    for file, uses in arrows.items():
        module = name_of(file)
        inside = found.setdefault(module, set())
        inside |= {name_of(other) for other in uses} - {module, "lib"}
    found.pop("lib", None)
    return found


def name_of(file: str) -> str:
    """Returns the module of the crate's root that a file belongs to."""
    return file.split("/")[0].removesuffix(".rs")


def faults(floors: list[Floor], arrows: Arrows) -> list[str]:
    """Returns what is wrong: a module without a floor, a name of none, an arrow that goes up."""
    place = {module: number for number, floor in enumerate(floors) for module in floor.modules}
    found = [
        f"module {module} stands on no floor, must be on one"
        for module in sorted(arrows.keys() - place.keys())
    ]
    found += [
        f"floor {floors[place[name]].name!r} has {name!r}, which is no module"
        for name in sorted(place.keys() - arrows.keys())
    ]
    for module, uses in sorted(arrows.items()):
        found += [
            f"{module} (floor {floors[place[module]].name!r}) uses {other}, "
            f"which stands above it ({floors[place[other]].name!r})"
            for other in sorted(uses)
            if module in place and other in place and place[other] > place[module]
        ]
    return found
