"""Does the number of Gaussians in the network's mixtures matter?

    granulcal generate funnel default -n 1410 --seed 1 -o pours
    python benches/components.py pours --train 500 1000 --components 1 2 3 5 8 12

The network alone (`mdrff`) by the first usable pours of the data set, and what it says of the last
ones: a row for each number, as it is done.
"""

import argparse
from pathlib import Path

import numpy as np

from granulcal.bayessim import BayesSim
from granulcal.bayessim.training.pairs import TrainingPairs
from granulcal.pours.dataset import Dataset


def main() -> None:
    """Prints a table: log density at held-out truths and validation loss."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path, help="data set of `granulcal generate`")
    parser.add_argument("--train", type=int, nargs="+", default=[500, 1000])
    parser.add_argument("--test", type=int, default=300, help="the last usable pours")
    parser.add_argument("--components", type=int, nargs="+", default=[1, 2, 3, 5, 8, 12])
    options = parser.parse_args()
    pairs = TrainingPairs.gather(Dataset.load(options.data))
    theta, x, prior = pairs.theta, pairs.x, pairs.prior
    held = slice(len(theta) - options.test, len(theta))
    print("| pours | components | log density | validation loss |")
    print("|---|---|---|---|")
    for size in options.train:
        for count in options.components:
            model = BayesSim.fit(
                theta[:size], x[:size], prior, quiet=True, method="mdrff", components=count
            )
            found = [
                float(model.posterior(row).coordinate_log_prob(truth)[0])
                for row, truth in zip(x[held], theta[held], strict=True)
            ]
            error = np.std(found) / np.sqrt(len(found))
            loss = np.mean(model.summary.validation_losses)
            print(f"| {size} | {count} | {np.mean(found):.2f} ± {error:.2f} | {loss:.2f} |")


if __name__ == "__main__":
    main()
