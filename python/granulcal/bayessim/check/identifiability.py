r"""What an observation can tell: information gained, effective dimension, the ridge.

For each parameter the information gained over the prior is the divergence of its marginal posterior
from its prior, $\int p(v | x) \log p(v | x) dv$ with v the parameter's quantile in the prior [nat].
With $\Sigma$ the posterior's covariance in units of the prior's spread and $\lambda$ its values,
$\sum_i \max(1 - \lambda_i, 0)$ counts the directions that are known: the effective dimension. The
eigenvector of the largest eigenvalue is the ridge, along which parameters can be traded. Evaluated
by the extension (`crates/bayessim/src/identifiability.rs`); here it is averaged.

Reference:
    Lindley, On a measure of the information provided by an experiment, Annals of Mathematical
    Statistics 27, 1956.
    Spantini et al., Optimal low-rank approximations of Bayesian linear inverse problems, SIAM
    Journal on Scientific Computing 37, 2015 (posterior over prior covariance).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from granulcal import _native
from granulcal.prior import Prior
from granulcal.short_names import short_names

if TYPE_CHECKING:
    from granulcal.bayessim.posterior.posterior import Posterior

__all__ = ["Identifiability"]

Array = NDArray[np.float64]

# A gain below this is hardly told from none: a posterior 10 % narrower than the prior.
NO_TRACE = 0.1
_PARTS = ("low", "middle", "high")


@dataclass(frozen=True)
class Identifiability:
    """What one posterior, or the average of several, knows.

    Attributes:
        names: paths of the parameters.
        gains: information gained over the prior for each parameter [nat], shape (p,).
        effective_dimension: directions that are known, 0 .. p.
        ridge: unit vector along which least is known, in spreads of the prior, shape (p,).
        ridge_spread: posterior spread along it over the prior's.
        blind: parts of the prior where a parameter leaves no trace, in words.
    """

    names: tuple[str, ...]
    gains: Array
    effective_dimension: float
    ridge: Array
    ridge_spread: float
    blind: tuple[str, ...] = ()

    @classmethod
    def of(cls, posterior: "Posterior") -> "Identifiability":
        """Returns what one posterior knows."""
        gains, _, dimension, ridge, spread = posterior.density.identifiability()
        return cls(tuple(posterior.names), np.array(gains), dimension, np.array(ridge), spread)

    @classmethod
    def average(cls, posteriors: Sequence["Posterior"], truth: Array) -> "Identifiability":
        """Returns what posteriors of known parameters `truth` (n, p) know on average."""
        prior = posteriors[0].prior
        known = [posterior.density.identifiability() for posterior in posteriors]
        gains = np.array([each[0] for each in known])
        covariance = np.mean([each[1] for each in known], axis=0)
        dimension, ridge, spread = _native.directions(covariance)
        return cls(
            tuple(prior.names),
            gains.mean(axis=0),
            dimension,
            np.array(ridge),
            spread,
            _blind(prior, gains, truth),
        )

    def as_dict(self) -> dict[str, Any]:
        """Returns plain values, for JSON."""
        return {
            "names": list(self.names),
            "gains": self.gains.tolist(),
            "effective_dimension": self.effective_dimension,
            "ridge": self.ridge.tolist(),
            "ridge_spread": self.ridge_spread,
            "blind": list(self.blind),
        }

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> "Identifiability":
        """Returns what `as_dict` gave."""
        arrays = {name: np.array(values[name]) for name in ("gains", "ridge")}
        lists = {name: tuple(values[name]) for name in ("names", "blind")}
        return cls(**{**values, **arrays, **lists})

    @property
    def directions(self) -> str:
        """How many directions are known, and along which least is, in words."""
        short = short_names(self.names)
        ridge = " ".join(f"{part:+.2f} {n}" for n, part in zip(short, self.ridge, strict=True))
        return (
            f"{self.effective_dimension:.1f} of {len(short)} directions are known; least along "
            f"{ridge}, where {self.ridge_spread:.0%} of the prior's spread is left"
        )

    def __str__(self) -> str:
        """A few lines in plain words."""
        short = short_names(self.names)
        told = ", ".join(f"{n} {g:.2f}" for n, g in zip(short, self.gains, strict=True))
        lines = [f"  information gained [nat]: {told}", f"  {self.directions}"]
        return "\n".join(lines + [f"  no trace: {line}" for line in self.blind])


def _blind(prior: Prior, gains: Array, truth: Array) -> tuple[str, ...]:
    """Thirds of one parameter's prior in which another is not informed; once where all are."""
    ranks = np.argsort(np.argsort(truth, axis=0), axis=0) * 3 // len(truth)
    short = short_names(prior.names)
    found: list[str] = []
    for i, name in enumerate(short):
        lines, asked = [], 0
        for j, other in enumerate(short):
            for part, word in enumerate(_PARTS):
                rows = ranks[:, j] == part
                if rows.sum() < 5:
                    continue
                asked += 1
                if gains[rows, i].mean() < NO_TRACE:
                    low, high = truth[rows, j].min(), truth[rows, j].max()
                    lines.append(f"{name} where {other} is {word} ({low:.3g} to {high:.3g})")
        found += [f"{name}, wherever in the prior"] if len(lines) == asked > 1 else lines
    return tuple(found)
