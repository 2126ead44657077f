"""How often the loop is right on pours of this simulator whose missing effects are known.

    python benches/loop_study.py run OUT.jsonl --archive DIR --nulls 100 --rounds 4   # resumable
    python benches/loop_study.py table OUT.jsonl

The scene and prior are those of benches/blind. Every set has a material of its own and three pours
at each of 4, 8 and 12 cm. First the nulls, then rounds of every candidate effect at three
strengths. Sealed heights are 2, 6 and 10 cm. The pours of a set are kept in OUT.pours, so that the
loop can be run on them again.
"""

import argparse
import json
import sys
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np
from loop_toy import table
from numpy.typing import NDArray

import granulcal as gc
from granulcal.loop import Observation, Surrogate, Thresholds, compare, trace
from granulcal.loop.archive import Archive, Plan, from_cube
from granulcal.loop.baseline import fit_base
from granulcal.loop.forward import Forward
from granulcal.loop.library import FUNNEL
from granulcal.loop.observation import Stack
from granulcal.loop.refit import fit_single

Array = NDArray[np.float64]

HEIGHTS = (0.02, 0.12)
FIT, SEALED = (0.04, 0.08, 0.12), (0.02, 0.06, 0.10)
POURS, MANY = 3, 6
STRENGTHS = (0.3, 0.6, 0.9)
RULES = Thresholds()
BLIND = Path(__file__).parent / "blind"
PAPER = 16


def plan(base: int, each: int) -> Plan:
    """Returns what the archive of the study is of."""
    return Plan(
        scene=gc.Scene.load(BLIND / "scene.toml"),
        prior=gc.Prior.load(BLIND / "prior.toml"),
        conditions=(("funnel.height", *HEIGHTS),),
        library=FUNNEL,
        base=base,
        each=each,
        seed=1,
    )


