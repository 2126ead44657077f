"""Several pours of one material: does one posterior of all of them hold the truth?

    granulcal generate funnel default -n 1300 --seed 1 -o pours
    granulcal train pours -o model
    python benches/ten_pours.py model --out truths --plot pair.png

Ten materials are drawn, each is poured ten times (minutes on one core; pours that are there are
not made again), and the posteriors of the first pour and of all ten are held against the truth;
log densities are over the prior's coordinates.
"""

import argparse
from pathlib import Path

import numpy as np

import granulcal as gc

MATERIALS, POURS = 10, 10
# Inside the default prior, away from its edges.
RANGES = {
    "sliding_friction": (0.15, 0.95),
    "rolling_friction": (0.02, 0.8),
    "restitution": (0.1, 0.75),
}
SAMPLES = 4000


def draw(seed: int) -> np.ndarray:
    """Returns the materials, shape (10, 3); rolling friction is uniform in its logarithm."""
    random = np.random.default_rng(seed)
    columns = [
        np.exp(random.uniform(*np.log(bounds), MATERIALS))
        if name == "rolling_friction"
        else random.uniform(*bounds, MATERIALS)
        for name, bounds in RANGES.items()
    ]
    return np.stack(columns, axis=1)


def pours(truth: np.ndarray, file: Path, seed: int) -> np.ndarray:
    """Returns the statistics of the pours of one material that can be used, shape (k, 16)."""
    if not file.exists():
        changes = {f"material.{name}": float(v) for name, v in zip(RANGES, truth, strict=True)}
        scene = gc.Scene.funnel(height=0.12).with_(changes)
        made = [gc.simulate(scene, seed=seed + number) for number in range(POURS)]
        usable = [pour for pour in made if pour.status not in ("unhealthy", "jammed")]
        file.parent.mkdir(parents=True, exist_ok=True)
        np.save(file, np.array([pour.statistics().paper16 for pour in usable]))
    return np.load(file)


def main() -> None:
    """Prints a table: how many of the 30 truths the 90 % intervals hold, how wide they are."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("model")
    parser.add_argument("--out", type=Path, default=Path("truths"))
    parser.add_argument("--seed", type=int, default=77)
    parser.add_argument("--plot", type=Path, help="picture of the first material's posteriors")
    options = parser.parse_args()
    model = gc.BayesSim.load(options.model)
    found = {1: [], POURS: []}
    for number, truth in enumerate(draw(options.seed)):
        x = pours(truth, options.out / f"{number:02d}.npy", 100 * (number + 1))
        posteriors = {k: model.posterior(x[:k]) for k in found}
        if options.plot is not None and number == 0:
            posteriors[POURS].pair_plot(options.plot, truth=truth, extra=posteriors[1])
        for k, rows in found.items():
            posterior = posteriors[k]
            sample = posterior.sample(SAMPLES, seed=1)
            density = posterior.coordinate_log_prob(truth)[0]
            low, high = np.quantile(sample, [0.05, 0.95], axis=0)
            inside = (low <= truth) & (truth <= high)
            misfit = model.misfit(x[:k])
            error = sample.mean(axis=0) - truth
            rows.append((density, inside, sample.std(axis=0), error, misfit.is_inside))
    print(
        "| pours | log density | truths in their 90 % interval | sd of the posterior "
        "| rms error of its mean | inside the model |"
    )
    print("|---|---|---|---|---|---|")
    for k, rows in found.items():
        columns = (np.array(column) for column in zip(*rows, strict=True))
        density, inside, width, error, is_inside = columns
        text = [
            ", ".join(f"{v:.3f}" for v in values)
            for values in (width.mean(axis=0), np.sqrt((error**2).mean(axis=0)))
        ]
        held = f"{inside.sum()} of {inside.size}"
        known = f"{density.mean():.2f} ± {density.std(ddof=1) / np.sqrt(len(rows)):.2f}"
        print(
            f"| {k} | {known} | {held} | {text[0]} | {text[1]} | {is_inside.sum()} of {len(rows)} |"
        )


if __name__ == "__main__":
    main()
