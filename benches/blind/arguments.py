"""Arguments that several of these commands take."""

import argparse

__all__ = ["add_part", "add_young"]


def add_part(parser: argparse.ArgumentParser, more: str = "") -> None:
    """Adds `--part K N`; `more` is said after what it means."""
    parser.add_argument(
        "--part",
        type=int,
        nargs=2,
        default=(0, 1),
        metavar=("K", "N"),
        help=f"of N runs side by side this is the one number K, from 0{more}",
    )


def add_young(parser: argparse.ArgumentParser, default: float) -> None:
    """Adds `--young`, of LAMMPS' grains; whoever takes it sets `engine.YOUNG`."""
    parser.add_argument("--young", type=float, default=default, help="of LAMMPS' grains [Pa]")
