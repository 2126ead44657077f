r"""Toy simulators with exact posteriors, to test inference against the truth.

`LinearGaussian` has a posterior in closed form. `PileStandIn` looks like the real problem (three
parameters, one of them log-uniform, sixteen noisy and correlated statistics, a bounded prior);
its posterior is exact on a grid.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal.bayessim.arrays import as_matrix
from granulcal.bayessim.network.mixture import Mixture
from granulcal.bayessim.posterior.posterior import Posterior
from granulcal.parameter import Parameter
from granulcal.prior import Prior

__all__ = ["LinearGaussian", "PileStandIn"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LinearGaussian:
    r"""Statistics $x = A u + n$ with $n \sim N(0, S)$, u the prior's coordinates of theta.

    With a normal prior the coordinates are z-scores and the posterior of k observations is normal
    with precision $I + k A^T S^{-1} A$; with uniform priors the identity is absent and the normal
    is cut to the prior's bounds.

    Attributes:
        prior: all parameters normal without bounds, or none normal.
        matrix: A, shape (statistics, parameters).
        noise_covariance: S, shape (statistics, statistics).

    Examples:
        >>> toy = LinearGaussian.random(seed=1)
        >>> theta, x = toy.simulate(100, seed=2)
        >>> toy.posterior(x[0]).mean().shape
        (3,)
    """

    prior: Prior
    matrix: Array
    noise_covariance: Array

    @classmethod
    def random(
        cls,
        *,
        seed: int = 0,
        parameters: int = 3,
        statistics: int = 16,
        noise: float = 1.0,
        bounded: bool = False,
    ) -> "LinearGaussian":
        """Returns a random toy with correlated noise of standard deviation about `noise`."""
        generator = np.random.default_rng(seed)
        prior = Prior(
            Parameter(path=f"theta.{i}", distribution="uniform", low=-1.0, high=3.0)
            if bounded
            else Parameter(path=f"theta.{i}", distribution="normal", mean=1.0, sd=2.0)
            for i in range(parameters)
        )
        matrix = generator.standard_normal((statistics, parameters))
        mixing = np.eye(statistics) + 0.3 * generator.standard_normal((statistics, statistics))
        return cls(prior, matrix, noise**2 * mixing @ mixing.T)

    def simulate(self, n: int, *, seed: int = 0) -> tuple[Array, Array]:
        """Returns `n` prior draws (n, p) and their statistics (n, s)."""
        theta = self.prior.sample(n, seed)
        return theta, self.simulate_at(theta, seed=seed + 1)

    def simulate_at(self, theta: ArrayLike, *, seed: int = 0) -> Array:
        """Returns one draw of the statistics for each row of `theta` (n, p), shape (n, s)."""
        clean = self.prior.to_unconstrained(theta) @ self.matrix.T
        noise = np.random.default_rng(seed).standard_normal(clean.shape)
        return clean + noise @ np.linalg.cholesky(self.noise_covariance).T

    def posterior(self, x: ArrayLike) -> Posterior:
        """Returns the exact posterior given `x` (s,) or k observations of one theta (k, s)."""
        return Posterior.from_mixture(self.prior, self.normal(x))

    def normal(self, x: ArrayLike) -> Mixture:
        """Returns the one normal of the coordinates that the posterior is, cut to the prior."""
        observed = as_matrix("x", x, columns=len(self.matrix))
        information = self.matrix.T @ np.linalg.inv(self.noise_covariance)
        precision = len(observed) * information @ self.matrix
        if all(parameter.distribution == "normal" for parameter in self.prior.free):
            precision = precision + np.eye(len(precision))
        covariance = np.linalg.inv(precision)
        mean = covariance @ information @ observed.sum(axis=0)
        return Mixture.from_covariances(np.ones(1), mean[None], covariance[None])


class PileStandIn:
    """Three material parameters to sixteen smooth, noisy, correlated statistics.

    The noise is between 0.3 and 3 of each statistic's spread over the prior and shares three hidden
    causes, as the noise of statistics of one pile does.
    """

    def __init__(self, *, seed: int = 0, noise: float = 1.0) -> None:
        """Draws the map and the noise from `seed`; `noise` is a factor on the latter."""
        generator = np.random.default_rng(seed)
        self.prior = Prior.default()
        self._hidden = generator.standard_normal((3, 24)) * np.array([[1.6], [1.3], [0.7]])
        self._shift = generator.standard_normal(24)
        self._output = generator.standard_normal((24, 16)) / np.sqrt(24)
        causes = generator.standard_normal((3, 16))
        covariance = causes.T @ causes / 3 + 0.5 * np.eye(16)
        # Some statistics say much, others next to nothing, and which ones is not told.
        share = np.geomspace(0.3, 3.0, 16)
        scale = generator.permutation(share) * self._clean(generator.random((4000, 3))).std(axis=0)
        spread = scale / np.sqrt(np.diag(covariance))
        self._noise_root = noise * np.linalg.cholesky(covariance * np.outer(spread, spread))

    def simulate(self, n: int, *, seed: int = 0) -> tuple[Array, Array]:
        """Returns `n` prior draws (n, 3) and their statistics (n, 16)."""
        theta = self.prior.sample(n, seed)
        return theta, self.simulate_at(theta, seed=seed + 1)

    def simulate_at(self, theta: ArrayLike, *, seed: int = 0) -> Array:
        """Returns one draw of the statistics for each row of `theta` (n, 3), shape (n, 16)."""
        clean = self._clean(self.prior.to_unconstrained(theta))
        noise = np.random.default_rng(seed).standard_normal(clean.shape)
        return clean + noise @ self._noise_root.T

    def exact_log_prob(self, theta: ArrayLike, x: ArrayLike, *, grid: int = 64) -> Array:
        """Returns the exact log posterior density of theta[i] given x[i], own units, shape (n,).

        The likelihood is summed over `grid`^3 cell centres of the prior's coordinates.
        """
        values = as_matrix("theta", theta, columns=3)
        observed = as_matrix("x", x, columns=16)
        axis = (np.arange(grid) + 0.5) / grid
        cells = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
        whiten = np.linalg.inv(self._noise_root).T
        at_cells = self._clean(cells) @ whiten
        at_theta = self._clean(self.prior.to_unconstrained(values)) @ whiten
        result = self.prior.log_slope(values)
        for i, target in enumerate(observed @ whiten):
            fits = -0.5 * np.sum((at_cells - target) ** 2, axis=1)
            evidence = np.log(np.mean(np.exp(fits - fits.max()))) + fits.max()
            result[i] += -0.5 * np.sum((at_theta[i] - target) ** 2) - evidence
        return result

    def _clean(self, coordinates: Array) -> Array:
        return np.tanh((2 * coordinates - 1) @ self._hidden + self._shift) @ self._output


def main() -> None:
    """Prints loss on the stand-in, exact loss, coverage and time of each method."""
    import argparse

    from granulcal.bayessim import BayesSim

    parser = argparse.ArgumentParser(
        prog="python -m granulcal.bayessim.check.toys", description=main.__doc__
    )
    parser.add_argument("--pairs", type=int, default=1000)
    parser.add_argument("--tests", type=int, default=300)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1])
    arguments = parser.parse_args()
    for seed in arguments.seeds:
        toy = PileStandIn(seed=seed)
        theta, x = toy.simulate(arguments.pairs, seed=10 + seed)
        new_theta, new_x = toy.simulate(arguments.tests, seed=9000 + seed)
        # In coordinates the prior's loss is 0, so these are the negative gains over the prior.
        prior_loss = -float(np.mean(toy.prior.log_prob(new_theta)))
        exact = -float(np.mean(toy.exact_log_prob(new_theta, new_x))) - prior_loss
        print(f"seed {seed}: exact {exact:.2f}")
        for method in ("auto", "emulated", "distilled", "mdrff", "plain"):
            model = BayesSim.fit(theta, x, toy.prior, seed=seed, quiet=True, method=method)
            check = model.check(new_theta, new_x)
            counts = ", ".join(
                f"{c.level:.0%} {c.inside / c.total:.3f}" for c in check.coverage.counts
            )
            print(
                f"seed {seed}: {method} {check.posterior_loss - prior_loss:.2f}, {counts}, "
                f"fit {model.summary.fit_seconds:.1f} s"
            )


if __name__ == "__main__":
    main()
