"""Trains small models and writes what Python says of them, for tests/agreement.rs.

    python crates/bayessim/tests/data/make_models.py

Torch's bits differ between versions, so models and numbers are made together and committed. The
folder `arithmetic` is of a granulcal that wrote version 3, and is only read.
"""

import json
from pathlib import Path

import numpy as np
from safetensors.numpy import load_file, save_file

from granulcal.bayessim import BayesSim
from granulcal.bayessim.posterior.average import Average
from granulcal.parameter import Parameter
from granulcal.pours.statistics import NAMES
from granulcal.prior import Prior

HERE = Path(__file__).parent
SMALL = {"features": 8, "ensemble": 2, "components": 2, "emulator_features": 8, "max_epochs": 15}
PRIOR = Prior(
    [
        Parameter(path="a", distribution="uniform", low=-1.0, high=3.0),
        Parameter(path="b", distribution="log_uniform", low=0.001, high=1.0),
        Parameter(path="c", distribution="normal", mean=1.0, sd=0.5, low=0.0),
    ]
)


def simulate(theta: np.ndarray, seed: int) -> np.ndarray:
    """Returns five statistics of each row, one of them wide and positive."""
    u = PRIOR.to_unconstrained(theta)
    noise = np.random.default_rng(seed).standard_normal((len(u), 5))
    clean = [u[:, 0], u[:, 1] + u[:, 0] ** 2, np.sin(u[:, 2]), u[:, 1] * u[:, 2], 3 * u[:, 1]]
    x = np.stack(clean, axis=1) + 0.3 * noise
    x[:, 4] = np.exp(x[:, 4])
    return x


def _save(model: BayesSim, folder: Path) -> None:
    """Saves a model without the table that only spares time, for it is a megabyte."""
    model.save(folder)
    weights = folder / "weights.safetensors"
    kept = {k: v for k, v in load_file(weights).items() if not k.startswith("pool_")}
    save_file(kept, weights)


def _said(model: BayesSim, tests: np.ndarray, at: np.ndarray) -> dict[str, list]:
    """Returns log densities at some parameters and means, for each observation."""
    posteriors = [model.posterior(row) for row in tests]
    return {
        "log_prob": [posterior.log_prob(at).tolist() for posterior in posteriors],
        "mean": [posterior.mean().tolist() for posterior in posteriors],
    }


def main() -> None:
    """Writes the folders and reference.json."""
    theta = PRIOR.sample(150, seed=0)
    x = simulate(theta, 1)
    tests = simulate(PRIOR.sample(4, seed=2), 3)
    tests[3, 0] = 99.0
    repeated = simulate(np.repeat(PRIOR.sample(1, seed=5), 3, axis=0), 6)
    at = PRIOR.sample(20, seed=4)
    reference = {"theta": at.tolist(), "x": tests.tolist(), "repeated": repeated.tolist()}
    for method in ("mdrff", "auto"):
        model = BayesSim.fit(theta, x, PRIOR, quiet=True, method=method, **SMALL)
        if method == "auto":
            # Whatever the weight was, the average is to be tested.
            network = BayesSim.fit(theta, x, PRIOR, quiet=True, method="mdrff", **SMALL)
            model.amortised, model.average = network.amortised, Average(0.7, 0.4)
        _save(model, HERE / method)
        reference[method] = _said(model, tests, at)
        if method == "auto":
            posterior = model.posterior(repeated)
            reference["repeated_log_prob"] = posterior.log_prob(at).tolist()
    reference["arithmetic"] = _said(BayesSim.load(HERE / "arithmetic"), tests, at)
    # With the statistics of a pile, for the command line.
    prior = Prior.default()
    theta = prior.sample(150, seed=0)
    generator = np.random.default_rng(1)
    x = prior.to_unconstrained(theta) @ generator.standard_normal((3, 16))
    x += 0.3 * generator.standard_normal(x.shape)
    model = BayesSim.fit(theta, x, prior, x_names=NAMES, quiet=True, method="emulated", **SMALL)
    _save(model, HERE / "pile")
    (HERE / "reference.json").write_text(json.dumps(reference) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
