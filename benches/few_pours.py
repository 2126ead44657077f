"""One recording, few pours: 150 in rounds beside pours of the prior and an iterative filter.

    python benches/few_pours.py --recordings 10
    python benches/few_pours.py --recordings 16 --noise 2 --no-filter

On `PileStandIn`, whose posterior is known exactly; with its noise doubled one pour
tells about as little as one of the funnel. The filter is the scheme of Cheng et al., written anew
from the paper: rounds of 16 simulations, weights by a normal likelihood whose covariance is a
multiple of the statistics' variances (there: of their squares, which here may be zero), the
multiple so large that a fifth of the simulations carry weight, and the next round from a normal
mixture (here: one normal) of the weighted ones.

Reference:
    Cheng, Shuku, Thoeni, Tempone, Luding and Magnanimo, An iterative Bayesian filtering framework
    for fast and automated calibration of DEM models, CMAME 350, 2019.
"""

import argparse

import numpy as np
from scipy import stats

from granulcal.bayessim.check.toys import PileStandIn
from granulcal.bayessim.emulator.likelihood import Likelihood
from granulcal.bayessim.network.mixture import Mixture
from granulcal.bayessim.network.standardise import Standardiser
from granulcal.bayessim.posterior.posterior import Posterior
from granulcal.bayessim.training.sequential import infer_within_budget
from granulcal.one_thread import one_thread

ROUNDS, SIZE, EFFECTIVE = 5, 16, 0.2


def of_the_prior(toy: PileStandIn, count: int, x_obs: np.ndarray, theta: np.ndarray) -> list:
    """Returns log density and coverage of each recording, by one emulator of prior pours."""
    drawn, x = toy.simulate(count, seed=77)
    standardiser = Standardiser.fit(x)
    u = toy.prior.to_unconstrained(drawn)
    fitted = Likelihood.fit(u, standardiser.apply(x), toy.prior, features=100, seed=0)[0]
    z = standardiser.apply(x_obs)
    return [
        judged(toy, Posterior.from_conditions(toy.prior, [(fitted, row[None])]), at)
        for row, at in zip(z, theta, strict=True)
    ]


def judged(toy: PileStandIn, posterior: Posterior, theta: np.ndarray) -> tuple[float, int]:
    """Returns the log density at the truth and how many 90 % intervals hold it."""
    u = toy.prior.to_unconstrained(theta[None])[0]
    draws = toy.prior.to_unconstrained(posterior.sample(2000))
    low, high = np.quantile(draws, [0.05, 0.95], axis=0)
    density = posterior.coordinate_log_prob(theta[None])[0]
    return float(density), int(np.sum((low <= u) & (u <= high)))


def filtered(toy: PileStandIn, x_obs: np.ndarray, seed: int) -> Posterior:
    """Returns the posterior of the iterative filter."""
    generator = np.random.default_rng(seed)
    u = generator.random((SIZE, 3))
    normal, spread = None, np.ones(16)
    for number in range(ROUNDS):
        theta = toy.prior.from_unconstrained(u)
        x = toy.simulate_at(theta, seed=seed * 100 + number)
        spread = x.std(axis=0) if normal is None else spread
        squares = np.sum(((x - x_obs) / spread) ** 2, axis=1)
        log_proposal = 0.0 if normal is None else normal.logpdf(u)
        for share in np.geomspace(1e-3, 1e4, 200):
            log_weights = -0.5 * squares / share - log_proposal
            weights = np.exp(log_weights - log_weights.max())
            weights /= weights.sum()
            if 1 / np.sum(weights**2) >= EFFECTIVE * SIZE:
                break
        mean = weights @ u
        covariance = (u - mean).T @ (weights[:, None] * (u - mean)) + 1e-6 * np.eye(3)
        normal = stats.multivariate_normal(mean, covariance)
        u = np.clip(normal.rvs(SIZE, random_state=generator), 0, 1)
    mixture = Mixture.from_covariances(np.ones(1), mean[None], covariance[None])
    return Posterior.from_mixture(toy.prior, mixture)


@one_thread()
def main() -> None:
    """Prints one row for each way."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--recordings", type=int, default=10)
    parser.add_argument("--budgets", type=int, nargs="+", default=[150])
    parser.add_argument("--noise", type=float, default=1.0, help="factor on the toy's noise")
    parser.add_argument("--no-filter", action="store_true", help="leave the iterative filter out")
    options = parser.parse_args()
    toy = PileStandIn(seed=0, noise=options.noise)
    theta, x = toy.simulate(options.recordings, seed=500)
    exact = toy.exact_log_prob(theta, x) - toy.prior.log_slope(theta)
    print(f"exact: {exact.mean():.2f}", flush=True)

    def show(name: str, rows: list) -> None:
        density, inside = np.array(rows, dtype=float).T
        error = density.std() / np.sqrt(len(rows))
        print(
            f"| {name} | {density.mean():.2f} ± {error:.2f} | {np.median(density):.2f} "
            f"| {np.mean(exact[: len(rows)] - density):.2f} "
            f"| {inside.sum():.0f} of {3 * len(rows)} |",
            flush=True,
        )

    print("| pours | log density | median | less than exact | truths in 90 % intervals |")
    if not options.no_filter:
        filters = [filtered(toy, row, i) for i, row in enumerate(x)]
        rows = [judged(toy, p, t) for p, t in zip(filters, theta, strict=True)]
        show("5 x 16, iterative filter", rows)
    for count in (150, 1000):
        show(f"{count} of the prior", of_the_prior(toy, count, x, theta))
    for budget in options.budgets:
        rows = []
        for i, row in enumerate(x):
            found = infer_within_budget(
                lambda at, first, i=i: toy.simulate_at(at, seed=1000 * i + first),
                toy.prior,
                row,
                budget=budget,
                seed=i,
            )
            rows.append(judged(toy, found.posterior, theta[i]))
            print(f"  {i} {rows[-1]}", flush=True)
        show(f"{budget} in rounds", rows)


if __name__ == "__main__":
    main()
