r"""Mixture density heads on random Fourier features, all members of an ensemble at once.

For member e, inputs x and features $\phi(x) = [x, \cos \Omega x, \sin \Omega x]$, one linear map
gives the logits, the means and the entries of the lower triangular precision factors F:

$$ q(u | x) = \sum_k \pi_k(x) N(u; m_k(x), (F_k(x) F_k(x)^T)^{-1}) $$

The diagonal of F is the exponential of its outputs, so every output is a valid density.

Reference:
    Bishop, Mixture density networks, 1994, equations (22) to (29).
    Ramos, Possas and Fox, BayesSim, RSS 2019, section IV.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
import torch
from numpy.typing import NDArray

from granulcal.bayessim.network.features import waves
from granulcal.bayessim.network.mixture import Mixture

__all__ = ["HeadLayout", "Network"]

# exp(12) of a whitened coordinate is a spread of 6e-6: below it a density is a spike on one pair.
_LARGEST_LOG_DIAGONAL = 12.0
# Spread of the components' first means, in spreads of the target.
_FIRST_SPREAD = 0.5
# Ridge and least variance of the regression that training starts from (all inputs have spread 1).
_RIDGE = 1.0
_LEAST_RESIDUAL = 1e-6


@dataclass(frozen=True)
class HeadLayout:
    """Where in a row of outputs the logits, means and factors of k components are."""

    components: int
    dimension: int

    @property
    def size(self) -> int:
        """Number of outputs."""
        p = self.dimension
        return self.components * (1 + p + p * (p + 1) // 2)

    @property
    def mean_columns(self) -> slice:
        """Where the means are; the weights lie before them, the factors behind."""
        return slice(self.components, self.components * (1 + self.dimension))

    def split(self, outputs: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Returns log weights (..., k), means (..., k, p) and factors (..., k, p, p)."""
        log_weights, means, log_diagonal, below = self._entries(outputs)
        factors = torch.diag_embed(log_diagonal.exp())
        rows, columns = _below(self.dimension)
        factors[..., rows, columns] = below
        return log_weights, means, factors

    def log_density(self, outputs: torch.Tensor, u: torch.Tensor) -> torch.Tensor:
        """Returns the log mixture density of `u` (..., p), shape (...)."""
        log_weights, means, log_diagonal, below = self._entries(outputs)
        rows, columns = _below(self.dimension)
        off = u[..., None, :] - means
        # F^T (u - m) entry by entry: thousands of products of small matrices take longer.
        whitened = off * log_diagonal.exp()
        if len(rows):
            whitened = whitened.index_add(-1, columns, below * off[..., rows])
        parts = log_weights + log_diagonal.sum(-1) - 0.5 * whitened.square().sum(-1)
        return torch.logsumexp(parts, dim=-1) - 0.5 * self.dimension * math.log(2 * math.pi)

    def _entries(self, outputs: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Log weights, means, log diagonals of the factors, and what lies below them."""
        k, p = self.components, self.dimension
        log_weights = torch.log_softmax(outputs[..., :k], dim=-1)
        means = outputs[..., self.mean_columns].unflatten(-1, (k, p))
        entries = outputs[..., self.mean_columns.stop :].unflatten(-1, (k, p * (p + 1) // 2))
        log_diagonal = entries[..., :p].clamp(-_LARGEST_LOG_DIAGONAL, _LARGEST_LOG_DIAGONAL)
        return log_weights, means, log_diagonal, entries[..., p:]

    def mixtures(self, outputs: torch.Tensor) -> list[Mixture]:
        """Returns one mixture for each row of `outputs` (n, size)."""
        log_weights, means, factors = (part.double().numpy() for part in self.split(outputs))
        weights = np.exp(log_weights)
        weights /= weights.sum(axis=-1, keepdims=True)
        return [Mixture(*row) for row in zip(weights, means, factors, strict=True)]


@cache
def _below(dimension: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Rows and columns of the entries below the diagonal."""
    rows, columns = torch.tril_indices(dimension, dimension, offset=-1)
    return rows, columns


@dataclass
class Network:
    """Weights of an ensemble of e members with d inputs and m frequencies each.

    Attributes:
        layout: meaning of the outputs.
        frequencies: shape (e, m, d), already divided by the length scales; never trained.
        linear: weights on the inputs themselves, shape (e, d, layout.size).
        fourier: weights on the random features, shape (e, 2 m, layout.size).
        bias: shape (e, 1, layout.size).
    """

    layout: HeadLayout
    frequencies: torch.Tensor
    linear: torch.Tensor
    fourier: torch.Tensor
    bias: torch.Tensor

    @classmethod
    def initial(
        cls, layout: HeadLayout, frequencies: torch.Tensor, generator: torch.Generator
    ) -> "Network":
        """Returns a network of zero weights whose components start at different means."""
        members, count, inputs = frequencies.shape
        network = cls(
            layout,
            frequencies.float(),
            torch.zeros(members, inputs, layout.size),
            torch.zeros(members, 2 * count, layout.size),
            torch.zeros(members, 1, layout.size),
        )
        # Equal components would have equal gradients and never part.
        shape = (members, 1, layout.components, layout.dimension)
        offsets = _FIRST_SPREAD * torch.randn(shape, generator=generator)
        network.bias[..., layout.mean_columns] = offsets.flatten(-2)
        return network

    def start_at_regression(self, member: int, x: torch.Tensor, u: torch.Tensor) -> None:
        """Sets the components of one member to the ridge regression of `u` on `x`.

        Args:
            member: index of the member.
            x: its training inputs, shape (n, d).
            u: its training targets, shape (n, p).
        """
        layout = self.layout
        rows = torch.cat([x, torch.ones(len(x), 1)], dim=1).double()
        gram = rows.T @ rows + _RIDGE * torch.eye(rows.shape[1], dtype=torch.float64)
        slopes = torch.linalg.solve(gram, rows.T @ u.double())
        residuals = u.double() - rows @ slopes
        covariance = residuals.T @ residuals / len(x)
        covariance += _LEAST_RESIDUAL * torch.eye(layout.dimension, dtype=torch.float64)
        factor = torch.linalg.cholesky(torch.linalg.inv(covariance))
        bias = self.bias[member, 0]
        offsets = bias[layout.mean_columns].unflatten(0, (layout.components, -1)).double()
        means = slopes[-1] + offsets @ torch.linalg.cholesky(covariance).T
        bias[layout.mean_columns] = means.flatten().float()
        self.linear[member][:, layout.mean_columns] = (
            slopes[:-1].repeat(1, layout.components).float()
        )
        below = torch.tril_indices(layout.dimension, layout.dimension, offset=-1)
        entries = torch.cat([torch.diagonal(factor).log(), factor[below[0], below[1]]])
        bias[layout.mean_columns.stop :] = entries.repeat(layout.components).float()

    def parameters(self) -> list[torch.Tensor]:
        """Returns the trained tensors: linear, fourier, bias."""
        return [self.linear, self.fourier, self.bias]

    def outputs(self, x: torch.Tensor) -> torch.Tensor:
        """Returns the heads' outputs at `x` (e, n, d), shape (e, n, layout.size)."""
        # Unit-size features: with Adam, steps of all weights are then alike.
        return x @ self.linear + waves(x, self.frequencies) @ self.fourier + self.bias

    def mixtures(self, x: NDArray[np.float64]) -> list[Mixture]:
        """Returns the pooled mixture of all members at each row of `x` (n, d)."""
        members = len(self.frequencies)
        rows = torch.from_numpy(x).expand(members, *x.shape)
        with torch.no_grad():
            outputs = self.double().outputs(rows)
        by_member = [self.layout.mixtures(o) for o in outputs]
        return [Mixture.pooled(list(group)) for group in zip(*by_member, strict=True)]

    def double(self) -> "Network":
        """Returns a float64 copy, detached from training."""
        tensors = (self.frequencies, self.linear, self.fourier, self.bias)
        return Network(self.layout, *(t.detach().double() for t in tensors))
