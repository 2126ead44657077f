"""What speaks against a verdict without taking it away: said among its doubts."""

from granulcal.loop.check.standing import Standing
from granulcal.loop.test.distance import Improvement
from granulcal.loop.test.thresholds import Thresholds
from granulcal.loop.test.verdict import NAMING, Verdict

__all__ = ["of_error", "of_left", "of_placebo", "of_rows"]


def of_placebo(placebo: Verdict, rules: Thresholds) -> tuple[str, ...]:
    """Returns what an alarm says where there is nothing to be found."""
    if placebo.p >= rules.confirm:
        return ()
    return (
        f"the same analysis of as many pours of the base model at its fit says {placebo.kind} (p = "
        f"{placebo.p:.2g}; {placebo.reason}), where there is nothing to be found: the surrogate is "
        "wrong there by as much, and a verdict has to be far more probable than that",
    )


def of_error(verdict: Verdict, fit: Improvement, sealed: Improvement | None) -> tuple[str, ...]:
    """Returns what is to be said of a name with which the error grows.

    A fit weighs every direction by its scatter, the error by the spread of the archive: the first
    can fall while the second grows.
    """
    if verdict.kind not in NAMING:
        return ()
    grown = [
        f"at the {use} conditions from {error.total_before.square:.3g} to "
        f"{error.total_after.square:.3g}"
        for use, error in (("fitted", fit), ("sealed", sealed))
        if error is not None and error.gain < 0
    ]
    if not grown:
        return ()
    named = ", ".join(verdict.named)
    return (
        f"with {named} the error D² grows, {' and '.join(grown)}: what speaks for the name lies in "
        "directions that scatter little",
    )


def of_left(verdict: Verdict, fit: Improvement, sealed: Improvement | None) -> tuple[str, ...]:
    """Returns where an error is left of a model that is said to explain the pours."""
    if verdict.kind not in (*NAMING, "NONE"):
        return ()
    left = [
        f"{label} ({use}): {after.square:.3g}, 95 % {after.interval[0]:.3g} to "
        f"{after.interval[1]:.3g}"
        for use, error in (("fitted", fit), ("sealed", sealed))
        if error is not None
        for label, after in zip(error.labels, error.after, strict=True)
        if after.interval[0] > 0
    ]
    if not left:
        return ()
    model = f"with {', '.join(verdict.named)}" if verdict.named else "of the base model"
    return (
        f"D² {model} is left at {'; at '.join(left)}. {verdict.kind} says that the residual test "
        "finds nothing more, not that the model is right there",
    )


def of_rows(standing: Standing) -> tuple[str, ...]:
    """Returns which rows without physics are nearer to the sealed conditions than a named model."""
    if standing.verdict.kind not in NAMING:
        return ()
    named = ", ".join(standing.verdict.named)
    return tuple(
        f"at the sealed conditions {row.name} is nearer to the measurement than the model with "
        f"{named}: its D² is less by {-row.gain:.3g} (95 %: {-row.gain_interval[1]:.3g} to "
        f"{-row.gain_interval[0]:.3g})"
        for row in standing.trivial
        if row.is_nearer
    )
