"""Experiment 9: which of the 16 statistics are needed.

One model for each subset, from the pours of experiment 5; what is compared is the log density of
the true parameters of the tests and the share of them in the 90 % region. Single statistics, every
pair (in the full version), the statistics of heights alone and of distances alone, random subsets
of a few, a greedy choice, and all less one.
"""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from granulcal.experiments.paper.common import three
from granulcal.experiments.paper.common.draw import SECOND, bars, new_figure, save
from granulcal.experiments.paper.common.experiment import Experiment
from granulcal.experiments.paper.common.measure import bootstrap, share_interval
from granulcal.experiments.paper.common.outcome import Figure, Outcome, Row, Table
from granulcal.experiments.paper.common.poured_set import PouredSet
from granulcal.experiments.paper.common.sizes import Size
from granulcal.experiments.paper.common.workshop import Pairs, Workshop
from granulcal.pours.statistics import NAMES

__all__ = ["EXPERIMENT"]

Array = NDArray[np.float64]
Subset = tuple[str, ...]

_SEED = 901
_OF_Z = ("max_z", "mean_z", "sd_z")
_OF_BOTH = ("dcor_r_z",)
_OF_R = tuple(n for n in NAMES if n not in _OF_Z + _OF_BOTH)
_SIZES = (3, 4, 6, 8)
_RANDOM_EACH = {True: 25, False: 1}
_GREEDY = {True: 8, False: 1}
# A loss of the mean log density below this is none.
_NOTHING = 0.1


class _Scores:
    """Log densities and coverage of every subset that was tried, each made once."""

    def __init__(self, workshop: Workshop) -> None:
        self.workshop = workshop
        self.training, self.tests = three.training_and_tests(workshop, three.VARIANTS[0])
        self.log_density: dict[Subset, Array] = {}
        self.held: dict[Subset, int] = {}

    def __call__(self, subset: Subset) -> float:
        """Returns the mean log density of the truths, own units [nat]."""
        ordered = tuple(n for n in NAMES if n in subset)
        if ordered not in self.log_density:
            name = "subset-" + "".join(f"{NAMES.index(n):x}" for n in ordered)
            model = self.workshop.model(name, self.training.of(ordered), method="emulated")
            tests: Pairs = self.tests.of(ordered)
            posteriors = [model.posterior(x) for x in tests.x]
            pairs = list(zip(posteriors, tests.theta, strict=True))
            self.log_density[ordered] = np.array([p.log_prob(t)[0] for p, t in pairs])
            regions = [bool(p.credible_region(0.9).contains(t)[0]) for p, t in pairs]
            self.held[ordered] = sum(regions)
        return float(self.log_density[ordered].mean())


def sets(size: Size) -> list[PouredSet]:
    """Returns the pours of this experiment."""
    return three.sets(size, three.VARIANTS[0])


def run(workshop: Workshop) -> Outcome:
    """Tries the subsets."""
    score, is_wide = _Scores(workshop), workshop.size.subsets
    everything = NAMES
    groups: dict[str, list[Subset]] = {
        "all 16": [everything],
        "one": [(name,) for name in NAMES],
        "heights alone (3)": [_OF_Z],
        "distances alone (12)": [_OF_R],
        "all less one": [tuple(n for n in NAMES if n != name) for name in NAMES],
    }
    if is_wide:
        groups["two"] = list(combinations(NAMES, 2))
    random = np.random.default_rng(_SEED)
    for size in _SIZES if is_wide else _SIZES[:1]:
        mixed = [_mixed(random, size) for _ in range(_RANDOM_EACH[is_wide])]
        groups[f"{size} that mix r and z"] = mixed
        groups[f"{size} of r alone"] = [
            tuple(random.choice(_OF_R, size, replace=False)) for _ in range(_RANDOM_EACH[is_wide])
        ]
    chosen: list[str] = []
    greedy: list[Subset] = []
    for _ in range(_GREEDY[is_wide]):
        rest = [n for n in NAMES if n not in chosen]
        chosen.append(max(rest, key=lambda n: score((*chosen, n))))
        greedy.append(tuple(chosen))
    groups["greedy"] = greedy
    best = score(everything)
    for name, subsets in groups.items():
        workshop.say(f"{name}: {len(subsets)} subsets")
        for subset in subsets:
            score(subset)
    return _outcome(workshop, score, groups, best, chosen)


