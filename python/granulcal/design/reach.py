r"""Radii that heights give: a local quadratic through pours.

Near a height h the radii of a pour from h' are $r = m(h) + s(h)(h' - h) + ... + \epsilon$, with m,
s and the covariance C of the noise from the pours nearby, weighted by a Gaussian kernel. A pour
whose two radii are seen tells its height no better than to

$$ \sigma_h(h) = (s^T C^{-1} s)^{-1/2}, $$

the Cramer-Rao bound of one pour: pours of one height differ by as much.

Reference:
    Fan and Gijbels, Local polynomial modelling and its applications, 1996.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal.errors import TrainingDataError

__all__ = ["Expected", "Reach"]

Array = NDArray[np.float64]

# Widths of the kernel, as shares of the range of heights, among which leaving one out chooses.
_WIDTHS = (0.03, 0.05, 0.08, 0.12, 0.2)
# Share of it over which the tangent at an end is fitted.
_END_WIDTH = 0.12
_FEWEST_POURS = 20
_GRID = 241


@dataclass(frozen=True)
class Expected:
    """What a height gives.

    Attributes:
        height: of the funnel [m].
        radii: mean inner and outer radius [m], shape (2,).
        slope: how they grow with the height [-], shape (2,).
        covariance: of pours of one height [m^2], shape (2, 2).
    """

    height: float
    radii: Array
    slope: Array
    covariance: Array

    @property
    def floor(self) -> float:
        """Least standard deviation of a height that is inferred from one pour's radii [m]."""
        information = self.slope @ np.linalg.solve(self.covariance, self.slope)
        return float(1 / np.sqrt(information)) if information > 0 else float("inf")


class Reach:
    """Inner and outer radius as functions of the height.

    Args:
        heights: of the pours [m], shape (n,).
        radii: their inner and outer radii [m], shape (n, 2).

    Raises:
        TrainingDataError: fewer than twenty pours, or all of one height.
    """

    def __init__(self, heights: ArrayLike, radii: ArrayLike) -> None:
        """Chooses the kernel's width."""
        self.heights, self.radii = np.asarray(heights, float), np.asarray(radii, float)
        if len(self.heights) < _FEWEST_POURS or np.ptp(self.heights) == 0:
            raise TrainingDataError(
                f"radii as a function of height need at least {_FEWEST_POURS} usable pours of "
                f"different heights, got {len(self.heights)}"
            )
        tried = [self._left_out(share * np.ptp(self.heights)) for share in _WIDTHS]
        losses = [float(np.sum(np.log(np.mean(errors**2, axis=0)))) for errors in tried]
        best = int(np.argmin(losses))
        self.width = float(_WIDTHS[best] * np.ptp(self.heights))
        """Standard deviation of the kernel [m]."""
        self._errors = tried[best]

    @property
    def low(self) -> float:
        """Lowest height of a usable pour [m]."""
        return float(self.heights.min())

    @property
    def high(self) -> float:
        """Highest height of a usable pour [m]."""
        return float(self.heights.max())

    def at(self, height: float) -> Expected:
        """Returns what a height gives; outside the pours' range along the tangent at its end."""
        inside = float(np.clip(height, self.low, self.high))
        weights = self._weights(inside, self.width)
        (mean, slope, _), _ = _polynomial(self.heights - inside, self.radii, weights)
        if height != inside:
            # A slope at an end is noisy, and an extrapolation leans on it alone.
            wide = self._weights(inside, _END_WIDTH * float(np.ptp(self.heights)))
            slope = _polynomial(self.heights - inside, self.radii, wide, degree=1)[0][1]
        covariance = np.einsum("i,ij,ik->jk", weights, self._errors, self._errors) / weights.sum()
        return Expected(height, mean + slope * (height - inside), slope, covariance)

    def beside(self, end: float) -> Expected:
        """Returns what just outside one end of the pours' range gives, with the tangent there."""
        return self.at(float(np.nextafter(end, np.inf if end == self.high else -np.inf)))

    def curve(self, count: int = _GRID) -> list[Expected]:
        """Returns what evenly spaced heights give."""
        return [self.at(height) for height in np.linspace(self.low, self.high, count)]

    def inner_with(self, outer: float) -> float:
        """Returns the inner radius of the formations with this outer radius [m]."""
        radii = np.array([each.radii for each in self.curve()])
        i = int(np.argmin(np.abs(radii[:, 1] - outer)))
        return float(radii[i, 0])

    def nearer_end(self, radii: Array) -> float:
        """Returns the end of the pours' range whose radii are nearer to `radii` (2,) [m]."""
        return min((self.low, self.high), key=lambda h: np.linalg.norm(self.at(h).radii - radii))

    def is_beyond(self, end: float, height: float) -> bool:
        """Returns whether a height lies outside the range on the side of this end."""
        return height > self.high if end == self.high else height < self.low

    def beyond(self, radii: Array) -> float:
        """Returns the height at which the tangent at the nearer end comes closest to `radii` [m].

        It lies outside the range if it `is_beyond` that end.

        Args:
            radii: inner and outer radius [m], shape (2,).
        """
        nearest = self.nearer_end(radii)
        end = self.beside(nearest)
        weight = np.linalg.solve(end.covariance, end.slope)
        return nearest + float(weight @ (radii - end.radii) / (weight @ end.slope))

    def _weights(self, height: float, width: float) -> Array:
        return np.exp(-0.5 * ((self.heights - height) / width) ** 2)

    def _left_out(self, width: float) -> Array:
        """Errors of each pour's radii predicted by all others [m], shape (n, 2)."""
        errors = np.empty_like(self.radii)
        for i, height in enumerate(self.heights):
            weights = self._weights(height, width)
            coefficients, leverage = _polynomial(self.heights - height, self.radii, weights)
            # Of a linear smoother, the error without a row is that with it over 1 - leverage.
            errors[i] = (self.radii[i] - coefficients[0]) / max(1 - leverage, 1e-3)
        return errors


def _polynomial(
    offsets: Array, values: Array, weights: Array, *, degree: int = 2
) -> tuple[Array, float]:
    """Coefficients (degree + 1, 2) of a weighted fit, and the leverage of a row at offset 0."""
    # In units of the offsets' spread, so that the small ridge means the same for each power.
    scale = float(np.sqrt(np.average(offsets**2, weights=weights))) or 1.0
    rows = (offsets[:, None] / scale) ** np.arange(degree + 1)
    gram = (rows * weights[:, None]).T @ rows + 1e-9 * weights.sum() * np.eye(degree + 1)
    coefficients = np.linalg.solve(gram, (rows * weights[:, None]).T @ values)
    leverage = float(np.linalg.inv(gram)[0, 0])
    return coefficients / scale ** np.arange(degree + 1)[:, None], leverage
