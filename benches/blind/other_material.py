r"""What no other material of granulcal explains of another engine's pours: chi squared over n.

    python benches/blind/other_material.py out/pairs --out out/materials
    python benches/blind/other_material.py out/liggghts --out out/by-law --law impact_friction=1.16

Takes the pairs that `code_pairs.py` has made. For one pour of theirs of a material at each of the
three heights to fit, y,

    m(theta), s(theta), R   means (cubic), spreads (quadratic) and correlation of granulcal's pours,
                            from a bank of `BANK` pours at each height
    theta = argmin |y - m|^2 in (s R s)^-1, within the prior
    x = means of `FRESH` fresh pours at theta, no emulator in between
    chi2 = |y - x - J d|^2 in (s R s (1 + 1/FRESH))^-1 at its least, d a last step by the slopes J

and chi2 / (n - 3) over the 16 statistics at three heights, n = 48, is 1 where another material
explains all. Beside it stands the same of a pour of granulcal in place of theirs, which has to be
1 within its scatter.
"""

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from arguments import add_law
from code_pairs import SEED
from make import CONDITIONS
from numpy.typing import NDArray
from scene import PARAMETERS, PRIOR, Bench
from scipy.optimize import least_squares

import granulcal as gc
from granulcal.bayessim.emulator.basis import polynomial
from granulcal.files import beside
from granulcal.loop.pours.cube import from_cube
from granulcal.pours.statistics import NAMES

Array = NDArray[np.float64]

BANK, FRESH = 300, 12
"""Pours of the bank at a height; fresh pours at a fit."""
SIZE = len(NAMES)
_STARTS, _STEP = 12, 1e-3


@dataclass(frozen=True)
class Emulator:
    """granulcal's pours at one height over the cube of the prior, u from -1 to 1.

    Attributes:
        mean: coefficients of the cubic, shape (20, 16).
        log_scale: of the quadratic of ln s, shape (10, 16).
        correlation: R, shape (16, 16).
    """

    mean: Array
    log_scale: Array
    correlation: Array

    @classmethod
    def fit(cls, u: Array, x: Array) -> "Emulator":
        """Returns it from pours x (n, 16) at u (n, 3)."""
        cubic, quadratic = polynomial(u, 3), polynomial(u, 2)
        weights = np.ones_like(x)
        for _ in range(3):
            mean = np.stack(
                [
                    np.linalg.lstsq(cubic * w[:, None], w * y, rcond=None)[0]
                    for w, y in zip(weights.T, x.T, strict=True)
                ],
                axis=1,
            )
            left = x - cubic @ mean
            # E ln |N(0, 1)| = -0.635.
            logs = np.log(np.abs(left) + 1e-3 * left.std(axis=0)) + 0.635
            log_scale = np.linalg.lstsq(quadratic, logs, rcond=None)[0]
            weights = np.exp(-quadratic @ log_scale)
        white = left * weights
        # ln s is of the middle of the noise; its tails count, too, and so do the coefficients.
        factor = np.sqrt((white**2).sum(axis=0) / (len(x) - cubic.shape[1]))
        log_scale[0] += np.log(factor)
        return cls(mean, log_scale, np.corrcoef(white, rowvar=False))

    def at(self, u: Array) -> tuple[Array, Array]:
        """Returns m (16,) and the root of s R s (16, 16) at u (3,)."""
        scale = np.exp(polynomial(u[None], 2)[0] @ self.log_scale)
        return polynomial(u[None], 3)[0] @ self.mean, scale[:, None] * np.linalg.cholesky(
            self.correlation
        )


def whitened(emulators: list[Emulator], u: Array, y: Array, roots_at: Array) -> Array:
    """Returns y (H, 16) less the means at u, whitened by the spreads at `roots_at`, (H 16,)."""
    parts = []
    for emulator, row in zip(emulators, y, strict=True):
        root = emulator.at(roots_at)[1]
        parts.append(np.linalg.solve(root, row - emulator.at(u)[0]))
    return np.concatenate(parts)


def nearest(emulators: list[Emulator], y: Array, seed: int) -> Array:
    """Returns u (3,) of the material whose pours y (H, 16) are most like."""
    best = None
    for start in np.random.default_rng(seed).uniform(-0.9, 0.9, (_STARTS, 3)):
        at = start
        for _ in range(3):
            # Spreads take no part in the gradient.
            found = least_squares(
                lambda u, held=at: whitened(emulators, u, y, held), at, bounds=(-1.0, 1.0)
            )
            at = np.clip(found.x, -0.999, 0.999)
        if best is None or found.cost < best[0]:
            best = found.cost, found.x
    assert best is not None
    return best[1]


