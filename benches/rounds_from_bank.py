"""150 pours in rounds beside pours of the prior, for many recordings, from pours that are there.

    granulcal generate funnel default -n 1300 --seed 1 -o pours
    python benches/rounds_from_bank.py pours --recordings 30

The last usable pours of the data set are the recordings, whose truth is known; the others are a
bank. A round asks for parameters and gets those of the nearest pour of the bank that it has not had
yet: no pour is made, so that many recordings can be compared. The bank is as dense as its pours, so
that rounds gain less from it than from pours made for them.
"""

import argparse
from pathlib import Path

import numpy as np
from rounds_on_pours import judged, show

from granulcal.bayessim import BayesSim
from granulcal.bayessim.emulator.likelihood import Likelihood
from granulcal.bayessim.network.standardise import Standardiser
from granulcal.bayessim.posterior.posterior import Posterior
from granulcal.bayessim.training.sequential import rounds_of
from granulcal.one_thread import one_thread
from granulcal.pours.dataset import Dataset
from granulcal.prior import Prior

Array = np.ndarray


class Bank:
    """Pours that are there, each given once.

    Args:
        u: their coordinates, shape (n, p).
        x: their statistics, NaN for a pour without, shape (n, s).
    """

    def __init__(self, u: Array, x: Array) -> None:
        """All are left."""
        self.u, self.x = u, x
        self.is_left = np.ones(len(u), dtype=bool)

    def __call__(self, design: Array, first: int) -> tuple[Array, Array]:
        """Returns coordinates (b, p) and statistics (b, s) of pours near `design` (b, p)."""
        rows = []
        for asked in design:
            distance = np.linalg.norm(self.u - asked, axis=1)
            rows.append(int(np.where(self.is_left, distance, np.inf).argmin()))
            self.is_left[rows[-1]] = False
        return self.u[rows], self.x[rows]


def of_the_prior(prior: Prior, u: Array, x: Array, observed: Array) -> list[Posterior]:
    """Returns the posterior of each row of `observed` by one emulator of `u` (n, p), `x` (n, s)."""
    usable = np.isfinite(x).all(axis=1)
    standardiser = Standardiser.fit(x[usable])
    z = standardiser.apply(x[usable])
    fitted = Likelihood.fit(u[usable], z, prior, features=100, seed=0)[0]
    rows = standardiser.apply(observed)
    return [Posterior.from_conditions(prior, [(fitted, row[None])]) for row in rows]


def by_default(prior: Prior, u: Array, x: Array, observed: Array) -> list[Posterior]:
    """Returns the same by the default of `granulcal train`."""
    usable = np.isfinite(x).all(axis=1)
    theta = prior.from_unconstrained(u[usable])
    model = BayesSim.fit(theta, x[usable], prior, quiet=True)
    return [model.posterior(row) for row in observed]


@one_thread()
def main() -> None:
    """Prints one row for each way; the last is the difference that the bar asks for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path, help="data set of `granulcal generate`")
    parser.add_argument("--recordings", type=int, default=30)
    parser.add_argument("--budget", type=int, default=150)
    parser.add_argument(
        "--most", type=int, default=1000, help="pours of the prior to compare with, usable or not"
    )
    options = parser.parse_args()
    data = Dataset.load(options.data)
    prior = data.prior
    columns = [data.theta_names.index(name) for name in prior.names]
    u = prior.to_unconstrained(data.theta[:, columns])
    x = np.where(data.is_usable[:, None], data.x, np.nan)
    held = np.flatnonzero(data.is_usable)[-options.recordings :]
    truths, observed = prior.from_unconstrained(u[held]), x[held]
    u, x = u[: held[0]], x[: held[0]]
    print(f"{len(u)} pours in the bank, {len(held)} recordings", flush=True)
    print("| pours | log density | each | truths in 90 % intervals | sd, coordinates |")
    print("|---|---|---|---|---|")
    rows = {}
    most = min(options.most, len(u))
    ways = {
        f"{options.budget} of the prior": (options.budget, of_the_prior),
        f"{most} of the prior": (most, of_the_prior),
        f"{most} of the prior, by `auto`": (most, by_default),
    }
    for name, (count, posteriors_of) in ways.items():
        posteriors = posteriors_of(prior, u[:count], x[:count], observed)
        rows[name] = [judged(p, truth) for p, truth in zip(posteriors, truths, strict=True)]
        show(name, rows[name])
    rounds = []
    for number, (truth, row) in enumerate(zip(truths, observed, strict=True)):
        found = rounds_of(Bank(u, x), prior, row, budget=options.budget, seed=number)
        rounds.append(judged(found.posterior, truth))
        print(f"recording {number}: {rounds[-1][0]:.2f}, {found.choice}", flush=True)
    show(f"{options.budget} in rounds", rounds)
    for name, others in rows.items():
        gain = np.array([a[0] - b[0] for a, b in zip(rounds, others, strict=True)])
        error = gain.std(ddof=1) / np.sqrt(len(gain))
        print(f"in rounds less {name}: {gain.mean():.2f} ± {error:.2f}")


if __name__ == "__main__":
    main()
