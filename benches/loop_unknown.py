"""What the loop says where what is missing has no name in its library, or is no effect at all.

    python benches/loop_unknown.py build/unknown.jsonl --sets 100    # half an hour of a core

The simulator is a closed form: eight statistics, nearly linear in three parameters, one number of
the condition and six effects, with correlated Gaussian noise. A set has three recordings at three
conditions and at two sealed ones. Of the loop it has the trace, ten pours of both models at their
fits, the step to where these are right, and what stands; not the rounds of further pours, of random
draws and of rivals. Words of the table are those that stand; a name is right if it is the effect
that was on. An unknown is a shift of all statistics that grows with the condition, in standard
deviations of one pour, at a cosine to an effect of the library.
"""

import argparse
import json
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from granulcal.loop import ConditionPours, Surrogate, Thresholds, compare, trace
from granulcal.loop.check.confirm import confirm
from granulcal.loop.check.recentre import misfit, recentre
from granulcal.loop.check.standing import stand
from granulcal.loop.effects.design import Design, Effect, cube_from_normal
from granulcal.loop.test.verdict import NAMING

Array = NDArray[np.float64]

PARAMETERS, EFFECTS, STATISTICS = 3, 6, 8
FIT, SEALED = (0.1, 0.5, 0.9), (0.3, 0.7)
RECORDINGS, POURS = 3, 10
BASE, EACH = 700, 80
NOISE = 0.15
RULES = Thresholds(replicates=500, replicates_after=200, refits=0)
LARGEST_Z = 5.0
EFFECTS_OF = tuple(Effect(f"effect {k}") for k in range(EFFECTS))


@dataclass(frozen=True)
class Case:
    """What is wrong with the recordings of a set.

    Attributes:
        unknown: shift along a direction of no effect [sd of a pour].
        cosine: of that direction with an effect of the library.
        scale: variance of the recordings over that of pours.
        beyond: how far a parameter lies beyond its prior, of its width.
        moved: how far one condition is from what it is said to be, of their range.
        effect: strength of one effect of the library.
    """

    unknown: float = 0.0
    cosine: float = 0.0
    scale: float = 1.0
    beyond: float = 0.0
    moved: float = 0.0
    effect: float = 0.0


CASES = {
    "nothing": Case(),
    "unknown, 1 sd": Case(unknown=1.0),
    "unknown, 3 sd": Case(unknown=3.0),
    "unknown, 3 sd, cosine 0.7": Case(unknown=3.0, cosine=0.7),
    "unknown, 10 sd": Case(unknown=10.0),
    "unknown, 10 sd, cosine 0.95": Case(unknown=10.0, cosine=0.95),
    "recordings vary by 1.5 times the variance": Case(scale=1.5),
    "recordings vary by 2.25 times the variance": Case(scale=2.25),
    "parameter 0.15 beyond its prior": Case(beyond=0.15),
    "one condition said 0.2 off": Case(moved=0.2),
    "an effect of 0.25": Case(effect=0.25),
    "an effect of 0.5": Case(effect=0.5),
}


