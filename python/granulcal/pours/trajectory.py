"""What happened over time: frames of a pour as arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Trajectory"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory:
    """Frames of a pour at T times: the start, one every so many seconds, and the end.

    N counts all grains of the scene, in the order of the start. A grain that is not in the scene at
    a time, since it has left it or is still to enter, is NaN there. Of clumps N counts spheres. As
    in `Simulation`, velocities are those of half a substep before. Arrays are read-only.

    Attributes:
        times: simulated times [s], shape (T,).
        positions: centres [m], shape (T, N, 3).
        velocities: [m/s], shape (T, N, 3).
        angular_velocities: [rad/s], shape (T, N, 3).
        orientations: turns of grains with a shape as `Pour.orientations`, shape (T, N, 4); of
            others (T, 0, 4).
        radii: [m], shape (N,).
        masses: [kg], shape (N,).
        kinetic_energy: of all grains at each time [J], shape (T,).
        potential_energy: likewise, as `Simulation.potential_energy` [J], shape (T,).

    Examples:
        >>> import granulcal as gc
        >>> pour = gc.simulate(gc.Scene.drop(0.02, count=20), seed=1, every=0.01)
        >>> seen = pour.trajectory
        >>> len(seen) == len(seen.times), seen.positions.shape == (len(seen), 20, 3)
        (True, True)
        >>> bool((seen.positions[-1] == pour.positions).all())
        True
    """

    times: Array
    positions: Array
    velocities: Array
    angular_velocities: Array
    orientations: Array
    radii: Array
    masses: Array
    kinetic_energy: Array
    potential_energy: Array

    def __len__(self) -> int:
        return len(self.times)

    def __repr__(self) -> str:
        span = f"{self.times[0]:g} to {self.times[-1]:.4g} s"
        return f"Trajectory({len(self)} times from {span}, {len(self.radii)} grains)"
