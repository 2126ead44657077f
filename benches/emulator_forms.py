"""How many frequencies an emulator of funnel pours needs, of its means and of its scales.

    granulcal generate funnel default -n 1410 --seed 501 -o pours
    python benches/emulator_forms.py pours

Each form is fitted to the first usable pours and tried on the last 300: mean log density of the
true parameters [nat, coordinates], one column for each seed of folds and frequencies.
"""

import argparse
from unittest.mock import patch

import numpy as np

import granulcal as gc
from granulcal.bayessim.emulator import emulator
from granulcal.bayessim.emulator.likelihood import WIDENINGS, Likelihood
from granulcal.bayessim.network.standardise import Standardiser
from granulcal.one_thread import one_thread

TESTS = 300
FORMS = ((32, 16), (100, 16), (200, 16), (100, 32), (100, 64), (200, 32))
"""Frequencies of the means and of the scales; (100, 16) is what is shipped."""


@one_thread()
def main() -> None:
    """Prints one row for each form."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("pours")
    parser.add_argument("--train", type=int, default=1000)
    parser.add_argument("--seeds", type=int, default=2)
    options = parser.parse_args()
    data = gc.Dataset.load(options.pours)
    usable = np.flatnonzero(data.is_usable)
    u = data.prior.to_unconstrained(data.theta[usable])
    z = Standardiser.fit(data.x[usable[: options.train]]).apply(data.x[usable])
    few, tests = slice(0, options.train), slice(-TESTS, None)
    print(f"| means | scales | axes | {' | '.join(f'seed {s}' for s in range(options.seeds))} |")
    print("|---" * (3 + options.seeds) + "|")
    for means, scales in FORMS:
        scores, axes = [], []
        for seed in range(options.seeds):
            with patch.object(emulator, "_SCALE_FEATURES", scales):
                found = Likelihood.fit(u[few], z[few], data.prior, features=means, seed=seed)[0]
            rows = found.held_out_scores(u[tests], z[tests])[0]
            scores.append(f"{rows[WIDENINGS.index(found.widening)].mean():.2f}")
            axes.append(str(found.axis_count))
        print(f"| {means} | {scales} | {', '.join(axes)} | {' | '.join(scores)} |", flush=True)


if __name__ == "__main__":
    main()
