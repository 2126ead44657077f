r"""Score tests: what is left of a fit, along what each effect would do.

In coordinates whitened by $V = L L^T$, with J the slopes of what was fitted and $\Lambda$ the
precision of its prior (1 for z-scores of theta, 0 for strengths),

$$ M = I - J (J^T J + \Lambda)^{-1} J^T $$

At the fit $J^T r = \Lambda \hat w$, hence $M (r + J \hat w) = r$: the residual is already the
efficient one, and projecting it once more would project it twice. With the direction $D_k$

$$ S_k = D_k^T r, \quad I_{kl} = D_k^T M D_l, \quad \hat\psi_k = S_k / I_{kk}, \quad
   T_k = \max(0, \hat\psi_k)^2 I_{kk}, \quad c_{kl} = I_{kl} / \sqrt{I_{kk} I_{ll}} $$

(no cut at 0 for two-sided effects), and $\kappa_k = I_{kk} / D_k^T D_k$ is the share of an effect
that the parameters cannot mimic. $D_k$ is what the effect does where it is hardly seen; since some
bend, $T_k$ is the larger of that and of the same along what it does at twice that strength.

Reference:
    Rao, Large sample tests of statistical hypotheses, Proc. Camb. Phil. Soc. 44, 1948.
    Neyman, Optimal asymptotic tests of composite hypotheses, 1959 (projection of nuisances).
    Liu, Lin and Ghosh, Semiparametric regression of multidimensional genetic pathway data,
    Biometrics 63, 2007 (score of a variance component).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.surrogate.baseline import Fit
from granulcal.loop.surrogate.linearised import LinearisedSurrogate

__all__ = ["Scores", "families"]

Array = NDArray[np.float64]

# Effects this parallel cannot be distinguished.
PARALLEL = 0.95
# Range in unit conditions over which an unknown discrepancy is smooth.
DISCREPANCY_LENGTH = 0.5
# kappa is quoted for effects that would be seen at full strength at three standard deviations.
_LEAST_SQUARE = 9.0


@dataclass(frozen=True)
class Scores:
    """The linear picture around a fit.

    Attributes:
        effects: indices of the K effects that are tested.
        two_sided: of each.
        whiten: L^-1, shape (n, n), n = H m.
        slopes: whitened J, shape (n, p + |A|).
        precision: diagonal of Lambda, shape (p + |A|,).
        directions: whitened D, shape (n, K).
        stronger: the same of stronger effects, along which they are looked for as well.
        direction_errors: trace of M cov(D_k), shape (K,).
        smooth: root of the whitened kernel of an unknown discrepancy, shape (n, n).
    """

    effects: tuple[int, ...]
    two_sided: NDArray[np.bool_]
    whiten: Array
    slopes: Array
    precision: Array
    directions: Array
    stronger: Array
    direction_errors: Array
    smooth: Array

    @classmethod
    def of(cls, local: LinearisedSurrogate, fit: Fit, effects: tuple[int, ...]) -> "Scores":
        """Returns the scores of `effects` beyond a fit."""
        design = local.surrogate.design
        whiten = np.asarray(np.linalg.inv(fit.root), dtype=np.float64)
        # Without effects one that is cut off again, for the shape.
        nothing = np.zeros(local.size)
        found = [local.directions(fit.v, k, fit.psi) for k in effects] or [(nothing, nothing)]
        directions, stronger = (
            np.column_stack(columns)[:, : len(effects)] for columns in zip(*found, strict=True)
        )
        gap = local.conditions[:, None] - local.conditions[None]
        kernel = np.exp(-0.5 * np.sum(gap**2, axis=2) / DISCREPANCY_LENGTH**2)
        kernel_root = np.linalg.cholesky(kernel + 1e-9 * np.eye(len(kernel)))
        smooth = whiten @ np.kron(kernel_root, local.surrogate.axes)
        precision = np.concatenate([np.ones(len(fit.v)), np.zeros(len(fit.active))])
        scores = cls(
            effects=effects,
            two_sided=np.array([design.effects[k].is_two_sided for k in effects], dtype=bool),
            whiten=whiten,
            slopes=whiten @ fit.slopes,
            precision=precision,
            directions=whiten @ directions,
            stronger=whiten @ stronger,
            direction_errors=np.zeros(len(effects)),
            smooth=smooth,
        )
        white_m = whiten.T @ scores.remain(whiten)
        errors = [float(np.sum(white_m * local.direction_error(k))) for k in effects]
        scores.direction_errors[:] = errors
        return scores

    def remain(self, columns: Array) -> Array:
        """Returns M times `columns` (n, any)."""
        normal = self.slopes.T @ self.slopes + np.diag(self.precision + 1e-9)
        return columns - self.slopes @ np.linalg.solve(normal, self.slopes.T @ columns)

    @property
    def information(self) -> Array:
        """I, shape (K, K)."""
        return self._information(self.directions)

    @property
    def cosines(self) -> Array:
        """c, shape (K, K)."""
        return _cosines(self.information)

    @property
    def likeness(self) -> Array:
        """|c|, or that of stronger effects where it is less, shape (K, K)."""
        return np.minimum(abs(self.cosines), abs(_cosines(self._information(self.stronger))))

    def _information(self, columns: Array) -> Array:
        return columns.T @ self.remain(columns)

    @property
    def kappa(self) -> Array:
        """Share of each effect that the fit cannot mimic; NaN for one too weak to say, (K,)."""
        left = np.diag(self.information)
        share = left / np.maximum(np.sum(self.directions**2, axis=0), 1e-300)
        known = left > np.maximum(_LEAST_SQUARE, self.direction_errors)
        return np.where(known, share, np.nan)

    def strengths(self, residuals: Array) -> Array:
        """Returns the one-step strengths of whitened efficient `residuals` (n, b), (K, b)."""
        information = np.maximum(np.diag(self.information), 1e-12)
        return (self.directions.T @ residuals) / information[:, None]

    def squares(self, residuals: Array) -> Array:
        """Returns T of whitened efficient `residuals` (n, b), shape (K, b)."""
        along = (self._along(columns, residuals) for columns in (self.directions, self.stronger))
        return np.maximum(*along)

    def _along(self, columns: Array, residuals: Array) -> Array:
        """Squares of `residuals` (n, b) along directions (n, K), shape (K, b)."""
        information = np.maximum(np.sum(columns * self.remain(columns), axis=0), 1e-12)
        score = columns.T @ residuals
        cut = np.where(self.two_sided[:, None], score, np.maximum(score, 0.0))
        return cut**2 / information[:, None]

    def unknown(self, residuals: Array) -> Array:
        """Returns the variance-component score V of `residuals` (n, b), shape (b,)."""
        along = self.smooth.T @ residuals
        expected = float(np.sum(self.smooth * self.remain(self.smooth)))
        return np.sum(along**2, axis=0) / expected


def _cosines(information: Array) -> Array:
    size = np.sqrt(np.maximum(np.diag(information), 1e-12))
    return information / np.outer(size, size)


def families(scores: Scores) -> list[tuple[int, ...]]:
    """Returns groups of `scores.effects` whose directions are parallel, largest kappa first."""
    cosines, left = scores.likeness, set(range(len(scores.effects)))
    groups = []
    while left:
        seed = min(left)
        group, fresh = {seed}, {seed}
        while fresh:
            fresh = {j for j in left - group if max(cosines[i, j] for i in fresh) > PARALLEL}
            group |= fresh
        left -= group
        groups.append(tuple(scores.effects[i] for i in sorted(group)))
    return groups
