"""Experiment 8: the height to pour a ring from, and the grains that a pour into a bowl spills.

Material as in `examples/couscous.toml`: the paper's sliding friction and restitution of couscous
and barley, and the rolling friction 0.1; the paper's own rolling friction lets grains roll on for
metres, so that no ring is left (docs/results/design.md).
"""

from pathlib import Path

import numpy as np

from granulcal.design.pattern import simulate_plan
from granulcal.design.picture import plan_picture
from granulcal.design.ring import Ring
from granulcal.design.ring_model import HEIGHT, RingModel, observing_radii
from granulcal.design.rings import design_rings
from granulcal.design.spill import design_spill
from granulcal.errors import ExtrapolationError, UnreachableRingError
from granulcal.experiments.paper.common.draw import ACCENT, SECOND, new_figure, save
from granulcal.experiments.paper.common.experiment import Experiment
from granulcal.experiments.paper.common.measure import Published, error_row
from granulcal.experiments.paper.common.outcome import Figure, Outcome, Row, Table
from granulcal.experiments.paper.common.poured_set import PouredSet
from granulcal.experiments.paper.common.sizes import Size
from granulcal.experiments.paper.common.workshop import Workshop
from granulcal.pours.scene import Scene
from granulcal.pours.simulate import simulate

__all__ = ["COUSCOUS", "EXPERIMENT"]

_PAPER = Published(mean=0.0530, sd=0.2221, count=50)
_ROLLING = 0.1
COUSCOUS = {
    "material.sliding_friction": 0.6687,
    "material.rolling_friction": _ROLLING,
    "material.restitution": 0.7689,
}
"""The paper's couscous, but for its rolling friction."""
_BARLEY = {**COUSCOUS, "material.sliding_friction": 0.3807, "material.restitution": 0.4792}
_SEED, _WIDE_SEED, _WANTED_SEED, _SPILL_SEED = 801, 803, 805, 807
# The paper pours its rings from 27.1, 10.1 and 1.5 cm; from 1.5 cm the pile closes the funnel here.
_POURED_FROM = (0.271, 0.101, 0.039)
_WIDE = (0.025, 0.3)
_BOWL = Path(__file__).parent / "bowl.toml"
_SPILL_HEIGHTS = (0.06, 0.30)
_CM = 1e2


def sets(size: Size) -> list[PouredSet]:
    """Returns the pours of this experiment."""
    scene, bowl = size.scene(), Scene.load(_BOWL).with_({"grains.count": size.grains})
    return [
        PouredSet("rings", size.training + size.tests, scene),
        PouredSet("rings-wide", size.training, scene),
        PouredSet("spill", 2 * size.spills, bowl),
    ]


def run(workshop: Workshop) -> Outcome:
    """Infers heights, plans and pours the pattern, and counts what the bowl spills."""
    size = workshop.size
    scene = observing_radii(size.scene().with_(COUSCOUS))
    quiet = workshop.quiet
    common = {"threads": workshop.threads, "progress": not quiet}
    workshop.say(f"rings: {size.training} pours")
    folder = workshop.folder / "pours" / "rings"
    model = RingModel.train(scene, pours=size.training, out=folder, seed=_SEED, **common)
    held_out = model.held_out(size.tests, seed=_SEED + 1, out=folder, **common)
    wide_folder = workshop.folder / "pours" / "rings-wide"
    workshop.say(f"rings from 2.5 to 30 cm: {size.training} pours")
    wide = RingModel.train(
        scene, heights=_WIDE, pours=size.training, out=wide_folder, seed=_WIDE_SEED, **common
    )
    workshop.pours += 2 * size.training + size.tests + held_out.unusable.total
    workshop.seeds |= {"rings": _SEED, "rings-wide": _WIDE_SEED, "spill": _SPILL_SEED}
    try:
        pattern_rows, plan_file = _pattern(workshop, wide, scene)
    except (ExtrapolationError, UnreachableRingError) as error:
        # Few grains make a poor ring; what the design refuses is told, not drawn.
        pattern_rows, plan_file = [["refused", str(error), "", ""]], None
    spills, spill_file = _spills(workshop)
    inside = held_out.coverage
    return Outcome(
        rows=[
            error_row("error of the height [cm]", _CM * held_out.errors, size, _PAPER),
            Row(
                quantity="heights in their 90 % interval",
                ours=f"{inside:.0%}",
                count=len(held_out.heights),
            ),
            Row(
                quantity="least sd of the height that the pours allow, Cramer-Rao [cm]",
                ours=f"{_CM * np.sqrt(np.mean(held_out.floors**2)):.4f}",
                count=len(held_out.heights),
            ),
        ],
        answer=f"The height is inferred from two percentiles with an error of "
        f"{_CM * held_out.errors.mean():.4f} ± {_CM * held_out.errors.std(ddof=1):.4f} cm.",
        tables=[
            Table(
                title="Three concentric formations: wanted and poured, inner / outer radius [cm]",
                columns=[
                    "poured from [cm] (90 % interval)",
                    "wanted",
                    "poured alone",
                    "all three on the ground",
                ],
                rows=pattern_rows,
            ),
            Table(
                title="Grains that a bowl spills: expected, and P(at least 10) with its 90 % band",
                columns=["height of the tip [cm]", "couscous", "barley"],
                rows=spills,
            ),
        ],
        figures=[
            *([] if plan_file is None else [Figure(file=plan_file, caption=_PATTERN)]),
            Figure(file=spill_file, caption=_SPILLS),
        ],
        notes=[
            "The paper's wanted radii are in no text; here they are what one pour from each of "
            "27.1, 10.1 and 3.9 cm gives. From the paper's 1.5 cm the pile reaches the tip and "
            "holds the funnel closed.",
            "The paper's spill counts stand in a figure and its bowl is not described: nothing "
            "can be compared. The bowl here has a rim of 14 cm at a height of 4.5 cm.",
            f"Held-out pours that could not be used and are not counted: {held_out.unusable}.",
        ],
    )


