"""Who presses on whom: the lasting contacts of grains as arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from granulcal.arrays import read_only

if TYPE_CHECKING:
    from granulcal._native import ContactArrays

__all__ = ["Contacts"]


@dataclass(frozen=True, eq=False, repr=False)
class Contacts:
    """The lasting contacts that carried something in the last substep, k of them.

    A force is the impulse that the solver found for the substep over its length: exact for grains
    at rest. While grains collide it changes from substep to substep and lacks what impacts give,
    and so it lacks what bonds and pulls across gaps give beside the contact. Arrays are read-only.

    Attributes:
        pairs: rows of the two grains in `positions`, shape (k, 2); the second is -1 at a wall.
        walls: number of the wall in `wall_names`, shape (k,); -1 between two grains.
        points: where they touch [m], on the first grain's surface, shape (k, 3).
        normals: unit vectors to the first grain, shape (k, 3).
        forces: on the first grain, normal part and friction [N], shape (k, 3); on the other one it
            is the opposite.
        wall_names: `ground`, `funnel` for its cone and once more for its stem, `walls.0` and so on.

    Examples:
        >>> import granulcal as gc
        >>> pour = gc.simulate(gc.Scene.drop(0.02, count=20), seed=1)
        >>> on_ground = pour.contacts.at_wall("ground")
        >>> carried = pour.contacts.forces[on_ground].sum(axis=0)[2]
        >>> bool(np.isclose(carried, 9.81 * pour.masses.sum(), rtol=0.01))
        True
    """

    pairs: NDArray[np.int64]
    walls: NDArray[np.int64]
    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    forces: NDArray[np.float64]
    wall_names: tuple[str, ...]

    @classmethod
    def of(cls, native: ContactArrays) -> Contacts:
        """Returns them as the Rust side tells them."""
        *arrays, names = native
        pairs, walls, points, normals, forces = map(read_only, arrays)
        return cls(pairs, walls, points, normals, forces, tuple(names))

    def at_wall(self, name: str) -> NDArray[np.bool_]:
        """Returns which contacts are at a wall, shape (k,); for `funnel` at both of its parts.

        Raises:
            KeyError: the scene has no wall of this name; names those that it has.
        """
        if name not in self.wall_names:
            known = ", ".join(dict.fromkeys(self.wall_names))
            raise KeyError(f"this scene has no wall {name!r}; its walls are {known}")
        numbers = [number for number, wall in enumerate(self.wall_names) if wall == name]
        return np.isin(self.walls, numbers)

    def __len__(self) -> int:
        return len(self.walls)

    def __repr__(self) -> str:
        at_walls = int((self.walls >= 0).sum())
        return f"Contacts({len(self) - at_walls} between grains, {at_walls} at walls)"
