"""Trains the small model `pile`, with the statistics of a pile, for the command line's tests.

    python crates/bayessim/tests/data/make_models.py

The models `mdrff`, `auto` and `arithmetic` are not made anew: reference.json has what NumPy and
PyTorch said of them when Python evaluated posteriors itself, numbers that owe nothing to Rust.
"""

from pathlib import Path

import numpy as np
from safetensors.numpy import load_file, save_file

from granulcal.bayessim import BayesSim
from granulcal.pours.statistics import NAMES
from granulcal.prior import Prior

HERE = Path(__file__).parent
SMALL = {"features": 8, "ensemble": 2, "components": 2, "emulator_features": 8, "max_epochs": 15}


def _save(model: BayesSim, folder: Path) -> None:
    """Saves a model without the table that only spares time, for it is a megabyte."""
    model.save(folder)
    weights = folder / "weights.safetensors"
    kept = {k: v for k, v in load_file(weights).items() if not k.startswith("pool_")}
    save_file(kept, weights)


def main() -> None:
    """Writes the folder."""
    prior = Prior.default()
    theta = prior.sample(150, seed=0)
    generator = np.random.default_rng(1)
    x = prior.to_unconstrained(theta) @ generator.standard_normal((3, 16))
    x += 0.3 * generator.standard_normal(x.shape)
    model = BayesSim.fit(theta, x, prior, x_names=NAMES, quiet=True, method="emulated", **SMALL)
    _save(model, HERE / "pile")


if __name__ == "__main__":
    main()
