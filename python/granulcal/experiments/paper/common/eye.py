"""The scene's camera with errors of observation, several of them on one pour.

Grains are told from the ground as by colour, as the paper does on velvet: a pixel is grain where
the undisturbed image shows a grain, whatever the disturbed depth says.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.effects.image_faults import blurred
from granulcal.pours.camera import Camera
from granulcal.pours.scene import Scene
from granulcal.pours.simulate import Pour
from granulcal.pours.statistics import NAMES, statistics

__all__ = ["BARE", "SENSOR", "Disturbance", "Eye", "View"]

Array = NDArray[np.float64]

SENSOR = Path(__file__).parent.parent / "d435.toml"
"""A RealSense D435 as `granulcal reproduce sensor` fits it to measured frames of boards."""

BARE = 1e-6
"""Height from which a pixel of the undisturbed image shows a grain: rounding of a depth [m]."""


@dataclass(frozen=True, kw_only=True)
class Disturbance:
    """Errors of one observation; all zero is none.

    Attributes:
        blur: Gaussian blur of the down-sampled image, standard deviation [px].
        fine_blur: the same before down-sampling [px].
        depth_noise: Gaussian noise of each pixel's depth, standard deviation [m].
        is_d435: whether the image is that of the measured sensor.
    """

    blur: float = 0.0
    fine_blur: float = 0.0
    depth_noise: float = 0.0
    is_d435: bool = False


@dataclass(frozen=True)
class Eye:
    """The camera of a scene at its full resolution.

    Attributes:
        height: above the ground [m].
        field_width: of the ground in view [m].
        pixels: along a side, before down-sampling.
        step: pixels that become one.
    """

    height: float
    field_width: float
    pixels: int
    step: int

    @classmethod
    def of(cls, scene: Scene) -> "Eye":
        """Returns the camera of a scene."""
        camera = scene.to_dict()["camera"]
        return cls(
            camera["height"],
            camera["field_width"],
            int(camera["pixels"]),
            int(camera["downsample"]),
        )

    @cached_property
    def camera(self) -> Camera:
        """The camera, which looks straight down."""
        return Camera.overhead(height=self.height, field_width=self.field_width, pixels=self.pixels)

    def at(self, positions: Array, radii: Array, seed: int) -> "View":
        """Returns the view of grains.

        Args:
            positions: their centres [m], shape (n, 3).
            radii: theirs [m], shape (n,).
            seed: of what is random in a disturbed image.
        """
        clean = self.small(self.camera.render(positions, radii))
        return View(self, positions, radii, seed, clean)

    def look(
        self, disturbances: "Mapping[str, Disturbance | Callable[[int], Disturbance]]"
    ) -> tuple[tuple[str, ...], Callable[[Pour], Array]]:
        """Returns names and function for `Workshop.poured`: the 16 statistics of each image.

        Args:
            disturbances: of each image by its name, or a function of the pour's seed.
        """
        names = tuple(f"{name}/{statistic}" for name in disturbances for statistic in NAMES)

        def seen(pour: Pour) -> Array:
            view = self.at(pour.positions, pour.radii, pour.seed)
            wanted = [d(pour.seed) if callable(d) else d for d in disturbances.values()]
            return np.concatenate([view.statistics(each) for each in wanted])

        return names, seen

    def small(self, depth: NDArray[np.float32]) -> Array:
        """Returns the heights of the pixels that survive down-sampling [m], NaN is no data."""
        kept = depth[self.step // 2 :: self.step, self.step // 2 :: self.step].astype(float)
        count = self.pixels // self.step
        kept = kept[:count, :count]
        return np.where(kept > 0, self.height - kept, np.nan)

    def points(self, z: Array, is_grain: NDArray[np.bool_]) -> Array:
        """Returns the points of the pixels that are grain [m], shape (n, 3)."""
        # The pixel that survives lies half a pixel beyond the middle of its block.
        at = self.step // 2 + self.step * np.arange(len(z)) + 0.5 - 0.5 * self.pixels
        ground = at * self.field_width / self.pixels
        nearer = 1 - z / self.height
        x, y = ground[None, :] * nearer, -ground[:, None] * nearer
        kept = is_grain & np.isfinite(z)
        return np.stack([x[kept], y[kept], z[kept]], axis=1)


@dataclass(frozen=True, eq=False)
class View:
    """Grains seen by an eye.

    Attributes:
        eye: the camera.
        positions: centres of the grains [m], shape (n, 3).
        radii: theirs [m], shape (n,).
        seed: of what is random in a disturbed image.
        clean: heights without any error [m], shape (h, w).
    """

    eye: Eye
    positions: Array
    radii: Array
    seed: int
    clean: Array

    def heights(self, disturbance: Disturbance) -> Array:
        """Returns the heights of the disturbed image [m], NaN is no data, shape (h, w)."""
        z = self.clean
        if disturbance.fine_blur > 0 or disturbance.is_d435:
            image = self.eye.camera.render(
                self.positions,
                self.radii,
                blur_px=disturbance.fine_blur,
                sensor=SENSOR if disturbance.is_d435 else None,
                seed=self.seed,
            )
            z = self.eye.small(image)
        if disturbance.blur > 0:
            z = blurred(z, disturbance.blur)
        if disturbance.depth_noise > 0:
            noise = np.random.default_rng(self.seed).standard_normal(z.shape)
            z = z + disturbance.depth_noise * noise
        return z

    def points(self, heights: Array, threshold: float = BARE) -> Array:
        """Returns the points of the pixels that show a grain [m], shape (n, 3).

        Args:
            heights: of the image whose points are wanted [m], shape (h, w).
            threshold: height in the undisturbed image from which on a pixel is grain [m].
        """
        is_grain = np.isfinite(self.clean) & (self.clean > threshold)
        return self.eye.points(heights, is_grain)

    def statistics(self, disturbance: Disturbance) -> Array:
        """Returns the 16 statistics of the disturbed image, shape (16,).

        Raises:
            ValueError: too few grains are in view.
        """
        return np.asarray(statistics(self.points(self.heights(disturbance))))
