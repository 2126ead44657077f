"""150 funnel pours in rounds for one recording, beside a model of pours of the prior.

    granulcal generate funnel default -n 1300 --seed 1 -o pours
    granulcal train pours -o model
    python benches/rounds_on_pours.py --out rounds --model model

Four materials of the prior's middle are poured once each: the recordings, whose truth is known.
For each, `infer_within_budget` spends its budget (minutes on one core; pours that are there are not
made again). Without `--model` only the rounds are run.
"""

import argparse
import json
from pathlib import Path

import numpy as np
from ten_pours import RANGES, draw

import granulcal as gc
from granulcal.bayessim.posterior.posterior import Posterior
from granulcal.bayessim.training.sequential import infer_within_budget
from granulcal.files import write_beside
from granulcal.one_thread import one_thread
from granulcal.pours.kept_pours import KeptPours

RECORDINGS = 4
_SEED_OF_RECORDINGS = 7000


def recorded(prior: gc.Prior, folder: Path, seed: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Returns the truth, shape (3,), and the statistics of its one pour, shape (16,), of each."""
    file = folder / "recordings.json"
    if not file.exists():
        found = []
        for number, row in enumerate(draw(seed)[:RECORDINGS]):
            by_path = {f"material.{name}": float(v) for name, v in zip(RANGES, row, strict=True)}
            scene = gc.Scene.funnel(height=0.12).with_(by_path)
            pour = gc.simulate(scene, seed=_SEED_OF_RECORDINGS + number)
            x = np.asarray(pour.statistics()).tolist()
            theta = [by_path[name] for name in prior.names]
            found.append({"theta": theta, "x": x, "status": pour.status})
        folder.mkdir(parents=True, exist_ok=True)
        write_beside(file, json.dumps(found))
    return [
        (np.array(row["theta"]), np.array(row["x"]))
        for row in json.loads(file.read_text(encoding="utf-8"))
    ]


def judged(posterior: Posterior, truth: np.ndarray) -> tuple[float, int, np.ndarray]:
    """Returns log density at the truth, how many 90 % intervals hold it, and the spreads."""
    prior = posterior.prior
    u = prior.to_unconstrained(truth[None])[0]
    draws = prior.to_unconstrained(posterior.sample(4000, seed=1))
    low, high = np.quantile(draws, [0.05, 0.95], axis=0)
    density = float(posterior.coordinate_log_prob(truth[None])[0])
    return density, int(np.sum((low <= u) & (u <= high))), draws.std(axis=0)


def show(name: str, rows: list[tuple[float, int, np.ndarray]]) -> None:
    """Prints one row of the table."""
    density = np.array([row[0] for row in rows])
    each = ", ".join(f"{d:.2f}" for d in density)
    spreads = ", ".join(f"{s:.3f}" for s in np.mean([row[2] for row in rows], axis=0))
    error = density.std(ddof=1) / np.sqrt(len(rows))
    inside = f"{sum(row[1] for row in rows)} of {3 * len(rows)}"
    print(f"| {name} | {density.mean():.2f} ± {error:.2f} | {each} | {inside} | {spreads} |")


@one_thread()
def main() -> None:
    """Prints a table: one row for the rounds, one for the model of the prior's pours."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="folder of the pours")
    parser.add_argument("--model", type=Path, help="model of pours of the prior")
    parser.add_argument("--budget", type=int, default=150)
    parser.add_argument("--recordings", type=int, default=RECORDINGS, help="the first of the four")
    parser.add_argument("--seed", type=int, default=303)
    parser.add_argument("--threads", type=int, default=1)
    options = parser.parse_args()
    prior = gc.Prior.default()
    recordings = recorded(prior, options.out, options.seed)[: options.recordings]
    rounds, misfits = [], []
    for number, (truth, x) in enumerate(recordings):
        pours = KeptPours(
            gc.Scene.funnel(height=0.12),
            prior,
            options.out / f"{number}-{options.budget}.json",
            seed=number,
            threads=options.threads,
        )
        found = infer_within_budget(
            pours, prior, x, budget=options.budget, seed=number, progress=print
        )
        rounds.append(judged(found.posterior, truth))
        misfits.append(found.misfit.is_inside)
        print(f"recording {number}: log density {rounds[-1][0]:.2f}", flush=True)
    print("| pours | log density | each | truths in 90 % intervals | sd, coordinates |")
    print("|---|---|---|---|---|")
    show(f"{options.budget} in rounds", rounds)
    if options.model is not None:
        model = gc.BayesSim.load(options.model)
        name = f"model of {model.summary.pair_count} pours of the prior"
        show(name, [judged(model.posterior(x), truth) for truth, x in recordings])
        inside = sum(model.misfit(x).is_inside for _, x in recordings)
        print(f"found inside the model: {inside} of {len(recordings)} by the model's test")
    print(f"found inside the model: {sum(misfits)} of {len(misfits)} after the rounds")


if __name__ == "__main__":
    main()