_PATTERN = "The pattern: heights from above, and distances of each pour's grains from the axis."
_SPILLS = "Spilled grains against the height: pours and their expectation."


def _pattern(workshop: Workshop, model: RingModel, scene: Scene) -> tuple[list, str | None]:
    """Plans the three formations, pours them alone and together."""
    wanted = []
    for i, height in enumerate(_POURED_FROM):
        seen = simulate(scene.with_({HEIGHT: height}), seed=_WANTED_SEED + i).observed()
        inner, outer = np.asarray(seen)
        # Of a pile nobody asks for an inner radius.
        wanted.append(Ring(outer=outer, inner=None if i == len(_POURED_FROM) - 1 else inner))
    plan = design_rings(model, wanted, tolerance=0.5, extrapolate=True)
    pattern = simulate_plan(plan, seed=_WANTED_SEED)
    plan_picture(plan, pattern, workshop.own / "pattern.png")
    rows = []
    for pour, (inner, outer) in zip(plan.pours, pattern.rings, strict=True):
        alone = simulate(scene.with_({HEIGHT: pour.height}), seed=_WANTED_SEED + 10).observed()
        first = "any" if pour.wanted_inner is None else f"{_CM * pour.wanted_inner:.2f}"
        rows.append(
            [
                f"{_CM * pour.height:.2f} ({_CM * pour.height_low:.2f} to "
                f"{_CM * pour.height_high:.2f})",
                f"{first} / {_CM * pour.wanted_outer:.2f}",
                " / ".join(f"{_CM * r:.2f}" for r in np.asarray(alone)),
                f"{_CM * inner:.2f} / {_CM * outer:.2f}",
            ]
        )
    return rows, "pattern.png"


def _spills(workshop: Workshop) -> tuple[list, str]:
    scene = Scene.load(_BOWL).with_({"grains.count": workshop.size.grains})
    forecasts = {}
    for name, material in (("couscous", COUSCOUS), ("barley", _BARLEY)):
        workshop.say(f"bowl, {name}: {workshop.size.spills} pours")
        forecasts[name] = design_spill(
            scene.with_(material),
            heights=_SPILL_HEIGHTS,
            grains=(1, 10),
            pours=workshop.size.spills,
            out=workshop.folder / "pours" / f"spill-{name}",
            seed=_SPILL_SEED,
            threads=workshop.threads,
            progress=not workshop.quiet,
        )
        workshop.pours += workshop.size.spills
    figure = new_figure(5.6, 3.4)
    axis = figure.subplots()
    for (name, found), colour in zip(forecasts.items(), (ACCENT, SECOND), strict=True):
        axis.plot(_CM * found.poured_heights, found.spilled, ".", color=colour)
        axis.plot(_CM * found.heights, found.expected, color=colour, label=name)
    axis.set_xlabel("height of the funnel's tip [cm]")
    axis.set_ylabel("spilled grains")
    axis.legend(frameon=False, fontsize=8)
    file = save(figure, workshop.own / "spills.png")
    heights = forecasts["couscous"].heights
    rows = []
    for k in range(0, len(heights), 10):
        cells = [f"{_CM * heights[k]:.1f}"]
        for found in forecasts.values():
            ten = found.grains.index(10)
            cells.append(
                f"{found.expected[k]:.1f}; {found.probability[ten, k]:.2f} "
                f"({found.low[ten, k]:.2f} to {found.high[ten, k]:.2f})"
            )
        rows.append(cells)
    return rows, file


EXPERIMENT = Experiment(
    number=8,
    name="rings",
    title="Rings, and spilled grains",
    section="Robotic Demonstrations",
    asks="From which height does a ring have to be poured, and how many grains does a bowl spill?",
    run=run,
    sets=sets,
)
