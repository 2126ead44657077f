"""Experiment 3: what errors of the depth image do to the inferred sliding friction.

Three models see the same disturbed images of evenly spaced frictions: one trained on undisturbed
images as in the paper, one trained on images of every blur and noise, and one trained on images of
the measured sensor. A level breaks a model when the root mean square error exceeds a tenth of the
range of the friction.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granulcal.experiments.paper.common import friction
from granulcal.experiments.paper.common.draw import (
    ACCENT,
    SECOND,
    new_figure,
    posterior_image,
    save,
)
from granulcal.experiments.paper.common.experiment import Experiment
from granulcal.experiments.paper.common.measure import bootstrap
from granulcal.experiments.paper.common.outcome import Figure, Outcome, Row, Table
from granulcal.experiments.paper.common.poured_set import PouredSet
from granulcal.experiments.paper.common.sizes import Size
from granulcal.experiments.paper.common.workshop import Pairs, Workshop

__all__ = ["EXPERIMENT"]

Array = NDArray[np.float64]

_BROKEN = 0.1
_GRID = np.linspace(0.01, 1.0, 200)
# A second peak counts from this share of the highest on.
_PEAK = 0.2
_MM = 1e3
_SERIES = {
    "blur": ("blur", friction.BLURS, "px of the down-sampled image"),
    "fine blur": ("blur before down-sampling", friction.BLURS, "px of the full image"),
    "noise": ("depth noise", tuple(_MM * n for n in friction.NOISES), "mm"),
}
_NONE = "clean"


@dataclass(frozen=True, eq=False)
class _Level:
    """Posteriors of all tests at one level.

    Attributes:
        density: on the grid, shape (n, g).
        errors: mean of the posterior less truth, shape (n,).
        several: share of the posteriors that have more than one peak.
        held: share of the truths in their 90 % interval.
    """

    density: Array
    errors: Array
    several: float
    held: float

    @property
    def rms(self) -> float:
        return float(np.sqrt(np.mean(self.errors**2)))


def sets(size: Size) -> list[PouredSet]:
    """Returns the pours of this experiment."""
    return friction.sets(size, "even")


def run(workshop: Workshop) -> Outcome:
    """Trains the three models and looks at every level with each."""
    training = friction.training(workshop)
    tests = friction.even_tests(workshop)
    models = {
        "undisturbed images": workshop.model("clean", friction.view(training, _NONE)),
        "disturbed images": workshop.model("mixed", friction.view(training, "mixed")),
        "images of the sensor": workshop.model("d435", friction.view(training, "d435")),
    }
    views = dict.fromkeys(name.rpartition("/")[0] for name in tests.names)
    levels = {
        (label, view): _level(model, friction.view(tests, view))
        for label, model in models.items()
        for view in views
    }
    clean, mixed, sensor = models
    rows = []
    for key, (what, values, unit) in _SERIES.items():
        for label, paper in (
            (clean, "blur > 4 px" if "blur" in key else "none up to 4 mm"),
            (mixed, ""),
        ):
            rows.append(
                _breakdown(
                    f"{what} that breaks a model of {label} [{unit}]",
                    paper,
                    key,
                    values,
                    {v: levels[label, v] for v in views},
                )
            )
    for label in (clean, mixed, sensor):
        rows.append(_sensor_row(label, levels[label, "d435"]))
    title = (
        "Root mean square error of the sliding friction; share of posteriors with several peaks; "
    )
    return Outcome(
        rows=rows,
        answer=_answer(rows),
        tables=[
            Table(
                title=title + "share of truths in the 90 % interval",
                columns=["image", *models],
                rows=[
                    [view]
                    + [
                        f"{levels[label, view].rms:.3f}; {levels[label, view].several:.0%}; "
                        f"{levels[label, view].held:.0%}"
                        for label in models
                    ]
                    for view in views
                ],
            )
        ],
        figures=[
            Figure(
                file=_posteriors(workshop, tests, {v: levels[clean, v] for v in views}, "clean"),
                caption="Posteriors over the true sliding friction of a model of undisturbed "
                "images: brightest at the peak, truth in red. As in the paper's figure.",
            ),
            Figure(
                file=_posteriors(workshop, tests, {v: levels[mixed, v] for v in views}, "mixed"),
                caption="The same images and a model that was trained on disturbed ones.",
            ),
            Figure(file=_curves(workshop, levels, models), caption="Error against the level."),
        ],
        notes=[
            "The paper does not say whether its blur acts before or after it keeps every 20th "
            "pixel; both are here. A pixel of the full image is "
            f"{_MM * _width(workshop, 1):.2f} mm wide on the ground, one of the down-sampled image "
            f"{_MM * _width(workshop):.1f} mm.",
            "Grains are told from the ground by colour, as on velvet, so that noise moves depths "
            "and not the mask.",
            "The sensor is a RealSense D435 as `granulcal reproduce sensor` fits it to boards at "
            "0.4 to 0.7 m.",
            f"Not usable were, of the training pours: {training.unusable}; of the tests: "
            f"{tests.unusable}.",
        ],
    )


def _level(model, tests: Pairs) -> _Level:
    density, errors, several, held = [], [], 0, 0
    for truth, x in zip(tests.theta, tests.x, strict=True):
        posterior = model.posterior(x)
        p = np.exp(posterior.log_prob(_GRID[:, None]))
        density.append(p)
        errors.append(posterior.mean()[0] - truth[0])
        low, high = posterior.credible_region(0.9).intervals[0]
        held += int(low <= truth[0] <= high)
        several += int(_peaks(p) > 1)
    count = len(errors)
    return _Level(np.array(density), np.array(errors), several / count, held / count)


def _peaks(p: Array) -> int:
    """Peaks that rise by a fifth of the highest above the valleys beside them."""
    found, top, valley = 0, 0.0, 0.0
    is_rising = True
    for value in np.append(p, 0.0):
        if is_rising:
            top = max(top, value)
            if top - value >= _PEAK * p.max():
                found, is_rising, valley = found + 1, False, value
        else:
            valley = min(valley, value)
            if value - valley >= _PEAK * p.max():
                is_rising, top = True, value
    return found


def _breakdown(quantity, paper, key, values, levels: dict[str, _Level]) -> Row:
    names = [_NONE, *(f"{key} {v:g}" for v in values)]
    errors = [levels[name] for name in names]
    broken = [v for v, level in zip((0.0, *values), errors, strict=True) if level.rms > _BROKEN]
    low, high = bootstrap(errors[-1].errors, "rms")
    return Row(
        quantity=quantity,
        paper=paper,
        ours=f"from {broken[0]:g}" if broken else f"none up to {values[-1]:g}",
        interval=f"rms at {values[-1]:g}: {errors[-1].rms:.3f} ({low:.3f} to {high:.3f})",
        count=len(errors[0].errors),
    )


def _sensor_row(label: str, level: _Level) -> Row:
    low, high = bootstrap(level.errors, "rms")
    return Row(
        quantity=f"error under the sensor of a model of {label}",
        ours=f"{level.errors.mean():.4f} ± {level.errors.std(ddof=1):.4f}",
        interval=f"rms {level.rms:.4f} ({low:.4f} to {high:.4f})",
        count=len(level.errors),
    )


def _answer(rows: list[Row]) -> str:
    return (
        f"Blur breaks a model of undisturbed images {rows[0].ours} px and one of disturbed images "
        f"{rows[1].ours} px; depth noise {rows[4].ours} mm and {rows[5].ours} mm."
    )


def _width(workshop: Workshop, downsample: int | None = None) -> float:
    scene = workshop.size.scene()
    step = scene.get("camera.downsample") if downsample is None else downsample
    return scene.get("camera.field_width") / scene.get("camera.pixels") * step


def _posteriors(workshop: Workshop, tests: Pairs, levels: dict[str, _Level], name: str) -> str:
    figure = new_figure(9.5, 5.6)
    axes = figure.subplots(len(_SERIES), 5, sharex=True, sharey=True)
    for i, (key, (_, values, unit)) in enumerate(_SERIES.items()):
        short = "mm" if unit == "mm" else "px"
        for j, value in enumerate((0.0, *values)):
            level = levels[_NONE if value == 0 else f"{key} {value:g}"]
            title = f"{key} {value:g} {short}"
            truth = tests.theta[:, 0]
            posterior_image(axes[i, j], truth, _GRID, level.density, title, is_left=j == 0)
    return save(figure, workshop.own / f"posteriors-{name}.png")


def _curves(workshop: Workshop, levels: dict, models: dict) -> str:
    figure = new_figure(8.4, 2.9)
    axes = figure.subplots(1, len(_SERIES), sharey=True)
    for axis, (key, (what, values, unit)) in zip(axes, _SERIES.items(), strict=True):
        for (label, _), colour in zip(list(models.items())[:2], (ACCENT, SECOND), strict=True):
            rms = [levels[label, _NONE if v == 0 else f"{key} {v:g}"].rms for v in (0.0, *values)]
            axis.plot((0.0, *values), rms, "o-", color=colour, label=f"model of {label}")
        axis.axhline(_BROKEN, color="0.6", lw=0.8, ls="--")
        axis.set_xlabel(f"{what}\n[{unit}]", fontsize=8)
    axes[0].set_ylabel("rms error of the sliding friction", fontsize=8)
    axes[0].legend(fontsize=7, frameon=False)
    return save(figure, workshop.own / "levels.png")


EXPERIMENT = Experiment(
    number=3,
    name="observation-error",
    title="Sensitivity to errors of observation",
    section="Sensitivity to Observation Error",
    asks="Which blur and which depth noise break the inference, and does training on such images "
    "move that?",
    run=run,
    sets=sets,
)
