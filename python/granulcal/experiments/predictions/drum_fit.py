r"""The drum's base model at the true size of its grains, fitted to both pictures.

A pour of the 29,000 grains of 1.2 mm takes minutes, one of 1.7 mm a tenth of that. So the
statistics $c_v(u)$ of the larger grains at a speed v are emulated by a quadratic polynomial over
the unit cube of `UNKNOWN`, and the true ones are taken to differ from them by what a pour of true
grains at the best point so far, $u_k$, differs by (output space mapping; Bandler et al. 2004):

$$ u_{k+1} = \arg\min_u \sum_v Q\left(c_v(u) + f_v(u_k) - c_v(u_k) - y_v\right)
   + \sum_j \frac{(u_j - 1/2)^2}{1 / 12}, \qquad f_v(u_0) = c_v(u_0) $$

The misfit Q counts the slope at $s = 0.5$ degrees and the heights at 0.4 mm, what a picture is
known to, as four numbers for their fifteen; each with the emulator's error in quadrature. The
uniform priors are normals of their mean and spread. What is kept are the points with the least
misfit of their own pours of true grains, without any emulator.

Reference:
    Bandler et al., Space mapping: the state of the art, IEEE Trans. Microwave Theory Tech. 52,
    2004, 337.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import qmc

from granulcal.bayessim.emulator.basis import polynomial
from granulcal.bayessim.emulator.ridge import Ridge
from granulcal.experiments.loop_drum.task import RESOLUTION
from granulcal.experiments.loop_drum.task import SPEEDS as PICTURED
from granulcal.experiments.predictions.between_speeds import HEIGHT, SLOPE
from granulcal.experiments.predictions.drum_base import DrumBase
from granulcal.pours.scene import Scene
from granulcal.prior import Parameter, Prior

__all__ = ["KEPT", "POINTS", "ROUNDS", "UNKNOWN", "DrumFit", "true_size"]

Array = NDArray[np.float64]

UNKNOWN = Prior(
    [
        Parameter(path="material.sliding_friction", distribution="uniform", low=0.1, high=1.0),
        Parameter(path="material.rolling_friction", distribution="log_uniform", low=0.02, high=0.5),
        Parameter(
            path="walls.1.material.sliding_friction", distribution="uniform", low=0.1, high=1.0
        ),
        Parameter(path="grains.volume", distribution="uniform", low=2.5e-5, high=3.2e-5),
    ]
)
"""Friction of the grains and of the end walls, and the grains' volume [m^3]."""
POINTS = 32
"""Pours of 1.7 mm at each speed."""
ROUNDS = 5
"""Pours of the true size at each speed."""
KEPT = 2
"""Settings that predictions are made of."""
_DESIGN_SEED = 7
_STARTS = 8
_COUNT = 4.0
# Largest substep [s] at which the pours of the true size overlap by less than `default` allows.
_SUBSTEP = 1.0 / 5000.0


def true_size(scene: Scene) -> dict[str, float]:
    """Returns the numbers of the drum's scene with grains of the true diameter."""
    ratio = RESOLUTION.diameter / scene.get("grains.diameter")
    scaled = {path: scene.get(path) * ratio**p for path, p in RESOLUTION.scales.items()}
    return {"grains.diameter": RESOLUTION.diameter, "substep": _SUBSTEP, **scaled}


