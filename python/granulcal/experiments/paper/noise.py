"""Experiment 1: how much pours of one material differ.

The paper runs its simulator 500 times at sliding friction 0.01 and 500 times at 1 and finds that
the variance of each statistic is at least two orders of magnitude below its mean. A variance and a
mean have different units, so that their ratio hangs on the unit of length; it is given here in
metres, as the paper's axes are, beside the coefficient of variation, which has no unit.
"""

import numpy as np

from granulcal.experiments.paper.common.draw import ACCENT, SECOND, new_figure, save
from granulcal.experiments.paper.common.experiment import Experiment
from granulcal.experiments.paper.common.outcome import Figure, Outcome, Row, Table
from granulcal.experiments.paper.common.poured_set import PouredSet
from granulcal.experiments.paper.common.sizes import Size
from granulcal.experiments.paper.common.workshop import Workshop
from granulcal.pours.statistics import NAMES, UNITS
from granulcal.prior import Parameter, Prior

__all__ = ["EXPERIMENT"]

_SEED = 101
_FRICTIONS = (0.01, 1.0)
# "At least two orders of magnitude smaller".
_BAR = 1e-2


def sets(size: Size) -> list[PouredSet]:
    """Returns the pours of this experiment."""
    return [PouredSet("noise", len(_FRICTIONS) * size.repeats, size.scene())]


def run(workshop: Workshop) -> Outcome:
    """Pours both materials and compares variances with means."""
    size = workshop.size
    prior = Prior(
        [Parameter(path="material.sliding_friction", distribution="uniform", low=0.0, high=1.0)]
    )
    theta = np.repeat(_FRICTIONS, size.repeats)[:, None]
    x = workshop.poured("noise", size.scene(), prior, theta, seed=_SEED)
    groups = [x[theta[:, 0] == friction] for friction in _FRICTIONS]
    groups = [group[np.isfinite(group).all(axis=1)] for group in groups]
    means = np.array([group.mean(axis=0) for group in groups])
    variances = np.array([group.var(axis=0, ddof=1) for group in groups])
    ratio = variances / np.abs(means)
    variation = np.sqrt(variances) / np.abs(means)
    rows, worst = [], []
    for i, friction in enumerate(_FRICTIONS):
        k = int(ratio[i].argmax())
        low, high = _ratio_interval(groups[i][:, k])
        worst.append(NAMES[k])
        rows.append(
            Row(
                quantity=f"variance over mean, largest of 16, sliding friction {friction:g}",
                paper="at most 0.01 (n = 500)",
                ours=f"{ratio[i, k]:.2g} ({NAMES[k]})",
                interval=f"{low:.2g} to {high:.2g}",
                count=len(groups[i]),
                verdict=_verdict(low, high, size),
            )
        )
    return Outcome(
        rows=rows,
        answer=f"{int((ratio < _BAR).all(axis=0).sum())} of the 16 statistics have a variance two "
        f"orders below their mean at both frictions; the largest ratios are those of "
        f"{' and '.join(dict.fromkeys(worst))}.",
        tables=[
            Table(
                title="Each statistic: variance over mean, and standard deviation over mean",
                columns=["statistic", "unit"]
                + [f"{what}, {f:g}" for f in _FRICTIONS for what in ("var/mean", "sd/mean")],
                rows=[
                    [name, UNITS[name]]
                    + [
                        f"{value:.2g}"
                        for i in range(len(_FRICTIONS))
                        for value in (ratio[i, k], variation[i, k])
                    ]
                    for k, name in enumerate(NAMES)
                ],
            )
        ],
        figures=[Figure(file=_picture(workshop, variation), caption=_CAPTION)],
        notes=[
            "Pours differ here by the seed of the grains' first places (0.1 mm of jitter), not by "
            "the arithmetic: one seed gives one result, bit for bit, on any number of threads.",
            f"{len(theta) - sum(map(len, groups))} of {len(theta)} pours were not usable "
            "(jammed, unhealthy, or too few grains in view).",
        ],
    )


_CAPTION = (
    "Standard deviation over mean of each statistic between pours of one material, at both ends of "
    "the sliding friction."
)


def _ratio_interval(values: np.ndarray) -> tuple[float, float]:
    """95 % interval of variance over mean, by resampling the pours."""
    rows = np.random.default_rng(0).integers(len(values), size=(2000, len(values)))
    drawn = values[rows]
    low, high = np.quantile(drawn.var(axis=1, ddof=1) / np.abs(drawn.mean(axis=1)), (0.025, 0.975))
    return float(low), float(high)


def _verdict(low: float, high: float, size: Size) -> str:
    if size.verdict:
        return size.verdict
    return "better" if high < _BAR else "worse" if low > _BAR else "not decided"


def _picture(workshop: Workshop, variation: np.ndarray) -> str:
    figure = new_figure(7.5, 3.4)
    axis = figure.subplots()
    places = np.arange(len(NAMES))
    for i, (friction, colour) in enumerate(zip(_FRICTIONS, (ACCENT, SECOND), strict=True)):
        shift = 0.4 * i - 0.2
        label = f"sliding friction {friction:g}"
        axis.bar(places + shift, variation[i], 0.4, color=colour, label=label)
    axis.set_yscale("log")
    axis.set_xticks(places, NAMES, rotation=60, ha="right", fontsize=8)
    axis.set_ylabel("sd / mean")
    axis.legend(fontsize=8, frameon=False)
    return save(figure, workshop.own / "noise.png")


EXPERIMENT = Experiment(
    number=1,
    name="noise",
    title="Noise of the system",
    section="Preliminary Tests for System Noise",
    asks="How much do the 16 statistics differ between pours of one material?",
    run=run,
    sets=sets,
)