def _mixed(random: np.random.Generator, size: int) -> Subset:
    """A random subset with at least one statistic of z and one of r."""
    while True:
        subset = tuple(random.choice(NAMES, size, replace=False))
        if set(subset) & set(_OF_Z) and set(subset) & set(_OF_R):
            return subset


def _outcome(
    workshop: Workshop,
    score: _Scores,
    groups: dict[str, list[Subset]],
    best: float,
    chosen: list[str],
) -> Outcome:
    count = len(score.tests)
    loss = {name: [best - score(s) for s in subsets] for name, subsets in groups.items()}
    rows = []
    for name in ("3 that mix r and z", "3 of r alone", "heights alone (3)", "distances alone (12)"):
        worst = groups[name][int(np.argmax(loss[name]))]
        each = score.log_density[tuple(NAMES)] - score.log_density[_ordered(worst)]
        low, high = bootstrap(each)
        low_share, high_share = share_interval(score.held[_ordered(worst)], count)
        rows.append(
            Row(
                quantity=f"loss of log density against all 16 [nat], worst subset of: {name}",
                paper="sufficient" if "mix" in name else "not sufficient",
                ours=f"{max(loss[name]):.2f} ({', '.join(_ordered(worst))})"
                if len(worst) <= 4
                else f"{max(loss[name]):.2f}",
                interval=f"{low:.2f} to {high:.2f}; truths in the 90 % region "
                f"{score.held[_ordered(worst)] / count:.0%} ({low_share:.0%} to {high_share:.0%})",
                count=count,
            )
        )
    without = dict(zip(NAMES, loss["all less one"], strict=True))
    needless = [name for name, value in without.items() if value < _NOTHING]
    return Outcome(
        rows=rows,
        answer=f"The greedy choice is {', '.join(chosen)}: with {len(chosen)} statistics it is "
        f"within {best - score(tuple(chosen)):.2f} nat of all 16 on {count} tests. "
        f"{len(needless)} of the 16 can each be left out alone at a loss below {_NOTHING} nat.",
        tables=[
            Table(
                title="Loss of mean log density against all 16 [nat]; truths in the 90 % region",
                columns=["subsets", "tried", "least loss", "median", "largest", "held, mean"],
                rows=[
                    [
                        name,
                        str(len(subsets)),
                        f"{min(loss[name]):.2f}",
                        f"{np.median(loss[name]):.2f}",
                        f"{max(loss[name]):.2f}",
                        f"{np.mean([score.held[_ordered(s)] for s in subsets]) / count:.0%}",
                    ]
                    for name, subsets in groups.items()
                ],
            ),
            Table(
                title="The greedy choice",
                columns=["statistics", "added", "loss [nat]", "truths in the 90 % region"],
                rows=[
                    [
                        str(len(s)),
                        s[-1],
                        f"{best - score(s):.2f}",
                        f"{score.held[_ordered(s)] / count:.0%}",
                    ]
                    for s in groups["greedy"]
                ],
            ),
        ],
        figures=[
            Figure(
                file=_picture(workshop, loss),
                caption="Loss of log density with one statistic alone, and with all but one.",
            )
        ],
        notes=[
            'Models of this comparison are the emulator\'s alone (`method="emulated"`), so that '
            "hundreds of them are affordable; the pours are those of experiment 5.",
            "The tests that a subset is chosen by, as the greedy choice and the worst of a group, "
            "are those that its loss is told of: on others the chosen lose more, the worst less.",
            "The paper reports a preliminary study in a sentence and no numbers: subsets suffice "
            "unless they have fewer than three statistics or are of r or z alone.",
        ],
    )


def _ordered(subset: Subset) -> Subset:
    return tuple(n for n in NAMES if n in subset)


def _picture(workshop: Workshop, loss: dict[str, list[float]]) -> str:
    figure = new_figure(8.4, 3.6)
    left, right = figure.subplots(1, 2)
    bars(left, NAMES, np.array(loss["one"]), "loss with this one alone [nat]")
    bars(right, NAMES, np.array(loss["all less one"]), "loss without this one [nat]")
    right.axvline(0, color="0.5", lw=0.6)
    left.patches[int(np.argmin(loss["one"]))].set_color(SECOND)
    right.patches[int(np.argmax(loss["all less one"]))].set_color(SECOND)
    return save(figure, workshop.own / "ablation.png")


EXPERIMENT = Experiment(
    number=9,
    name="ablation",
    title="Which statistics matter",
    section="Summary Statistic Extraction",
    asks="Which of the 16 statistics are needed for the three parameters?",
    run=run,
    sets=sets,
)
