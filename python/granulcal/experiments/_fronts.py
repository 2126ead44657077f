"""What studies of fronts of columns share: own errors, tensions, the run, a picture."""

from collections.abc import Sequence
from math import ceil
from pathlib import Path

from granulcal.loop.close import Closed, close_loop
from granulcal.loop.effects.definitions import Definition
from granulcal.loop.effects.library import LibraryEffect
from granulcal.loop.pours.forward import Forward
from granulcal.loop.report.folder import write_report
from granulcal.loop.task import FIT, Task

__all__ = [
    "DEFINITIONS",
    "FILM",
    "NUISANCES",
    "OUTLINES",
    "TENSIONS",
    "TORSION",
    "close_fronts",
]

# Tension in N/m: as multiples of a bead's weight it would grow with gravity. Where all gravities
# are one, in units of free fall, it does all the same.
TENSIONS = (
    LibraryEffect(
        name="tension.capillary",
        family="cohesion",
        path="effects.capillary.tension",
        full=0.15,
        unit="N/m",
        also=(("effects.capillary.walls", 0.0),),
        doc="liquid bridges between beads; surface tension",
    ),
    LibraryEffect(
        name="tension.dry",
        family="cohesion",
        path="effects.adhesion.tension",
        full=0.15,
        unit="N/m",
        also=(("effects.adhesion.walls", 0.0),),
        doc="adhesion of touching beads; surface energy",
    ),
)
# Nothing is free in theory: the share is 1.
FILM = LibraryEffect(
    name="film.shear",
    path="effects.lubrication.shear",
    doc="the film between beads resists surfaces that slide past each other; share of theory",
)
TORSION = LibraryEffect(
    name="torsion",
    path="material.torsional_friction",
    off=0.02,
    full=0.3,
    doc="torsional friction between beads",
)
# Own errors: fronts of one condition are shifted by 25 to 50 ms from campaign to campaign, frames
# are told at 240 a second, lengths are read off a wide lens.
NUISANCES = {
    "clock.offset": {"sd": 0.02, "shared": False},
    "clock.scale": 0.02,
    "length.scale": 0.02,
}
# The outline, with longer and shorter links, and what each camera alone saw.
_LINK = "observe.front.link"
OUTLINES = (
    Definition("outline, links of 1.5", {_LINK: 1.5}),
    Definition("outline, links of 1.2", {_LINK: 1.2}),
    Definition("outline, links of 2", {_LINK: 2.0}),
)
DEFINITIONS = (
    *OUTLINES,
    Definition("camera 1 alone", {_LINK: 1.5}, {"camera": 1}),
    Definition("camera 2 alone", {_LINK: 1.5}, {"camera": 2}),
)
# Pours of a model that was not the verdict's.
_DRAWN, _SEED = 5, 8_200_007
_COLUMNS = 3


def close_fronts(
    asked: Task, folder: Path, *, command: str, title: str, budget: int, rounds: int
) -> bool:
    """Runs the loop; report.html, verdict.json and fronts.png in `folder`.

    Returns whether the verdict stands.
    """
    closed = close_loop(asked, folder, budget=budget, rounds=rounds, pairs=0)
    write_report(closed, folder, command=command, title=title)
    _draw(folder / "fronts.png", closed, Forward(folder / "pours", 1))
    print(folder / "fronts.png")
    return closed.standing.stands


def _draw(path: Path, closed: Closed, forward: Forward) -> None:
    """Draws the fronts of every condition: measured, of the base model, of the best other one."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    trace = closed.trace
    best = trace.best
    if best is trace.base and trace.explanations:
        # Nothing is adequate: the most probable model all the same.
        best = trace.explanations[0]
    fronts = _fronts(closed.task.scene.observed_names)
    conditions = closed.task.conditions
    lines = ceil(len(conditions) / _COLUMNS)
    figure, axes = plt.subplots(
        lines,
        _COLUMNS,
        figsize=(10.5, 3.1 * lines),
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
        for of, (times, columns, line) in fronts.items():
            for label, rows, colour in drawn:
                front = 1e3 * rows[:, columns]
                low, high = front.min(axis=0), front.max(axis=0)
                axis.fill_between(times, low, high, color=colour, alpha=0.25, lw=0)
                axis.plot(times, front.mean(axis=0), line, color=colour, label=f"{label}{of}")
            for number, row in enumerate(1e3 * closed.measured[condition.name]):
                label = f"measured{of}" if number == 0 else None
                axis.plot(times, row[columns], f"k.{line}", lw=0.8, label=label)
        axis.set_title(f"{condition.name} ({'fitted' if condition.use == FIT else condition.use})")
    for axis in axes.flat[max(len(conditions) - _COLUMNS, 0) : len(conditions)]:
        axis.set_xlabel("time [s]")
        # The last of its column, though panels that are not used stand below it.
        axis.tick_params(labelbottom=True)
    for axis in axes[:, 0]:
        axis.set_ylabel("radius of the front [mm]")
    # Above all panels: within one it may cover what is drawn there.
    handles, labels = axes.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, fontsize=8, loc="outside upper center", ncols=len(fronts))
    figure.savefig(path, dpi=80)
    plt.close(figure)


def _fronts(names: Sequence[str]) -> dict[str, tuple[list[float], list[int], str]]:
    """Times, columns and line of each front among statistics; that at the end has no time."""
    found: dict[str, tuple[list[float], list[int], str]] = {}
    both = any(name.startswith("liquid_radius") for name in names)
    kinds = (("front_radius", ", beads" if both else "", "-"), ("liquid_radius", ", liquid", "--"))
    for kind, of, line in kinds:
        # front_radius[0.1] and so on.
        within = [(j, n[len(kind) + 1 : -1]) for j, n in enumerate(names) if n.startswith(kind)]
        timed = [(float(at), j) for j, at in within if at != "end"]
        if timed:
            found[of] = ([at for at, _ in timed], [j for _, j in timed], line)
    return found
