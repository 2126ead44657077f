"""Arguments that several of these commands take."""

import argparse

__all__ = ["add_law", "add_part", "add_young"]


def add_law(parser: argparse.ArgumentParser) -> None:
    """Adds `--law NAME=NUMBER ...`, further numbers of granulcal's material."""
    parser.add_argument(
        "--law",
        type=_number,
        nargs="+",
        default=[],
        metavar="NAME=NUMBER",
        help="of granulcal's material, such as rolling_dashpot=0.7",
    )


def _number(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    return name, float(value)


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
