"""How often the loop is right on pours of this simulator whose missing effects are known.

    python benches/loop_study.py run OUT.jsonl --archive DIR --nulls 120 --rounds 4   # resumable
    python benches/loop_study.py table OUT.jsonl
    python benches/loop_study.py run NULLS.jsonl --archive SMALL --small --rounds 0   # nulls alone

The scene and prior are those of benches/blind, with pixels of 1 mm. Every set has a material of its
own and three pours at each of 4, 8 and 12 cm. First the nulls; then rounds, each of every candidate
effect at three strengths, four pairs, and six effects that the library lacks at two strengths.
Sealed heights are 2, 6 and 10 cm. `--small` has 120 grains, pixels of 1.6 mm without noise, and an
archive of half the size: minutes on an idle core where the whole study takes an hour. The pours of
a set are kept in OUT.pours, so that the loop can be run on them again. `--first` numbers the sets
from there: their materials and seeds are others. `--only pair` passes over all other sets, which
keep their numbers. `--checks` asks what `close-loop` asks before a
word stands (loop_study_checks.py): 30 to 60 further pours a set.
"""

import argparse
import json
import sys
from dataclasses import dataclass
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np
from loop_study_checks import Checks
from loop_study_table import table
from numpy.typing import NDArray

import granulcal as gc
from granulcal.loop import ConditionPours, Discrepancy, Surrogate, Thresholds, Trace, compare, trace
from granulcal.loop.check.coverage import calibrate
from granulcal.loop.effects.library import FUNNEL, LibraryEffect
from granulcal.loop.pours.archive import Archive, ArchivePlan
from granulcal.loop.pours.cube import from_cube
from granulcal.loop.pours.forward import Forward
from granulcal.loop.surrogate.baseline import fit_base
from granulcal.loop.surrogate.stacked_means import StackedMeans
from granulcal.loop.test.refit import fit_single
from granulcal.loop.test.verdict import NAMING
from granulcal.one_thread import one_thread
from granulcal.pours.statistics import NAMES

Array = NDArray[np.float64]

HEIGHTS = (0.02, 0.12)
FIT, SEALED = (0.04, 0.08, 0.12), (0.02, 0.06, 0.10)
# Pours of a set at each height; fresh ones of the truth, for its misfit (of two, sets of no misfit
# had counted among those of more than one); at sealed heights.
POURS, FRESH, MANY = 3, 8, 3
STRENGTHS, OUTSIDE_STRENGTHS, OF_PAIRS = (0.3, 0.6, 0.9), (0.5, 1.0), 0.7
PAIRS = 4
KINDS = ("null", "single", "pair", "hidden")
RULES = Thresholds()
BLIND = Path(__file__).parent / "blind"

CANDIDATES = tuple(effect for effect in FUNNEL if effect.nuisance_sd is None)
OUTSIDE: tuple[LibraryEffect, ...] = (
    LibraryEffect(name="rolling.form", path="effects.rolling_form.speed", full=0.05),
    LibraryEffect(name="funnel.x", path="effects.funnel.x", full=0.01),
    LibraryEffect(name="funnel.lean", path="effects.funnel.lean_y", full=0.1),
    LibraryEffect(name="ground.layer", path="effects.layer.thickness", full=2e-3),
    LibraryEffect(name="outlet", path="funnel.stem_radius", off=0.018, full=0.0135),
    LibraryEffect(
        name="clump",
        path="effects.clump.aspect",
        off=1.0,
        full=1.5,
        also=(("start.jitter", 1e-4),),
    ),
)
"""What the simulator can do and the library of the study lacks."""


@dataclass(frozen=True)
class Truth:
    """What a set is made with."""

    kind: str
    effects: tuple[str, ...] = ()
    strengths: tuple[float, ...] = ()

    @staticmethod
    def all(nulls: int, rounds: int) -> list["Truth"]:
        """Returns the truths of all sets; within a round kinds come in turn."""
        found = [Truth("null")] * nulls
        for number in range(rounds):
            singles = [
                Truth("single", (e.name,), (-s if e.is_two_sided and (i + number) % 2 else s,))
                for i, s in enumerate(STRENGTHS)
                for e in CANDIDATES
            ]
            others = [Truth("hidden", (e.name,), (s,)) for s in OUTSIDE_STRENGTHS for e in OUTSIDE]
            generator = np.random.default_rng([number, 43])
            for _ in range(PAIRS):
                first, second = generator.choice(len(CANDIDATES), size=2, replace=False)
                names = CANDIDATES[first].name, CANDIDATES[second].name
                others.append(Truth("pair", names, (OF_PAIRS, OF_PAIRS)))
            places = np.linspace(0, len(singles), len(others), endpoint=False) + 0.5
            order = [*zip(range(len(singles)), singles, strict=True)]
            order += [*zip(places, others, strict=True)]
            found += [truth for _, truth in sorted(order, key=lambda pair: pair[0])]
        return found