class DrumFit:
    """The fit, and its settings from the best on; none where no pour was usable.

    Args:
        drum: its pours.
        speeds: of the pictures [1/min], shape (2,).
        values: their heights [m] and slope [degrees], shape (2, s).
        is_slope: which of the statistics is the slope, shape (s,).
        say: is told each round.
    """

    def __init__(
        self,
        drum: DrumBase,
        speeds: Array,
        values: Array,
        is_slope: NDArray[np.bool_],
        *,
        say: Callable[[str], None],
    ) -> None:
        """Pours what is missing and fits."""
        self._speeds, self._values, self._is_slope = speeds, values, is_slope
        self._count = np.where(is_slope, 1.0, np.sqrt(_COUNT / max(1, (~is_slope).sum())))
        self._emulate(drum)
        size, shift = true_size(drum.scene), np.zeros_like(values)
        tried: list[tuple[float, dict[str, float]]] = []
        for number in range(ROUNDS):
            u = self._best(shift)
            setting = {**_named(u), **size}
            try:
                poured = drum.pictured(setting, speeds)
            except ValueError as error:
                say(f"drum of 1.2 mm, round {number + 1}: {error}; the fit ends here")
                break
            shift = poured - self._at(u)
            misfit = float(np.sum(self._scaled(poured) ** 2))
            tried.append((misfit, setting))
            say(_round(number, misfit, _named(u), poured - values, is_slope))
        self.settings: tuple[dict[str, float], ...] = tuple(
            setting for _, setting in sorted(tried, key=lambda one: one[0])[:KEPT]
        )

    def _emulate(self, drum: DrumBase) -> None:
        """Coefficients (2, d, s) and errors (2, s) of the larger grains' emulators."""
        points = np.asarray(qmc.Sobol(len(UNKNOWN.names), rng=_DESIGN_SEED).random(POINTS))
        coefficients, errors = [], []
        windows = {rpm: PICTURED[int(rpm)] for rpm in self._speeds.tolist()}
        asked = [(_named(u), *one) for one in windows.items() for u in points]
        drum.fill("drum of 1.7 mm: pours", asked)
        for rpm, window in windows.items():
            kept, rows = [], []
            for u in points:
                try:
                    rows.append(drum.at(_named(u), rpm, *window))
                except ValueError:
                    continue  # An unusable pour tells nothing.
                kept.append(u)
            ridge = Ridge(polynomial(2 * np.array(kept) - 1, 2))
            found = np.array(rows)
            middle = found.mean(axis=0)
            fits = [ridge.fit(column) for column in (found - middle).T]
            one = np.array([fit.coefficients for fit in fits]).T
            one[0] += middle
            coefficients.append(one)
            left = [f.loo_residuals(c) for f, c in zip(fits, (found - middle).T, strict=True)]
            errors.append(np.sqrt(np.mean(np.square(left), axis=1)))
        self._coefficients = np.array(coefficients)
        picture = np.where(self._is_slope, SLOPE, HEIGHT)
        self._picture, self._error = picture, np.hypot(picture, np.array(errors))

    def _at(self, u: Array) -> Array:
        """Statistics of the larger grains at u (4,), shape (2, s)."""
        return np.asarray((polynomial(2 * u[None] - 1, 2) @ self._coefficients)[:, 0])

    def _scaled(self, poured: Array) -> Array:
        """What pours leave of the pictures, in errors of a picture."""
        return np.asarray(self._count * (poured - self._values) / self._picture)

    def _best(self, shift: Array) -> Array:
        """The most probable u (4,), with true grains that differ by a shift (2, s)."""

        def residuals(u: Array) -> Array:
            left = self._count * (self._at(u) + shift - self._values) / self._error
            return np.concatenate([left.ravel(), (u - 0.5) * np.sqrt(12.0)])

        starts = qmc.Sobol(len(UNKNOWN.names), rng=_DESIGN_SEED + 1).random(_STARTS)
        found = [least_squares(residuals, u, bounds=(0.0, 1.0)) for u in starts]
        return np.asarray(min(found, key=lambda one: one.cost).x)


def _named(u: Array) -> dict[str, float]:
    values = UNKNOWN.from_unconstrained(np.asarray(u)[None])[0].tolist()
    return dict(zip(UNKNOWN.names, values, strict=True))


def _round(
    number: int,
    misfit: float,
    at: dict[str, float],
    left: Array,
    is_slope: NDArray[np.bool_],
) -> str:
    """One line: where the pours of a round were, and what they leave of the pictures."""
    numbers: Sequence[str] = [f"{value:.3g}" for value in at.values()]
    heights = " and ".join(f"{1e3 * np.sqrt(np.mean(row[~is_slope] ** 2)):.2f}" for row in left)
    slopes = " and ".join(f"{float(row[is_slope][0]):+.1f}" for row in left)
    return (
        f"drum of 1.2 mm, round {number + 1} at {', '.join(numbers)}: profiles {heights} mm off, "
        f"slopes {slopes} degrees; misfit {misfit:.1f}"
    )
