"""The table of `loop_study.py`: rates with 95 % Wilson intervals beside the targets."""

import json
from collections.abc import Callable, Sequence
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np
from rates import median, rate

from granulcal.loop import Thresholds
from granulcal.loop.check.coverage import needed_stretch
from granulcal.loop.test.refit import interval
from granulcal.loop.test.verdict import NAMING

__all__ = ["table"]

Row = dict[str, Any]

_ALARMS = (*NAMING, "RESIDUAL", "UNEXPLAINED")
_LEVEL = 0.95
# For a truth that no stretch holds: the interval is nearly the whole prior.
_LARGEST = 12.0
_BANDS = ((0.0, 0.5, ""), (0.5, 1.0, ">= 75 %"), (1.0, np.inf, ">= 98 %"))


def table(paths: list[Path]) -> None:
    """Prints the rates, and one line for each candidate and each effect outside the library."""
    rows = [json.loads(line) for path in paths for line in path.read_text().splitlines()]
    jammed = sum(row["kind"] == "jammed" for row in rows)
    of = {k: [r for r in rows if r["kind"] == k] for k in ("null", "single", "pair", "hidden")}
    counts = ", ".join(f"{len(v)} {k}" for k, v in of.items())
    print(f"{len(rows)} sets: {counts}, {jammed} jammed\n")
    if any("final" in r for r in rows):
        _finals(of)
        print("\nThe words of the fits, before a check:\n")
    print("| what | rate | 95 % | target |\n|---|---|---|---|")
    _nulls(of["null"])
    _singles(of["single"])
    _names(of)
    _strengths(of["single"])
    _removed(of)
    print("\n| effect | sets | p <= .05 | named | right | median delta | strength covered |")
    print("|---|---|---|---|---|---|---|")
    for name in dict.fromkeys(r["effects"][0] for r in (*of["single"], *of["hidden"])):
        _effect(name, [r for r in (*of["single"], *of["hidden"]) if r["effects"][0] == name])


def _finals(of: dict[str, list[Row]]) -> None:
    """What stands, for the sets whose words were checked."""
    of = {kind: [r for r in rows if "final" in r] for kind, rows in of.items()}
    print("| what stands | rate | 95 % | target |\n|---|---|---|---|")
    own = ("removed", "fallback")
    final = {
        kind: [{**r, **dict.fromkeys(own), **r["final"]} for r in rows] for kind, rows in of.items()
    }
    spoken = [*final["null"], *final["single"], *final["pair"], *final["hidden"]]
    alarms = [r["verdict"] in _ALARMS for r in final["null"]]
    _rate("null: alarm", alarms, "<= 5 % (<= 8 %)")
    _rate("null: named", [_is_named(r) for r in final["null"]])
    _rate("no word (UNCONFIRMED), of all", [r["verdict"] == "UNCONFIRMED" for r in spoken])
    _rate("looked again, of all", [r.get("looked", 0) > 0 for r in spoken])
    _bands(
        final["single"],
        ("single: alarm", "single: named"),
        lambda r: r["verdict"] in _ALARMS,
        lambda r: r["named"][0],
    )
    _naming(final)
    named = [r for r in final["single"] if _is_named(r) and r["best"] == r["effects"] and r["own"]]
    held = [_is_in(r, r["own"]["intervals"][0]) for r in named]
    _rate("single, named rightly: strength in the 95 % of its own pours", held, "90 to 97 %")
    _removed(final)


def _naming(of: dict[str, list[Row]]) -> None:
    named = [r for r in of["single"] if _is_named(r)]
    inside = [r["effects"][0] in r["named"] for r in named]
    _rate("single, named: truth in the set", inside, ">= 97 %")
    spoken = [*of["null"], *of["single"], *of["pair"]]
    wrong = [_is_named(r) and not set(r["named"]) & set(r["effects"]) for r in spoken]
    _rate("false naming, of all sets of the library", wrong, "<= 5 %")
    told = [w for r, w in zip(spoken, wrong, strict=True) if _is_named(r)]
    _rate("false naming, of the named ones", told)
    strong = [r for r in of["hidden"] if r["delta"] >= 1]
    _rate("outside, delta >= 1: not named", [not _is_named(r) for r in strong], ">= 70 %")
    _rate("outside, delta >= 1: UNEXPLAINED", [r["verdict"] == "UNEXPLAINED" for r in strong])
    _rate("outside, all: named", [_is_named(r) for r in of["hidden"]])
    two = [r for r in of["pair"] if _is_named(r)]
    alone = [set(r["named"]) <= set(r["effects"]) for r in two]
    _rate("pairs, named: no false member", alone, ">= 95 %")
    both = [set(r["named"]) == set(r["effects"]) for r in of["pair"]]
    _rate("pairs: both found", both, ">= 60 %")
    # Where one effect by itself leaves nothing there is no second to be found.
    apart = [b for r, b in zip(of["pair"], both, strict=True) if not _by_one(r)]
    _rate("  of those that no single effect explains", apart)


def _nulls(rows: list[Row]) -> None:
    _rate("false alarm, p <= .05", [r["p"] <= 0.05 for r in rows], "<= 5 % (<= 8 %)")
    _rate("false alarm, p <= .01", [r["p"] <= 0.01 for r in rows])
    for i, name in enumerate(("library", "any", "smooth")):
        _rate(f"false alarm, {name} alone", [r["p_each"][i] <= 0.05 for r in rows])
    _rate("null named", [_is_named(r) for r in rows])


def _singles(rows: list[Row]) -> None:
    _bands(rows, ("detected", "named"), lambda r: r["p"] <= 0.05, lambda r: r["first"])


