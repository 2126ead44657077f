"""What the truth may have and the base model has not: one effect a file."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import numpy as np
from engine import Setup


@dataclass(frozen=True, kw_only=True)
class Effect:
    """An effect of the truth.

    Attributes:
        name: its name in the sealed answers and in families.toml.
        unit: of the strength.
        strengths: weak, medium and strong, in `unit`. How well an effect can be seen is measured
            by the misfit it leaves, not by this.
        apply: (setup, strength, random numbers of the set) -> the setup with the effect.
    """

    name: str
    unit: str
    strengths: tuple[float, float, float]
    apply: Callable[[Setup, float, np.random.Generator], Setup]


def load() -> dict[str, Effect]:
    """Returns every effect of this folder by its name."""
    files = sorted(Path(__file__).parent.glob("[a-z]*.py"))
    found = [import_module(f"effects.{file.stem}").EFFECT for file in files]
    return {effect.name: effect for effect in found}