class World:
    """The closed form, and the surrogate of pours of it."""

    def __init__(self, seed: int) -> None:
        random = np.random.default_rng(seed)
        self.slopes = 0.5 * random.standard_normal((PARAMETERS, STATISTICS))
        self.along = 0.6 * random.standard_normal(STATISTICS)
        self.bend = 0.15 * random.standard_normal((PARAMETERS, STATISTICS))
        self.of_effects = 0.6 * random.standard_normal((EFFECTS, STATISTICS))
        # One of them does nearly what a parameter does.
        self.of_effects[1] = 0.8 * self.slopes[0] + 0.3 * self.of_effects[1]
        self.growth = random.uniform(-0.8, 1.5, EFFECTS)
        shared = random.standard_normal((STATISTICS, 3))
        half = 0.5 * np.eye(STATISTICS) + 0.5 * shared @ shared.T / 3
        self.root = NOISE * np.linalg.cholesky(half)
        random = np.random.default_rng(3)
        count = BASE + EFFECTS * EACH
        theta, c = random.random((count, PARAMETERS)), random.random(count)
        psi = np.zeros((count, EFFECTS))
        for k in range(EFFECTS):
            psi[BASE + k * EACH : BASE + (k + 1) * EACH, k] = random.random(EACH)
        x = self.mean(theta, c, psi) + self.noise(count, random)
        design = Design(("a", "b", "c"), ("condition",), EFFECTS_OF)
        self.surrogate = Surrogate.fit(design, theta, c[:, None], psi, x, features=8)

    def mean(self, theta: Array, c: Array, psi: Array) -> Array:
        """Returns the statistics without noise, shape (n, s)."""
        t, c = 2 * theta - 1, np.asarray(c)[:, None]
        slope = t @ self.slopes
        mean = slope + t**2 @ self.bend + c * self.along + 0.4 * c * slope[:, ::-1]
        return mean + (psi * (1 + self.growth * (c - 0.5))) @ self.of_effects

    def noise(self, count: int, random: np.random.Generator) -> Array:
        """Returns the noise of pours, shape (n, s)."""
        return random.standard_normal((count, STATISTICS)) @ self.root.T

    def pours(
        self, at: tuple[Array, Array], c: float, count: int, random: np.random.Generator
    ) -> Array:
        """Returns the statistics of pours of parameters and strengths `at`, shape (n, s)."""
        theta, psi = (np.tile(one, (count, 1)) for one in at)
        return self.mean(theta, np.full(count, c), psi) + self.noise(count, random)

    def unknown(self, case: Case, random: np.random.Generator) -> Callable[[float], Array]:
        """Returns the shift that no effect makes, by the condition."""
        way = random.standard_normal(STATISTICS)
        way /= np.linalg.norm(way)
        if case.cosine:
            like = np.linalg.solve(self.root, self.of_effects[random.integers(EFFECTS)])
            like /= np.linalg.norm(like)
            way -= like * (way @ like)
            across = np.sqrt(1 - case.cosine**2) / np.linalg.norm(way)
            way = case.cosine * like + across * way
        shift = case.unknown * self.root @ way
        return lambda c: shift * (0.7 + 0.6 * c)


def measured(
    world: World, case: Case, random: np.random.Generator
) -> tuple[dict[float, Array], str | None]:
    """Returns the recordings by condition, the sealed ones last, and the effect that is on."""
    theta, psi, right = random.uniform(0.1, 0.9, PARAMETERS), np.zeros(EFFECTS), None
    if case.beyond:
        theta[random.integers(PARAMETERS)] = random.choice([-case.beyond, 1 + case.beyond])
    if case.effect:
        k = int(random.integers(EFFECTS))
        psi[k], right = case.effect, EFFECTS_OF[k].name
    places = {c: c for c in (*FIT, *SEALED)}
    if case.moved:
        c = FIT[random.integers(len(FIT))]
        off = case.moved * random.choice([-1, 1])
        places[c] = c + off if 0 <= c + off <= 1 else c - off
    shift, seen = world.unknown(case, random), {}
    for told, c in places.items():
        rows = world.pours((theta, psi), c, RECORDINGS, random)
        clean = world.mean(theta[None], np.array([c]), psi[None])
        seen[told] = clean + np.sqrt(case.scale) * (rows - clean) + shift(c)
    return seen, right


