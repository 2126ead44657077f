"""How often the loop is right on a stand-in whose missing effects are known.

    python benches/loop_toy.py run OUT.jsonl --archive 0 --sets 100   # one archive, resumable
    python benches/loop_toy.py table OUT.jsonl [OUT2.jsonl ...]       # prints the table

Each archive has 1500 base pours and 150 for each of 8 effects. A set is 5 pours at each of three
heights with a material of its own: half of the sets without effect, 3/10 with one of the library,
1/20 with two, 3/20 with one that the library lacks. Sealed heights are two others.
"""

import argparse
import json
import sys
from dataclasses import dataclass
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np
from loop_pile import HIDDEN, LIBRARY, PileLoopToy
from numpy.typing import NDArray
from rates import median, rate

from granulcal.loop import ConditionPours, Surrogate, Thresholds, compare, trace
from granulcal.loop.check.discrepancy import Discrepancy
from granulcal.loop.surrogate.baseline import fit_base
from granulcal.loop.surrogate.stacked_means import StackedMeans
from granulcal.loop.test.refit import fit_single

Array = NDArray[np.float64]

FIT, SEALED = (0.2, 0.6, 1.0), (0.4, 0.8)
POURS, MANY = 5, 40
STRENGTHS = (0.3, 0.6, 0.9)
RULES = Thresholds(replicates=1000, replicates_after=400, refits=16)


