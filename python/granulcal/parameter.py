"""One parameter of a prior: a path and a distribution.

Which numbers it may have is checked by the simulator, as in files. The coordinates and quantiles
stay here: training and its plots need them for arrays of parameters.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from granulcal import _native
from granulcal.errors import PriorError

__all__ = ["Parameter"]

Array = NDArray[np.float64]

_STANDARD_NORMAL = NormalDist()


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One number of a scene or a material, and what is believed of it before any pour.

    Attributes:
        path: where the number lives, for example `material.sliding_friction`.
        distribution: `uniform`, `log_uniform`, `normal` or `fixed`.
        low: lower bound, in the parameter's own unit.
        high: upper bound, in the parameter's own unit.
        mean: mean of the normal before it is cut to its bounds.
        sd: standard deviation of the normal before it is cut to its bounds.
        value: value of a fixed parameter.
    """

    path: str
    distribution: str
    low: float | None = None
    high: float | None = None
    mean: float | None = None
    sd: float | None = None
    value: float | None = None

    def __post_init__(self) -> None:
        """Checks the types; which numbers may be is the simulator's to say, for files and here."""
        for key in ("path", "distribution"):
            if not isinstance(getattr(self, key), str):
                raise PriorError(f"{key} must be a string, got {getattr(self, key)!r}")
        numbers: dict[str, float] = {}
        for key in ("low", "high", "mean", "sd", "value"):
            number = getattr(self, key)
            if number is None:
                continue
            if isinstance(number, bool) or not isinstance(number, int | float | np.number):
                raise PriorError(f"{self.path}: {key} must be a number, got {number!r}")
            try:
                numbers[key] = float(number)
            except OverflowError:
                # A whole number has any length in TOML and in Python.
                allowed = "from -1.8e308 to 1.8e308"
                raise PriorError(f"{self.path}: {key} must be {allowed}, got more") from None
            object.__setattr__(self, key, numbers[key])
        try:
            _native.check_parameter(self.path, self.distribution, **numbers)
        except ValueError as error:
            raise PriorError(str(error)) from None

    @property
    def is_free(self) -> bool:
        """Whether the parameter is inferred: every distribution but `fixed`."""
        return self.distribution != "fixed"

    @property
    def is_log(self) -> bool:
        """Whether the parameter's coordinate is its logarithm."""
        return self.distribution == "log_uniform"

    @property
    def in_words(self) -> str:
        """The distribution as `granulcal inspect` says it, for example `normal 0.08 ± 0.004`."""
        low, high, mean, sd, value = (
            None if number is None else repr(number).removesuffix(".0")
            for number in (self.low, self.high, self.mean, self.sd, self.value)
        )
        if self.distribution == "fixed":
            return f"fixed at {value}"
        if self.distribution != "normal":
            return f"{self.distribution} from {low} to {high}"
        bounds = [f" from {low}"] * (low is not None) + [f" to {high}"] * (high is not None)
        return f"normal {mean} ± {sd}{''.join(bounds)}"

    @property
    def bounds(self) -> tuple[float, float]:
        """Lowest and highest possible value, in the parameter's own unit; may be infinite."""
        if self.distribution == "fixed":
            assert self.value is not None
            return self.value, self.value
        low = -np.inf if self.low is None else self.low
        high = np.inf if self.high is None else self.high
        return low, high

    def to_coordinate(self, value: Array) -> Array:
        """Returns the prior range mapped to [0, 1] (log first if log-uniform), or z-scores."""
        with np.errstate(invalid="ignore", divide="ignore"):
            warped = np.log(value) if self.is_log else value
        origin, scale = self._affine()
        coordinate = (warped - origin) / scale
        low, high = self.bounds
        # Round-off must not carry a value at a bound across it.
        inside = (value >= low) & (value <= high)
        return np.where(inside, np.clip(coordinate, *self.coordinate_bounds), coordinate)

    def from_coordinate(self, coordinate: Array) -> Array:
        """Returns the value of a coordinate; round-off never leaves the bounds."""
        origin, scale = self._affine()
        warped = origin + scale * coordinate
        value = np.exp(warped) if self.is_log else warped
        low, high = self.bounds
        # Round-off only: a coordinate that is truly outside stays outside.
        inside = self._is_inside_coordinate(coordinate)
        return np.where(inside, np.clip(value, low, high), value)

    def log_slope(self, value: Array) -> Array:
        """Returns log |d coordinate / d value|, shape of `value`."""
        scale = self._affine()[1]
        with np.errstate(invalid="ignore", divide="ignore"):
            size = np.log(value) if self.is_log else np.zeros_like(value)
        return -size - np.log(scale)

    def coordinate_log_density(self, coordinate: Array) -> Array:
        """Returns the log prior density of a coordinate, -inf outside the bounds."""
        if self.distribution == "normal":
            first, last = self._normal_cdf_range()
            density = -0.5 * coordinate**2 - 0.5 * np.log(2 * np.pi) - np.log(last - first)
        else:
            density = np.zeros_like(coordinate)
        return np.where(self._is_inside_coordinate(coordinate), density, -np.inf)

    def quantile(self, probability: Array) -> Array:
        """Returns the value below which a share `probability` of the prior lies."""
        if self.distribution != "normal":
            return self.from_coordinate(probability)
        first, last = self._normal_cdf_range()
        share = np.clip(first + (last - first) * probability, 1e-300, 1 - 1e-16)
        coordinate = np.array([_STANDARD_NORMAL.inv_cdf(p) for p in share.ravel()])
        low, high = self.bounds
        return np.clip(self.from_coordinate(coordinate.reshape(share.shape)), low, high)

    @property
    def coordinate_bounds(self) -> tuple[float, float]:
        """The bounds as coordinates: (0, 1) unless the distribution is normal."""
        if self.distribution != "normal":
            return 0.0, 1.0
        low, high = self.bounds
        origin, scale = self._affine()
        return (low - origin) / scale, (high - origin) / scale

    @property
    def prior_mean(self) -> float:
        """Mean of the distribution, in the parameter's own unit."""
        low, high = self.bounds
        if self.distribution == "fixed":
            return low
        if self.distribution == "uniform":
            return 0.5 * (low + high)
        if self.distribution == "log_uniform":
            return float((high - low) / np.log(high / low))
        first, last = self.coordinate_bounds
        mass = _STANDARD_NORMAL.cdf(last) - _STANDARD_NORMAL.cdf(first)
        shift = (_STANDARD_NORMAL.pdf(first) - _STANDARD_NORMAL.pdf(last)) / mass
        return float(self.from_coordinate(np.array(shift)))

    def as_dict(self) -> dict[str, str | float]:
        """Returns the keys of the TOML form that are set."""
        keys = ("path", "distribution", "low", "high", "mean", "sd", "value")
        return {key: getattr(self, key) for key in keys if getattr(self, key) is not None}

    def _is_inside_coordinate(self, coordinate: Array) -> NDArray[np.bool_]:
        low, high = self.coordinate_bounds
        return (coordinate >= low) & (coordinate <= high)

    def _affine(self) -> tuple[float, float]:
        if self.distribution == "normal":
            assert self.mean is not None and self.sd is not None
            return self.mean, self.sd
        low, high = self.bounds
        if self.is_log:
            low, high = float(np.log(low)), float(np.log(high))
        return low, high - low

    def _normal_cdf_range(self) -> tuple[float, float]:
        assert self.mean is not None and self.sd is not None
        normal = NormalDist(self.mean, self.sd)
        first = 0.0 if self.low is None else normal.cdf(self.low)
        last = 1.0 if self.high is None else normal.cdf(self.high)
        return first, last
