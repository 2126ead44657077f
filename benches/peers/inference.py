"""Posteriors of granulcal beside sbi's, in one run: sbibm tasks, and held-out pours of a data set.

    pip install -r benches/peers/inference-requirements.txt
    pip install --no-deps sbibm==1.1.0
    python benches/peers/inference.py sbibm --simulations 1000 --out build/sbibm.csv
    python benches/peers/inference.py pours DATA --train 500 1000 --test 300 --out build/pours.csv

Rows are appended to the CSV file as they are done, and rows already there are not run again.
Seconds are processor times of this process on one thread; a busy machine makes them longer.

Reference:
    Lueckmann, Boelts, Greenberg, Goncalves and Macke, Benchmarking simulation-based inference,
    AISTATS 2021 (tasks, reference posteriors, C2ST).
"""

import argparse
import copy
import csv
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch

from granulcal.bayessim import BayesSim
from granulcal.bayessim.posterior.average import EMULATOR_ALONE
from granulcal.parameter import Parameter
from granulcal.prior import Prior

OURS = ("auto", "emulated", "mdrff", "plain")
SBI = ("maf", "nsf", "mdn")
TASKS = ("gaussian_linear", "gaussian_mixture", "two_moons", "slcp")
FIELDS = {
    "sbibm": ("task", "simulations", "observation", "method", "c2st", "fit_seconds"),
    "pours": (
        "train", "test", "method", "log_density", "standard_error", "median", "error_of_mean",
        "cover50", "cover80", "cover90", "cover95", "fit_seconds", "posterior_ms",
    ),
}  # fmt: skip


