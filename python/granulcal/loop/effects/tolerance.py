"""Declared tolerances of the statistics themselves: ways in which a simulator is known to be off.

For truths of another simulator, or a camera whose error was measured: directions in the statistics,
as functions of one condition input, each with a standard deviation. They are random effects of
every fit and can never be a finding. The file:

    {"names": ["max_z", ...], "path": "funnel.height", "at": [0.02, 0.12],
     "directions": [[[...], [...]], ...]}       # one sd of each: direction, place, statistic
"""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granulcal.documents import ListOf, Number, Table, Text, read_json
from granulcal.errors import ObservationError
from granulcal.loop.effects.design import Effect

__all__ = ["Tolerances"]

Array = NDArray[np.float64]

_SCHEMA = Table(
    {
        "names": ListOf(Text(), least=1),
        "path": Text(),
        "at": ListOf(Number(), least=1),
        "directions": ListOf(ListOf(ListOf(Number())), least=1),
    }
)
# Strength 1 stands for this many standard deviations.
_FULL = 2.0


@dataclass(frozen=True)
class Tolerances:
    """Directions in which statistics may be off.

    Attributes:
        names: statistics, s of them; others are exact.
        path: the condition input that directions depend on.
        at: its values, increasing, shape (g,).
        directions: one standard deviation of each in the statistics' units, shape (D, g, s).
    """

    names: tuple[str, ...]
    path: str
    at: Array
    directions: Array

    @classmethod
    def load(cls, path: Path) -> "Tolerances":
        """Returns the tolerances in a JSON file.

        Raises:
            FileNotFoundError: there is no such file.
            ObservationError: shapes that do not agree, or places that do not rise.
        """
        try:
            document = read_json(path, _SCHEMA)
        except ValueError as error:
            raise ObservationError(str(error)) from None
        names, at = tuple(document["names"]), np.array(document["at"], dtype=float)
        try:
            directions = np.array(document["directions"], dtype=float)
        except ValueError:
            raise ObservationError(f"{path}: directions must have rows of one length") from None
        if directions.ndim != 3 or directions.shape[1:] != (len(at), len(names)):
            raise ObservationError(
                f"{path}: directions must have shape (D, {len(at)}, {len(names)}), "
                f"got {directions.shape}"
            )
        if not (np.diff(at) > 0).all():
            raise ObservationError(f"{path}: at must rise, got {at.tolist()}")
        return cls(names, str(document["path"]), at, directions)

    def fingerprint(self) -> str:
        """Returns a hash of all numbers."""
        text = json.dumps([self.names, self.path, self.at.tolist(), self.directions.tolist()])
        return hashlib.sha256(text.encode()).hexdigest()

    def effects(self) -> tuple[Effect, ...]:
        """Returns the random effects."""
        return tuple(
            Effect(f"tolerance.{i + 1}", is_two_sided=True, nuisance_sd=1.0 / _FULL)
            for i in range(len(self.directions))
        )

    def shift(self, direction: int, values: Array, names: tuple[str, ...]) -> Array:
        """Returns what a direction at strength 1 adds to statistics `names` at `values` (n,)."""
        found = np.zeros((len(values), len(names)))
        for j, name in enumerate(names):
            if name in self.names:
                column = self.directions[direction, :, self.names.index(name)]
                found[:, j] = _FULL * np.interp(values, self.at, column)
        return found
