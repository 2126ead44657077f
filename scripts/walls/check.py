"""Holds the walls: no circle of files, no arrow up a floor, no crate that knows one it must not.

`make lint` runs it. It reads the sources alone, within a second, and needs only the standard
library. With `--draw` it writes docs/floors.svg anew; without, it fails where that is out of date.
"""

import argparse
import sys
from pathlib import Path

import crates
import floors
import picture
import python
import rust
from graph import Arrows, circles, shortest_circle

ROOT = Path(__file__).parents[2]
FLOORED = "dem"
PICTURE = Path("docs/floors.svg")


def main() -> int:
    """Prints what is wrong, one a line; 1 if anything is."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draw", action="store_true", help=f"write {PICTURE}")
    parser.add_argument("--root", type=Path, default=ROOT, help="folder of the workspace")
    options = parser.parse_args()
    found = faults(options.root) or of_picture(options.root, draw=options.draw)
    for line in found:
        print(line, file=sys.stderr)
    return 1 if found else 0


def faults(root: Path) -> list[str]:
    """Returns what is wrong with the walls, a line each."""
    found = []
    for folder in crates.manifests(root).values():
        arrows = rust.arrows_of(folder)
        where = (folder / "src").relative_to(root)
        found += of_circles(str(where), "files", arrows)
        if folder.name == FLOORED:
            modules = floors.by_module(arrows)
            found += of_circles(str(where), "modules", modules)
            at = where.parent / "floors.toml"
            found += [
                f"{at}: {fault}" for fault in floors.faults(floors.floors_of(folder), modules)
            ]
    package = root / "python" / "granulcal"
    found += of_circles(str(package.relative_to(root)), "files", python.arrows_of(package))
    return found + crates.faults(root)


def of_circles(where: str, what: str, arrows: Arrows) -> list[str]:
    """Returns a line for each circle, with a shortest way around it."""
    return [
        f"{where}: a circle of {len(circle)} {what}, for example "
        + " -> ".join(shortest_circle(arrows, circle))
        for circle in circles(arrows)
    ]


def of_picture(root: Path, *, draw: bool) -> list[str]:
    """Writes the picture of crates and floors, or returns a line if it is out of date."""
    crate, path = root / "crates" / FLOORED, root / PICTURE
    modules = floors.by_module(rust.arrows_of(crate))
    drawn = picture.draw(crates.arrows_of(root), floors.floors_of(crate), modules)
    if draw:
        path.write_text(drawn, encoding="utf-8")
    elif not path.exists() or path.read_text(encoding="utf-8") != drawn:
        return [f"{PICTURE} is out of date: run `python scripts/walls/check.py --draw`"]
    return []


if __name__ == "__main__":
    raise SystemExit(main())
