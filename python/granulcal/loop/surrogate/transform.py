r"""A monotone scale for each statistic, in which its noise is nearest to normal.

Of $t(x) = x$, $\log x$ and $-1 / x$ (positive statistics) and $\mathrm{asinh}((x - a) / b)$ (a the
median, b half the interquartile range) the one with the largest profile likelihood of a quadratic
regression,

$$ \ell = -\tfrac n2 \log \hat\sigma^2_t + \sum_i \log |t'(x_i)| $$

The reciprocal is for what runs off along a ridge: the degrees of freedom of a chi distribution,
fitted to radii, go to their bound of 100 where those are normal. Pours of one model had 4.3, 4.9
and 100, and on the logarithm the last was 30 standard deviations of a pour off. It ends, and what
lies beyond would not be seen: it has to be the best of all pours as well, whatever effects do.

Reference:
    Box and Cox, An analysis of transformations, JRSS B 26, 1964, equation 9.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Transform"]

Array = NDArray[np.float64]

# A reciprocal ends where its statistic is infinite: largest value, in those of the archive.
_BEYOND = 10.0


@dataclass(frozen=True)
class Transform:
    """z = (t(x) - shift) / spread for one statistic.

    Attributes:
        kind: `identity`, `log`, `reciprocal` or `asinh`.
        centre: a of asinh; the smallest value that log and reciprocal accept.
        width: b of asinh; the largest value that the inverse of the reciprocal returns.
        shift: mean of t over the archive's base pours.
        spread: its standard deviation there.
    """

    kind: str
    centre: float
    width: float
    shift: float
    spread: float

    @classmethod
    def choose(
        cls, x: Array, features: Array, everywhere: tuple[Array, Array] | None = None
    ) -> "Transform":
        """Returns the best transform of `x` (n,) given regression features (n, d).

        `everywhere` are the same of all pours, those with effects among them: there a reciprocal
        has to be the best as well, for it ends.
        """
        low, centre, high = np.quantile(x, [0.25, 0.5, 0.75])
        width = max((high - low) / 2, 1e-3 * float(x.std()), 1e-300)
        tried = [cls("identity", 0.0, 1.0, 0.0, 1.0), cls("asinh", centre, width, 0.0, 1.0)]
        if x.min() > 0:
            least = float(x.min()) / 2
            tried.append(cls("log", least, 1.0, 0.0, 1.0))
            tried.append(cls("reciprocal", least, _BEYOND * float(x.max()), 0.0, 1.0))
        best = _best(tried, x, features)
        if best.kind == "reciprocal" and everywhere and _best(tried, *everywhere) is not best:
            best = _best(tried[:-1], x, features)
        t = best._t(x)
        spread = float(t.std())
        return cls(best.kind, best.centre, best.width, float(t.mean()), spread or 1.0)

    def __call__(self, x: Array) -> Array:
        """Returns z of `x`, any shape."""
        return (self._t(x) - self.shift) / self.spread

    def inverse(self, z: Array) -> Array:
        """Returns x of `z`, any shape; what a log had cut off comes back as the cut."""
        t = np.asarray(z, dtype=np.float64) * self.spread + self.shift
        if self.kind == "log":
            return np.exp(t)
        if self.kind == "reciprocal":
            return -1 / np.minimum(t, -1 / self.width)
        if self.kind == "asinh":
            return self.centre + self.width * np.sinh(t)
        return t

    def _t(self, x: Array) -> Array:
        if self.kind == "log":
            return np.log(np.maximum(x, self.centre))
        if self.kind == "reciprocal":
            return -1 / np.maximum(x, self.centre)
        if self.kind == "asinh":
            return np.arcsinh((x - self.centre) / self.width)
        return np.asarray(x, dtype=np.float64)

    def _slope(self, x: Array) -> Array:
        if self.kind == "log":
            return 1 / np.maximum(x, self.centre)
        if self.kind == "reciprocal":
            return np.maximum(x, self.centre) ** -2
        if self.kind == "asinh":
            return 1 / np.sqrt((x - self.centre) ** 2 + self.width**2)
        return np.ones_like(x)


def _best(tried: Sequence[Transform], x: Array, features: Array) -> Transform:
    """The transform of the largest profile likelihood."""
    hat = np.linalg.qr(features)[0]
    scores = []
    for transform in tried:
        t = transform._t(x)
        left = t - hat @ (hat.T @ t)
        score = -0.5 * len(x) * np.log(max(float(left @ left) / len(x), 1e-300))
        score += float(np.log(np.maximum(transform._slope(x), 1e-300)).sum())
        # A transform has to be worth it.
        scores.append(score + (5.0 if transform.kind == "identity" else 0.0))
    return tried[int(np.argmax(scores))]
