"""Makes blind sets: recordings for `granulcal close-loop`, and sealed answers somewhere else.

    python benches/blind/make.py out/sets --sealed out/sealed --sets 42
    python benches/blind/make.py out/liggghts --sealed out/answers --sets 30 --nulls 30 \
        --engine epsd2 --young 1e7
    python benches/blind/make.py out/pairs --sealed out/answers --sets 38 --nulls 14 \
        --pairs 12 --outside 12 --no-singles

A set is a folder with `loop.toml`, scene, prior and depth images. Nothing in it says what the truth
has. Sets that are there are not made again, so it goes on where it was stopped.
"""

import argparse
import json
import os
import secrets
import shutil
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import effects
import engine
import numpy as np
from answers import seal, seals, write_text
from arguments import add_part, add_young
from engine import Pile, Setup
from engines import ENGINES, Engine, add_engine
from scene import PARAMETERS, PRIOR, SCENE, Bench

import granulcal as gc

CONDITIONS = {"fit": (0.04, 0.08, 0.12), "sealed": (0.02, 0.06, 0.10)}
"""Heights of the funnel's tip [m]."""
NULLS = 10
"""Sets without effect in a round, unless told otherwise."""
OUTSIDE = ("clumps", "charge", "slot", "count", "vibration")
"""Effects that are hard to name: one of each, at the medium strength, in a round."""
TRIES = 4
"""Pours that are tried where grains stay in the funnel."""
FOREIGN = ("clumps", "charge", "slot")
"""Of these what no effect of the loop's library is."""
TOUCHING = ("adhesion", "cohesion", "polydispersity")
"""At most one of these in a pair: they take all spheres as equal, and the pair style is one."""
MOST = 1000
"""Names that are dealt out: more than any plan has sets."""

Truth = tuple[tuple[str, int], ...]
"""Effects by name, each with its level of strength, in the order in which they are applied."""


@dataclass(frozen=True)
class Planned:
    """A set to be made: its place in the plan, its name, its effects and how strong they are."""

    index: int
    name: str
    truth: Truth


@dataclass(frozen=True, kw_only=True)
class Round:
    """What a round of sets has, in this order.

    Attributes:
        nulls: sets without effect.
        singles: whether every effect is there at three strengths, and the odd ones.
        pairs: sets with two effects of the library, each medium or strong.
        outside: sets with an effect that the library lacks, of all strengths in turn.
    """

    nulls: int = NULLS
    singles: bool = True
    pairs: int = 0
    outside: int = 0

    def truths(self, random: np.random.Generator) -> list[Truth]:
        """Returns what the sets have; pairs are drawn."""
        known = [name for name in effects.load() if name not in OUTSIDE]
        found: list[Truth] = [()] * self.nulls
        if self.singles:
            found += [((name, level),) for name in known for level in range(3)]
            found += [((name, 1),) for name in OUTSIDE]
        found += [_pair(known, random) for _ in range(self.pairs)]
        foreign = [((name, level),) for level in (1, 2, 0) for name in FOREIGN]
        return found + [foreign[i % len(foreign)] for i in range(self.outside)]


def _pair(known: Sequence[str], random: np.random.Generator) -> Truth:
    """Two effects; drag first, for it changes the weight that others are stated by."""
    while True:
        names = [str(name) for name in random.choice(known, size=2, replace=False)]
        if sum(name in TOUCHING for name in names) < 2:
            names.sort(key=lambda name: (name != "air_drag", name in TOUCHING))
            return tuple((name, int(random.integers(1, 3))) for name in names)


def plan(seed: int, count: int, of: Round | None = None) -> list[Planned]:
    """Returns the first sets of one round after the other."""
    order = np.random.default_rng([seed, 0]).permutation(MOST)
    random = np.random.default_rng([seed, 2])
    what: list[Truth] = []
    while len(what) < count:
        what += (of or Round()).truths(random)
    return [Planned(i, f"set-{order[i]:03d}", truth) for i, truth in enumerate(what[:count])]


