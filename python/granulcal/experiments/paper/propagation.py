"""Experiment 4: how wrong a parameter may be before the formation shows it.

One parameter at a time is moved away from a reference material. Means over several pours at each
value are smoothed by a cubic in the parameter; the answer is the least change, to either side, that
moves the height of the formation or the mean radius by a grain, or its diameter by five per cent.
The interval comes from resampling the pours.
"""

import numpy as np
from numpy.typing import NDArray

from granulcal.experiments.paper.common.draw import ACCENT, SECOND, new_figure, save
from granulcal.experiments.paper.common.experiment import Experiment
from granulcal.experiments.paper.common.outcome import Figure, Outcome, Row
from granulcal.experiments.paper.common.poured_set import PouredSet
from granulcal.experiments.paper.common.sizes import Size
from granulcal.experiments.paper.common.workshop import Workshop
from granulcal.pours.statistics import NAMES
from granulcal.prior import Parameter, Prior

__all__ = ["EXPERIMENT"]

Array = NDArray[np.float64]

_SEED = 401
_SHARE = 0.05
_DEGREE = 3
_RESAMPLES = 400
_HEIGHT, _RADIUS, _WIDEST = "max_z", "mean_r", "max_r"
_ROLLING = "material.rolling_friction"
# The parameters, their ranges, the reference, and the paper's two answers.
_SWEEPS = {
    "material.sliding_friction": ((0.01, 1.0), 0.5, ("± 0.05", "± 0.1")),
    _ROLLING: ((1e-3, 1.0), 0.1, ("± 3", "± 4")),
    "material.restitution": ((0.01, 0.99), 0.5, ("± 0.01", "± 0.05")),
}
_SHORT = {
    "material.sliding_friction": "sliding friction",
    _ROLLING: "ln rolling friction",
    "material.restitution": "restitution",
}


def _set_name(path: str) -> str:
    return f"propagation-{path.rpartition('.')[2]}"


def sets(size: Size) -> list[PouredSet]:
    """Returns the pours of this experiment."""
    count = size.sweep[0] * size.sweep[1]
    return [PouredSet(_set_name(path), count, size.scene()) for path in _SWEEPS]


def run(workshop: Workshop) -> Outcome:
    """Sweeps the three parameters."""
    size = workshop.size
    scene = size.scene().with_({path: middle for path, (_, middle, _) in _SWEEPS.items()})
    diameter = scene.get("grains.diameter")
    rows, curves = [], {}
    for number, (path, (bounds, middle, paper)) in enumerate(_SWEEPS.items()):
        low, high = (float(_warp(path, b)) for b in bounds)
        values = np.linspace(low, high, size.sweep[0])
        kind = "log_uniform" if path == _ROLLING else "uniform"
        prior = Prior([Parameter(path=path, distribution=kind, low=bounds[0], high=bounds[1])])
        theta = np.repeat(_unwarp(path, values), size.sweep[1])[:, None]
        theta = np.clip(theta, *bounds)
        x = workshop.poured(_set_name(path), scene, prior, theta, seed=_SEED + number)
        x = x.reshape(len(values), size.sweep[1], -1)
        curves[path] = values, x
        at, short = float(_warp(path, middle)), _SHORT[path]
        shifts = {
            f"{short} that moves height or mean radius by a grain": (
                (_HEIGHT, lambda y: np.full_like(y, diameter)),
                (_RADIUS, lambda y: np.full_like(y, diameter)),
            ),
            f"{short} that moves the diameter by 5 %": ((_WIDEST, lambda y: _SHARE * y),),
        }
        for (quantity, wanted), theirs in zip(shifts.items(), paper, strict=True):
            rows.append(_row(quantity, theirs, values, x, at, wanted))
    return Outcome(
        rows=rows,
        answer="The least changes that show: " + "; ".join(f"{r.quantity}: {r.ours}" for r in rows),
        figures=[Figure(file=_picture(workshop, curves, diameter), caption=_CAPTION)],
        notes=[
            "A smaller change says that the formation tells more of the parameter; neither is "
            "better by itself, so that nothing is judged.",
            "Reference: sliding friction 0.5, rolling friction 0.1, restitution 0.5. The paper "
            "does not state its own. The diameter is twice the largest distance of a grain from "
            "the axis, which isolated grains decide.",
        ],
    )