def _bands(
    rows: list[Row],
    words: tuple[str, str],
    is_found: Callable[[Row], bool],
    first: Callable[[Row], str],
) -> None:
    """Rates of what is found and named, and whether its first name is right, by the misfit."""
    for low, high, target in _BANDS:
        chosen = [r for r in rows if low <= r["delta"] < high]
        band = f"delta {low:g} to {high:g}" if np.isfinite(high) else f"delta from {low:g}"
        _rate(f"{words[0]}, {band}", [is_found(r) for r in chosen], target)
        _rate(f"{words[1]}, {band}", [_is_named(r) for r in chosen])
        right = [first(r) == r["effects"][0] for r in chosen if _is_named(r)]
        _rate("  of these the first is right", right, ">= 90 %" if low >= 1 else "")


def _names(of: dict[str, list[Row]]) -> None:
    named = [r for r in of["single"] if _is_named(r)]
    if named:
        size = np.mean([len(r["families"]) for r in named])
        print(f"| mean number of families named | {size:.2f} | | <= 1.5 |")
    _rate(
        "single, p <= .01: UNEXPLAINED",
        [r["verdict"] == "UNEXPLAINED" for r in of["single"] if r["p"] <= 0.01],
    )
    _naming(of)
    _rate("pairs, p <= .05", [r["p"] <= 0.05 for r in of["pair"]])


def _strengths(rows: list[Row]) -> None:
    _rate("strength in its 95 % interval, all singles", [_covers(r) for r in rows], "90 to 97 %")
    for name, chosen in (
        ("p <= .01", [r for r in rows if r["p"] <= 0.01]),
        ("named rightly", [r for r in rows if r["effects"][0] in r["named"]]),
        ("kappa at least .5", [r for r in rows if (r["kappa"] or 0) >= 0.5]),
        ("kappa below .5 or not known", [r for r in rows if not (r["kappa"] or 0) >= 0.5]),
    ):
        _rate(f"strength in its 95 % interval, {name}", [_covers(r) for r in chosen])
    halves = [[r for r in rows if r["index"] % 2 == i] for i in (0, 1)]
    stretches = [_stretch(half) for half in halves]
    crossed = [
        _is_in(r, interval(np.array(r["curve"]), _LEVEL, stretch))
        for half, stretch in zip(halves, reversed(stretches), strict=True)
        for r in half
    ]
    shown = ", ".join(f"{stretch:.3g}" for stretch in stretches)
    _rate(f"strength, stretched as the other half needs ({shown})", crossed, "90 to 97 %")
    wide = [r for r in rows if r.get("wide")]
    within = [_is_in(r, r["wide"]["interval"]) for r in wide]
    _rate("strength in the interval that pairs widened", within, "90 to 97 %")
    _rate("  the same sets, plain interval", [_covers(r) for r in wide])
    _median("  stretch", [r["wide"]["stretch"] for r in wide])
    signs = [np.sign(r["strengths"][0]) for r in rows]
    shift = [s * (r["strength"][0] - r["strengths"][0]) for s, r in zip(signs, rows, strict=True)]
    if shift:
        size = np.sqrt(np.mean(np.square(shift)))
        name = "strength: mean error towards its sign, rms"
        print(f"| {name} | {np.mean(shift):.3f}, {size:.3f} | | |")


def _stretch(rows: list[Row]) -> float:
    """Returns the stretch with which intervals hold their truth in 95 % of the sets."""
    needed = [needed_stretch(np.array(r["curve"]), r["strengths"][0], _LEVEL) for r in rows]
    known = sorted(s if np.isfinite(s) else _LARGEST for s in needed) or [1.0]
    return known[min(ceil(_LEVEL * (len(known) + 1)), len(known)) - 1]


def _removed(of: dict[str, list[Row]]) -> None:
    right = [r for r in of["single"] if r["verdict"] == "EFFECT" and r["effects"][0] in r["named"]]
    _median("R at sealed heights, right effect", [r.get("removed") for r in right], ">= 90 %")
    hidden = [r for r in of["hidden"] if _is_named(r)]
    _median("R, outside that was named", [r.get("removed") for r in hidden])
    unexplained = [r for rows in of.values() for r in rows if r["verdict"] == "UNEXPLAINED"]
    left = [r.get("fallback") for r in unexplained]
    _median("R of the correction, UNEXPLAINED", left, ">= 70 %")


def _effect(name: str, rows: list[Row]) -> None:
    found = sum(r["p"] <= 0.05 for r in rows)
    named = [r for r in rows if _is_named(r)]
    right = sum(name in r["named"] for r in named)
    delta = np.median([r["delta"] for r in rows])
    covered = f"{sum(map(_covers, rows))}" if "strength" in rows[0] else "-"
    cells = [name, len(rows), found, len(named), right, f"{delta:.2f}", covered]
    print("| " + " | ".join(map(str, cells)) + " |")


def _by_one(row: Row) -> bool:
    """Whether a single effect leaves nothing of the set."""
    return any(len(effects) == 1 and p > Thresholds().adequate for effects, _, p in row["models"])


def _is_named(row: Row) -> bool:
    return row["verdict"] in NAMING


def _covers(row: Row) -> bool:
    return _is_in(row, row["strength"][1:])


def _is_in(row: Row, ends: Sequence[float]) -> bool:
    return ends[0] <= row["strengths"][0] <= ends[1]


def _rate(name: str, hits: list[bool], target: str = "") -> None:
    # Its tables have a column of targets, which may be empty.
    rate(name, hits, target)


def _median(name: str, values: list[float | None], target: str = "") -> None:
    median(name, values, target)
