r"""Counts out of n that vary more than chance: a beta-binomial regression.

A pour of n grains at height t (scaled to [-1, 1]) with material z (standardised) spills

$$ y \sim \mathrm{BetaBinomial}(n, p, \rho), \qquad
   \mathrm{logit}\, p = \sum_j a_j T_j(t) + \sum_i (b_i + c_i t) z_i, $$

with Chebyshev polynomials T_j and rho the correlation of two grains of one pour: the variance is
$n p (1 - p) (1 + (n - 1) \rho)$, so that rho = 0 is a binomial. The coefficients are those of
iterated weighted least squares under a weak normal prior, and rho has the largest likelihood. What
is uncertain is told by their posterior together, with sqrt(rho), a standard deviation of the
pours, uniform before them: draws of a multivariate t of the coefficients and log rho, weighted by
posterior over t, and drawn again by their weights. How probable many grains are hangs on rho more
than on the coefficients, and tens of pours do not settle it. A normal in place of the t is far off
where no pour spills: the likelihood is flat on one side, and half of the normal lies on the other.
The polynomial has the degree, 1 to 3, of the least BIC: a bend that few grains hint at would turn
the curve up where none are spilled.

References:
    Williams, Extra-binomial variation in logistic linear models, Applied Statistics 31, 1982.
    Gelman, Prior distributions for variance parameters, Bayesian Analysis 1, 2006: the uniform
        standard deviation.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

__all__ = ["CountModel", "beta_binomial_tail", "log_gamma"]

Array = NDArray[np.float64]

_DEGREES = (1, 2, 3)
# Standard deviations of the coefficients' prior: of the level, of the height, of the material.
_LEVEL_SD, _HEIGHT_SD, _MATERIAL_SD = 20.0, 5.0, 1.0
_ROUNDS = 60
# Draws to weight, the share of them that must count, and how often the t is moved for that.
_DRAWN, _ENOUGH, _ADAPTATIONS = 10_000, 0.2, 10
# Degrees of freedom of the t, and how much wider it is than what it stands for.
_FREEDOM, _WIDER = 5.0, 1.5
_RHO = (1e-7, 0.5)
_RHO_ROUNDS = 40
# Values of log rho that the t's place and width are made of.
_RHO_GRID = 41
_GOLDEN = (np.sqrt(5) - 1) / 2
# Logits beyond this are no different from 0 or n grains.
_LARGEST_LOGIT = 30.0
_HALF_LOG_TWO_PI = 0.5 * float(np.log(2 * np.pi))


@dataclass(frozen=True)
class CountModel:
    """The fitted regression.

    Attributes:
        total: n, grains of a pour.
        low: lowest height [m].
        high: highest height [m].
        coefficients: a, b, c, shape (d,).
        covariance: of a normal at their place, shape (d, d).
        rho: correlation of two grains of one pour [-].
        log_likelihood: of the counts that it was fitted to.
        rows, counts, precision: what it was fitted to, shapes (m, d) and (m,), and that of the
            coefficients' prior, (d, d).
    """

    total: int
    low: float
    high: float
    coefficients: Array
    covariance: Array
    rho: float
    log_likelihood: float
    rows: Array = field(repr=False)
    counts: Array = field(repr=False)
    precision: Array = field(repr=False)

    @classmethod
    def fit(
        cls,
        heights: Array,
        material: Array,
        counts: Array,
        total: int,
        *,
        degrees: tuple[int, ...] = _DEGREES,
    ) -> "CountModel":
        """Returns the regression of `counts` (m,) out of `total`.

        Args:
            heights: of the pours [m], shape (m,).
            material: standardised parameters, shape (m, q); q may be 0.
            counts: grains, shape (m,).
            total: grains of a pour.
            degrees: of the polynomial in the height, of which that of the least BIC is taken.
        """
        models = [cls._of_degree(heights, material, counts, total, degree) for degree in degrees]
        size = np.log(len(counts))
        return min(models, key=lambda m: size * len(m.coefficients) - 2 * m.log_likelihood)

    @classmethod
    def _of_degree(
        cls, heights: Array, material: Array, counts: Array, total: int, degree: int
    ) -> "CountModel":
        low, high = float(heights.min()), float(heights.max())
        rows = _rows(heights, material, low, high, degree)
        spreads = [_LEVEL_SD] + [_HEIGHT_SD] * degree + [_MATERIAL_SD] * (2 * material.shape[1])
        precision = np.diag(1 / np.square(spreads))

        def at(log_rho: float) -> tuple[float, Array, Array]:
            return _fitted(rows, counts, total, float(np.exp(log_rho)), precision)

        log_rho = _maximise(lambda x: at(x)[0], *np.log(_RHO))
        likelihood, coefficients, covariance = at(log_rho)
        rho = float(np.exp(log_rho))
        return cls(
            total, low, high, coefficients, covariance, rho, likelihood, rows, counts, precision
        )

    def shares(self, heights: Array, material: Array, coefficients: Array) -> Array:
        """Returns p at heights (h,) for m draws, shape (h, m).

        Args:
            heights: [m], shape (h,).
            material: standardised parameters of each draw, shape (m, q).
            coefficients: of each draw, shape (m, d).
        """
        degree = coefficients.shape[1] - 2 * material.shape[1] - 1
        found = np.empty((len(heights), len(coefficients)))
        for i, height in enumerate(heights):
            rows = _rows(np.full(len(material), height), material, self.low, self.high, degree)
            found[i] = _logistic(np.sum(rows * coefficients, axis=1))
        return found

    def draw(self, count: int, generator: np.random.Generator) -> tuple[Array, Array]:
        """Returns draws of the posterior of coefficients, shape (count, d), and of rho (count,)."""
        middle, scale = self._moments()
        drawn, weight = self._weighted_draws(middle, _WIDER * scale, generator)
        for _ in range(_ADAPTATIONS):
            if _effective(weight) >= _ENOUGH * _DRAWN:
                break
            # Milder weights, of which enough count, say where the next draws must be.
            power = 1.0
            while _effective(weight**power) < _ENOUGH * _DRAWN / 4:
                power /= 1.5
            mild = weight**power / np.sum(weight**power)
            middle = mild @ drawn
            scale = np.cov(drawn.T, aweights=mild, bias=True)
            drawn, weight = self._weighted_draws(middle, _WIDER * scale, generator)
        if _effective(weight) < count:
            warnings.warn(
                f"the forecast's band is of {_effective(weight):.0f} draws that count, where "
                f"{count} are wanted: pours at other heights would tell more",
                stacklevel=2,
            )
        # Systematic: each draw as often as its weight says, to within one.
        share = np.cumsum(weight) / weight.sum()
        at = (generator.random() + np.arange(count)) / count
        chosen = np.minimum(np.searchsorted(share, at), len(share) - 1)
        chosen = generator.permutation(chosen)
        return drawn[chosen, :-1], np.exp(drawn[chosen, -1])

    def _moments(self) -> tuple[Array, Array]:
        """Mean (d + 1,) and covariance of coefficients and log rho, the former as if normal."""
        grid = np.linspace(np.log(_RHO[0]), np.log(_RHO[1]), _RHO_GRID)
        places, within, log_weight = [], [], []
        for log_rho in grid:
            rho = float(np.exp(log_rho))
            log, place, covariance = _fitted(
                self.rows, self.counts, self.total, rho, self.precision
            )
            log += 0.5 * log_rho - 0.5 * place @ self.precision @ place
            log_weight.append(log + 0.5 * np.linalg.slogdet(covariance)[1])
            places.append(np.append(place, log_rho))
            within.append(covariance)
        weight = np.exp(np.array(log_weight) - max(log_weight))
        weight /= weight.sum()
        middle = weight @ np.array(places)
        scale = np.cov(np.array(places).T, aweights=weight, bias=True)
        scale[:-1, :-1] += np.tensordot(weight, np.array(within), axes=1)
        # A rho that lies between two values of the grid is known no better than those.
        scale[-1, -1] += np.square(grid[1] - grid[0]) / 12
        return middle, scale

    def _weighted_draws(
        self, middle: Array, scale: Array, generator: np.random.Generator
    ) -> tuple[Array, Array]:
        """Returns draws of a multivariate t, and posterior over t but for a factor."""
        dimension = len(middle)
        root = np.linalg.cholesky(scale)
        normal = generator.standard_normal((_DRAWN, dimension))
        stretch = np.sqrt(_FREEDOM / generator.chisquare(_FREEDOM, _DRAWN))
        unit = normal * stretch[:, None]
        drawn = middle + unit @ root.T
        log_t = -0.5 * (_FREEDOM + dimension) * np.log1p(np.sum(unit**2, axis=1) / _FREEDOM)
        coefficients, log_rho = drawn[:, :-1], drawn[:, -1]
        least, most = np.log(_RHO)
        is_possible = (log_rho >= least) & (log_rho <= most)
        rho = np.exp(np.clip(log_rho, least, most))[:, None]
        shares = _logistic(coefficients @ self.rows.T)
        quadratic = np.einsum("ij,jk,ik->i", coefficients, self.precision, coefficients)
        # sqrt(rho) uniform is a density of sqrt(rho) over log rho.
        log_prior = -0.5 * quadratic + 0.5 * log_rho
        log_likelihood = _log_likelihoods(self.counts, self.total, shares, rho)
        log_weight = np.where(is_possible, log_likelihood + log_prior - log_t, -np.inf)
        return drawn, np.exp(log_weight - log_weight.max())


def beta_binomial_tail(least: int, total: int, share: Array, rho: float | Array) -> Array:
    r"""Returns P(y >= least) of a beta-binomial, shape of `share`.

    With $s = 1/\rho - 1$, $\alpha = p s$, $\beta = (1 - p) s$ the probabilities of 0, 1, ... follow
    from $P(y + 1) / P(y) = (n - y)(y + \alpha) / ((y + 1)(n - y - 1 + \beta))$.

    Args:
        least: number of grains.
        total: n.
        share: p, shape (..., m).
        rho: correlation of two grains of one pour, one or of each draw, shape (m,).
    """
    if least <= 0:
        return np.ones_like(share)
    if least > total:
        return np.zeros_like(share)
    size = 1 / rho - 1
    alpha, beta = share * size, (1 - share) * size
    log_term = log_gamma(total + beta) - log_gamma(beta)
    log_term += log_gamma(np.array(size)) - log_gamma(np.array(total + size))
    log_below = log_term.copy()
    for y in range(least - 1):
        log_term = (
            log_term + np.log((total - y) * (y + alpha)) - np.log((y + 1) * (total - y - 1 + beta))
        )
        log_below = np.logaddexp(log_below, log_term)
    return np.abs(np.expm1(np.minimum(log_below, 0)))


def log_gamma(x: Array) -> Array:
    """Returns log Gamma of positive numbers by Stirling's series above 10."""
    x = np.asarray(x, float)
    factor: Array = np.ones_like(x)
    up: Array = x.copy()
    while (small := up < 10).any():
        factor = np.where(small, factor * up, factor)
        up = up + small
    shift = np.log(factor)
    series = 1 / (12 * up) - 1 / (360 * up**3) + 1 / (1260 * up**5) - 1 / (1680 * up**7)
    return (up - 0.5) * np.log(up) - up + _HALF_LOG_TWO_PI + series - shift