def truth_of(index: int, nulls: int) -> tuple[str, float] | None:
    """Effect and strength of a set; None of a null."""
    candidates = [effect for effect in FUNNEL if effect.nuisance_sd is None]
    number = index - nulls
    if number < 0:
        return None
    effect = candidates[number % len(candidates)]
    strength = STRENGTHS[(number // len(candidates)) % len(STRENGTHS)]
    sign = -1.0 if effect.is_two_sided and (number // len(candidates)) % 2 else 1.0
    return effect.name, sign * strength


class Study:
    """Sets of one archive."""

    def __init__(self, archive: Path, kept: Path, base: int, each: int, threads: int) -> None:
        """Fills the archive and fits its surrogate."""
        self.plan = plan(base, each)
        store = Archive(archive, self.plan)
        store.fill(threads=threads, say=lambda line: print(line, file=sys.stderr))
        rows = store.pours()
        self.surrogate = Surrogate.fit(
            self.plan.design, rows.theta, rows.condition, rows.psi, rows.x, names=rows.names
        )
        self.forward = Forward(kept, threads)

    def pours(self, theta: Array, height: float, psi: dict[str, float], seeds: range) -> Array:
        """Pours of a material (unit coordinates) with effects."""
        values = dict(
            zip(
                self.plan.prior.names,
                from_cube(self.plan.prior, theta[None])[0].tolist(),
                strict=True,
            )
        )
        for name, strength in psi.items():
            effect = next(e for e in FUNNEL if e.name == name).at(self.plan.scene)
            values |= effect.numbers(strength)
            height += effect.full * strength if effect.shift else 0.0
        scene = self.plan.scene.with_({**values, "funnel.height": height})
        return self.forward.pours(scene, seeds)

    def observe(self, height: float, rows: Array) -> Observation:
        """The pours as the loop sees them."""
        low, high = HEIGHTS
        return Observation.of(f"{100 * height:g} cm", [(height - low) / (high - low)], rows)

    def row(self, index: int, nulls: int) -> dict[str, Any] | None:
        """Returns the row of one set; None if its pours jam."""
        generator = np.random.default_rng([index, 41])
        theta, truth = (
            generator.uniform(0.05, 0.95, len(self.plan.prior.names)),
            truth_of(index, nulls),
        )
        psi = {} if truth is None else {truth[0]: truth[1]}
        first = 1_000_000 + 1000 * index
        sets = [self.pours(theta, h, psi, range(first, first + POURS)) for h in FIT]
        if any(len(rows) < POURS for rows in sets):
            return None
        observed = [self.observe(h, rows) for h, rows in zip(FIT, sets, strict=True)]
        found = trace(self.surrogate, observed, RULES, seed=index)
        row: dict[str, Any] = {
            "index": index,
            "kind": "null" if truth is None else "single",
            "effects": list(psi),
            "strengths": list(psi.values()),
            "delta": 0.0,
            "p": found.gate.p,
            "p_each": [found.gate.p_library, found.gate.p_any, found.gate.p_smooth],
            "verdict": found.verdict.kind,
            "named": found.verdict.named,
            "families": found.verdict.families,
            "models": [[o.effects, o.log_probability, o.p_after] for o in found.explanations[:4]],
            "theta": theta.tolist(),
            "theta_fit": found.base.theta.tolist(),
        }
        if truth is not None:
            self._grade(row, found, theta, psi, observed, first)
        return row

    def _grade(
        self,
        row: dict[str, Any],
        found: Any,
        theta: Array,
        psi: dict[str, float],
        observed: list[Observation],
        first: int,
    ) -> None:
        """Adds misfit, strength and what is gone at sealed heights."""
        names = [effect.name for effect in FUNNEL]
        seeds = range(first + 100, first + 100 + MANY)
        spread = self.surrogate.raw_spread[:PAPER]

        def squares(heights: tuple[float, ...], best: Any) -> Any:
            sets = []
            for unit, effects in (
                (theta, psi),
                (found.base.theta, {}),
                (best.theta, dict(zip(best.effects, best.best_strengths.tolist(), strict=True))),
            ):
                sets.append([self.pours(unit, h, effects, seeds)[:, :PAPER] for h in heights])
            if any(len(rows) < 2 for group in sets for rows in group):
                return None
            return compare([f"{h:g}" for h in heights], *sets, spread, draws=200)

        fitted = squares(FIT, found.base)
        row["delta"] = sqrt(max(fitted.total_before.square, 0.0)) if fitted else 0.0
        k = names.index(row["effects"][0])
        stack = Stack.of(self.surrogate, observed)
        local, base = fit_base(self.surrogate, stack, row["index"])
        model = fit_single(local, stack.means.ravel(), base, k, RULES)
        row["strength"] = [float(model.strengths[0]), *model.intervals[0].tolist()]
        singles = [one for one in found.explanations if len(one.effects) == 1]
        candidates = self.surrogate.design.candidates
        row["first"] = (
            singles[0].effects[0]
            if singles
            else names[candidates[int(found.gate.squares.argmax())]]
        )
        if found.verdict.kind in ("EFFECT", "SET", "EFFECTS"):
            sealed = squares(SEALED, found.best)
            row["removed"] = sealed.removed if sealed else None


def run(options: argparse.Namespace) -> None:
    """Appends the rows that are not there yet."""
    path: Path = options.out
    done = set()
    if path.exists():
        done = {json.loads(line)["index"] for line in path.read_text().splitlines()}
    study = Study(
        options.archive, path.with_suffix(".pours"), options.base, options.each, options.threads
    )
    candidates = sum(effect.nuisance_sd is None for effect in FUNNEL)
    total = options.nulls + options.rounds * candidates * len(STRENGTHS)
    with path.open("a", encoding="utf-8") as file:
        for index in range(total):
            if index in done:
                continue
            row = study.row(index, options.nulls)
            file.write(json.dumps(row or {"index": index, "kind": "jammed"}) + "\n")
            file.flush()
            print(f"\r{index + 1} of {total}", end="", file=sys.stderr)
    print(file=sys.stderr)


def main() -> None:
    """Runs sets or prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    runner = commands.add_parser("run")
    runner.add_argument("out", type=Path)
    runner.add_argument("--archive", type=Path, required=True)
    runner.add_argument("--nulls", type=int, default=100)
    runner.add_argument("--rounds", type=int, default=4)
    runner.add_argument("--base", type=int, default=1500)
    runner.add_argument("--each", type=int, default=150)
    runner.add_argument("--threads", type=int, default=2)
    commands.add_parser("table").add_argument("paths", type=Path, nargs="+")
    options = parser.parse_args()
    run(options) if options.command == "run" else table(options.paths)


if __name__ == "__main__":
    main()
