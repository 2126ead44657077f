"""A pour while it goes on, for those who look into it on the way."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from granulcal import _native
from granulcal.pours.contacts import Contacts
from granulcal.pours.pour import Pour
from granulcal.pours.scene import Scene, require_scene
from granulcal.real import check_real
from granulcal.whole import check_seed, check_whole

__all__ = ["Simulation"]

Array = NDArray[np.float64]


class Simulation:
    """A pour that goes on as far as it is told to; `simulate` is for one that is of use at its end.

    What it shows is of the present time, each array a copy of its own. Where one stops on the way
    changes no bit of the pour. While one thread simulates, another that asks it for anything gets a
    RuntimeError.

    Velocities are those of the middle of the last substep, v(t - dt / 2): grains that are let go at
    time 0 rest at -dt / 2. The kinetic energy is that at the time of the positions.

    Args:
        scene: what is poured.
        seed: seed of the start's jitter and of the camera's noise.
        threads: threads that share this pour; the bits stay the same.

    Raises:
        TypeError: `scene` is no scene.
        ValueError: a number is out of its range, the grains do not fit, or more memory is needed
            than there is.

    Examples:
        >>> simulation = Simulation(Scene.drop(0.02, count=20), seed=1)
        >>> while simulation.status is None:
        ...     simulation.advance(0.1)
        ...     highest = simulation.positions[:, 2].max()
        >>> simulation.status, len(simulation.contacts()) >= 20
        ('at_rest', True)
    """

    def __init__(self, scene: Scene, seed: int = 0, *, threads: int = 1) -> None:
        require_scene(scene)
        check_seed(seed)
        check_whole("threads", threads, at_least=1)
        self.scene = scene
        """What is poured."""
        self.seed = seed
        """Seed of the pour."""
        self.native = _native.Simulation(scene.native, seed, threads)
        """The simulation as the Rust side holds it."""

    def advance(self, seconds: float) -> None:
        """Simulates `seconds`, rounded to whole substeps, or less if the pour ends before.

        Other Python threads run meanwhile. Ctrl-C stops it between two substeps; it can go on from
        there.

        Raises:
            TypeError: no number.
            ValueError: NaN, below 0, or less than half a substep but 0, which a loop would repeat
                without an end.
        """
        check_real("seconds", seconds)
        if not seconds >= 0.0:
            raise ValueError(f"seconds must be at least 0, got {seconds:g}")
        if 0.0 < seconds < 0.5 * self.substep:
            raise ValueError(
                f"seconds must be 0 or at least half a substep of {self.substep:g} s, for it is "
                f"rounded to whole ones; got {seconds:g}"
            )
        self.native.advance_to(self.time + float(seconds))

    def advance_to(self, time: float) -> None:
        """Simulates to the substep that ends nearest to `time` [s], at most to the pour's end.

        In a loop over times of frames nothing adds up, as it does where `advance` rounds each time.
        A time that is past already simulates nothing.

        Raises:
            TypeError: no number.
            ValueError: NaN.
        """
        check_real("time", time)
        if np.isnan(time):
            raise ValueError("time must be a number of seconds, got nan")
        self.native.advance_to(float(time))

    def frames(self, every: float) -> Iterator[Simulation]:
        """Goes on to the end, and yields itself now, after every so many seconds and at the end.

        Args:
            every: simulated time between two frames [s], a substep at least.

        Raises:
            TypeError: `every` is no number.
            ValueError: it is less than a substep.

        Examples:
            >>> simulation = Simulation(Scene.drop(0.02, count=20), seed=1)
            >>> heights = [now.positions[:, 2].mean() for now in simulation.frames(every=0.05)]
            >>> bool(heights[0] > heights[-1])
            True
        """
        check_real("every", every)
        # Rounding takes a part of a substep that is meant as one.
        if not every >= self.substep * (1.0 - 1e-9):
            raise ValueError(f"every must be at least a substep, {self.substep:g} s, got {every:g}")
        return self._frames(float(every))

    def _frames(self, every: float) -> Iterator[Simulation]:
        begin = self.time
        for frame in itertools.count(1):
            yield self
            if self.status is not None:
                return
            # From the frame's own time: rounding to substeps must not add up.
            self.native.advance_to(begin + frame * every)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.native.time

    @property
    def substep(self) -> float:
        """Length of a substep [s]."""
        return self.native.substep

    @property
    def status(self) -> str | None:
        """How the pour ended, in the words of `Pour.status`; None while it goes on."""
        return self.native.status

    @property
    def numbers(self) -> NDArray[np.int64]:
        """Number at the start of the grain in each row of the arrays, shape (n,).

        Those that have left the scene have no row.
        """
        return self.native.numbers

    @property
    def positions(self) -> Array:
        """Centres of the grains in the scene [m], shape (n, 3); of clumps, of their spheres."""
        return self.native.positions

    @property
    def velocities(self) -> Array:
        """Velocities [m/s], shape (n, 3)."""
        return self.native.velocities

    @property
    def angular_velocities(self) -> Array:
        """Angular velocities [rad/s], shape (n, 3)."""
        return self.native.angular_velocities

    @property
    def orientations(self) -> Array:
        """Turns of grains with a shape as `Pour.orientations`, shape (n, 4); else (0, 4)."""
        return self.native.orientations

    @property
    def radii(self) -> Array:
        """Radii [m], shape (n,)."""
        return self.native.radii

    @property
    def masses(self) -> Array:
        """Masses [kg], shape (n,)."""
        return self.native.masses

    @property
    def kinetic_energy(self) -> float:
        """Of all grains, of translation and rotation [J].

        Each is taken to have fallen freely for the last half substep: one that rests has
        m (g dt)^2 / 8, 3e-6 J/kg with the preset `default`. `status` tells rest.
        """
        return self.native.energy[0]

    @property
    def potential_energy(self) -> float:
        """Of all grains, above the scene's origin, and of what bonds and layers hold [J].

        What pulls (`effects.capillary`, `effects.adhesion`) and `effects.liquid` hold is no part of
        it. In a fluid (`effects.fluid`) it is less its lift, and the fluid that moves with the
        grains counts as theirs. Grains that have left the scene count where they left it.
        """
        return self.native.energy[1]

    def contacts(self) -> Contacts:
        """Returns the lasting contacts of the last substep; none before the first.

        Raises:
            ValueError: the grains have a shape, whose impulses are not kept.
        """
        return Contacts.of(self.native.contacts())

    def pour(self) -> Pour:
        """Returns the present state as a pour, `horizon` its status if it has not ended."""
        return Pour(self.native.pour(), self.scene, self.seed)

    def __reduce__(self) -> NoReturn:
        raise TypeError(
            "a Simulation stays in its process: hand over its arrays, or the scene and the seed, "
            "which make it again"
        )

    def __repr__(self) -> str:
        told = self.status or "goes on"
        return f"Simulation({self.scene.name!r}, {self.time:.4g} s, {told})"
