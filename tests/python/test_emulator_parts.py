"""Parts of the emulator's fit: optimiser, slopes of the evidence, tails, single precision."""

import numpy as np
import pytest
import torch

from granulcal.bayessim.emulator.basis import _Evidence, _frequencies, polynomial
from granulcal.bayessim.emulator.noise import Noise
from granulcal.bayessim.network.adam import Adam


def test_adam_moves_as_torch_does() -> None:
    start = torch.tensor([1.0, -2.0, 0.5], dtype=torch.float64)
    ours, theirs = start.clone(), start.clone().requires_grad_(True)
    adam = Adam([ours], [0.3])
    reference = torch.optim.AdamW([theirs], lr=0.05, weight_decay=0.3)
    for _ in range(50):
        adam.step([4 * ours**3 + torch.sin(ours)], 0.05)
        reference.zero_grad()
        (theirs**4 - torch.cos(theirs)).sum().backward()
        reference.step()
    assert torch.allclose(ours, theirs.detach(), atol=1e-9)


def test_slopes_of_the_evidence_are_those_of_differences() -> None:
    generator = np.random.default_rng(0)
    v = generator.normal(size=(60, 2))
    targets = np.column_stack([np.sin(v[:, 0]), v[:, 1] ** 2]) + 0.1 * generator.normal(
        size=(60, 2)
    )
    frequencies = _frequencies(12, 2, 0)

    def evidence(log_length: np.ndarray, log_ratio: np.ndarray) -> float:
        phase = v @ (frequencies / np.exp(log_length)).T
        waves = np.concatenate([np.cos(phase), np.sin(phase)], axis=1) / np.sqrt(12)
        design = np.concatenate([3.0 * polynomial(v, 1), waves], axis=1)
        total = 0.0
        for y, ratio in zip(targets.T, np.exp(log_ratio), strict=True):
            covariance = design @ design.T / ratio + np.eye(len(y))
            square = y @ np.linalg.solve(covariance, y)
            total += 0.5 * (len(y) * np.log(square) + np.linalg.slogdet(covariance)[1])
        return total

    at = np.array([0.7, 1.1]), np.array([-2.0, -1.0])
    slopes = _Evidence(v, targets, frequencies).slopes(*at)
    for which in range(2):
        for i in range(2):
            step = np.zeros(2)
            step[i] = 1e-5
            high = [a + step * (n == which) for n, a in enumerate(at)]
            low = [a - step * (n == which) for n, a in enumerate(at)]
            difference = (evidence(*high) - evidence(*low)) / 2e-5
            assert slopes[which][i] == pytest.approx(difference, rel=1e-4, abs=1e-4)


def test_noise_of_two_sizes_gets_heavy_tails() -> None:
    generator = np.random.default_rng(0)
    size = np.where(generator.random(2000) < 0.5, 1.0, 0.1)
    white = generator.normal(size=(2000, 2)) * size[:, None]
    assert Noise.fit(white, heavy=True).degrees < 3 == Noise.fit(white).degrees
    assert Noise.fit(generator.normal(size=(2000, 2))).degrees >= 40
