"""Where rounds pour, beside pours of the prior, where one pour tells as little as a funnel's.

    python benches/rounds_design.py --recordings 16 --designs even
    python benches/rounds_design.py --recordings 16 --designs even sharp

On `PileStandIn` with its noise doubled, whose posterior is known exactly; recordings
are the same for all rows, so that differences are surer than levels. The form of each emulator is
looked for more coarsely than by `infer_within_budget`, at a third of the time.
"""

import argparse

import numpy as np

from granulcal.bayessim.check.toys import PileStandIn
from granulcal.bayessim.emulator import likelihood
from granulcal.bayessim.emulator.likelihood import Likelihood
from granulcal.bayessim.network.standardise import Standardiser
from granulcal.bayessim.posterior.posterior import Posterior
from granulcal.bayessim.training import round_fit
from granulcal.bayessim.training.round_fit import RoundFit, first_design
from granulcal.one_thread import one_thread

BUDGET = 150
# Share of the budget that the first round takes from the prior, powers of the likelihood in the
# later ones, share of the prior in them.
DESIGNS = {
    "even": (0.4, (0.5, 0.5, 0.5), 0.1),
    "sharp": (0.27, (0.5, 0.75, 1.0), 0.05),
}
SMALL = {"few": 150, "many": 1000}


class Study:
    """Recordings of known truth, and what each way says of it."""

    def __init__(self, noise: float, count: int) -> None:
        """Draws `count` recordings."""
        self.toy = PileStandIn(seed=0, noise=noise)
        self.theta, self.x = self.toy.simulate(count, seed=500)
        slope = self.toy.prior.log_slope(self.theta)
        self.exact = self.toy.exact_log_prob(self.theta, self.x) - slope

    def of_the_prior(self, pours: int, seed: int) -> np.ndarray:
        """Returns the log density at each truth by one emulator of pours of the prior."""
        drawn, x = self.toy.simulate(pours, seed=seed)
        standardiser, prior = Standardiser.fit(x), self.toy.prior
        u, z = prior.to_unconstrained(drawn), standardiser.apply(x)
        fitted = Likelihood.fit(u, z, prior, features=100, seed=0)[0]
        rows = standardiser.apply(self.x)
        return np.array(
            [
                self._density(Posterior.from_conditions(prior, [(fitted, row[None])]), i)
                for i, row in enumerate(rows)
            ]
        )

    def in_rounds(self, first: float, powers: tuple[float, ...], share: float) -> np.ndarray:
        """Returns the same by rounds for each recording."""
        round_fit._PRIOR_SHARE = share
        return np.array([self._rounds(i, first, powers) for i in range(len(self.x))])

    def _rounds(self, i: int, first: float, powers: tuple[float, ...]) -> float:
        toy, size = self.toy, round(first * BUDGET)
        ends = np.linspace(size, BUDGET, len(powers) + 1).round().astype(int)
        u = first_design(toy.prior, size, i)
        x = toy.simulate_at(toy.prior.from_unconstrained(u), seed=1000 * i)
        fit = RoundFit.of(toy.prior, u, x, self.x[i][None], i)
        for number, (more, power) in enumerate(zip(np.diff(ends), powers, strict=True), start=1):
            design = fit.next(u, int(more), i + number + 1, power)
            made = toy.simulate_at(toy.prior.from_unconstrained(design), seed=1000 * i + number)
            u, x = np.concatenate([u, design]), np.concatenate([x, made])
            fit = RoundFit.of(toy.prior, u, x, self.x[i][None], i)
        density = self._density(fit.posterior, i)
        print(f"  recording {i}: {density:.2f}", flush=True)
        return density

    def _density(self, posterior: Posterior, i: int) -> float:
        return float(posterior.coordinate_log_prob(self.theta[i][None])[0])


@one_thread()
def main() -> None:
    """Prints one row for each way."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--recordings", type=int, default=16)
    parser.add_argument("--noise", type=float, default=2.0)
    parser.add_argument("--designs", nargs="+", default=["even"], choices=list(DESIGNS))
    options = parser.parse_args()
    likelihood._CELLS, likelihood._POOL = 1024, 8192
    likelihood.AXIS_COUNTS = (6, 16)
    study = Study(options.noise, options.recordings)
    print(f"exact: {study.exact.mean():.2f}")

    def show(name: str, densities: np.ndarray) -> None:
        lost = study.exact - densities
        error = lost.std() / np.sqrt(len(lost))
        print(f"| {name} | {densities.mean():.2f} | {lost.mean():.2f} ± {error:.2f} |", flush=True)

    print("| pours | log density | below exact |")
    print("|---|---|---|")
    few = np.mean([study.of_the_prior(SMALL["few"], 77 + i) for i in range(3)], axis=0)
    show(f"{SMALL['few']} of the prior (mean of three fits)", few)
    show(f"{SMALL['many']} of the prior", study.of_the_prior(SMALL["many"], 90))
    for name in options.designs:
        show(f"{BUDGET} in rounds, {name}", study.in_rounds(*DESIGNS[name]))


if __name__ == "__main__":
    main()
