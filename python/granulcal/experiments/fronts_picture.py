"""A picture of fronts against time: measured, of the base model, of the best other one."""

from math import ceil
from pathlib import Path

from granulcal.loop.close import Closed
from granulcal.loop.pours.forward import Forward
from granulcal.loop.task import FIT

__all__ = ["draw_fronts"]

# Pours of a model that was not the verdict's.
_DRAWN, _SEED = 5, 8_200_007
_COLUMNS = 3


def draw_fronts(path: Path, closed: Closed, forward: Forward) -> None:
    """Draws the fronts of every condition: measured, of the base model, of the best other one."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    trace = closed.trace
    best = trace.best
    if best is trace.base and trace.explanations:
        # Nothing is adequate: the most probable model all the same.
        best = trace.explanations[0]
    # front_radius[0.1] and so on; that at the end, if there is one, is last.
    within = [name.partition("[")[2][:-1] for name in closed.task.scene.observed_names]
    times = [float(time) for time in within if time != "end"]
    conditions = closed.task.conditions
    rows = ceil(len(conditions) / _COLUMNS)
    figure, axes = plt.subplots(
        rows,
        _COLUMNS,
        figsize=(10.5, 3.1 * rows),
        sharex=True,
        sharey="row",
        squeeze=False,
        layout="constrained",
    )
    for axis in axes.flat[len(conditions) :]:
        axis.set_visible(False)
    for axis, condition in zip(axes.flat, conditions, strict=False):
        before, after = closed.simulated[condition.name]
        if best is not trace.best:
            after = forward.pours(closed.scene(condition, best), range(_SEED, _SEED + _DRAWN))
        drawn = [("base model", before, "C0")]
        if best is not trace.base:
            drawn.append((f"with {' + '.join(best.effects)}", after, "C1"))
        for label, rows, colour in drawn:
            fronts = 1e3 * rows[:, : len(times)]
            low, high = fronts.min(axis=0), fronts.max(axis=0)
            axis.fill_between(times, low, high, color=colour, alpha=0.25, lw=0)
            axis.plot(times, fronts.mean(axis=0), color=colour, label=label)
        for number, row in enumerate(1e3 * closed.measured[condition.name]):
            label = "measured" if number == 0 else None
            axis.plot(times, row[: len(times)], "k.-", lw=0.8, label=label)
        axis.set_title(f"{condition.name} ({'fitted' if condition.use == FIT else condition.use})")
    for axis in axes[(len(conditions) - 1) // _COLUMNS]:
        axis.set_xlabel("time [s]")
    for axis in axes[:, 0]:
        axis.set_ylabel("radius of the front [mm]")
    axes.flat[0].legend(fontsize=8, loc="upper left")
    figure.savefig(path, dpi=80)
    plt.close(figure)
