"""Experiment 2: how the error of the sliding friction falls with the number of training pours."""

import numpy as np

from granulcal.experiments.paper.common import friction
from granulcal.experiments.paper.common.draw import ACCENT, new_figure, save
from granulcal.experiments.paper.common.experiment import Experiment
from granulcal.experiments.paper.common.measure import Published, error_row
from granulcal.experiments.paper.common.outcome import Figure, Outcome, Table
from granulcal.experiments.paper.common.poured_set import PouredSet
from granulcal.experiments.paper.common.sizes import Size
from granulcal.experiments.paper.common.workshop import Workshop

__all__ = ["EXPERIMENT"]

# Share of the training pours, and the paper's number for 500 and 1000.
_PAPER = {
    0.5: Published(mean=0.0191, sd=0.0799, count=50),
    1.0: Published(mean=0.0062, sd=0.0018, count=50),
}
_SHARES = (0.125, 0.25, 0.5, 1.0)
_FEWEST = 50


def sets(size: Size) -> list[PouredSet]:
    """Returns the pours of this experiment."""
    return friction.sets(size, "tests")


def run(workshop: Workshop) -> Outcome:
    """Trains on growing parts of one set and infers the same tests with each."""
    size = workshop.size
    training = friction.view(friction.training(workshop), "clean")
    tests = friction.tests(workshop)
    rows, points = [], []
    for share in _SHARES:
        count = round(share * size.training)
        part = training.first(count)
        if len(part) < _FEWEST:
            continue
        model = workshop.model(f"friction-clean-{count}", part)
        posteriors = [model.posterior(x) for x in tests.x]
        errors = np.array([p.mean()[0] for p in posteriors]) - tests.theta[:, 0]
        inside = [
            p.credible_region(0.9).contains(t)[0]
            for p, t in zip(posteriors, tests.theta, strict=True)
        ]
        label = f"error of the sliding friction, {count} training pours"
        rows.append(error_row(label, errors, size, _PAPER.get(share)))
        points.append((count, errors, float(np.mean(inside))))
    last = points[-1]
    return Outcome(
        rows=rows,
        answer=f"From {last[0]} pours the sliding friction is inferred with an error of "
        f"{last[1].mean():.4f} ± {last[1].std(ddof=1):.4f} (mean of the posterior less truth).",
        tables=[
            Table(
                title="Error against the number of training pours",
                columns=["training pours", "rms error", "largest", "90 % regions that hold it"],
                rows=[
                    [
                        str(count),
                        f"{np.sqrt(np.mean(e**2)):.4f}",
                        f"{np.abs(e).max():.4f}",
                        f"{held:.0%}",
                    ]
                    for count, e, held in points
                ],
            )
        ],
        figures=[Figure(file=_picture(workshop, points), caption=_CAPTION)],
        notes=[
            "Rolling friction and restitution are known and fixed at the scene's 0.1 and 0.5; the "
            "paper does not say at which values its own are.",
            f"Not usable were, of the training pours: {training.unusable}; of the tests: "
            f"{tests.unusable}.",
        ],
    )


_CAPTION = (
    "Errors of the tests against the number of training pours; the bar is the root mean square."
)


def _picture(workshop: Workshop, points: list) -> str:
    figure = new_figure(5.2, 3.2)
    axis = figure.subplots()
    for count, errors, _ in points:
        axis.plot(np.full(len(errors), count), errors, ".", color=ACCENT, alpha=0.4)
        rms = np.sqrt(np.mean(errors**2))
        axis.plot([count] * 2, [-rms, rms], color="#d62728", lw=7, alpha=0.3)
    axis.axhline(0, color="0.6", lw=0.6)
    axis.set_xscale("log")
    axis.set_xticks([p[0] for p in points], [str(p[0]) for p in points])
    axis.minorticks_off()
    axis.set_xlabel("training pours")
    axis.set_ylabel("error of the sliding friction")
    return save(figure, workshop.own / "training-size.png")


EXPERIMENT = Experiment(
    number=2,
    name="training-size",
    title="Number of training pours",
    section="Preliminary Tests for System Noise",
    asks="How sharply is the sliding friction inferred from 500 and from 1000 pours?",
    run=run,
    sets=sets,
)
