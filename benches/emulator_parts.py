"""What an emulator of few pours lacks: its parts, taken in turn from an emulator of many.

    python benches/emulator_parts.py --few 150 --many 1000

On `PileStandIn` with its noise doubled. Mean log density of 300 other truths under
their posteriors [nat, coordinates].
"""

import argparse
from dataclasses import replace
from unittest.mock import patch

import numpy as np

from granulcal.bayessim.check.toys import PileStandIn
from granulcal.bayessim.emulator import likelihood
from granulcal.bayessim.emulator.basis import learn_length_scales
from granulcal.bayessim.emulator.emulator import Prediction
from granulcal.bayessim.emulator.likelihood import WIDENINGS, Likelihood
from granulcal.bayessim.emulator.signal import SignalAxes
from granulcal.bayessim.network.standardise import Standardiser
from granulcal.one_thread import one_thread

TESTS = 300


class Joined:
    """Means, and what is unknown of them, by one emulator; the noise of another."""

    def __init__(self, means, noisy) -> None:
        """Takes two emulators of the same axes."""
        self.means, self.noisy = means, noisy
        self.noise, self.shift = noisy.noise, means.shift

    def predict(self, u, **options) -> Prediction:
        """Returns what is expected at `u` (n, p)."""
        means = self.means.predict(u, **options)
        return Prediction(means.means, self.noisy.predict(u, **options).scales, means.unknown)


@one_thread()
def main() -> None:
    """Prints one row for each part."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--few", type=int, default=150)
    parser.add_argument("--many", type=int, default=1000)
    parser.add_argument("--noise", type=float, default=2.0)
    options = parser.parse_args()
    toy = PileStandIn(seed=0, noise=options.noise)
    theta, x = toy.simulate(options.many + TESTS, seed=77)
    u = toy.prior.to_unconstrained(theta)
    z = Standardiser.fit(x[: options.many]).apply(x)
    u, tests, z, observed = u[:-TESTS], u[-TESTS:], z[:-TESTS], z[-TESTS:]

    def fit(count: int) -> Likelihood:
        return Likelihood.fit(u[:count], z[:count], toy.prior, features=100, seed=0)[0]

    def show(name: str, found: Likelihood) -> None:
        scores = found.held_out_scores(tests, observed)[0][WIDENINGS.index(found.widening)]
        print(f"| {name} | {scores.mean():.2f} |", flush=True)

    print("| parts of many | log density |")
    print("|---|---|")
    many = fit(options.many)
    show("all", many)
    show("none", fit(options.few))
    spread = (u - u.mean(axis=0)) / u.std(axis=0)
    rotated = SignalAxes.fit(spread, z).apply(z)
    lengths = learn_length_scales(u, rotated, features=100, seed=0)
    is_varying = bool(np.abs(many.leading.scale_coefficients[:, 1:]).max() > 0)

    def as_of_many(scores, levels):
        forms = (many.axis_count, is_varying, False)
        (key,) = [k for k in scores if (k.axis_count, k.varying_scale, k.heavy_tails) == forms]
        return key, WIDENINGS.index(many.widening)

    with patch.object(SignalAxes, "fit", lambda *_: many.axes):
        show("axes", fit(options.few))
        with (
            patch.object(likelihood, "learn_length_scales", lambda *_, **__: lengths),
            patch.object(likelihood, "_most_probable_of_the_honest", as_of_many),
        ):
            few = fit(options.few)
    show("axes, length scales, form", few)
    show(
        "axes, length scales, form, noise", replace(few, leading=Joined(few.leading, many.leading))
    )
    show(
        "axes, length scales, form, means", replace(few, leading=Joined(many.leading, few.leading))
    )


if __name__ == "__main__":
    main()
