"""The loop's report as three Parquet tables.

- conditions, a row each: its numbers, use, pours; E, floor, D^2 with 95 % before and after, and of
  what needs no physics under sealed ones;
- candidates, a row for each effect of the library: kappa and the smallest strength seen, before and
  with the data; score and p; of its refit log probability, p of what it leaves, strength psi and
  number of the scene with interval;
- residuals, a row for each statistic under each condition to fit: of the base and of the final
  model, in standard deviations.

What is not known is null.
"""

from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from granulcal.files import beside
from granulcal.loop.check.trivial import LINE, NEAREST, RESIDUAL
from granulcal.loop.closed import Closed
from granulcal.loop.test.trace import Explanation

__all__ = ["candidates", "conditions", "residuals", "write_tables"]

Row = dict[str, Any]
# Columns of the rows that need no physics.
_COLUMN = {NEAREST: "nearest", LINE: "line", RESIDUAL: "base_and_residual"}


def write_tables(closed: Closed, folder: Path) -> list[Path]:
    """Writes the three files and returns them.

    Raises:
        ModuleNotFoundError: pyarrow is not installed; it comes with `granulcal[report]`.
    """
    try:
        import pyarrow as arrow  # pyright: ignore[reportMissingImports]
        from pyarrow import parquet  # pyright: ignore[reportMissingImports]
    except ModuleNotFoundError:
        raise ModuleNotFoundError(
            "Parquet tables need pyarrow: pip install 'granulcal[report]'"
        ) from None
    written = []
    for name, rows in (
        ("conditions", conditions(closed)),
        ("candidates", candidates(closed)),
        ("residuals", residuals(closed)),
    ):
        path = folder / f"{name}.parquet"
        columns = list(dict.fromkeys(key for row in rows for key in row))
        table = arrow.table({key: [_known(row.get(key)) for row in rows] for key in columns})
        with beside(path) as temporary:
            parquet.write_table(table, temporary)
        written.append(path)
    return written


def conditions(closed: Closed) -> list[Row]:
    """Returns a row for each condition that has an error to tell."""
    at = {condition.name: condition for condition in closed.task.conditions}
    corrected = {one.label: one for one in closed.corrections}
    trivial: dict[str, Row] = {}
    for row in closed.standing.trivial:
        for label, square in zip(row.labels, row.squares, strict=True):
            trivial.setdefault(label, {})[f"square_{_COLUMN[row.name]}"] = float(square)
    rows = []
    for use, found in (("fit", closed.fit), ("sealed", closed.sealed)):
        if found is None:
            continue
        for label, before, after in zip(found.labels, found.before, found.after, strict=True):
            correction = corrected.get(label)
            rows.append(
                {"condition": label, **at[label].at, "use": use}
                | {"pours": len(at[label].recordings), "floor": after.floor}
                | {"error_before": before.error, "error_after": after.error}
                | {"square_before": before.square, "square_after": after.square}
                | {
                    "square_before_low": before.interval[0],
                    "square_before_high": before.interval[1],
                }
                | {"square_after_low": after.interval[0], "square_after_high": after.interval[1]}
                | {"scaled_square_before": correction.before if correction else None}
                | {"scaled_square_corrected": correction.after if correction else None}
                | {f"square_{column}": None for column in _COLUMN.values()}
                | trivial.get(label, {})
            )
    return rows


def candidates(closed: Closed) -> list[Row]:
    """Returns a row for each effect of the library that could have been named."""
    trace, sights = closed.trace, closed.power
    singles = {one.effects[0]: one for one in trace.explanations if len(one.effects) == 1}
    rows = []
    for i, name in enumerate(sights.effects):
        effect = closed.task.effect(name) if name in _library(closed) else None
        row: Row = {
            "effect": name,
            "family": (effect.family if effect else "") or name,
            "path": effect.path if effect else "",
            "unit": effect.unit if effect else "-",
            "is_named": name in closed.verdict.named,
            "kappa_before": float(sights.kappa[i]),
            "detectable_before": float(sights.shown[i]),
            "kappa": float(trace.power.kappa[i]),
            "detectable": float(trace.power.shown[i]),
            "score_square": float(trace.residual_test.squares[i]),
            "one_step_strength": float(trace.residual_test.strengths[i]),
            "adjusted_p": float(trace.residual_test.adjusted[i]),
        }
        rows.append(row | _refit(closed, name, singles.get(name)))
    return rows


def residuals(closed: Closed) -> list[Row]:
    """Returns a row for each statistic under each condition to fit."""
    trace = closed.trace
    before, after = trace.residuals, trace.residuals_of(trace.best)
    return [
        {
            "condition": label,
            "statistic": statistic,
            "before": float(before[h, i]),
            "after": float(after[h, i]),
        }
        for h, label in enumerate(trace.labels)
        for i, statistic in enumerate(trace.statistics)
    ]


def _refit(closed: Closed, name: str, one: Explanation | None) -> Row:
    """What a refit found; nulls where the residual test did not reject."""
    keys = ("log_probability", "p_after", "psi", "psi_low", "psi_high", "psi_best")
    of_pours = _of_pours(closed, name, one)
    if one is None:
        none = dict.fromkeys((*keys, "is_calibrated", "value", "value_low", "value_high"))
        return none | of_pours
    low, high = one.intervals[0]
    is_calibrated = one is closed.trace.best and closed.calibrated is not None
    if is_calibrated and closed.calibrated is not None:
        low, high = closed.calibrated.interval
    psi = float(one.strengths[0])
    numbers = (one.log_probability, one.p_after, psi, low, high, one.best_strengths[0])
    row: Row = dict(zip(keys, map(float, numbers), strict=True))
    row["is_calibrated"] = is_calibrated
    effect = closed.task.effect(name)
    ends = sorted((effect.value(float(low)), effect.value(float(high))))
    row |= {"value": effect.value(psi), "value_low": ends[0], "value_high": ends[1]}
    return row | of_pours


def _of_pours(closed: Closed, name: str, one: Explanation | None) -> Row:
    """The number by the model's own pours, as the page and verdict.json have it; else nulls."""
    keys = ("value_of_pours", "value_of_pours_low", "value_of_pours_high")
    own = closed.standing.own
    if one is None or one is not closed.trace.best or own is None:
        return dict.fromkeys(keys)
    ends = own.intervals[0] if closed.calibrated is None else closed.calibrated.interval
    effect = closed.task.effect(name)
    low, high = sorted(effect.value(float(end)) for end in ends)
    return dict(zip(keys, (effect.value(float(own.strengths[0])), low, high), strict=True))


def _library(closed: Closed) -> set[str]:
    return {effect.name for effect in closed.task.library}


def _known(value: Any) -> Any:
    if isinstance(value, float | np.floating):
        return float(value) if isfinite(value) else None
    return value