def make(planned: Planned, pour: Engine, seed: int, pours: int, sets: Path, sealed: Path) -> None:
    """Makes one set of an engine's pours and seals its answer."""
    bench, random = Bench.load(), np.random.default_rng([seed, 1, planned.index])
    theta = gc.Prior.load(PRIOR).sample(1, seed=int(random.integers(2**31)))[0]
    known = effects.load()
    of_effect = int(random.integers(2**31))
    draft = sets / f".{planned.name}.part"
    shutil.rmtree(draft, ignore_errors=True)
    draft.mkdir(parents=True)
    answer = {
        "set": planned.name,
        "salt": secrets.token_hex(16),
        "effects": [
            {
                "name": name,
                "strength": known[name].strengths[level],
                "unit": known[name].unit,
                "level": level,
            }
            for name, level in planned.truth
        ],
        "theta": dict(zip(PARAMETERS, map(float, theta), strict=True)),
        "seed": [seed, planned.index],
        "conditions": [],
    }
    lines = ['scene = "scene.toml"', 'prior = "prior.toml"', 'camera = "camera.toml"', "law = true"]
    for use, heights in CONDITIONS.items():
        for height in heights:
            made = []
            for number in range(pours):
                seeds = random.integers(2**31, size=TRIES + 1).tolist()
                setups = (bench.setup(theta, height, start) for start in seeds[:-1])
                for name, level in planned.truth:
                    # The same table, the same diameters: what is drawn belongs to the set.
                    effect = known[name]
                    setups = map(
                        partial(_apply, effect, effect.strengths[level], of_effect), setups
                    )
                image = f"{round(100 * height):02d}cm/pour-{number}.png"
                made.append(_recorded(bench, map(pour, setups), draft, image, seeds[-1]))
            answer["conditions"].append({"height": height, "use": use, "pours": made})
            images = [one["recording"] for one in made if "recording" in one]
            if images:
                lines += [
                    "",
                    "[[conditions]]",
                    f'name = "{round(100 * height)} cm"',
                    f'at = {{ "funnel.height" = {height} }}',
                    f'use = "{use}"',
                    f"recordings = {json.dumps(images)}",
                ]
    for file in (SCENE, PRIOR):
        shutil.copy(file, draft / file.name)
    (draft / "loop.toml").write_text("\n".join(lines) + "\n")
    for path in draft.rglob("*"):
        os.utime(path, (0, 0))  # When a set was made says where it stands in the plan.
    os.utime(draft, (0, 0))
    shutil.rmtree(sets / planned.name, ignore_errors=True)
    draft.rename(sets / planned.name)
    seal(answer, sealed, sets)


def _apply(effect: effects.Effect, strength: float, seed: int, setup: Setup) -> Setup:
    return effect.apply(setup, strength, np.random.default_rng(seed))


def _recorded(bench: Bench, piles: Iterator[Pile], folder: Path, image: str, noise: int) -> dict:
    """Records the first pour that leaves no grain in the funnel; returns what to seal of it."""
    tries, held = 0, 0
    for tries, pile in enumerate(piles, start=1):
        held = pile.held
        if held == 0:
            bench.record(pile, folder, image, noise)
            seen = bench.observe(pile.centres, pile.radii)
            return {
                "recording": image,
                "noise_seed": noise,
                "tries": tries,
                "lost": pile.lost,
                "rest_s": pile.rest_s,
                "statistics": seen.paper16.tolist(),
                "diagnostics": seen.diagnostics.tolist(),
            }
    return {"tries": tries, "held": held}


def seed_of(sealed: Path, given: int | None) -> int:
    """Returns the seed of the plan, drawn by the system if none is given; it is sealed, too.

    Raises:
        ValueError: the folder belongs to another seed.
    """
    file = sealed / "plan.json"
    if not file.exists():
        write_text(file, json.dumps({"seed": secrets.randbits(63) if given is None else given}))
    seed = json.loads(file.read_text())["seed"]
    if given is not None and seed != given:
        raise ValueError(f"{sealed} holds answers of another seed; choose another folder")
    return seed


def main() -> None:
    """Makes what is missing."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="folder of the sets")
    parser.add_argument("--sealed", type=Path, required=True, help="folder of the answers")
    parser.add_argument("--sets", type=int, default=42)
    parser.add_argument("--nulls", type=int, default=NULLS, help="of a round: sets without effect")
    parser.add_argument(
        "--singles",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="every effect at three strengths, and odd ones, in a round",
    )
    parser.add_argument("--pairs", type=int, default=0, help="of a round: sets with two effects")
    parser.add_argument(
        "--outside", type=int, default=0, help="of a round: an effect that the library lacks"
    )
    parser.add_argument("--first", type=int, default=0, help="sets of the plan to pass over")
    parser.add_argument("--pours", type=int, default=3, help="pours at each height")
    add_part(parser)
    add_young(parser, engine.YOUNG)
    add_engine(parser)
    parser.add_argument("--seed", type=int, help="of the plan; the default is drawn and sealed")
    options = parser.parse_args()
    engine.YOUNG = options.young
    for folder in (options.out, options.sealed):
        folder.mkdir(parents=True, exist_ok=True)
    seed = seed_of(options.sealed, options.seed)
    of = Round(
        nulls=options.nulls,
        singles=options.singles,
        pairs=options.pairs,
        outside=options.outside,
    )
    for planned in plan(seed, options.sets, of)[options.first :]:
        part, parts = options.part
        if planned.index % parts != part or planned.name in seals(options.out):
            continue
        began = time.monotonic()
        make(planned, ENGINES[options.engine], seed, options.pours, options.out, options.sealed)
        # No name and no number of the plan: nothing that is printed may give an answer away.
        took = time.monotonic() - began
        print(f"{len(seals(options.out))} sets, the last in {took:.0f} s", flush=True)


if __name__ == "__main__":
    main()