def scene(is_small: bool) -> gc.Scene:
    """Returns blind's scene with coarser pixels; the small one has few grains and no noise."""
    text = (BLIND / "scene.toml").read_text(encoding="utf-8")
    if is_small:
        plain = gc.Scene.from_toml(text[: text.index("[camera.sensor]")])
        return plain.with_({"grains.count": 120, "camera.pixels": 200})
    # Pixels of 1 mm, half as fine as blind's: a pour is examined in a third of the time.
    return gc.Scene.from_toml(text).with_({"camera.pixels": 320})


def plan(base: int, each: int, is_small: bool) -> ArchivePlan:
    """Returns what the archive of the study is of."""
    return ArchivePlan(
        scene=scene(is_small),
        prior=gc.Prior.load(BLIND / "prior.toml"),
        conditions=(("funnel.height", *HEIGHTS),),
        library=FUNNEL,
        base=base,
        each=each,
        seed=1,
    )


class Study:
    """Sets of one archive."""

    def __init__(
        self,
        archive: Path,
        kept: Path,
        plan: ArchivePlan,
        threads: int,
        pairs: int = 0,
        *,
        is_checked: bool = False,
    ) -> None:
        """Fills the archive and fits its surrogate."""
        self.plan, self.pairs = plan, pairs
        store = Archive(archive, self.plan)
        store.fill(threads=threads, say=lambda line: print(line, file=sys.stderr))
        rows = store.pours()
        self.surrogate = Surrogate.fit(
            self.plan.design, rows.theta, rows.condition, rows.psi, rows.x, names=rows.names
        )
        self.forward = Forward(kept, threads)
        named = {_name(height): height for height in FIT}
        self.checks = Checks(plan, named, POURS, self.forward, RULES) if is_checked else None

    def pours(self, theta: Array, height: float, psi: dict[str, float], seeds: range) -> Array:
        """Pours of a material (unit coordinates) with effects."""
        own = from_cube(self.plan.prior, theta[None])[0].tolist()
        values, faults = dict(zip(self.plan.prior.names, own, strict=True)), {}
        for name, strength in psi.items():
            effect = next(e for e in (*FUNNEL, *OUTSIDE) if e.name == name).at(self.plan.scene)
            values |= effect.numbers(strength)
            faults |= effect.faults(strength)
            height += effect.full * strength if effect.shift else 0.0
        scene = self.plan.scene.with_({**values, "funnel.height": height})
        return self.forward.pours(scene, seeds, faults)

    def observe(self, height: float, rows: Array) -> ConditionPours:
        """The pours as the loop sees them."""
        low, high = HEIGHTS
        return ConditionPours.of(_name(height), [(height - low) / (high - low)], rows)

    def row(self, index: int, truth: Truth) -> dict[str, Any] | None:
        """Returns the row of one set; None if its pours jam."""
        generator = np.random.default_rng([index, 41])
        theta = generator.uniform(0.05, 0.95, len(self.plan.prior.names))
        psi = dict(zip(truth.effects, truth.strengths, strict=True))
        first = 1_000_000 + 1000 * index
        sets = [self.pours(theta, h, psi, range(first, first + POURS)) for h in FIT]
        if any(len(rows) < POURS for rows in sets):
            return None
        observed = [self.observe(h, rows) for h, rows in zip(FIT, sets, strict=True)]
        found = trace(self.surrogate, observed, RULES, seed=index)
        row: dict[str, Any] = {
            "index": index,
            "kind": truth.kind,
            "effects": truth.effects,
            "strengths": truth.strengths,
            "delta": 0.0,
            "p": found.residual_test.p,
            "p_each": [
                found.residual_test.p_library,
                found.residual_test.p_any,
                found.residual_test.p_smooth,
            ],
            "verdict": found.verdict.kind,
            "named": found.verdict.named,
            "families": found.verdict.families,
            "models": [[o.effects, o.log_probability, o.p_after] for o in found.explanations[:4]],
            "theta": theta.tolist(),
            "theta_fit": found.base.theta.tolist(),
        }
        held = found
        if self.checks is not None:
            named = {_name(h): rows for h, rows in zip(FIT, sets, strict=True)}
            row["final"], held = self.checks.of(self.surrogate, found, named, observed, first + 200)
        if truth.kind == "null":
            return row
        fresh = [self.pours(theta, h, psi, range(first + 50, first + 50 + FRESH)) for h in FIT]
        if any(len(rows) < FRESH for rows in fresh):
            return None
        row["delta"] = self._delta(
            found, [self.observe(h, rows) for h, rows in zip(FIT, fresh, strict=True)]
        )
        if truth.kind == "single":
            self._grade(row, found, StackedMeans.of(self.surrogate, observed))
            self._widen(row, found, index)
        for words, one in ((row, found), (row.get("final", row), held)):
            is_named = words["verdict"] in NAMING
            if (is_named and index % 2 == 0) or words["verdict"] == "UNEXPLAINED":
                self._open(words, one, theta, psi, range(first + 100, first + 100 + MANY))
        return row

    def _delta(self, found: Trace, fresh: list[ConditionPours]) -> float:
        """Distance of fresh pours from the base fit, paper's statistics, noise taken out."""
        local, fit = found.local, found.base_fit
        stack = StackedMeans.of(self.surrogate, fresh)
        shape = stack.means.shape
        none = local.none()
        gap = local.in_statistics((stack.means.ravel() - local.mean(fit.v, none))[:, None])
        covariance = local.pour_covariance(fit.v, none) * POURS / FRESH
        covariance += local.error_covariance(fit.v, none)
        root = local.in_statistics(np.asarray(np.linalg.cholesky(covariance), dtype=np.float64))
        left = (gap[:, 0] ** 2 - np.sum(root**2, axis=1)).reshape(shape)
        chosen = [i for i, name in enumerate(self.surrogate.names) if name in NAMES]
        return sqrt(max(float(left[:, chosen].sum(axis=1).mean()), 0.0))

    def _grade(self, row: dict[str, Any], found: Trace, stack: StackedMeans) -> None:
        """Adds the strength of the true effect as the loop has it, named or not, and its rank."""
        names = [effect.name for effect in FUNNEL]
        k = names.index(row["effects"][0])
        candidates = self.surrogate.design.candidates
        fitted = {model.effects: model for model in found.models}
        model = fitted.get((k,))
        if model is None:
            local, base = fit_base(self.surrogate, stack, row["index"])
            model = fit_single(local, stack.means.ravel(), base, k, RULES)
        kappa = found.power.kappa[candidates.index(k)]
        row["strength"] = [float(model.strengths[0]), *model.intervals[0].tolist()]
        row["kappa"] = None if np.isnan(kappa) else float(kappa)
        row["curve"] = np.round(model.curve[:, ::10], 3).tolist()
        singles = [one for one in found.explanations if len(one.effects) == 1]
        first = names[candidates[int(found.residual_test.squares.argmax())]]
        row["first"] = singles[0].effects[0] if singles else first

    def _widen(self, row: dict[str, Any], found: Trace, index: int) -> None:
        """Adds the interval that simulated pairs have widened, where the right effect is named."""
        best = found.best
        if not self.pairs or best.effects != tuple(row["effects"]):
            return
        (name,) = best.effects

        def pour(b: int, theta: Array, psi: float) -> list[ConditionPours] | None:
            first = 500_000_000 + 100_000 * index + 100 * b
            sets = [
                (h, self.pours(theta, h, {name: psi}, range(first, first + POURS))) for h in FIT
            ]
            if not all(len(rows) for _, rows in sets):
                return None
            return [self.observe(h, rows) for h, rows in sets]

        model = found.model_of(best)
        wide = calibrate(self.surrogate, model, pour, RULES, count=self.pairs, seed=index)
        row["wide"] = None if wide is None else wide.to_dict()

    def _open(
        self, row: dict[str, Any], found: Trace, theta: Array, psi: dict[str, float], seeds: range
    ) -> None:
        """Adds the share of D^2 gone at sealed heights: by the effect named, or the correction."""
        best = dict(zip(found.best.effects, found.best.best_strengths.tolist(), strict=True))
        models = (theta, psi), (found.base.theta, {}), (found.best.theta, best)
        truth, before, after = [
            [self.pours(unit, h, effects, seeds) for h in SEALED] for unit, effects in models
        ]
        if any(len(rows) < 2 for rows in (*truth, *before, *after)):
            return
        size = len(NAMES)
        cut = [[x[:, :size] for x in group] for group in (truth, before, after)]
        spread = self.surrogate.raw_spread[:size]
        if best:
            labels = [f"{h:g}" for h in SEALED]
            row["removed"] = compare(labels, cut[0], cut[1], cut[2], spread, draws=200).removed
            return
        correction = Discrepancy.of(found.local, found.base_fit)
        was = now = 0.0
        for h, y, x in zip(SEALED, truth, before, strict=True):
            seen, plain = (
                StackedMeans.of(self.surrogate, [self.observe(h, rows)]) for rows in (y, x)
            )
            gap = ((seen.means - plain.means) @ self.surrogate.from_axes)[0]
            left = gap - correction.predict(seen.conditions[0])[0]
            noise = np.array(
                [
                    (self.surrogate.standardise(rows) @ self.surrogate.from_axes).var(0, ddof=1)
                    / len(rows)
                    for rows in (y, x)
                ]
            ).sum(axis=0)
            chosen = [i for i, name in enumerate(self.surrogate.names) if name in NAMES]
            was += float((gap**2 - noise)[chosen].sum())
            now += float((left**2 - noise)[chosen].sum())
        row["fallback"] = 1 - now / was if was > 0 else None