def word_of(world: World, seen: dict[float, Array], random: np.random.Generator, seed: int) -> dict:
    """Returns the word that stands, its names, and how D² falls at the sealed conditions."""
    surrogate, none = world.surrogate, np.zeros(EFFECTS)

    def pours(at: tuple[Array, Array], places: tuple[float, ...]) -> dict[float, Array]:
        return {c: world.pours(at, c, POURS, random) for c in places}

    def stacked(rows: dict[float, Array]) -> list[ConditionPours]:
        return [ConditionPours.of(f"{c:g}", [c], x) for c, x in rows.items()]

    observed = stacked({c: seen[c] for c in FIT})
    found = trace(surrogate, observed, RULES, seed=seed)
    best, fit = found.best, found.fit_of(found.best)
    of_base_at = found.base.theta, none
    before = pours(of_base_at, FIT)
    of_base = recentre(surrogate, found.base_fit, observed, stacked(before), RULES, seed=seed)
    at, after, own = of_base_at, before, of_base
    if best is not found.base:
        at = best.theta, fit.psi
        after = pours(at, FIT)
        own = recentre(surrogate, fit, observed, stacked(after), RULES, seed=seed)
        psi = fit.psi.copy()
        psi[list(fit.active)] = own.strengths
        moved = replace(fit, v=np.clip(own.v, -LARGEST_Z, LARGEST_Z), psi=psi)
        there = cube_from_normal(moved.v), psi
        fresh = pours(there, FIT)
        left = [misfit(surrogate, fit, observed, stacked(rows)) for rows in (fresh, after)]
        if left[0] < left[1]:
            at, after = there, fresh
            own = recentre(surrogate, moved, observed, stacked(after), RULES, seed=seed)
    sealed = [pours(of_base_at, SEALED)] * 2
    if best is not found.base:
        sealed[1] = pours(at, SEALED)
    fall, fall_sealed = (
        compare(
            [f"{c:g}" for c in places],
            [seen[c] for c in places],
            [base[c] for c in places],
            [model[c] for c in places],
            surrogate.raw_spread,
            draws=400,
            seed=seed,
        )
        for places, base, model in ((FIT, before, after), (SEALED, *sealed))
    )
    confirmed = confirm(surrogate, fit, stacked(pours((best.theta, fit.psi), FIT)))
    standing = stand(
        found.verdict,
        RULES,
        # Further rounds put a surrogate right that is not.
        confirmed=max(confirmed, RULES.detect),
        own=own,
        of_base=of_base,
        error=fall,
        sealed=fall_sealed,
        size=STATISTICS,
    )
    verdict = standing.verdict
    return {
        "word": verdict.kind,
        "named": verdict.named,
        "is_no_nearer": standing.is_no_nearer,
    }


def table(rows: list[dict]) -> None:
    """Prints the words of each case."""
    words = ("NONE", "RESIDUAL", "UNEXPLAINED", "UNCONFIRMED")
    print(f"| recordings | sets | {' | '.join(words)} | right name | other names |")
    print("|---|" + 7 * "---|")
    for case in CASES:
        of = [row for row in rows if row["case"] == case]
        if not of:
            continue
        count = Counter(row["word"] for row in of)
        named = [row for row in of if row["word"] in NAMING]
        right = sum(row["right"] in row["named"] and len(row["named"]) == 1 for row in named)
        cells = [len(of), *(count[word] for word in words), right, len(named) - right]
        print(f"| {case} | {' | '.join(map(str, cells))} |")


def main() -> None:
    """Makes the sets that are not there yet and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="JSON, a set a line; is gone on with")
    parser.add_argument("--sets", type=int, default=24, help="of each case (default: 24)")
    options = parser.parse_args()
    options.out.parent.mkdir(parents=True, exist_ok=True)
    lines = options.out.read_text().splitlines() if options.out.exists() else []
    rows = [json.loads(line) for line in lines]
    done = {(row["case"], row["set"]) for row in rows}
    world = World(7)
    with options.out.open("a") as file:
        for number in range(options.sets):
            for name, case in CASES.items():
                if (name, number) in done:
                    continue
                random = np.random.default_rng([crc32(name.encode()), number])
                seen, right = measured(world, case, random)
                row = {"case": name, "set": number, "right": right}
                row |= word_of(world, seen, random, number)
                rows.append(row)
                file.write(json.dumps(row) + "\n")
                file.flush()
    table(rows)


if __name__ == "__main__":
    main()
