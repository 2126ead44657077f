"""The first question to measured pours: is anything left of the fit without effects?"""

from collections.abc import Sequence
from dataclasses import dataclass

from granulcal.loop.surrogate.baseline import Fit, Start, fit_base
from granulcal.loop.surrogate.linearised import LinearisedSurrogate
from granulcal.loop.surrogate.stacked_means import StackedMeans
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.test.residual_test import ResidualTest, residual_test
from granulcal.loop.test.score import Scores
from granulcal.loop.test.thresholds import Thresholds
from granulcal.one_thread import one_thread

__all__ = ["BaseTest", "base_test"]


@dataclass(frozen=True)
class BaseTest:
    """The fit without effects, and the test of what it leaves.

    Attributes:
        local: the surrogate around the fit.
        fit: without effects.
        scores: of all candidates, beyond the fit.
        test: of the residual.
    """

    local: LinearisedSurrogate
    fit: Fit
    scores: Scores
    test: ResidualTest


@one_thread()
def base_test(
    surrogate: Surrogate,
    stack: StackedMeans,
    rules: Thresholds,
    seed: int = 0,
    starts: Sequence[Start] = (),
) -> BaseTest:
    """Returns what mean pours leave of the model without effects.

    Args:
        surrogate: of the archive.
        stack: the mean pours of all conditions.
        rules: how many replicates the test has.
        seed: of starts and replicates.
        starts: where the fit begins as well.
    """
    local, fit = fit_base(surrogate, stack, seed, starts)
    scores = Scores.of(local, fit, surrogate.design.candidates)
    test = residual_test(
        local, fit, scores, replicates=rules.replicates, refits=rules.refits, seed=seed
    )
    return BaseTest(local, fit, scores, test)