def _rows(heights: Array, material: Array, low: float, high: float, degree: int) -> Array:
    t = 2 * (heights - low) / (high - low) - 1
    polynomials = np.asarray(np.polynomial.chebyshev.chebvander(t, degree), float)
    return np.column_stack([polynomials, material, t[:, None] * material])


def _fitted(
    rows: Array, counts: Array, total: int, rho: float, precision: Array
) -> tuple[float, Array, Array]:
    """Log likelihood at one rho, the coefficients that it is of, and their covariance."""
    coefficients, covariance = _weighted(rows, counts, total, rho, precision)
    share = _logistic(rows @ coefficients)
    return _log_likelihood(counts, total, share, rho), coefficients, covariance


def _weighted(
    rows: Array, counts: Array, total: int, rho: float, precision: Array
) -> tuple[Array, Array]:
    """Coefficients by iterated weighted least squares, and their covariance."""
    coefficients = np.zeros(rows.shape[1])
    mean = (counts.sum() + 0.5) / (total * len(counts) + 1)
    coefficients[0] = np.log(mean / (1 - mean))
    spread, hessian = 1 + (total - 1) * rho, precision
    for _ in range(_ROUNDS):
        share = _logistic(rows @ coefficients)
        weight = total * share * (1 - share) / spread
        hessian = (rows * weight[:, None]).T @ rows + precision
        gradient = rows.T @ ((counts - total * share) / spread) - precision @ coefficients
        step = np.linalg.solve(hessian, gradient)
        # A long step from a poor start overshoots.
        step *= min(1.0, 2.0 / max(float(np.abs(step).max()), 1e-12))
        coefficients = coefficients + step
        if np.abs(step).max() < 1e-9:
            break
    return coefficients, np.asarray(np.linalg.inv(hessian), float)


