"""Experiment 10: the paper's outlook, statistics of a sequence of images while the grains fall.

The same pours are told by their last image alone, as everywhere else, and by five images on the way
together with the last. The images on the way show the grains that have left the funnel; the funnel
itself hides nothing.
"""

import numpy as np
from numpy.typing import NDArray

from granulcal.experiments.paper.common import three
from granulcal.experiments.paper.common.draw import ACCENT, SECOND, new_figure, save
from granulcal.experiments.paper.common.experiment import Experiment
from granulcal.experiments.paper.common.measure import bootstrap, error_row, share_interval
from granulcal.experiments.paper.common.outcome import Figure, Outcome, Row, Table
from granulcal.experiments.paper.common.poured_set import PouredSet
from granulcal.experiments.paper.common.sizes import Size
from granulcal.experiments.paper.common.workshop import Pairs, Workshop
from granulcal.pours.dataset import Dataset
from granulcal.pours.scene import Scene
from granulcal.pours.statistics import NAMES
from granulcal.prior import Prior

__all__ = ["EXPERIMENT"]

Array = NDArray[np.float64]

_TIMES = (0.35, 0.45, 0.6, 0.8, 1.0)
_RATE = 20.0
_SEED = 1001
_NAMES = ("sliding friction", "ln rolling friction", "restitution")
_LAST, _SEQUENCE = "last image", "sequence"


def sets(size: Size) -> list[PouredSet]:
    """Returns the pours of this experiment."""
    return [
        PouredSet("sequence-training", size.sequence, size.scene()),
        PouredSet("sequence-tests", size.tests, size.scene()),
    ]


def run(workshop: Workshop) -> Outcome:
    """Trains a model of the last images and one of the sequences of the same pours."""
    size, prior = workshop.size, Prior.default()
    scene = _filmed(size.scene())
    training = _both(workshop.data("sequence-training", scene, prior, size.sequence, _SEED))
    tests = _tests(workshop, scene, prior)
    truth = tests[_LAST].theta
    errors, spreads, log_density, held = {}, {}, {}, {}
    for kind, pairs in training.items():
        model = workshop.model(f"sequence-{kind.replace(' ', '-')}", pairs)
        posteriors = [model.posterior(x) for x in tests[kind].x]
        estimates = np.array([three.estimate(p) for p in posteriors])
        errors[kind] = three.in_ln(estimates) - three.in_ln(truth)
        spreads[kind] = np.array([three.in_ln(p.sample(2000)).std(axis=0) for p in posteriors])
        log_density[kind] = np.array(
            [p.log_prob(t)[0] for p, t in zip(posteriors, truth, strict=True)]
        )
        held[kind] = sum(
            bool(p.credible_region(0.9).contains(t)[0])
            for p, t in zip(posteriors, truth, strict=True)
        )
    gain = log_density[_SEQUENCE] - log_density[_LAST]
    low, high = bootstrap(gain)
    rows = [
        Row(
            quantity="gain of log density at the truth by the sequence [nat]",
            ours=f"{gain.mean():.2f} ± {gain.std(ddof=1):.2f}",
            interval=f"mean {low:.2f} to {high:.2f}",
            count=len(gain),
        )
    ]
    for kind in training:
        for i, name in enumerate(_NAMES):
            rows.append(error_row(f"error of {name}, {kind}", errors[kind][:, i], size))
        below, above = share_interval(held[kind], len(truth))
        rows.append(
            Row(
                quantity=f"truths in the 90 % region, {kind}",
                ours=f"{held[kind] / len(truth):.0%}",
                interval=f"{below:.0%} to {above:.0%}",
                count=len(truth),
            )
        )
    ratio = spreads[_SEQUENCE].mean(axis=0) / spreads[_LAST].mean(axis=0)
    return Outcome(
        rows=rows,
        answer=f"A sequence of {len(_TIMES)} images and the last raises the log density of the "
        f"truth by {gain.mean():.2f} nat ({low:.2f} to {high:.2f}) over the last image alone; "
        "the posterior's standard deviations become "
        + ", ".join(f"{r:.2f} ({n})" for r, n in zip(ratio, _NAMES, strict=True))
        + " times as large.",
        tables=[
            Table(
                title="Mean standard deviation of the posterior",
                columns=["statistics", *_NAMES],
                rows=[
                    [kind, *(f"{value:.3f}" for value in spreads[kind].mean(axis=0))]
                    for kind in training
                ],
            )
        ],
        figures=[
            Figure(
                file=_picture(workshop, spreads, truth),
                caption="Standard deviation of the posterior of each test, from the last image and "
                "from the sequence; below the line the sequence is sharper.",
            )
        ],
        notes=[
            "Images at " + ", ".join(f"{t:g}" for t in _TIMES) + " s after the grains are let go, "
            "each with the 16 statistics, of grains below the funnel's tip; a pour that has ended "
            "before shows its last image.",
            "No number of the paper: it names this as future work.",
            f"Training pours that were not usable: {training[_LAST].unusable}.",
        ],
    )


def _tests(workshop: Workshop, scene: Scene, prior: Prior) -> dict[str, Pairs]:
    """As many usable tests as were asked for, by their last image and by all images."""
    seen: dict[str, Pairs] = {}

    def pour(count: int) -> Pairs:
        seen.update(_both(workshop.data("sequence-tests", scene, prior, count, _SEED + 1)))
        return seen[_LAST]

    workshop.enough(workshop.size.tests, pour)
    return {kind: pairs.first(workshop.size.tests) for kind, pairs in seen.items()}


def _filmed(scene: Scene) -> Scene:
    times = ", ".join(f"{t:g}" for t in _TIMES)
    return Scene.from_toml(
        f"{scene.to_toml()}\n[observe]\nrate = {_RATE}\n\n[observe.images]\n"
        f"times = [{times}]\nbelow = {scene.get('funnel.height')}\n"
    )


def _both(data: Dataset) -> dict[str, Pairs]:
    """The usable pours, by their last image and by all images."""
    kept = data.is_usable & np.isfinite(data.paper16).all(axis=1)
    unusable, theta = data.left_out, data.theta[kept]
    last = data.paper16[kept]
    everything = np.column_stack([last, data.observed[kept]])
    names = (*NAMES, *data.observed_names)
    return {
        _LAST: Pairs(theta, last, data.prior, NAMES, unusable),
        _SEQUENCE: Pairs(theta, everything, data.prior, names, unusable),
    }


def _picture(workshop: Workshop, spreads: dict[str, Array], truth: Array) -> str:
    figure = new_figure(9, 3.1)
    axes = figure.subplots(1, len(_NAMES))
    for i, (axis, name) in enumerate(zip(axes, _NAMES, strict=True)):
        x, y = spreads[_LAST][:, i], spreads[_SEQUENCE][:, i]
        axis.plot(x, y, "o", ms=3.5, color=ACCENT)
        top = 1.05 * max(x.max(), y.max())
        axis.plot([0, top], [0, top], color=SECOND, lw=0.8)
        axis.set_title(name, fontsize=9)
        axis.set_xlabel("last image", fontsize=8)
        axis.tick_params(labelsize=7)
    axes[0].set_ylabel("sequence", fontsize=8)
    return save(figure, workshop.own / "spreads.png")


EXPERIMENT = Experiment(
    number=10,
    name="sequence",
    title="A sequence of images",
    section="Conclusions",
    asks="How much sharper is the posterior from images on the way than from the last image alone?",
    run=run,
    sets=sets,
)
