"""Fronts of the measured tests, and what rows told without their day say of them: one picture."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from granulcal.experiments.predictions.column_tests import Fronts, times_of

__all__ = ["draw"]

_ROWS, _COLUMNS = 4, 5
_SHOWN = {"sheared": "C0", "dry": "C1", "between": "C2"}
_LIQUIDS = {"w": "water", "g": "glycerol", "k": "clay"}


def draw(path: Path, fronts: Fronts, rows: Sequence[tuple[object, ...]]) -> None:
    """Draws a panel for each of the first twenty tests, in the order of gravity and viscosity.

    Args:
        path: where to.
        fronts: what was seen.
        rows: model, test, time [s] or `end`, radius, low, high [mm].
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    told: dict[tuple[object, object], list[list[float]]] = {}
    for model, test, *numbers in rows:
        if numbers[0] != "end":
            told.setdefault((model, test), []).append([float(str(one)) for one in numbers])
    order = sorted(
        range(len(fronts.tests)),
        key=lambda i: [fronts.tests[i].numbers[name] for name in ("N", "d_p", "mu_f")],
    )
    figure, axes = plt.subplots(
        _ROWS, _COLUMNS, figsize=(11, 8.4), sharey=True, layout="constrained"
    )
    for axis, i in zip(axes.flat, order, strict=False):
        test = fronts.tests[i]
        for model, colour in _SHOWN.items():
            known = told.get((model, test.code))
            if not known:
                continue
            times, middle, low, high = np.array(known).T
            axis.plot(1e3 * times, middle, color=colour, label=model)
            if model == next(iter(_SHOWN)):
                axis.fill_between(1e3 * times, low, high, color=colour, alpha=0.2, lw=0)
        axis.plot(1e3 * times_of(test), fronts.radius[i, :-1], "k.-", lw=0.8, label="measured")
        liquid = f"{_LIQUIDS[test.fluid]} {1e3 * test.numbers['mu_f']:.0f} mPa s"
        beads = f"{1e3 * test.numbers['d_p']:.0f} mm, {test.numbers['N']:.1f} g"
        axis.set_title(f"{beads}, {liquid}\n{test.campaign}", fontsize=8)
        axis.tick_params(labelsize=7)
    for axis in axes[-1]:
        axis.set_xlabel("time [ms]", fontsize=8)
    for axis in axes[:, 0]:
        axis.set_ylabel("front [mm]", fontsize=8)
    axes.flat[0].legend(fontsize=7)
    figure.savefig(path, dpi=75)
    plt.close(figure)