@dataclass(frozen=True)
class Truth:
    """What a set is made with."""

    kind: str
    effects: tuple[str, ...]
    strengths: tuple[float, ...]

    @classmethod
    def of(cls, index: int, generator: np.random.Generator) -> "Truth":
        """Returns the truth of a set; kinds come in a fixed order so that any prefix is fair."""
        turn, round_ = index % 20, index // 20
        names = [effect.name for effect in LIBRARY]
        if turn % 2 == 0:
            return cls("null", (), ())
        if turn in (1, 5, 7, 11, 13, 17):
            count = 6 * round_ + (1, 5, 7, 11, 13, 17).index(turn)
            strength = STRENGTHS[(count // len(names)) % 3]
            effect = LIBRARY[count % len(names)]
            sign = -1 if effect.is_two_sided and generator.random() < 0.5 else 1
            return cls("single", (effect.name,), (sign * strength,))
        if turn == 19:
            first, second = generator.choice(len(names), size=2, replace=False)
            return cls("pair", (names[first], names[second]), (0.7, 0.7))
        count = 3 * round_ + (3, 9, 15).index(turn)
        return cls("hidden", (HIDDEN[count % 3],), ((0.5, 1.0)[(count // 3) % 2],))


def one_set(toy: PileLoopToy, surrogate: Surrogate, archive: int, index: int) -> dict[str, Any]:
    """Returns the row of one set."""
    generator = np.random.default_rng([archive, index, 77])
    truth = Truth.of(index, generator)
    theta = generator.uniform(0.05, 0.95, 3)
    library = [effect.name for effect in LIBRARY]
    psi, hidden = np.zeros(len(library)), {}
    for name, strength in zip(truth.effects, truth.strengths, strict=True):
        if name in library:
            psi[library.index(name)] = strength
        else:
            hidden[name] = strength

    def pour(t: Array, height: float, p: Array, count: int, lacking: dict[str, float]) -> Array:
        rows = np.tile(t, (count, 1)), np.full((count, 1), height), np.tile(p, (count, 1))
        return toy.simulate(*rows, generator, lacking)

    observed = [ConditionPours.of(f"{h:g}", [h], pour(theta, h, psi, POURS, hidden)) for h in FIT]
    found = trace(surrogate, observed, RULES, seed=index)
    many = [ConditionPours.of(f"{h:g}", [h], pour(theta, h, psi, MANY, hidden)) for h in FIT]
    row: dict[str, Any] = {
        "index": index,
        "archive": archive,
        "kind": truth.kind,
        "effects": truth.effects,
        "strengths": truth.strengths,
        "delta": _delta(surrogate, many),
        "p": found.residual_test.p,
        "p_each": [
            found.residual_test.p_library,
            found.residual_test.p_any,
            found.residual_test.p_smooth,
        ],
        "adjusted": found.residual_test.adjusted.tolist(),
        "verdict": found.verdict.kind,
        "named": found.verdict.named,
        "models": [
            [one.effects, one.log_probability, one.p_after] for one in found.explanations[:4]
        ],
        "bartlett": found.residual_test.factors.tolist(),
        "theta": theta.tolist(),
        "theta_fit": found.base.theta.tolist(),
    }
    if truth.kind == "single":
        k = library.index(truth.effects[0])
        stack = StackedMeans.of(surrogate, observed)
        base = fit_base(surrogate, stack, index)
        model = fit_single(base[0], stack.means.ravel(), base[1], k, RULES)
        row["strength"] = [float(model.strengths[0]), *model.intervals[0].tolist()]
        best = [m for m in found.explanations if len(m.effects) == 1]
        row["first"] = (
            best[0].effects[0] if best else library[int(found.residual_test.squares.argmax())]
        )
    if found.verdict.kind in ("EFFECT", "SET", "EFFECTS", "UNEXPLAINED"):
        row["removed"], row["fallback"] = _removed(toy, surrogate, found, pour, theta, psi, hidden)
    return row


def _delta(surrogate: Surrogate, many: list[ConditionPours]) -> float:
    """Distance that the best base fit leaves, paper's statistics, noise removed."""
    stack = StackedMeans.of(surrogate, many)
    local, fit = fit_base(surrogate, stack, 0)
    count = len(stack.counts)
    back = surrogate.from_axes
    root = local.in_statistics(np.linalg.cholesky(local.pour_covariance(fit.v, fit.psi)))
    noise = np.sum(root**2, axis=1).reshape(count, -1)
    square = ((fit.residual.reshape(count, -1) @ back) ** 2 - noise)[:, :16].sum(axis=1).mean()
    return sqrt(max(float(square), 0.0))


def _removed(
    toy: PileLoopToy,
    surrogate: Surrogate,
    found: Any,
    pour: Any,
    theta: Array,
    psi: Array,
    hidden: dict[str, float],
) -> tuple[float, float]:
    """Share of D^2 gone at sealed heights: by the best explanation, and by the correction."""
    measured = [pour(theta, h, psi, MANY, hidden) for h in SEALED]
    best = found.best
    if found.verdict.kind == "UNEXPLAINED" and found.explanations:
        best = found.explanations[0]
    strengths = np.zeros(len(psi))
    names = [effect.name for effect in LIBRARY]
    for name, strength in zip(best.effects, best.best_strengths, strict=True):
        strengths[names.index(name)] = strength
    before = [pour(found.base.theta, h, np.zeros(len(psi)), MANY, {}) for h in SEALED]
    after = [pour(best.theta, h, strengths, MANY, {}) for h in SEALED]
    columns = surrogate.columns[:16]
    cut = [[x[:, columns] for x in group] for group in (measured, before, after)]
    spread = surrogate.raw_spread[columns]
    labels = [f"{h:g}" for h in SEALED]
    removed = compare(labels, *cut, spread, draws=100).removed
    # The correction lives on the transformed scale.
    local = found.local
    stack = StackedMeans.of(
        surrogate, [ConditionPours.of("", [h], m) for h, m in zip(SEALED, measured, strict=True)]
    )
    base = StackedMeans.of(
        surrogate, [ConditionPours.of("", [h], m) for h, m in zip(SEALED, before, strict=True)]
    )
    gp = Discrepancy.of(local, found.base_fit)
    gap = (stack.means - base.means) @ surrogate.from_axes
    left = gap - np.array([gp.predict([h])[0] for h in SEALED])
    root = np.linalg.cholesky(local.pour_covariance(found.base_fit.v, local.none()))
    noise = np.sum(local.in_statistics(root)[:16] ** 2)
    noise = noise * POURS / MANY * 2
    was, now = (float((g[:, :16] ** 2).sum(axis=1).mean()) - noise for g in (gap, left))
    return removed, 1 - now / was if was > 0 else float("nan")


def run(path: Path, archive: int, sets: int, truths: int | None = None) -> None:
    """Appends the rows that are not there yet; `truths` seeds the sets, else the archive does."""
    done = {row["index"] for row in _read([path])} if path.exists() else set()
    toy = PileLoopToy()
    pours = toy.archive(1500, 150, 100 + archive)
    surrogate = Surrogate.fit(toy.design, *pours, names=toy.names, seed=archive)
    with path.open("a", encoding="utf-8") as file:
        for index in range(sets):
            if index not in done:
                row = one_set(toy, surrogate, archive if truths is None else truths, index)
                file.write(json.dumps(row) + "\n")
                file.flush()
                print(f"\r{index + 1} of {sets}", end="", file=sys.stderr)
    print(file=sys.stderr)


def table(paths: list[Path]) -> None:
    """Prints the rates with 95 % Wilson intervals."""
    rows = [row for row in _read(paths) if row["kind"] != "jammed"]
    null = [r for r in rows if r["kind"] == "null"]
    single = [r for r in rows if r["kind"] == "single"]
    pair = [r for r in rows if r["kind"] == "pair"]
    hidden = [r for r in rows if r["kind"] == "hidden"]
    say = ("EFFECT", "SET", "EFFECTS")
    print("| what | rate | 95 % |\n|---|---|---|")
    rate("false alarm, p <= .05", [r["p"] <= 0.05 for r in null])
    rate("false alarm, p <= .01", [r["p"] <= 0.01 for r in null])
    for i, name in enumerate(("library", "any", "smooth")):
        rate(f"false alarm, {name} alone", [r["p_each"][i] <= 0.05 for r in null])
    rate("null named", [r["verdict"] in say for r in null])
    bands = ((0.0, 0.3), (0.3, 0.7), (0.7, 1.5), (1.5, 99.0))
    for low, high in bands:
        chosen = [r for r in single if low <= r["delta"] < high]
        rate(f"detected, delta {low:g}-{high:g}", [r["p"] <= 0.05 for r in chosen])
        named = [r for r in chosen if r["verdict"] in say]
        rate(f"named, delta {low:g}-{high:g}", [r in named for r in chosen])
        rate("  of these the first is right", [r["first"] == r["effects"][0] for r in named])
    named = [r for r in single if r["verdict"] in say]
    rate("single, named: truth in the set", [r["effects"][0] in r["named"] for r in named])
    rate(
        "single, p <= .01: UNEXPLAINED",
        [r["verdict"] == "UNEXPLAINED" for r in single if r["p"] <= 0.01],
    )
    if named:
        print(f"| mean size of the set | {np.mean([len(r['named']) for r in named]):.2f} | |")
    spoken = [r for r in rows if r["kind"] in ("null", "single", "pair")]
    wrong = [r["verdict"] in say and not set(r["named"]) & set(r["effects"]) for r in spoken]
    rate("false naming, of all library sets", wrong)
    told = [w for r, w in zip(spoken, wrong, strict=True) if r["verdict"] in say]
    rate("false naming, of named library sets", told)
    strong = [r for r in hidden if r["delta"] >= 1]
    rate("hidden, delta >= 1: not named", [r["verdict"] not in say for r in strong])
    rate("hidden, delta >= 1: UNEXPLAINED", [r["verdict"] == "UNEXPLAINED" for r in strong])
    rate("hidden, all: named", [r["verdict"] in say for r in hidden])
    rate("pairs, p <= .05", [r["p"] <= 0.05 for r in pair])
    two = [r for r in pair if r["verdict"] in say]
    rate("pairs, named: no false member", [set(r["named"]) <= set(r["effects"]) for r in two])
    rate("pairs: both found", [set(r["named"]) == set(r["effects"]) for r in pair])
    inside = [r["strength"][1] <= r["strengths"][0] <= r["strength"][2] for r in single]
    rate("strength in its 95 % interval, all singles", inside)
    chosen = [i for i, r in zip(inside, single, strict=True) if r["p"] <= 0.01]
    rate("strength in its 95 % interval, p <= .01", chosen)
    # Of a two-sided effect towards its own sign: too weak is below 0.
    shift = [(r["strength"][0] - r["strengths"][0]) * np.sign(r["strengths"][0]) for r in single]
    size = np.sqrt(np.mean(np.square(shift)))
    print(f"| strength: mean error towards its sign, rms | {np.mean(shift):.3f}, {size:.3f} | |")
    right = [r for r in single if r["verdict"] == "EFFECT" and r["effects"][0] in r["named"]]
    median("R at sealed heights, right effect", [r["removed"] for r in right])
    median("R, hidden that was named", [r["removed"] for r in hidden if r["verdict"] in say])
    unexplained = [r.get("fallback") for r in rows if r["verdict"] == "UNEXPLAINED"]
    median("R of the correction, UNEXPLAINED", unexplained)


def _read(paths: list[Path]) -> list[dict[str, Any]]:
    return [json.loads(line) for path in paths for line in path.read_text().splitlines()]


def main() -> None:
    """Runs sets or prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    runner = commands.add_parser("run")
    runner.add_argument("out", type=Path)
    runner.add_argument("--archive", type=int, default=0)
    runner.add_argument("--sets", type=int, default=100)
    runner.add_argument("--truths", type=int, help="seed of the sets (default: the archive's)")
    printer = commands.add_parser("table")
    printer.add_argument("paths", type=Path, nargs="+")
    arguments = parser.parse_args()
    if arguments.command == "run":
        run(arguments.out, arguments.archive, arguments.sets, arguments.truths)
    else:
        table(arguments.paths)


if __name__ == "__main__":
    main()
