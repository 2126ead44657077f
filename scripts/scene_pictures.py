"""The pictures of scenes in docs/scenes.md and docs/gallery.md.

    python scripts/scene_pictures.py [drum] [column] ...

Each is poured anew from its scene in examples/ and says in its file which law poured it: a test
compares that with the present one.
"""

import argparse
import re
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

import granulcal as gc

ROOT = Path(__file__).parents[1]
OUT = ROOT / "docs" / "results"
sys.path.insert(0, str(ROOT / "examples"))

import side_view  # noqa: E402


class View(NamedTuple):
    """When a scene is examined [s], what of it is drawn [m], and from where."""

    at: float | None = None
    within: float = np.inf
    behind: float = -np.inf
    from_above: bool = False


VIEWS = {
    "funnel": View(at=0.45),
    "drop": View(at=0.16),
    "drum": View(),
    # 0.15 s after the tube is lifted, 1 s after the gate is drawn.
    "column": View(at=0.43),
    "hopper": View(at=1.35),
    "hopper_round": View(at=0.75),
    "bowl": View(within=0.055),
    "trail": View(from_above=True),
    "scoop": View(within=0.06),
    # Cut in half.
    "crater": View(behind=-1e-3),
    "ring": View(within=0.15, behind=-1e-3),
}


def scene_of(name: str, at: float | None) -> gc.Scene:
    """Returns a scene of examples/ that ends at a time [s] and observes nothing on the way."""
    path = ROOT / "examples" / f"{name}.toml"
    if at is None:
        return gc.Scene.load(path)
    # Tables of the file by their heads: `[observe]` and below it `[observe.front]`.
    tables = re.split(r"^(?=\[)", path.read_text(encoding="utf-8"), flags=re.M)
    kept = [table for table in tables if not table.startswith("[observe")]
    return gc.Scene.from_toml("".join(kept)).with_({"end.horizon": at})


def main() -> int:
    """Writes the pictures that are asked for, all without a word; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help=f"of {', '.join(VIEWS)}; default all")
    names = parser.parse_args().names or list(VIEWS)
    for name in names:
        view = VIEWS[name]
        scene = scene_of(name, view.at)
        pour = gc.simulate(scene, seed=1)
        shown = (np.abs(pour.positions[:, :2]) <= view.within).all(axis=1)
        shown &= pour.positions[:, 1] >= view.behind
        side_view.draw(
            pour.positions[shown],
            2 * pour.radii[shown],
            str(OUT / f"{name}.png"),
            from_above=view.from_above,
            inches=5.0,
            metadata={"Law": str(scene.native.law)},
        )
        print(f"{name}: {pour.status}", flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
