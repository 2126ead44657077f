r"""Faults of the image and of its segmentation: operators on what a camera delivered, no pour.

With the heights z over the ground of the pixels of an image, NaN where there is no data,

- blur: $z' = G_\sigma * (w z) / G_\sigma * w$, w = 1 where there is data: a driver's smoothing;
- flying: a share f of the pixels at depth edges reads $z' = a z_\max + (1 - a) z_\min$ of the 3 x 3
  around it, $a \sim U(0, 1)$: pixels that see both sides of an edge, and that segmentation leaves;
- lost: a body no larger than a grain that touches nothing is taken for ground with probability p;
- offset: $z' = z + o$ of the pixels that are grain: their heights are told from another plane than
  the ground on which they lie (the pile of velvet), and so is whether they are above the threshold;
- missing: a share f of the pixels has no data, each by itself;
- aside: $x' = x - o$, or y, of the pixels' points: the camera stands beside the pour's axis;
- lens: $x' = (1 + s) x$, y as well: the focal length is longer by s than the stated one, so that
  the camera sees as much less of the ground; depths are right. It acts first, on a pour seen anew.

They act in this order; a pixel of z above the scene's threshold is grain. What they stand for and
their prior ranges: docs/theory/loop.md.

Reference:
    Knutsson and Westin, Normalized convolution, CVPR 1993 (blur with missing pixels).
    Foix, Alenya and Torras, Lock-in time-of-flight cameras: a survey, IEEE Sensors J. 11, 2011
    (flying pixels are mixtures of both sides of an edge).
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from granulcal.errors import ObservationError
from granulcal.loop.effects.connected import bodies
from granulcal.pours.scene import Scene
from granulcal.pours.simulate import Pour

__all__ = ["KINDS", "Frame", "blurred", "flying", "lost", "require_image"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_OF_IMAGE = ("blur", "flying", "lost", "offset", "aside_x", "aside_y", "missing")
# Each has a stream of random numbers by its place: new ones stand at the end.
KINDS = (*_OF_IMAGE, "lens")
"""What an effect of the image may be, in the order in which they act; the lens acts first."""

# The kernel is cut where 6e-5 of its weight is left.
_TRUNCATE = 4.0
# A depth edge: a step between neighbouring pixels above this many grain diameters.
_EDGE = 0.25
# As the statistic `isolated_grains` counts: steps within a body in spacings of pixels, and the
# diameter of the circle that holds a grain, in grain diameters.
_REACH, _GRAIN_CIRCLE = 1.5, 1.5


@dataclass(frozen=True)
class Frame:
    """An image of a pour: heights of its pixels, and how the camera stands.

    Attributes:
        z: heights over the ground [m], NaN is no data, shape (h, w).
        spacing: width of a pixel on the ground [m].
        eye: height of the pinhole camera [m]; infinite for a height map.
        threshold: height above which a pixel is grain [m].
        diameter: diameter of a grain, as the scene states it [m].
        lift: what is added to the heights of grains [m].
        aside: where the camera stands from the pour's axis, x and y [m].
    """

    z: Array
    spacing: float
    eye: float
    threshold: float
    diameter: float
    lift: float = 0.0
    aside: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def of(cls, pour: Pour, lens: float = 0.0) -> "Frame":
        """Returns what the scene's camera delivered of a pour, its noise included.

        Args:
            pour: what it saw.
            lens: share by which its focal length was longer than that by which the image is read.
        """
        scene = pour.scene
        camera = scene.to_dict()["camera"]
        width = None if lens == 0 else camera["field_width"] / (1 + lens)
        if camera["projection"] == "pinhole":
            depth = pour.depth_image(width).astype(np.float64)
            eye = float(camera["height"])
            z = np.where(depth > 0, eye - depth, np.nan)
        else:
            eye, z = np.inf, pour.height_map(width)
        diameter = scene.get("grains.diameter")
        return cls(z, scene.ground_resolution, eye, float(camera["height_threshold"]), diameter)

    @property
    def is_grain(self) -> Mask:
        """Which pixels are taken for grains, shape (h, w)."""
        return np.isfinite(self.z) & (self.z > self.threshold)

    def ground(self) -> tuple[Array, Array]:
        """Returns x and y of the pixels' points [m], the pour's axis at 0, each (h, w)."""
        height, width = self.z.shape
        x = (np.arange(width) + 0.5 - width / 2) * self.spacing
        # A camera's image up is world +y; the rows of a height map go up with y.
        up = 1.0 if np.isinf(self.eye) else -1.0
        y = up * (np.arange(height) + 0.5 - height / 2) * self.spacing
        nearer = 1.0 - self.z / self.eye
        return x * nearer, y[:, None] * nearer

    def points(self) -> Array:
        """Returns the points of the pixels that are taken for grains [m], shape (n, 3)."""
        x, y = self.ground()
        lifted = self.z + self.lift
        # Whoever reads the recording knows the lifted heights alone.
        kept = self.is_grain & (lifted > self.threshold)
        aside_x, aside_y = self.aside
        return np.stack([x[kept] - aside_x, y[kept] - aside_y, lifted[kept]], axis=1)

    @classmethod
    def with_faults(cls, pour: Pour, faults: Mapping[str, float], seed: int) -> "Frame":
        """Returns the image of a pour with the faults of `faults`, by kind."""
        return cls.of(pour, faults.get("lens", 0.0)).with_(faults, seed)

    def with_(self, faults: Mapping[str, float], seed: int) -> "Frame":
        """Returns the image with the faults of `faults`, by kind; `seed` is of what is random.

        A lens is none of an image: see `with_faults`.
        """
        frame = self
        for number, kind in enumerate(_OF_IMAGE):
            value = faults.get(kind, 0.0)
            if value == 0:
                continue
            generator = np.random.default_rng([seed, number])
            if kind == "offset":
                frame = replace(frame, lift=value)
                continue
            if kind in ("aside_x", "aside_y"):
                x, y = frame.aside
                aside = (value, y) if kind == "aside_x" else (x, value)
                frame = replace(frame, aside=aside)
                continue
            z = frame.z
            if kind == "blur":
                z = frame._blurred(value)
            elif kind == "missing":
                z = np.where(generator.random(z.shape) < value, np.nan, z)
            elif kind == "flying":
                z = flying(z, value, _EDGE * frame.diameter, generator)
            else:
                x, y = frame.ground()
                reach, size = _REACH * frame.spacing, 0.5 * _GRAIN_CIRCLE * frame.diameter
                gone = lost(x, y, frame.is_grain, reach, size, value, generator)
                z = np.where(gone, np.minimum(z, frame.threshold), z)
            frame = replace(frame, z=z)
        return frame

    def _blurred(self, sigma: float) -> Array:
        """The blurred heights; far from any grain they are the ground's and stay as they are."""
        z = self.z.copy()
        rows, columns = np.nonzero(np.isfinite(z) & (z > 0.5 * self.threshold))
        if len(rows) == 0:
            return z
        margin = 2 * round(_TRUNCATE * sigma) + 1
        box = tuple(
            slice(max(int(i.min()) - margin, 0), int(i.max()) + margin + 1) for i in (rows, columns)
        )
        z[box] = blurred(z[box], sigma)
        return z


