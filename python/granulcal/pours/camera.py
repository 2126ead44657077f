"""A camera that makes recordings of simulated grains, as a real one would."""

from __future__ import annotations

import tomllib
from os import PathLike
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal import _native
from granulcal.arrays import unmasked
from granulcal.documents import ENCODING, LARGEST_DOCUMENT, read_bytes
from granulcal.pours.statistics import as_points
from granulcal.real import check_finite, check_real
from granulcal.whole import check_seed, check_whole

__all__ = ["Camera"]

# A tenth of a millimetre: finer than a depth camera at this range, and 16 bits reach 6.5 m.
_DEPTH_UNIT = 1e-4
_LENS = ("width", "height", "fx", "fy", "cx", "cy")


class Camera:
    """A pinhole camera above the ground that takes depth images of grains; made by `overhead`.

    Image right is world +x, image up is world +y.
    """

    def __init__(self, native: _native.Camera, words: str = "Camera()") -> None:
        self._native = native
        self._words = words

    @classmethod
    def overhead(cls, *, height: float, field_width: float, pixels: int) -> Camera:
        """Returns a camera that looks straight down.

        Args:
            height: height above the ground [m].
            field_width: side of the square of ground in view [m].
            pixels: pixels along a side of the image.

        Raises:
            TypeError: no number.
            ValueError: a number is out of its range.
        """
        check_real("height", height)
        check_real("field_width", field_width)
        check_whole("pixels", pixels, at_least=1)
        made = _native.Camera.overhead(height, field_width, pixels)
        told = f"height={height:g}, field_width={field_width:g}, pixels={pixels}"
        return cls(made, f"Camera.overhead({told})")

    @classmethod
    def load(cls, path: str | PathLike[str], *, height: float) -> Camera:
        """Returns the camera whose lens stands in a TOML, looking straight down.

        Args:
            path: TOML with width, height, fx, fy, cx and cy, as `Recording.open` takes it.
            height: height above the ground [m].

        Raises:
            FileNotFoundError: there is no such file.
            ValueError: it is no file of TOML, lacks a number of the lens, or one is out of its
                range.
        """
        check_real("height", height)
        try:
            text = read_bytes(path, most=LARGEST_DOCUMENT).decode(ENCODING)
            table = tomllib.loads(text)
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise ValueError(f"{path}: not valid TOML: {error}") from None
        missing = [name for name in _LENS if name not in table]
        if missing:
            raise ValueError(f"{path} must have {', '.join(_LENS)}; it lacks {', '.join(missing)}")
        columns, rows, *rest = (table[name] for name in _LENS)
        fx, fy, cx, cy = map(float, rest)
        made = _native.Camera.above(height, (columns, rows, fx, fy, cx, cy))
        return cls(made, f"Camera.load({str(path)!r}, height={height:g})")

    def tilted(self, *, x_deg: float = 0.0, y_deg: float = 0.0) -> Camera:
        """Returns the camera turned about its own x axis, then its own y axis [deg].

        Raises:
            TypeError: an angle is no number.
            ValueError: it is not finite.
        """
        check_finite("x_deg", x_deg)
        check_finite("y_deg", y_deg)
        tilted = self._native.tilted(float(np.radians(x_deg)), float(np.radians(y_deg)))
        return Camera(tilted, f"{self._words}.tilted(x_deg={x_deg:g}, y_deg={y_deg:g})")

    def __repr__(self) -> str:
        return self._words

    def __reduce__(self) -> NoReturn:
        raise TypeError(
            "a Camera stays in its process: make it again there, by `overhead` or `load`"
        )

    def render(
        self,
        positions: ArrayLike,
        radii: ArrayLike,
        *,
        depth_noise: float = 0.0,
        blur_px: float = 0.0,
        sensor: str | PathLike[str] | None = None,
        seed: int = 0,
    ) -> NDArray[np.float32]:
        """Returns the depth image of grains on the ground z = 0 [m], 0 is no data, shape (h, w).

        Args:
            positions: centres of the grains [m], shape (n, 3).
            radii: their radii [m], shape (n,).
            depth_noise: standard deviation of Gaussian noise of each pixel [m].
            blur_px: standard deviation of a Gaussian blur [px].
            sensor: TOML that `granulcal fit-sensor` wrote: noise, pattern, rounding and holes.
            seed: seed of the noise.

        Raises:
            TypeError: an array that does not hold real numbers, or a seed that is no whole number.
            ValueError: another shape, or a number out of its range.
        """
        check_seed(seed)
        centres, sizes = as_points("positions", positions), as_points("radii", radii)
        return self._native.render(centres, sizes, depth_noise, blur_px, seed, sensor)

    def record(
        self,
        positions: ArrayLike,
        radii: ArrayLike,
        folder: str | PathLike[str],
        *,
        depth_noise: float = 0.0,
        blur_px: float = 0.0,
        sensor: str | PathLike[str] | None = None,
        seed: int = 0,
        depth_unit: float = _DEPTH_UNIT,
    ) -> tuple[Path, Path]:
        """Writes `depth.png` (16 bits) and `camera.toml` into `folder`, as a real camera would.

        Args:
            positions: centres of the grains [m], shape (n, 3).
            radii: their radii [m], shape (n,).
            folder: where to write; made if it does not exist.
            depth_noise: standard deviation of Gaussian noise of each pixel [m].
            blur_px: standard deviation of a Gaussian blur [px].
            sensor: TOML that `granulcal fit-sensor` wrote: noise, pattern, rounding and holes.
            seed: seed of the noise.
            depth_unit: metres per count of the image.

        Returns:
            The paths of the image and of the camera, for `Recording.open`.
        """
        image = self.render(
            positions, radii, depth_noise=depth_noise, blur_px=blur_px, sensor=sensor, seed=seed
        )
        place = Path(folder)
        place.mkdir(parents=True, exist_ok=True)
        paths = place / "depth.png", place / "camera.toml"
        self.save(image, *paths, depth_unit=depth_unit)
        return paths

    def save(
        self,
        image: NDArray[np.float32],
        png: str | PathLike[str],
        toml: str | PathLike[str],
        *,
        depth_unit: float = _DEPTH_UNIT,
    ) -> None:
        """Writes a depth image [m] of shape (h, w) as a 16-bit PNG, and the camera's TOML.

        Raises:
            ValueError: another shape, or masked entries: 0 says that there is no data.
        """
        self._native.save_image(
            np.ascontiguousarray(unmasked("image", image)), png, toml, depth_unit
        )