def _effective(weight: Array) -> float:
    """How many equal draws say as much as weighted ones."""
    return float(np.sum(weight) ** 2 / np.sum(weight**2))


def _log_likelihood(counts: Array, total: int, share: Array, rho: float) -> float:
    return float(_log_likelihoods(counts, total, share, rho))


def _log_likelihoods(counts: Array, total: int, share: Array, rho: float | Array) -> Array:
    """Of shares (..., m) of counts (m,) at one rho or at each of shape (..., 1), shape (...)."""
    size = 1 / rho - 1
    alpha, beta = share * size, (1 - share) * size
    terms = log_gamma(counts + alpha) - log_gamma(alpha)
    terms += log_gamma(total - counts + beta) - log_gamma(beta)
    terms += log_gamma(np.array(size)) - log_gamma(np.array(total + size))
    return terms.sum(axis=-1)


def _maximise(function: Callable[[float], float], low: float, high: float) -> float:
    """Place of the maximum of a function of one peak, by golden section."""
    a, b = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    fa, fb = function(a), function(b)
    for _ in range(_RHO_ROUNDS):
        if fa >= fb:
            high, b, fb = b, a, fa
            a = high - _GOLDEN * (high - low)
            fa = function(a)
        else:
            low, a, fa = a, b, fb
            b = low + _GOLDEN * (high - low)
            fb = function(b)
    return (low + high) / 2


def _logistic(x: Array) -> Array:
    return 1 / (1 + np.exp(-np.clip(x, -_LARGEST_LOGIT, _LARGEST_LOGIT)))