def blurred(z: Array, sigma: float) -> Array:
    """Returns z (h, w) smoothed by a Gaussian of `sigma` [px]; missing pixels count for nothing."""
    reach = max(round(_TRUNCATE * sigma), 1)
    taps = np.exp(-0.5 * (np.arange(reach + 1) / sigma) ** 2)
    known = np.isfinite(z)
    total, weight = np.where(known, z, 0.0), known.astype(np.float64)
    for axis in (0, 1):
        total, weight = _convolved(total, taps, axis), _convolved(weight, taps, axis)
    return np.where(known, total / np.where(known, weight, 1.0), np.nan)


def flying(z: Array, share: float, step: float, generator: np.random.Generator) -> Array:
    """Returns z (h, w) in which a share of the pixels at steps above `step` [m] mix both sides."""
    high, low = _around(z, -np.inf, np.maximum), _around(z, np.inf, np.minimum)
    rise = np.where(np.isfinite(z), high, 0.0) - np.where(np.isfinite(z), low, 0.0)
    chosen = (rise > step) & (generator.random(z.shape) < share)
    mixed = np.where(chosen, low, 0.0) + generator.random(z.shape) * rise
    return np.where(chosen, mixed, z)


def lost(
    x: Array,
    y: Array,
    is_grain: Mask,
    reach: float,
    size: float,
    share: float,
    generator: np.random.Generator,
) -> Mask:
    """Returns which pixels belong to lone grains that a segmentation loses, shape (h, w).

    Args:
        x: of the pixels' points [m], shape (h, w).
        y: the same.
        is_grain: pixels that are grain.
        reach: longest step within a body [m].
        size: radius of the circle about its centroid that holds a lone grain [m].
        share: probability that one is lost.
        generator: of the draws.
    """
    label = bodies(x, y, is_grain, reach)
    px, py = x[is_grain], y[is_grain]
    _, body = np.unique(label, return_inverse=True)
    count = np.bincount(body)
    middle_x, middle_y = (np.bincount(body, p) / count for p in (px, py))
    far = np.zeros(len(count))
    np.maximum.at(far, body, np.hypot(px - middle_x[body], py - middle_y[body]))
    gone = (far <= size) & (generator.random(len(count)) < share)
    found = np.zeros(is_grain.shape, dtype=bool)
    found[is_grain] = gone[body]
    return found


def require_image(scene: Scene, effects: Iterable[str]) -> None:
    """Refuses effects of the image, by name, for a scene that has no image to read again.

    Raises:
        ObservationError: the scene observes statistics of its own, or tells grains by colour.
    """
    names = ", ".join(effects)
    if not names:
        return
    if scene.observed_names:
        raise ObservationError(
            f"{names}: effects of the image do not apply to a scene that observes statistics of "
            f"its own ({', '.join(scene.observed_names)}); name other effects"
        )
    if scene.to_dict()["camera"].get("mask") == "colour":
        raise ObservationError(
            f"{names}: effects of the image need a camera that tells grains by height "
            '(camera.mask = "height"); name other effects'
        )


def _convolved(values: Array, taps: Array, axis: int) -> Array:
    """Sums of neighbours along an axis, weighted by their distance; nothing is outside."""
    moved = np.moveaxis(values, axis, 0)
    out = taps[0] * moved
    for distance in range(1, min(len(taps), len(moved))):
        out[distance:] += taps[distance] * moved[:-distance]
        out[:-distance] += taps[distance] * moved[distance:]
    return np.moveaxis(out, 0, axis)


def _around(z: Array, missing: float, of: np.ufunc) -> Array:
    """Largest or smallest of the 3 x 3 pixels around each, those without data left out."""
    padded = np.pad(np.where(np.isfinite(z), z, missing), 1, constant_values=missing)
    rows = of(of(padded[:-2], padded[1:-1]), padded[2:])
    return of(of(rows[:, :-2], rows[:, 1:-1]), rows[:, 2:])
