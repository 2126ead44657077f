"""Takes a simulation to its end and keeps what there was to see in memory."""

import numpy as np
from numpy.typing import NDArray

from granulcal.arrays import read_only
from granulcal.pours.simulation import Simulation
from granulcal.pours.trajectory import Trajectory

__all__ = ["recorded"]

Array = NDArray[np.float64]
_VECTORS = ("positions", "velocities", "angular_velocities")


def recorded(simulation: Simulation, every: float) -> Trajectory:
    """Returns the frames of a simulation from where it is to its end.

    Raises:
        TypeError: `every` is no number.
        ValueError: it is less than a substep, or more memory is needed than there is.
    """
    native, frames = simulation.native, simulation.frames(every)
    native.require_room(float(every))
    radii, masses = read_only(native.all_radii), read_only(native.all_masses)
    seen: dict[str, list[Array]] = {name: [] for name in (*_VECTORS, "orientations")}
    times, energies = [], []
    for now in frames:
        times.append(now.time)
        energies.append(native.energy)
        rows = now.numbers
        for name in _VECTORS:
            seen[name].append(_of_all(getattr(now, name), rows, len(radii)))
        # Grains with a shape are all there, from the start to the end.
        seen["orientations"].append(now.orientations)
    # One after the other, so that two copies of all are never there.
    stacked = {name: read_only(np.stack(seen.pop(name))) for name in tuple(seen)}
    kinetic, potential = np.array(energies).T
    return Trajectory(
        times=read_only(np.array(times)),
        radii=radii,
        masses=masses,
        kinetic_energy=read_only(kinetic),
        potential_energy=read_only(potential),
        **stacked,
    )


def _of_all(values: Array, rows: NDArray[np.int64], count: int) -> Array:
    """Returns the values of all grains by their number, NaN for those that are not there."""
    if len(values) == count:
        return values
    found = np.full((count, values.shape[1]), np.nan)
    found[rows] = values
    return found
