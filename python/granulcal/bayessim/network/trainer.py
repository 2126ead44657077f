"""Trains the members of an ensemble side by side and keeps each at its best validation loss."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from granulcal.bayessim.network.adam import Adam
from granulcal.bayessim.network.features import draw_frequencies
from granulcal.bayessim.network.network import HeadLayout, Network
from granulcal.bayessim.replicates import gathered, material_of
from granulcal.bayessim.training.config import Config
from granulcal.one_thread import one_thread
from granulcal.progress import steps

__all__ = ["Progress", "TrainingResult", "train"]

Array = NDArray[np.float64]

# Steps of one pass at most: more pairs make larger batches, not longer training.
_STEPS = 100
# More pairs than this lie closer together, and need less smoothing between them.
_PAIRS_OF_JITTER = 1500
# Pairs shown in all at most, and the fewest passes that are made of them.
_SHOWN, _FEWEST_PASSES = 600_000, 40


@dataclass(frozen=True)
class Progress:
    """State after one pass, given to the progress callback.

    Attributes:
        epoch: passes done.
        max_epochs: passes at most.
        train_loss: mean negative log density of this pass over all members [nat].
        validation_loss: mean of the members' lowest validation losses [nat].
    """

    epoch: int
    max_epochs: int
    train_loss: float
    validation_loss: float


@dataclass(frozen=True, kw_only=True)
class TrainingResult:
    """The trained network and the counts of its training; see `TrainingSummary`."""

    network: Network
    status: str
    train_count: int
    validation_count: int
    epoch_count: int
    best_epochs: tuple[int, ...]
    train_losses: tuple[float, ...]
    validation_losses: tuple[float, ...]
    curve: tuple[tuple[float, float], ...]


@one_thread()
def train(
    u: Array,
    x: Array,
    relevance: Array,
    *,
    config: Config,
    seed: int,
    weights: Array | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> TrainingResult:
    """Returns the ensemble trained on standardised pairs.

    Args:
        u: standardised coordinates of the parameters, shape (n, p).
        x: standardised statistics, shape (n, s).
        relevance: factor on each statistic's frequencies, shape (s,).
        config: settings.
        seed: seed of the frequencies, the splits, the batches and the jitter.
        weights: of each pair in the loss, shape (n,); None: all the same.
        progress: called after each pass.

    Of several numbers of components the one of the lowest mean validation loss is kept. On one
    thread: see `one_thread`.
    """
    results = [
        _Training(u, x, relevance, config, count, seed, weights).run(progress)
        for count in config.component_counts
    ]
    return min(results, key=lambda result: float(np.mean(result.validation_losses)))


class _Training:
    def __init__(
        self,
        u: Array,
        x: Array,
        relevance: Array,
        config: Config,
        components: int,
        seed: int,
        weights: Array | None,
    ) -> None:
        self.config = config
        self.jitter = config.jitter * min(1.0, _PAIRS_OF_JITTER / len(u))
        passes = max(_FEWEST_PASSES, _SHOWN // len(u))
        self.passes = min(config.max_epochs, passes)
        self.generator = torch.Generator().manual_seed(seed)
        self.u = torch.from_numpy(u).float()
        self.x = torch.from_numpy(x).float()
        weights = np.ones(len(u)) if weights is None else weights / weights.mean()
        self.weights = torch.from_numpy(weights).float()
        members = config.ensemble
        validation_count = max(1, round(config.validation_share * len(x)))
        material = material_of(u)
        orders = [gathered(self._permutation(len(x)).numpy(), material) for _ in range(members)]
        order = torch.from_numpy(np.stack(orders))
        self.validation = order[:, :validation_count]
        self.training = order[:, validation_count:]
        scale = torch.from_numpy(relevance / (config.length_scale * _median_distance(x, relevance)))
        frequencies = torch.stack(
            [
                draw_frequencies(
                    config.features, x.shape[1], kernel=config.kernel, seed=seed * members + i
                )
                * scale
                for i in range(members)
            ]
        )
        layout = HeadLayout(components, u.shape[1])
        self.network = Network.initial(layout, frequencies, self.generator)
        if config.linear_start:
            for i, rows in enumerate(self.training):
                self.network.start_at_regression(i, self.x[rows], self.u[rows])
        self.best = [tensor.clone() for tensor in self.network.parameters()]

    def run(self, progress: Callable[[Progress], None] | None) -> TrainingResult:
        config, members = self.config, self.config.ensemble
        parameters = self.network.parameters()
        for tensor in parameters:
            tensor.requires_grad_(True)
        # Only the Fourier weights decay.
        adam = Adam([t.detach() for t in parameters], [0.0, config.weight_decay, 0.0])
        best_loss = torch.full((members,), torch.inf)
        best_epoch = torch.zeros(members, dtype=torch.long)
        train_loss = torch.zeros(members)
        epoch, status = 0, "epoch_limit"
        curve = []
        for epoch in steps("network", range(1, self.passes + 1)):
            turn = math.pi * (epoch - 1) / self.passes
            train_loss = self._one_pass(adam, 0.5 * config.learning_rate * (1 + math.cos(turn)))
            with torch.no_grad():
                loss = self._loss(self.validation, jitter=0.0)
            is_better = loss < best_loss
            best_loss = torch.where(is_better, loss, best_loss)
            best_epoch[is_better] = epoch
            for kept, tensor in zip(self.best, parameters, strict=True):
                kept[is_better] = tensor.detach()[is_better]
            curve.append((float(train_loss.mean()), float(loss.mean())))
            if progress is not None:
                means = (float(train_loss.mean()), float(best_loss.mean()))
                progress(Progress(epoch, self.passes, *means))
            if bool((epoch - best_epoch >= config.patience).all()):
                status = "stopped_early"
                break
        if not bool(torch.isfinite(best_loss).all()):
            status = "diverged"
        network = Network(self.network.layout, self.network.frequencies, *self.best)
        return TrainingResult(
            network=network,
            status=status,
            train_count=self.training.shape[1],
            validation_count=self.validation.shape[1],
            epoch_count=epoch,
            best_epochs=tuple(best_epoch.tolist()),
            train_losses=tuple(train_loss.tolist()),
            validation_losses=tuple(best_loss.tolist()),
            curve=tuple(curve),
        )

    def _one_pass(self, adam: Adam, rate: float) -> torch.Tensor:
        count = self.training.shape[1]
        order = torch.stack([row[self._permutation(count)] for row in self.training])
        total, parameters = torch.zeros(len(order)), self.network.parameters()
        for batch in order.split(max(self.config.batch_size, count // _STEPS), dim=1):
            loss = self._loss(batch, jitter=self.jitter)
            adam.step(torch.autograd.grad(loss.sum(), parameters), rate)
            total += loss.detach() * batch.shape[1]
        return total / count

    def _loss(self, rows: torch.Tensor, *, jitter: float) -> torch.Tensor:
        x, u = self.x[rows], self.u[rows]
        if jitter:
            x = x + jitter * torch.randn(x.shape, generator=self.generator)
        log_density = self.network.layout.log_density(self.network.outputs(x), u)
        return -(self.weights[rows] * log_density).mean(dim=1)

    def _permutation(self, count: int) -> torch.Tensor:
        return torch.randperm(count, generator=self.generator)


def _median_distance(x: Array, relevance: Array) -> float:
    """Median distance between scaled inputs, on at most 500 of them."""
    some = (x * relevance)[:500]
    squares = np.sum((some[:, None] - some[None]) ** 2, axis=-1)
    return float(np.sqrt(np.median(squares[np.triu_indices(len(some), 1)]))) or 1.0