_CAPTION = (
    "Means over pours of the height and of the mean radius as one parameter moves; the bands are "
    "one grain about the reference (dashed)."
)


def _warp(path: str, value: Array | float) -> Array:
    return np.log(value) if path == _ROLLING else np.asarray(value, float)


def _unwarp(path: str, value: Array) -> Array:
    return np.exp(value) if path == _ROLLING else value


def _row(quantity: str, paper: str, values: Array, x: Array, at: float, wanted) -> Row:
    shown = [(NAMES.index(name), of) for name, of in wanted]
    best = _least(values, x[:, :, [i for i, _ in shown]], at, [of for _, of in shown])
    generator, seeds = np.random.default_rng(0), x.shape[1]
    drawn = []
    for _ in range(_RESAMPLES):
        rows = generator.integers(seeds, size=(len(values), seeds))
        again = np.take_along_axis(x, rows[:, :, None], axis=1)
        again = again[:, :, [i for i, _ in shown]]
        drawn.append(_least(values, again, at, [of for _, of in shown]))
    # Between two that are infinite there is no number, which is beyond the range as well.
    with np.errstate(invalid="ignore"):
        low, high = np.quantile(drawn, (0.025, 0.975))
    # The nearer end: what is beyond it nobody has poured.
    reach = min(at - values[0], values[-1] - at)
    told = f"more than ± {reach:.2g}" if not np.isfinite(best) else f"± {best:.2g}"
    top = f"{high:.2g}" if np.isfinite(high) else "beyond the range"
    interval = f"{low:.2g} to {top}" if np.isfinite(low) else "beyond the range"
    count = int(np.isfinite(x).all(axis=2).sum())
    return Row(quantity=quantity, paper=paper, ours=told, interval=interval, count=count)


def _least(values: Array, x: Array, at: float, wanted: list) -> float:
    """Least change from `at` at which any curve has moved as far as wanted; infinite if none."""
    fine = np.linspace(values[0], values[-1], 801)
    scaled = 2 * (values - values[0]) / (values[-1] - values[0]) - 1
    found = np.inf
    for k, of in enumerate(wanted):
        each = x[:, :, k]
        kept = np.isfinite(each)
        weight = kept.sum(axis=1)
        is_there = weight > 0
        mean = np.where(kept, each, 0).sum(axis=1)[is_there] / weight[is_there]
        degree = min(_DEGREE, int(is_there.sum()) - 1)
        fit = np.polynomial.Polynomial.fit(
            scaled[is_there], mean, degree, domain=(-1, 1), w=np.sqrt(weight[is_there])
        )
        curve = fit(2 * (fine - values[0]) / (values[-1] - values[0]) - 1)
        middle = np.interp(at, fine, curve)
        moved = np.abs(curve - middle) >= of(np.array(middle))
        if moved.any():
            found = min(found, float(np.abs(fine[moved] - at).min()))
    return found


def _picture(workshop: Workshop, curves: dict, diameter: float) -> str:
    figure = new_figure(9, 3)
    axes = figure.subplots(1, len(curves))
    for axis, (path, (values, x)) in zip(axes, curves.items(), strict=True):
        for name, colour in ((_HEIGHT, ACCENT), (_RADIUS, SECOND)):
            mean = 1e3 * np.nanmean(x[:, :, NAMES.index(name)], axis=1)
            axis.plot(values, mean, "o-", ms=3, color=colour, label=name)
            at = float(_warp(path, _SWEEPS[path][1]))
            middle = float(np.interp(at, values, mean))
            axis.axhspan(
                middle - 1e3 * diameter, middle + 1e3 * diameter, color=colour, alpha=0.12, lw=0
            )
            axis.axvline(at, color="0.6", ls="--", lw=0.7)
        axis.set_xlabel(_SHORT[path], fontsize=8)
        axis.tick_params(labelsize=7)
    axes[0].set_ylabel("[mm]", fontsize=8)
    axes[0].legend(fontsize=7, frameon=False)
    return save(figure, workshop.own / "propagation.png")


EXPERIMENT = Experiment(
    number=4,
    name="propagation",
    title="Propagation of error",
    section="Propagation of Error",
    asks="How wrong may a parameter be before height, mean radius or diameter show it?",
    run=run,
    sets=sets,
)
