"""Time-averaged pictures of a drum against a light: dark is grain, light is air."""

import math
from dataclasses import dataclass
from os import PathLike

import numpy as np
from numpy.typing import NDArray

from granulcal.measured.names import observed_of, value_at
from granulcal.pours.scene import Scene
from granulcal.pours.statistics import ObservedStatistics

__all__ = ["DrumImage"]

Array = NDArray[np.float64]

# The drum's rim is a dark line about two pixels wide; it is left out.
_RIM_PIXELS = 3
# Grey values of grains and of air: these percentiles of the drum, whatever surrounds it.
_DARK_PERCENTILE, _LIGHT_PERCENTILE = 5.0, 75.0
# Columns of the slope's line over its width, as in a simulated profile.
_SLOPE_COLUMNS = 41
# Modes of Pillow that keep more than eight bits of grey, which its conversion would cut off.
_DEEP = ("I;16", "I;16L", "I;16B", "I;16N", "I")
# Share by which a picture may be off a square, and its width off the scene's drum.
_OFF = 0.02


@dataclass(frozen=True, kw_only=True, eq=False)
class DrumImage:
    """The mean of many pictures along a drum's axis; the drum fills the picture.

    A pixel that is half as light as air was hidden for half of the time. The free surface is where,
    from above, pixels first are as dark as that: the definition of the simulated `surface_z`.

    Attributes:
        grey: grey values, the first row on top, shape (h, w).
        width: width of the picture, the drum's inner diameter [m].
    """

    grey: Array
    width: float

    @classmethod
    def open(cls, path: str | PathLike[str], *, width: float) -> "DrumImage":
        """Returns the picture in a BMP or PNG file; colours become grey.

        Args:
            path: the file.
            width: width of the picture, the drum's inner diameter [m].

        Raises:
            FileNotFoundError: there is no such file.
            ValueError: it is no picture, is not square, has no contrast or numbers that are no
                grey values, or the width is not positive.
            ModuleNotFoundError: Pillow, which comes with `granulcal[plot]`, is not installed.
        """
        from PIL import Image, UnidentifiedImageError

        if not (np.isfinite(width) and width > 0.0):
            raise ValueError(f"width must be positive and finite [m], got {width}")
        try:
            with Image.open(path) as image:
                if image.mode == "F":
                    raise ValueError(f"{path} must have 8 or 16 bits of grey, got fractions")
                whole = image if image.mode in _DEEP else image.convert("L")
                grey = np.asarray(whole, dtype=np.float64)
        except UnidentifiedImageError:
            raise ValueError(f"{path} is no picture that can be read") from None
        rows, columns = grey.shape
        if abs(rows - columns) > _OFF * columns:
            raise ValueError(
                f"{path} must be square, for the drum fills it: got {columns}x{rows} pixels"
            )
        made = cls(grey=grey, width=width)
        dark, light = made._levels()
        if light - dark < 1.0:
            raise ValueError(f"{path} shows no grains: its grey values are {dark} to {light}")
        return made

    def _levels(self) -> tuple[float, float]:
        rows, columns = self.grey.shape
        y, x = np.ogrid[:rows, :columns]
        off = np.hypot(y + 0.5 - 0.5 * rows, x + 0.5 - 0.5 * columns)
        drum = self.grey[off < 0.5 * columns - _RIM_PIXELS]
        dark, light = np.percentile(drum, (_DARK_PERCENTILE, _LIGHT_PERCENTILE))
        return float(dark), float(light)

    def surface(self, level: float = 0.5) -> tuple[Array, Array]:
        """Returns x and height z of the free surface from the drum's centre [m], a column each.

        NaN where the surface is not in the drum.

        Args:
            level: share of the time for which a point below the surface is hidden, in (0, 1).
        """
        height, width = self.grey.shape
        pixel = self.width / width
        dark, light = self._levels()
        hidden = (light - self.grey) / (light - dark)
        x = (np.arange(width) + 0.5) * pixel - 0.5 * self.width
        z = (0.5 * height - (np.arange(height) + 0.5)) * pixel
        radius = 0.5 * self.width - _RIM_PIXELS * pixel
        surface = np.full(width, np.nan)
        for column in np.flatnonzero(np.abs(x) < radius):
            inside = np.flatnonzero(np.abs(z) < np.sqrt(radius**2 - x[column] ** 2))
            shares = hidden[inside, column]
            dark_rows = np.flatnonzero(shares >= level)
            if len(dark_rows) == 0 or dark_rows[0] == 0:
                continue
            below = dark_rows[0]
            beyond = (shares[below] - level) / (shares[below] - shares[below - 1])
            surface[column] = z[inside[below]] + beyond * pixel
        return x, surface

    def observed(self, scene: Scene) -> ObservedStatistics:
        """Returns the measured `surface_z[x]` of the scene's x and the `surface_slope`.

        Raises:
            ValueError: the scene observes no surface, or its drum is not as wide as the picture.
        """
        if not any(name == "surface_slope" for name in scene.observed_names):
            return observed_of(scene, {"surface_z": lambda _: np.nan}, "a drum's picture")
        drums = _drums(scene)
        if drums and all(abs(self.width - drum) > _OFF * drum for drum in drums):
            raise ValueError(
                f"width must be the inner diameter of the scene's drum, "
                f"{' or '.join(f'{drum:g}' for drum in drums)} m, got {self.width:g} m"
            )
        x, z = self.surface(scene.get("observe.surface.level"))
        within = scene.get("observe.surface.slope_within")

        def slope(_: str | None) -> float:
            columns = np.linspace(-within, within, _SLOPE_COLUMNS)
            heights = [value_at(x, z, at) for at in columns]
            if not np.isfinite(heights).all():
                return float("nan")
            return -float(np.degrees(np.arctan(np.polyfit(columns, heights, 1)[0])))

        kinds = {
            "surface_z": lambda at: value_at(x, z, float(at or "nan")),
            "surface_slope": slope,
        }
        return observed_of(scene, kinds, "a drum's picture")


def _drums(scene: Scene) -> list[float]:
    """Diameters of the cylinders along y about the centre of the scene's surface [m]."""
    document = scene.to_dict()
    centre = document["observe"]["surface"]["centre"]
    found = []
    for wall in document.get("walls", []):
        shape = wall["shape"]
        if shape["kind"] != "cylinder":
            continue
        ends = ((shape[end][0], shape[end][2]) for end in ("from", "to"))
        if all(math.dist(end, centre) < _OFF * shape["radius"] for end in ends):
            found.append(2.0 * shape["radius"])
    return sorted(set(found))
