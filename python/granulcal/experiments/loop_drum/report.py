"""The drum before and after, at the measured speeds and at two that are measured elsewhere."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granulcal.experiments.loop_drum.task import at_speed
from granulcal.loop.closed import Closed
from granulcal.loop.pours.forward import Forward
from granulcal.loop.report.predict import predict
from granulcal.loop.task import SEALED, Condition
from granulcal.loop.test.trace import Explanation

__all__ = ["Speed", "compare_speeds", "table"]

Array = NDArray[np.float64]

# Rounds a minute of speeds without a picture here, and when their mean begins and ends [s].
_FURTHER = {10: (2.0, 2.6), 30: (1.1, 1.4)}
_DRAWS = 4
_SEED = 8_100_011


@dataclass(frozen=True, kw_only=True, eq=False)
class Speed:
    """One speed; profiles are in metres, the slope in degrees comes last.

    Attributes:
        rpm: rounds a minute.
        measured: statistics of the picture, shape (s,); None where there is none.
        before: pours of the base model at its fit, shape (n, s).
        after: pours of the augmented model at its fit, shape (n, s).
        spread_before: where there is no picture, pours of draws around the fit; else `before`.
        spread_after: the same of the augmented model.
    """

    rpm: int
    measured: Array | None
    before: Array
    after: Array
    spread_before: Array
    spread_after: Array


def compare_speeds(closed: Closed, folder: Path) -> list[Speed]:
    """Simulates the further speeds before and after; draws `profiles.png` in `folder`."""
    found = []
    forward, after_model = Forward(folder / "pours", 1), _after(closed)
    for condition in closed.task.conditions:
        before, after = closed.simulated[condition.name]
        if after_model is not closed.trace.best:
            seeds = range(_SEED, _SEED + _DRAWS)
            after = forward.pours(closed.scene(condition, after_model), list(seeds))
        found.append(
            Speed(
                rpm=int(condition.name.split()[0]),
                measured=closed.measured[condition.name][0],
                before=before,
                after=after,
                spread_before=before,
                spread_after=after,
            )
        )
    for rpm, (begin, end) in _FURTHER.items():
        where = Condition(f"{rpm} rpm", at_speed(rpm, begin, end), SEALED, ())
        base = predict(closed, where, closed.trace.base, forward, draws=_DRAWS)
        best = base
        if after_model is not closed.trace.base:
            best = predict(closed, where, after_model, forward, draws=_DRAWS)
        found.append(
            Speed(
                rpm=rpm,
                measured=None,
                before=base[0],
                after=best[0],
                spread_before=base[1],
                spread_after=best[1],
            )
        )
    found.sort(key=lambda one: one.rpm)
    _picture(folder / "profiles.png", closed, found)
    return found


def _after(closed: Closed) -> Explanation:
    """The model of the verdict; where nothing explains the pictures, the most probable one."""
    if closed.verdict.kind == "UNEXPLAINED":
        return closed.trace.explanations[0]
    return closed.trace.best


def table(closed: Closed, speeds: list[Speed]) -> list[str]:
    """Returns what was found as Markdown."""
    verdict = closed.verdict
    x = _places(closed)
    after = " + ".join(_after(closed).effects) or "the base model"
    lines = [f"Verdict: {verdict.kind} {', '.join(verdict.named)}; after: {after}", ""]
    lines += ["| rpm | slope: measured | before | after | rms: before [mm] | after [mm] |"]
    lines += ["|---|---|---|---|---|---|"]
    for one in speeds:
        shown = "-" if one.measured is None else f"{one.measured[-1]:.1f}"
        cells = [_slope(one.before, one.spread_before), _slope(one.after, one.spread_after)]
        for rows in (one.before, one.after):
            cells.append("-" if one.measured is None else f"{_rms_mm(rows, one.measured):.2f}")
        lines.append(f"| {one.rpm} | {shown} | {' | '.join(cells)} |")
    lines += ["", "Height of the surface [mm] at x [mm]:", ""]
    lines += ["| rpm | | " + " | ".join(f"{1e3 * at:.0f}" for at in x) + " |"]
    lines += ["|---" * (len(x) + 2) + "|"]
    for one in speeds:
        rows = [("before", one.before.mean(axis=0)), ("after", one.after.mean(axis=0))]
        if one.measured is not None:
            rows.insert(0, ("measured", one.measured))
        for label, row in rows:
            cells = " | ".join(f"{1e3 * value:.1f}" for value in row[:-1])
            lines.append(f"| {one.rpm} | {label} | {cells} |")
    return [*lines, ""]


def _places(closed: Closed) -> list[float]:
    names = closed.task.scene.observed_names
    return [closed.task.scene.get(f"observe.surface.x.{i}") for i in range(len(names) - 1)]


def _slope(at_fit: Array, spread: Array) -> str:
    low, high = spread[:, -1].min(), spread[:, -1].max()
    return f"{at_fit[:, -1].mean():.1f} ({low:.1f} to {high:.1f})"


def _rms_mm(rows: Array, measured: Array) -> float:
    return 1e3 * float(np.sqrt(np.mean((rows.mean(axis=0) - measured)[:-1] ** 2)))


def _picture(path: Path, closed: Closed, speeds: list[Speed]) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    x = 1e3 * np.array(_places(closed))
    best = _after(closed)
    models = [("base model", "before", "spread_before", "C0")]
    if best is not closed.trace.base:
        models.append((f"with {' + '.join(best.effects)}", "after", "spread_after", "C1"))
    figure, grid = plt.subplots(2, 2, figsize=(8.2, 8.4), sharex=True, sharey=True)
    axes = list(grid.flat)
    turn = np.linspace(0.0, 2 * np.pi, 200)
    for axis, one in zip(axes, speeds, strict=True):
        axis.plot(42 * np.cos(turn), 42 * np.sin(turn), color="0.7", lw=1)
        for label, at_fit, spread, colour in models:
            rows = 1e3 * getattr(one, spread)[:, :-1]
            low, high = rows.min(axis=0), rows.max(axis=0)
            axis.fill_between(x, low, high, color=colour, alpha=0.25, lw=0)
            mean = 1e3 * getattr(one, at_fit).mean(axis=0)[:-1]
            axis.plot(x, mean, color=colour, label=label)
        if one.measured is not None:
            axis.plot(x, 1e3 * one.measured[:-1], "k.-", label="measured")
        title = f"{one.rpm} rpm" if one.measured is not None else f"{one.rpm} rpm, predicted"
        axis.set(title=title, aspect="equal", xlim=(-43, 43), ylim=(-43, 43))
    for axis in grid[-1]:
        axis.set_xlabel("x [mm]")
    for axis in grid[:, 0]:
        axis.set_ylabel("height of the free surface [mm]")
    figure.tight_layout()
    shown = next(a for a, s in zip(axes, speeds, strict=True) if s.measured is not None)
    shown.legend(fontsize=8, loc="upper right")
    figure.savefig(path, dpi=80)
    plt.close(figure)
