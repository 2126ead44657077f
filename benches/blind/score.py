"""Opens the sealed answers and prints how the loop has done, beside the targets.

    python benches/blind/score.py out/sets --sealed out/sealed

The loop's verdict on a set stands in `SET/report/verdict.json`; sets without one are counted as not
analysed. An answer whose hash is not the sealed one ends the scoring.
"""

import argparse
import json
import math
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from answers import unseal
from scipy.stats import binomtest

from granulcal.loop.check.standing import FALLEN
from granulcal.loop.test.verdict import KINDS, NAMING

FAMILIES = Path(__file__).parent / "families.toml"
STRONG, MIDDLE = 1.0, 0.5
"""Misfits delta = sqrt(D2 before) at which sets are graded [-]."""


class BadVerdictError(ValueError):
    """A verdict file that is not one."""


@dataclass(frozen=True)
class Family:
    """What the loop may call an effect of the truth.

    Attributes:
        names: the loop's effects that are right; none is out of library.
        strength: (offset, factor) from the truth's strength to that of a loop's effect.
    """

    names: tuple[str, ...]
    strength: dict[str, tuple[float, float]]


@dataclass(frozen=True)
class Verdict:
    """What the loop has said of a set.

    Attributes:
        verdict: one of `KINDS`.
        named: the loop's effects, the best first.
        strength: low, middle and high by effect, in the loop's units.
        before, after: squared misfit at the fit heights and at the sealed ones [-].
        pours: pours of the simulator besides those that all analyses share.
    """

    verdict: str
    named: tuple[str, ...]
    strength: dict[str, tuple[float, float, float]]
    before: dict[str, float]
    after: dict[str, float]
    pours: int

    @classmethod
    def read(cls, path: Path) -> "Verdict":
        """Returns the verdict in a file.

        Raises:
            BadVerdictError: a key is missing or a value is none that a verdict has.
        """
        try:
            table = json.loads(path.read_text())
            found = cls(
                verdict=table["verdict"],
                named=tuple(table["named"]),
                strength={k: tuple(map(float, v)) for k, v in table["strength"].items()},
                before={k: float(v["before"]) for k, v in table["misfit"].items()},
                after={k: float(v["after"]) for k, v in table["misfit"].items()},
                pours=int(table["pours"]),
            )
        except (KeyError, TypeError, ValueError) as error:
            raise BadVerdictError(f"{path}: {type(error).__name__}: {error}") from error
        if found.verdict not in KINDS:
            allowed = ", ".join(KINDS)
            raise BadVerdictError(f"{path}: verdict is {found.verdict!r}, allowed: {allowed}")
        if (found.verdict in NAMING) != bool(found.named):
            raise BadVerdictError(f"{path}: {found.verdict} with effects named {found.named}")
        for missing in {"fit", "sealed"} - set(found.before):
            raise BadVerdictError(f"{path}: no misfit of the {missing} heights")
        return found


@dataclass(frozen=True)
class Truth:
    """An effect of a set's truth, its strength in the truth's unit, and what it may be called."""

    effect: str
    strength: float
    family: Family


@dataclass(frozen=True)
class Judged:
    """A set with its truth and the loop's verdict."""

    name: str
    truth: tuple[Truth, ...]
    verdict: Verdict

    @property
    def right(self) -> set[str]:
        """The names of the loop that are right."""
        return {name for one in self.truth for name in one.family.names}

    @property
    def is_null(self) -> bool:
        """Whether the truth has no effect."""
        return not self.truth

    @property
    def is_outside(self) -> bool:
        """Whether the library lacks the truth's effect."""
        return not self.is_null and not self.right

    @property
    def is_single(self) -> bool:
        """Whether the truth has one effect, of the library."""
        return len(self.truth) == 1 and bool(self.right)

    @property
    def is_pair(self) -> bool:
        """Whether the truth has two effects, of the library."""
        return len(self.truth) == 2

    @property
    def finds_both(self) -> bool:
        """Whether each effect of the truth has a name."""
        named = set(self.verdict.named)
        return all(named & set(one.family.names) for one in self.truth)

    @property
    def delta(self) -> float:
        """Misfit of the best base fit, the root of D2 at the fit heights [-]."""
        return math.sqrt(max(0.0, self.verdict.before["fit"]))

    @property
    def is_detected(self) -> bool:
        """Whether the loop says that something is there."""
        return self.verdict.verdict not in ("NONE", *FALLEN)

    @property
    def has_fallen(self) -> bool:
        """Whether the loop's own checks have taken its word away."""
        return self.verdict.verdict in FALLEN

    @property
    def is_named(self) -> bool:
        """Whether the loop says what it is."""
        return self.verdict.verdict in NAMING

    @property
    def is_first_right(self) -> bool:
        """Whether the effect named first is right."""
        return self.is_named and self.verdict.named[0] in self.right

    @property
    def holds_truth(self) -> bool:
        """Whether an effect that is named is right."""
        return not self.right.isdisjoint(self.verdict.named)

    @property
    def is_false(self) -> bool:
        """Whether a name is wrong: the only one, all of a set, or one of several together."""
        if not self.is_named:
            return False
        if self.verdict.verdict == "EFFECTS":
            return not self.right.issuperset(self.verdict.named)
        return not self.holds_truth

    @property
    def covers(self) -> bool | None:
        """Whether the interval of the strength holds the truth; None where that means nothing."""
        if not self.is_single:
            return None
        (one,) = self.truth
        for name in self.verdict.named:
            if name in one.family.strength:
                offset, factor = one.family.strength[name]
                if name not in self.verdict.strength:
                    return None
                low, _, high = self.verdict.strength[name]
                return low <= offset + factor * one.strength <= high
        return None


