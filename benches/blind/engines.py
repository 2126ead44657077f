"""The other engines by name: LAMMPS, and LIGGGHTS by its rolling friction."""

import argparse
from collections.abc import Callable
from functools import partial

import engine
import liggghts_engine
from engine import Pile, Setup

__all__ = ["ENGINES", "Engine", "add_engine"]

Engine = Callable[[Setup], Pile]

ENGINES: dict[str, Engine] = {
    "lammps": engine.pour,
    **{name: partial(liggghts_engine.pour, rolling=name) for name in liggghts_engine.ROLLING},
}
"""A pour each; LIGGGHTS knows no effect and no Young's modulus below 5e6 Pa."""


def add_engine(parser: argparse.ArgumentParser) -> None:
    """Adds `--engine`."""
    parser.add_argument(
        "--engine",
        choices=ENGINES,
        default="lammps",
        help="epsd and epsd2 are LIGGGHTS, which needs --young 1e7 and knows no effect",
    )
