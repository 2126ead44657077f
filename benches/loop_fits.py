"""What the loop's surrogate claims, and the words of its fits, on fresh pours: no check, no report.

    python benches/loop_fits.py level OUT plain    # squared error at the truth over what is claimed
    python benches/loop_fits.py words OUT plain    # a row of OUT/words-plain.jsonl for each set
    python benches/loop_fits.py table OUT plain    # their rates, with exact intervals

Scene, cameras, effects and archives are those of loop_rate.py; a missing archive is filled. Sets
have materials and seeds that are not in it: three pours at each of three heights. A set of words
takes some ten seconds of a core, where a whole run takes minutes.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from loop_rate import ALARMS, BLIND, HEIGHTS, KINDS, archive, rate, rows_of, scene_of
from numpy.typing import NDArray
from scipy.stats import chi2

import granulcal as gc
from granulcal.loop.close import fit_surrogate
from granulcal.loop.effects.design import normal_from_cube
from granulcal.loop.effects.library import by_name
from granulcal.loop.pours.archive import Archive
from granulcal.loop.pours.cube import from_cube
from granulcal.loop.pours.measures import Measures
from granulcal.loop.surrogate.condition_pours import ConditionPours
from granulcal.loop.surrogate.linearised import LinearisedSurrogate
from granulcal.loop.surrogate.stacked_means import StackedMeans
from granulcal.loop.task import FIT
from granulcal.loop.test.trace import trace
from granulcal.loop.test.verdict import NAMING

Array = NDArray[np.float64]

POURS, BUDGET = 3, 4000
TRUTHS = {
    "none": ("", 0.0),
    "offset -0.2 mm": ("camera.offset", -0.2),
    "offset 0.3 mm": ("camera.offset", 0.3),
    "blur 0.39 px": ("camera.blur", 0.13),
    "blur 0.6 px": ("camera.blur", 0.2),
    "3 % missing": ("camera.missing", 0.3),
    "diameter 3.94 mm": ("diameter", 0.15),
}
"""Effects of `level`, by what they are: name and psi."""


def pours(camera: str, unit: Array, name: str, psi: float, seed: int) -> list[Array]:
    """Returns the statistics of the pours of a set, (n, s) for each height.

    Args:
        camera: by name.
        unit: material in unit coordinates, shape (3,).
        name: of the effect; "" is none.
        psi: its strength.
        seed: of the first pour.
    """
    scene, prior = scene_of(camera), gc.Prior.load(BLIND / "prior.toml")
    own = dict(zip(prior.names, from_cube(prior, unit[None])[0].tolist(), strict=True))
    numbers, faults = {}, {}
    if name:
        (effect,) = (one.at(scene) for one in by_name([name]))
        numbers, faults = effect.numbers(psi), effect.faults(psi)
    found = []
    for height in HEIGHTS[FIT]:
        there = scene.with_({**own, **numbers, "funnel.height": height})
        first = seed + 10 * round(100 * height)
        many = [gc.simulate(there, seed=first + i) for i in range(POURS)]
        found.append(np.array([Measures.of(there).of_pour(pour, faults) for pour in many]))
    return found


def observed(store: Archive, x: list[Array]) -> list[ConditionPours]:
    """Returns the pours of a set as the loop has them."""
    plan = store.plan
    return [
        ConditionPours.of(f"{height:g} m", plan.unit({"funnel.height": height}), rows)
        for height, rows in zip(HEIGHTS[FIT], x, strict=True)
    ]


def level(out: Path, camera: str, sets: int) -> None:
    """Prints Q = (y - m)^T V^-1 (y - m) at the truth over the number of y, and its p."""
    store = archive(out, camera, BUDGET, 1)
    known = fit_surrogate(store, seed=0)
    names = [effect.name for effect in known.design.effects]
    print("| truth | Q over its mean | median | largest | p <= 0.05 | p <= 0.01 | farthest axis |")
    print("|---|---|---|---|---|---|---|")
    for label, (name, psi) in TRUTHS.items():
        found, farthest = [], 0.0
        for i in range(sets):
            unit = np.random.default_rng([i, 990]).uniform(size=3)
            # Another diameter, another pour.
            seed = 10_000_000 + 1000 * i + 500 * (name == "diameter")
            x = pours(camera, unit, name, psi, seed)
            stack = StackedMeans.of(known, observed(store, x))
            v = normal_from_cube(unit)
            local = LinearisedSurrogate.at(known, stack.conditions, stack.counts, v)
            strengths = local.none()
            if name:
                strengths[names.index(name)] = psi
            covariance = local.covariance(v, strengths)
            left = stack.means.ravel() - local.mean(v, strengths)
            found.append(float(left @ np.linalg.solve(covariance, left)))
            farthest = max(farthest, float(np.abs(left / np.sqrt(np.diag(covariance))).max()))
        count = known.size * len(HEIGHTS[FIT])
        ratio, p = np.array(found) / count, chi2.sf(found, count)
        print(
            f"| {label} | {ratio.mean():.2f} | {np.median(ratio):.2f} | {ratio.max():.2f} "
            f"| {100 * np.mean(p <= 0.05):.0f} % | {100 * np.mean(p <= 0.01):.0f} % "
            f"| {farthest:.1f} |",
            flush=True,
        )


def words(out: Path, camera: str, sets: int) -> None:
    """Writes what the fits say of nulls and effects in turn."""
    file = out / f"words-{camera}.jsonl"
    done = {row["set"] for row in rows_of(file)}
    todo = [i for i in range(sets) if i not in done]
    if not todo:
        return
    store = archive(out, camera, BUDGET, 1)
    known = fit_surrogate(store, seed=0)
    for i in todo:
        kind = KINDS.get(["", *KINDS][i % (1 + len(KINDS))])
        psi = kind.strength(kind.values[i // (1 + len(KINDS)) % 2]) if kind else 0.0
        truth = kind.truth if kind else ""
        is_noisy = camera == "noisy"
        unit = np.random.default_rng([i, 77, is_noisy]).uniform(size=3)
        x = pours(camera, unit, truth, psi, 20_000_000 + 1000 * i + 500 * is_noisy)
        found = trace(known, observed(store, x), seed=0)
        row = {
            "set": i,
            "truth": truth,
            "psi": psi,
            "word": found.verdict.kind,
            "named": found.verdict.named,
            "p": found.residual_test.p,
            "models": [(m.effects, m.log_probability, m.p_after) for m in found.explanations],
        }
        with file.open("a", encoding="utf-8") as rows:
            rows.write(json.dumps(row) + "\n")
        print(i, truth, found.verdict.kind, *found.verdict.named, flush=True)


def table(out: Path, camera: str) -> None:
    """Prints rates, and by how much the truth is more probable than the best other effect."""
    rows = rows_of(out / f"words-{camera}.jsonl")
    nulls = [row for row in rows if not row["truth"]]
    others = [row for row in rows if row["truth"]]
    named = [row for row in others if row["word"] in NAMING]
    print("| what | rate | 95 %, exact |\n|---|---|---|")
    rate("null: alarm", [row["word"] in ALARMS for row in nulls])
    rate("effect: alarm", [row["word"] in ALARMS for row in others])
    rate("effect: named", [row["word"] in NAMING for row in others])
    rate("effect: UNEXPLAINED", [row["word"] == "UNEXPLAINED" for row in others])
    rate("named: the truth alone", [row["named"] == [row["truth"]] for row in named])
    rate("named: the truth among them", [row["truth"] in row["named"] for row in named])
    leads = [lead for row in others if (lead := _lead(row)) is not None]
    below = sum(lead < -3 for lead in leads)
    print(f"\ntruth over the best other: {np.median(leads):.1f} nat (median of {len(leads)} sets)")
    print(f"more than 3 nat behind it in {below}")


def _lead(row: dict[str, Any]) -> float | None:
    """Log probability of the truth less that of the best other single effect [nat]."""
    alone = {effects[0]: log for effects, log, _ in row["models"] if len(effects) == 1}
    own = alone.pop(row["truth"], None)
    return None if own is None or not alone else own - max(alone.values())


def main() -> None:
    """Measures or prints."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("do", choices=("level", "words", "table"))
    parser.add_argument("out", type=Path)
    parser.add_argument("camera", choices=("plain", "noisy"))
    parser.add_argument("--sets", type=int, default=60)
    options = parser.parse_args()
    if options.do == "table":
        table(options.out, options.camera)
    else:
        do = level if options.do == "level" else words
        do(options.out, options.camera, options.sets)


if __name__ == "__main__":
    main()