def families(path: Path = FAMILIES) -> dict[str, Family]:
    """Returns the families in a file by the truth's effect."""
    tables = tomllib.loads(path.read_text())
    return {
        effect: Family(
            tuple(table["names"]),
            {
                name: (float(line.get("offset", 0.0)), float(line["factor"]))
                for name, line in table.get("strength", {}).items()
            },
        )
        for effect, table in tables.items()
    }


def judge(
    sets: Path, sealed: Path, known: dict[str, Family], report: str = "report"
) -> tuple[list[Judged], list[str]]:
    """Returns the sets that have a verdict, and the names of those that have none.

    Raises:
        BrokenSealError: an answer is not the one that was sealed.
        BadVerdictError: a verdict file is not one, or a truth is in no family.
    """
    judged, missing = [], []
    for name, answer in sorted(unseal(sealed, sets).items()):
        file = sets / name / report / "verdict.json"
        if not file.exists():
            missing.append(name)
            continue
        judged.append(Judged(name, _truth(answer, known), Verdict.read(file)))
    return judged, missing


def _truth(answer: dict, known: dict[str, Family]) -> tuple[Truth, ...]:
    """The effects of an answer."""
    unknown = [one["name"] for one in answer["effects"] if one["name"] not in known]
    if unknown:
        raise BadVerdictError(f"{answer['set']}: no family of the effect {unknown[0]!r}")
    return tuple(
        Truth(one["name"], float(one["strength"]), known[one["name"]]) for one in answer["effects"]
    )


def wilson(hits: int, total: int) -> tuple[float, float]:
    """Returns the 95 % interval of a share (Wilson 1927)."""
    interval = binomtest(hits, total).proportion_ci(method="wilson")
    return interval.low, interval.high


def share(hits: Sequence[bool]) -> str:
    """Returns a share with its interval as text."""
    if not hits:
        return "no such set"
    low, high = (100 * max(0.0, min(1.0, end)) for end in wilson(sum(hits), len(hits)))
    percent = 100 * sum(hits) / len(hits)
    return f"{percent:.0f} % = {sum(hits)}/{len(hits)} ({low:.0f}-{high:.0f})"


def removed(sets: Sequence[Judged], seed: int = 0) -> str:
    """Returns 1 - sum D2 after / sum D2 before at the sealed heights; bootstrap over sets."""
    if not sets:
        return "no such set"
    before, after = (
        np.array([getattr(s.verdict, side)["sealed"] for s in sets]) for side in ("before", "after")
    )
    if before.sum() <= 0.0:
        return f"no misfit to remove, n = {len(sets)}"
    rows = np.random.default_rng(seed).integers(len(sets), size=(2000, len(sets)))
    sums = before[rows].sum(axis=1)
    drawn = 1.0 - after[rows].sum(axis=1)[sums > 0] / sums[sums > 0]
    low, high = 100 * np.quantile(drawn, [0.025, 0.975])
    return f"{100 * (1 - after.sum() / before.sum()):.0f} % ({low:.0f}-{high:.0f}), n = {len(sets)}"