class Sbi:
    """sbi's neural posterior estimation with its defaults, in the prior's coordinates.

    A flow may put a posterior outside the prior, so that sbi would draw for hours: where nothing
    was accepted for `PATIENCE` seconds, the prior stands in for it, and `outside` counts that.
    """

    PATIENCE = 20.0

    def __init__(self, prior: Any, estimator: str) -> None:
        """Takes a torch prior over coordinates."""
        self.prior, self.estimator = prior, estimator
        self.lost: list[bytes] = []

    @property
    def outside(self) -> int:
        """Observations whose posterior lies outside the prior."""
        return len(self.lost)

    def fit(self, u: np.ndarray, x: np.ndarray) -> "Sbi":
        """Trains on coordinates (n, p) and statistics (n, s)."""
        from sbi.inference import NPE

        inference = NPE(self.prior, density_estimator=self.estimator, show_progress_bars=False)
        inference.append_simulations(
            torch.as_tensor(u, dtype=torch.float32), torch.as_tensor(x, dtype=torch.float32)
        )
        inference.train()
        self.posterior = inference.build_posterior()
        return self

    def sample(self, x: np.ndarray, n: int) -> np.ndarray:
        """Returns `n` draws of the coordinates given statistics (s,)."""
        observed = torch.as_tensor(x, dtype=torch.float32)[None]
        limits = {"show_progress_bars": False, "max_sampling_time": self.PATIENCE}
        try:
            return self.posterior.sample((n,), x=observed, **limits).numpy()
        except RuntimeError:
            self.lost.append(x.tobytes())
            return self.prior.sample((n,)).numpy()

    def log_prob(self, u: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Returns log densities of coordinates (n, p) given statistics (s,)."""
        observed = torch.as_tensor(x, dtype=torch.float32)[None]
        points = torch.as_tensor(u, dtype=torch.float32)
        if x.tobytes() in self.lost:
            return self.prior.log_prob(points).numpy()
        # The share of the flow outside the prior, which sbi divides by: to a hundredth of a nat.
        leakage = {"num_rejection_samples": 2000}
        log_prob = self.posterior.log_prob(points, x=observed, leakage_correction_params=leakage)
        return log_prob.numpy()


class Ours:
    """granulcal's BayesSim by one of its methods, in the prior's coordinates."""

    def __init__(self, prior: Prior, method: str) -> None:
        """Takes our prior."""
        self.prior, self.method = prior, method

    def fit(self, u: np.ndarray, x: np.ndarray) -> "Ours":
        """Trains on coordinates (n, p) and statistics (n, s)."""
        theta = self.prior.from_unconstrained(u)
        self.model = BayesSim.fit(theta, x, self.prior, quiet=True, method=self.method)
        print(f"    {self.model.summary}", flush=True)
        return self

    def sample(self, x: np.ndarray, n: int) -> np.ndarray:
        """Returns `n` draws of the coordinates given statistics (s,)."""
        return self.prior.to_unconstrained(self.model.posterior(x).sample(n, seed=1))

    def emulated(self) -> "Ours":
        """Returns the emulator alone that `auto` holds: the fit of `emulated`, not made again."""
        alone = Ours(self.prior, "emulated")
        alone.model = copy.copy(self.model)
        alone.model.amortised, alone.model.average = None, EMULATOR_ALONE
        return alone

    def log_prob(self, u: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Returns log densities of coordinates (n, p) given statistics (s,)."""
        return self.model.posterior(x).coordinate_log_prob(self.prior.from_unconstrained(u))


def sbibm_priors(task: Any) -> tuple[Prior, Any]:
    """Returns a task's prior as ours and as torch's, the latter over our coordinates."""
    distribution = task.get_prior_dist()
    support = getattr(distribution, "base_dist", distribution)
    count = task.dim_parameters
    if hasattr(support, "low"):
        bounds = zip(support.low.tolist(), support.high.tolist(), strict=True)
        ours = [
            Parameter(path=f"theta.{i}", distribution="uniform", low=low, high=high)
            for i, (low, high) in enumerate(bounds)
        ]
        cube = torch.distributions.Uniform(torch.zeros(count), torch.ones(count))
        return Prior(ours), torch.distributions.Independent(cube, 1)
    spread = distribution.covariance_matrix.diagonal().sqrt().tolist()
    means = distribution.loc.tolist()
    ours = [
        Parameter(path=f"theta.{i}", distribution="normal", mean=mean, sd=sd)
        for i, (mean, sd) in enumerate(zip(means, spread, strict=True))
    ]
    return Prior(ours), torch.distributions.MultivariateNormal(torch.zeros(count), torch.eye(count))


def run_sbibm(options: argparse.Namespace, add: Callable[..., None], done: set[tuple]) -> None:
    """C2ST against the reference posteriors: 0.5 cannot be distinguished, 1 always can."""
    import sbibm
    from sbibm.metrics import c2st

    for name in options.tasks:
        task = sbibm.get_task(name)
        prior, torch_prior = sbibm_priors(task)
        for count in options.simulations:
            torch.manual_seed(0)
            theta = task.get_prior()(num_samples=count)
            x = task.get_simulator()(theta).numpy()
            u = prior.to_unconstrained(theta.double().numpy())
            auto: Any = None
            for method in options.methods:
                observations = range(1, options.observations + 1)
                if all((name, str(count), str(o), method) in done for o in observations):
                    continue
                torch.manual_seed(1)
                started = time.process_time()
                if method == "emulated" and auto is not None:
                    made = auto.emulated()
                else:
                    made = Sbi(torch_prior, method) if method in SBI else Ours(prior, method)
                    made.fit(u, x)
                auto = made if method == "auto" else auto
                seconds = time.process_time() - started
                for o in observations:
                    if (name, str(count), str(o), method) in done:
                        continue
                    observed = task.get_observation(o).numpy()[0].astype(float)
                    reference = task.get_reference_posterior_samples(o)[: options.samples]
                    draws = prior.from_unconstrained(made.sample(observed, options.samples))
                    score = float(c2st(reference, torch.as_tensor(draws, dtype=torch.float32)))
                    add(name, count, o, method, round(score, 3), round(seconds, 1))


def run_pours(options: argparse.Namespace, add: Callable[..., None], done: set[tuple]) -> None:
    """Log density at the truth, error of the posterior mean and coverage on held-out pours."""
    from granulcal.bayessim.training.pairs import TrainingPairs
    from granulcal.pours.dataset import Dataset

    pairs = TrainingPairs.gather(Dataset.load(options.data))
    prior, count = pairs.prior, len(pairs.theta)
    print(f"{pairs.pair_count} pours, {count} usable, left out: {pairs.excluded}")
    # The last pours of a data set test, so that choices made on its first ones never saw them.
    order = np.arange(count)
    test, rest = order[count - options.test :], order[: count - options.test]
    u, x = prior.to_unconstrained(pairs.theta), pairs.x
    cube = torch.distributions.Uniform(torch.zeros(u.shape[1]), torch.ones(u.shape[1]))
    torch_prior = torch.distributions.Independent(cube, 1)
    for size in options.train:
        rows = rest[:size]
        if len(rows) < size:
            print(f"only {len(rows)} usable pours are left to train on, {size} asked for")
        for method in options.methods:
            if (str(len(rows)), str(len(test)), method) in done:
                continue
            torch.manual_seed(1)
            made = Sbi(torch_prior, method) if method in SBI else Ours(prior, method)
            started = time.process_time()
            made.fit(u[rows], x[rows])
            seconds = time.process_time() - started
            density, levels, errors = np.empty(len(test)), np.empty(len(test)), np.empty(u.shape[1])
            squares, took = [], 0.0
            for i, row in enumerate(test):
                started = time.process_time()
                draws = made.sample(x[row], 1000)
                took += time.process_time() - started
                density[i] = made.log_prob(u[row][None], x[row])[0]
                levels[i] = np.mean(made.log_prob(draws, x[row]) > density[i])
                squares.append((draws.mean(axis=0) - u[row]) ** 2)
            errors = np.sqrt(np.mean(squares, axis=0)) / u[test].std(axis=0)
            cover = [round(float(np.mean(levels < level)), 3) for level in (0.5, 0.8, 0.9, 0.95)]
            add(
                len(rows), len(test), method, round(float(density.mean()), 3),
                round(float(density.std() / np.sqrt(len(test))), 3),
                round(float(np.median(density)), 3),
                " ".join(f"{e:.3f}" for e in errors), *cover,
                round(seconds, 1), round(1e3 * took / len(test), 1),
            )  # fmt: skip
            if isinstance(made, Sbi) and made.outside:
                print(f"    {made.outside} of {len(test)} posteriors lie outside the prior")


def main() -> None:
    """Runs what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("sbibm", "pours"))
    parser.add_argument("data", type=Path, nargs="?", help="data set of `granulcal generate`")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--methods", nargs="+", default=[*OURS, *SBI], choices=[*OURS, *SBI])
    parser.add_argument("--tasks", nargs="+", default=list(TASKS), choices=TASKS)
    parser.add_argument("--simulations", type=int, nargs="+", default=[1000])
    parser.add_argument("--observations", type=int, default=3)
    parser.add_argument("--samples", type=int, default=2000)
    parser.add_argument("--train", type=int, nargs="+", default=[500, 1000])
    parser.add_argument("--test", type=int, default=300)
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    torch.set_num_threads(1)
    fields = FIELDS[options.what]
    key = 4 if options.what == "sbibm" else 3
    done: set[tuple] = set()
    if options.out.exists():
        with options.out.open(newline="") as file:
            done = {tuple(row[:key]) for row in list(csv.reader(file))[1:]}
    else:
        options.out.parent.mkdir(parents=True, exist_ok=True)
        options.out.write_text(",".join(fields) + "\n")

    def add(*row: Any) -> None:
        with options.out.open("a", newline="") as file:
            csv.writer(file, lineterminator="\n").writerow(row)
        print(*row, flush=True)

    (run_sbibm if options.what == "sbibm" else run_pours)(options, add, done)


if __name__ == "__main__":
    main()
