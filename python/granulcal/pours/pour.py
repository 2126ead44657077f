"""The outcome of one pour: grains at its end, and what the camera sees of them."""

from __future__ import annotations

from functools import cached_property
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from granulcal import _native
from granulcal.arrays import read_only
from granulcal.pours.contacts import Contacts
from granulcal.pours.scene import Scene
from granulcal.pours.statistics import DiagnosticStatistics, ObservedStatistics, Statistics
from granulcal.pours.trajectory import Trajectory

__all__ = ["Pour"]

Array = NDArray[np.float64]


class Pour:
    """Grains at the end of a pour, how it ended and how far it can be trusted.

    Its arrays are read-only: copy one to change it.

    Examples:
        >>> import granulcal as gc
        >>> pour = gc.simulate(gc.Scene.drop(0.02, count=20), seed=1)
        >>> pour.positions.shape, pour.status
        ((20, 3), 'at_rest')
    """

    def __init__(
        self,
        native: _native.Pour,
        scene: Scene,
        seed: int,
        trajectory: Trajectory | None = None,
    ) -> None:
        self._native = native
        self._trajectory = trajectory
        self.scene = scene
        """The scene, with the material and the preset that were simulated."""
        self.seed = seed
        """Seed of the grains' start and of the camera's noise."""

    @cached_property
    def positions(self) -> Array:
        """Centres of the grains [m], ground at z = 0, shape (n, 3): of those in the scene.

        Grains that are clumps (`effects.clump`) have a row for each sphere, of one grain after the
        other; so have velocities and radii.
        """
        return read_only(self._native.positions)

    @cached_property
    def velocities(self) -> Array:
        """Velocities of the grains [m/s], shape (n, 3)."""
        return read_only(self._native.velocities)

    @cached_property
    def angular_velocities(self) -> Array:
        """Angular velocities of the grains [rad/s], shape (n, 3)."""
        return read_only(self._native.angular_velocities)

    @cached_property
    def orientations(self) -> Array:
        """Turns of grains with a shape, quaternions i, j, k, w, shape (n, 4); else (0, 4).

        From the body's axes, about its centre of mass, to the scene's: those of a box are along its
        edges, a cylinder's axis is y, a superquadric and a hull have their principal axes.
        `Scene.body_vertices` has the body in them, `vertices` in the scene. SciPy's
        `Rotation.from_quat` takes this order.
        """
        return read_only(self._native.orientations)

    @cached_property
    def radii(self) -> Array:
        """Radii [m], shape (n,), of clumps those of spheres; of a shape half the diameter."""
        return read_only(self._native.radii)

    @cached_property
    def masses(self) -> Array:
        """Masses of the grains [kg], shape (n,), of clumps those of spheres."""
        return read_only(self._native.masses)

    @cached_property
    def contacts(self) -> Contacts:
        """The lasting contacts of the last substep, and what they carry [N].

        Raises:
            ValueError: the grains have a shape, whose impulses are not kept, or another simulator
                has poured.
        """
        return Contacts.of(self._native.contacts())

    @property
    def trajectory(self) -> Trajectory:
        """What happened over time.

        Raises:
            ValueError: `simulate` was not asked for frames.
        """
        if self._trajectory is None:
            raise ValueError("this pour has no frames: ask for them, simulate(scene, every=0.02)")
        return self._trajectory

    @cached_property
    def radii_out(self) -> Array:
        """Radii of the grains that have left through the scene's outflow [m], shape (m,)."""
        return read_only(self._native.radii_out)

    @property
    def status(self) -> str:
        """How it ended: `at_rest`, `out_of_view`, `ran_out`, `jammed`, `horizon`, `unhealthy`."""
        return self._native.status

    @property
    def grains_in_funnel(self) -> int:
        """Grains whose centre is in the funnel at the end; 0 where the scene has none."""
        return self._native.grains_in_funnel

    @property
    def state_hash(self) -> str:
        """Hash of every bit of the final state, 32 hexadecimal digits: equal for equal pours."""
        return self._native.state_hash

    @cached_property
    def health(self) -> dict[str, float]:
        """Penetration [radii], residuals [-], energy created [-], grains lost, work done."""
        return self._native.health

    @property
    def simulated_s(self) -> float:
        """Simulated time [s]."""
        return self._native.simulated_s

    @property
    def cpu_seconds(self) -> float:
        """Processor time of the simulation [s]."""
        return self._native.cpu_seconds

    def vertices(self, on_rim: int = 64) -> Array:
        """Returns where the points of `Scene.body_vertices` are at the end [m], shape (n, k, 3).

        (0, 0, 3) if the grains are round or clumps.

        Args:
            on_rim: points on each rim of a cylinder.

        Raises:
            TypeError: `on_rim` is no whole number.
            ValueError: it is below 3 or above 100,000.
        """
        body = self.scene.body_vertices(on_rim)
        if len(self.orientations) == 0:
            return np.zeros((0, 0, 3))
        axis, w = self.orientations[:, None, :3], self.orientations[:, None, 3:]
        across = np.cross(axis, body[None])
        turned = body[None] + 2.0 * (w * across + np.cross(axis, across))
        return self.positions[:, None] + turned

    def depth_image(self, field_width: float | None = None) -> NDArray[np.float32]:
        """Returns what the scene's pinhole camera sees: depth [m], 0 is no data, shape (h, w).

        Args:
            field_width: ground that its image shows in place of the scene's [m]: another lens.

        Raises:
            ValueError: the scene's camera is orthographic; it delivers `height_map`.
        """
        image = self._seen(field_width).depth
        if image is None:
            raise ValueError("the scene's camera is orthographic: ask for height_map()")
        return image

    def look_from(self, view: str) -> NDArray[np.float32]:
        """Returns what one of the scene's further views sees: depth [m], shape (h, w).

        0 is no data, and the image is without noise.

        Args:
            view: its name in the scene (table `views`).

        Raises:
            KeyError: the scene has no view of this name.
        """
        image = self._native.look_from(view)
        if image is None:
            raise KeyError(f"this scene has no view {view!r}; views stand in its table `views`")
        return image

    def height_map(self, field_width: float | None = None) -> Array:
        """Returns what the scene's orthographic camera sees: heights [m], shape (h, w).

        Args:
            field_width: ground that the map shows in place of the scene's [m].

        Raises:
            ValueError: the scene's camera is a pinhole; it delivers `depth_image`.
        """
        heights = self._seen(field_width).heights
        if heights is None:
            raise ValueError("the scene's camera is a pinhole: ask for depth_image()")
        return heights

    def points(self) -> Array:
        """Returns the points of the image that were taken for grains [m], shape (k, 3).

        Empty if no grain is in view.
        """
        return self._observation.points

    def statistics(self) -> Statistics:
        """Returns the statistics of the image, the simulated half of every comparison.

        Raises:
            ValueError: too few grains are in view.
        """
        return Statistics(self._observation.statistics())

    def diagnostic_statistics(self) -> DiagnosticStatistics:
        """Returns the diagnostic statistics of the image, about the scene's vertical axis.

        Isolated grains are seen only by pixels finer than a grain: `camera.downsample` decides.

        Raises:
            ValueError: too few grains are in view.
        """
        return DiagnosticStatistics(self._observation.diagnostics())

    def observed(self) -> ObservedStatistics:
        """Returns the statistics that the scene observes; there are none if it observes nothing."""
        return ObservedStatistics(self._native.observed, self.scene.observed_names)

    def series(self, name: str) -> tuple[Array, Array]:
        """Returns times after the begin of the observation [s] and the samples of what is observed.

        Args:
            name: `front_radius` or `liquid_radius` [m], `discharged` [%], `surface_slope` [deg] or
                the height of the surface at a stated x, `surface_z[0.01]` [m].

        Raises:
            KeyError: the scene does not observe it.
        """
        all_series = self._native.series
        if name not in all_series:
            known = ", ".join(all_series) or "nothing"
            raise KeyError(f"this scene has no series {name!r}; it observes {known} over time")
        return all_series[name]

    @cached_property
    def _observation(self) -> _native.Observation:
        return self._native.observe()

    def _seen(self, field_width: float | None) -> _native.Observation:
        return self._observation if field_width is None else self._native.observe(field_width)

    def _repr_html_(self) -> str:
        from granulcal.html import page, picture, seen_from_above

        rows = {"status": self.status, "what": self._told_count}
        rows |= {"simulated": f"{self.simulated_s:.2f} s", "seed": self.seed}
        view = self._observation
        label = "z [m]" if view.depth is None else "depth [m]"
        image = view.heights if view.depth is None else view.depth
        drawn = "" if image is None else picture(seen_from_above(image, label))
        return page(f"Pour of {self.scene.name}", rows, drawn)

    @property
    def _told_count(self) -> str:
        spheres = len(self.radii)
        if self.scene.get("effects.clump.aspect") <= 1.0:
            return f"{spheres} grains"
        return (
            f"{spheres} spheres of {spheres // int(self.scene.get('effects.clump.spheres'))} grains"
        )

    def __reduce__(self) -> NoReturn:
        raise TypeError(
            "a Pour stays in its process: hand over its arrays and statistics(), or the "
            "scene and the seed, which make it again"
        )

    def __repr__(self) -> str:
        return f"Pour({self._told_count}, {self.status}, {self.simulated_s:.2f} s)"