def table(sets: Sequence[Judged]) -> list[tuple[str, str, str, str]]:
    """Returns metric, outstanding, acceptable and measured of section 7 of the loop's design."""
    nulls = [s for s in sets if s.is_null]
    singles = [s for s in sets if s.is_single]
    outside = [s for s in sets if s.is_outside]
    pairs = [s for s in sets if s.is_pair]
    of_pairs = [s for s in pairs if s.is_named]
    strong = [s for s in singles if s.delta >= STRONG]
    middle = [s for s in singles if MIDDLE <= s.delta < STRONG]
    weak = [s for s in singles if s.delta < MIDDLE]
    named = [s for s in singles if s.is_named]
    library = [s for s in nulls + singles if s.is_named]
    right = [s for s in named if s.is_first_right and not s.is_false]
    unexplained = [s for s in sets if s.verdict.verdict == "UNEXPLAINED"]
    covered = [s.covers for s in right if s.covers is not None]
    pours = [s.verdict.pours for s in sets]
    size = f"{np.mean([len(s.verdict.named) for s in named]):.1f}" if named else "-"
    far = [not s.is_named for s in outside if s.delta >= STRONG]
    return [
        ("false alarm, null of the other code", "<= 10 %", "<= 20 %",
         share([s.is_detected for s in nulls])),
        ("the same, of those with a word", "", "",
         share([s.is_detected for s in nulls if not s.has_fallen])),
        ("no word (UNCONFIRMED, OVERTURNED), null", "", "",
         share([s.has_fallen for s in nulls])),
        ("the same, sets with an effect", "", "",
         share([s.has_fallen for s in sets if not s.is_null])),
        ("detected, delta >= 1", ">= 98 %", ">= 90 %", share([s.is_detected for s in strong])),
        ("detected, delta .5-1", ">= 75 %", ">= 50 %", share([s.is_detected for s in middle])),
        ("detected, delta < .5", "-", "-", share([s.is_detected for s in weak])),
        ("top-1 among named singles, delta >= 1", ">= 90 %", ">= 80 %",
         share([s.is_first_right for s in strong if s.is_named])),
        ("truth inside what is named", ">= 97 %", ">= 90 %", share([s.holds_truth for s in named])),
        ("mean number of names", "<= 1.5", "<= 2", size),
        ("false naming among library verdicts that name", "<= 5 %", "<= 10 %",
         share([s.is_false for s in library])),
        ("pairs: detected", "-", "-", share([s.is_detected for s in pairs])),
        ("pairs, named: no false member", ">= 95 %", ">= 85 %",
         share([s.right.issuperset(s.verdict.named) for s in of_pairs])),
        ("pairs: both found", ">= 60 %", ">= 40 %", share([s.finds_both for s in pairs])),
        ("out of library, delta >= 1: UNEXPLAINED or not named", ">= 70 %", ">= 50 %", share(far)),
        ("removed misfit at sealed heights, right effect", ">= 90 %", ">= 70 %", removed(right)),
        ("removed misfit at sealed heights, UNEXPLAINED", ">= 70 %", ">= 50 %",
         removed(unexplained)),
        ("95 % interval of the strength covers", "90-97 %", ">= 85 %", share(covered)),
        ("pours besides the shared ones, mean (most)", "<= 2500", "<= 5000 most",
         f"{np.mean(pours):.0f} ({max(pours)})" if pours else "-"),
    ]  # fmt: skip


def main() -> None:
    """Prints the table and, if asked for, a line for each set."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sets", type=Path)
    parser.add_argument("--sealed", type=Path, required=True)
    parser.add_argument("--families", type=Path, default=FAMILIES)
    parser.add_argument("--report", default="report", help="folder in a set's (default: report)")
    parser.add_argument("--each", action="store_true", help="a line for each set, truth and all")
    options = parser.parse_args()
    judged, missing = judge(
        options.sets, options.sealed, families(options.families), options.report
    )
    print(f"{len(judged)} sets with a verdict, {len(missing)} not analysed\n")
    print("| metric | outstanding | acceptable | measured |\n|---|---|---|---|")
    for row in table(judged):
        print(f"| {' | '.join(row)} |")
    if options.each:
        print("\n| set | truth | strength | delta | verdict | named |\n|---|---|---|---|---|---|")
        for s in judged:
            effects = ", ".join(one.effect for one in s.truth) or "none"
            strength = ", ".join(f"{one.strength:g}" for one in s.truth) or "-"
            cells = [s.name, effects, strength, f"{s.delta:.2f}", s.verdict.verdict]
            print(f"| {' | '.join([*cells, ', '.join(s.verdict.named) or '-'])} |")


if __name__ == "__main__":
    main()