def left(emulators: list[Emulator], y: Array, u: Array, fresh: list[Array]) -> float:
    """Returns chi2 / (n - 3) of y (H, 16) beside fresh pours (k, 16) at u, each height's own."""
    gaps, slopes = [], []
    for emulator, row, pours in zip(emulators, y, fresh, strict=True):
        root = emulator.at(u)[1] * np.sqrt(1.0 + 1.0 / len(pours))
        gaps.append(np.linalg.solve(root, row - pours.mean(axis=0)))
        moved = [
            (emulator.at(u + _STEP * e)[0] - emulator.at(u - _STEP * e)[0]) / (2 * _STEP)
            for e in np.eye(3)
        ]
        slopes.append(np.linalg.solve(root, np.stack(moved, axis=1)))
    gap, slope = np.concatenate(gaps), np.concatenate(slopes)
    rest = gap - slope @ np.linalg.lstsq(slope, gap, rcond=None)[0]
    return float(rest @ rest) / (len(rest) - 3)


class Pours:
    """granulcal's pours, seen by the camera without noise, over the cube of the prior."""

    def __init__(self, law: dict[str, float]) -> None:
        """Reads the experiment; `law` are further numbers of the material."""
        self.bench, self.prior = Bench.load(law), gc.Prior.load(PRIOR)

    def theta(self, u: Array) -> Array:
        """Returns mu_s, mu_r, e (n, 3) of u (n, 3)."""
        return from_cube(self.prior, 0.5 * (u + 1.0))

    def rows(self, u: Array, height: float, seeds: range) -> Array:
        """Returns the statistics of pours at u (n, 3), or (3,) for all; NaN where unusable."""
        theta = self.theta(np.broadcast_to(u, (len(seeds), 3)))
        rows = np.full((len(seeds), SIZE), np.nan)
        for i, seed in enumerate(seeds):
            pour = self.bench.pour(theta[i], height, seed)
            if pour.status in ("at_rest", "out_of_view"):
                rows[i] = self.bench.observe(pour.positions, pour.radii).paper16
        return rows


def main() -> None:
    """Prints chi2 / (n - 3) of every material."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("pairs", type=Path, help="folder of code_pairs.py")
    parser.add_argument("--out", type=Path, required=True, help="folder of the bank")
    parser.add_argument("--materials", type=int, default=20)
    add_law(parser)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    pours, heights = Pours(dict(options.law)), CONDITIONS["fit"]
    emulators = []
    for h, height in enumerate(heights):
        file = options.out / f"bank-{round(1000 * height):03d}.npz"
        if not file.exists():
            u = np.random.default_rng([SEED, h]).uniform(-1.0, 1.0, (BANK, 3))
            x = pours.rows(u, height, range(50_000 + 1000 * h, 50_000 + 1000 * h + BANK))
            with beside(file) as draft:
                np.savez(draft, u=u, x=x)
        bank = np.load(file)
        good = np.isfinite(bank["x"]).all(axis=1)
        emulators.append(Emulator.fit(bank["u"][good], bank["x"][good]))
    theta = gc.Prior.load(PRIOR).sample(options.materials, seed=SEED)
    print("| material | " + " | ".join(PARAMETERS) + " | nearest | other engine | granulcal |")
    print("|---" * (len(PARAMETERS) + 4) + "|")
    theirs, ours = [], []
    for number, row in enumerate(theta):
        pairs = [
            dict(np.load(options.pairs / f"{number:02d}-{round(1000 * h):03d}.npz"))
            for h in heights
        ]
        cells = []
        for kind, kept in (("theirs", theirs), ("ours", ours)):
            if any(p["held"] > 0 or len(p["ours"]) == 0 for p in pairs):
                cells.append(("-", "-"))
                continue
            y = np.array(
                [(p["theirs"] if kind == "theirs" else p["ours"][0])[:SIZE] for p in pairs]
            )
            u = nearest(emulators, y, number)
            first = 80_000 + 1000 * number + (0 if kind == "theirs" else 500)
            fresh = [
                rows[np.isfinite(rows).all(axis=1)]
                for h, height in enumerate(heights)
                for rows in [pours.rows(u, height, range(first + 100 * h, first + 100 * h + FRESH))]
            ]
            kept.append(left(emulators, y, u, fresh))
            at = ", ".join(f"{value:.3g}" for value in pours.theta(u[None])[0])
            cells.append((at, f"{kept[-1]:.2f}"))
        own = " | ".join(f"{value:.3g}" for value in row)
        print(f"| {number} | {own} | {cells[0][0]} | {cells[0][1]} | {cells[1][1]} |", flush=True)
    for name, found in (("the other engine", theirs), ("granulcal", ours)):
        values = np.array(found)
        error = values.std(ddof=1) / np.sqrt(len(values))
        met = f"at most 1.2 in {(values <= 1.2).sum()} of {len(values)}"
        middle = f"{values.mean():.2f} ± {error:.2f}, median {np.median(values):.2f}"
        print(f"{name}: chi2 / (n - 3) {middle}, {met}")


if __name__ == "__main__":
    main()
