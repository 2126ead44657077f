"""Infer a material: simulate a training set, train BayesSim, ask it about a pour."""

import argparse
from pathlib import Path

import granulcal as gc


def main() -> None:
    """Prints the 90 % interval of each parameter beside the true value."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pours", type=int, default=200, help="training pours")
    parser.add_argument("--count", type=int, default=500, help="grains of each pour")
    parser.add_argument("--out", type=Path, default=Path("out/calibrate"), help="folder")
    options = parser.parse_args()

    scene = gc.Scene.drop(0.05, count=options.count, preset="fast")
    data = gc.generate(scene, gc.Prior.default(), options.pours, out=options.out)
    model = gc.BayesSim.fit(data)

    truth = gc.Material(sliding_friction=0.4, rolling_friction=0.05, restitution=0.5)
    observed = gc.simulate(scene, truth, seed=7).statistics()
    print(model.misfit(observed))
    posterior = model.posterior(observed)
    region = posterior.credible_region(0.9)
    for name, value in zip(posterior.names, posterior.mode(), strict=True):
        low, high = region[name]
        true = truth.values()[name]
        print(f"{name:<28} true {true:.3g}, mode {value:.3g}, 90 % {low:.3g} to {high:.3g}")


if __name__ == "__main__":
    main()