def _name(height: float) -> str:
    return f"{100 * height:g} cm"


@one_thread()
def run(options: argparse.Namespace) -> None:
    """Appends the rows that are not there yet."""
    path: Path = options.out
    done = set()
    if path.exists():
        done = {json.loads(line)["index"] for line in path.read_text().splitlines()}
    half = 2 if options.small else 1
    asked = plan(options.base // half, options.each // half, options.small)
    kept = path.with_suffix(".pours")
    study = Study(
        options.archive, kept, asked, options.threads, options.pairs, is_checked=options.checks
    )
    truths = Truth.all(options.nulls, options.rounds)
    part, parts = options.part
    with path.open("a", encoding="utf-8") as file:
        for index, truth in enumerate(truths, start=options.first):
            if index in done or index % parts != part or truth.kind not in options.only:
                continue
            row = study.row(index, truth)
            file.write(json.dumps(row or {"index": index, "kind": "jammed"}) + "\n")
            file.flush()
            print(f"\r{index - options.first + 1} of {len(truths)}", end="", file=sys.stderr)
    print(file=sys.stderr)


def main() -> None:
    """Runs sets or prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    runner = commands.add_parser("run")
    runner.add_argument("out", type=Path)
    runner.add_argument("--archive", type=Path, required=True)
    runner.add_argument("--nulls", type=int, default=120)
    runner.add_argument("--rounds", type=int, default=4)
    runner.add_argument("--first", type=int, default=0, help="number of the first set")
    runner.add_argument("--base", type=int, default=1500)
    runner.add_argument("--each", type=int, default=150)
    runner.add_argument("--small", action="store_true")
    runner.add_argument("--pairs", type=int, default=0, help="simulated pairs of a named effect")
    runner.add_argument("--checks", action="store_true", help="what a word has to stand")
    runner.add_argument("--only", nargs="+", choices=KINDS, default=KINDS, metavar="KIND")
    runner.add_argument("--threads", type=int, default=2)
    runner.add_argument(
        "--part",
        type=int,
        nargs=2,
        default=(0, 1),
        metavar=("K", "N"),
        help="of N runs side by side, each with its own OUT, this is the one number K, from 0",
    )
    commands.add_parser("table").add_argument("paths", type=Path, nargs="+")
    options = parser.parse_args()
    run(options) if options.command == "run" else table(options.paths)


if __name__ == "__main__":
    main()
