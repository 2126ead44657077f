"""From wanted rings to the heights to pour from."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from granulcal.design.plan import Plan, PlannedPour
from granulcal.design.reach import Expected, Reach
from granulcal.design.ring import Ring
from granulcal.design.ring_model import HEIGHT, RingModel
from granulcal.errors import ExtrapolationError, UnreachableRingError

__all__ = ["design_rings", "require_tolerance"]

Array = NDArray[np.float64]

# Pours of the height at an end of the range that are wider or narrower are still pours of it.
_NOISE_SPREADS = 2.0
# By so much farther in the squared distance, in standard deviations between pours, the posterior's
# mean lies between heights that give the ring.
_BETWEEN = 4.0
# Half width of a central 90 % interval of a normal in standard deviations.
_HALF_90 = 1.645
_FAILED = (
    "the model of the heights fails its own check on pours that were left out of it: heights and "
    "intervals may be wrong; pour more (`--pours`)"
)


def design_rings(
    model: RingModel,
    rings: Sequence[Ring],
    *,
    tolerance: float = 0.1,
    extrapolate: bool = False,
) -> Plan:
    """Returns the plan that pours these rings about one axis.

    Args:
        model: trained with the material of the grains.
        rings: what is wanted, in any order.
        tolerance: how far a radius may be from the wanted one, over the wanted outer radius [-].
        extrapolate: go beyond the heights of the training along the tangent, flagged, in place of
            refusing.

    Raises:
        ValueError: no ring, or a tolerance that is not positive.
        ExtrapolationError: a ring that is wider or narrower than any training height gives.
        UnreachableRingError: radii that no height gives together; the message says which come
            closest.

    Examples:
        >>> import granulcal as gc
        >>> scene = gc.Scene.funnel(count=100, preset="fast")
        >>> model = gc.RingModel.train(scene, heights=(0.05, 0.13), pours=60, progress=False)
        >>> wanted = model.reach.at(0.1).radii[1]
        >>> 0.08 < gc.design_rings(model, [gc.Ring(outer=wanted)]).pours[0].height < 0.12
        True
    """
    if not rings:
        raise ValueError("design_rings needs at least one ring, got none")
    require_tolerance(tolerance)
    reach = model.reach
    pours, notes = [], [_FAILED] if model.fails_its_check else []
    refused: list[ExtrapolationError | UnreachableRingError] = []
    for order, ring in enumerate(sorted(rings, key=lambda r: -r.outer), start=1):
        try:
            pour, told = _planned_with(model, ring, order, tolerance, extrapolate)
        except (ExtrapolationError, UnreachableRingError) as error:
            refused.append(error)
            continue
        pours.append(pour)
        notes += told
    _refuse(refused, len(pours))
    return Plan(
        pours=tuple(pours),
        trained_low=reach.low,
        trained_high=reach.high,
        pour_count=model.pour_count,
        scene_toml=model.scene.to_toml(),
        notes=tuple(notes),
    )


def _planned_with(
    model: RingModel, ring: Ring, order: int, tolerance: float, extrapolate: bool
) -> tuple[PlannedPour, list[str]]:
    """The pour of one ring, and what must be known of it."""
    reach = model.reach
    if _is_outside(reach, ring):
        pour = _extrapolated(reach, ring, order, extrapolate)
        return pour, [
            f"pour {order} is extrapolated: {100 * pour.height:.1f} cm is outside the heights "
            f"of the training, {_centimetres(reach.low, reach.high)}, where the trend gives "
            f"{100 * pour.expected_inner:.2f} / {100 * pour.expected_outer:.2f} cm; its "
            "interval leaves out that the trend may not go on"
        ]
    pour, is_of_two = _inferred(model, ring, order, tolerance)
    told = (
        f"pour {order}: more than one height gives this ring, of which "
        f"{100 * pour.height:.1f} cm comes nearest; its interval holds the others, too"
    )
    return pour, [told] * is_of_two


def _refuse(refused: Sequence[ExtrapolationError | UnreachableRingError], planned: int) -> None:
    """Tells of every ring that cannot be had, and that the others can.

    Raises:
        ExtrapolationError: the first is of this kind.
        UnreachableRingError: likewise.
    """
    if not refused:
        return
    told = "; ".join(str(error) for error in refused)
    if planned:
        told += f"; without {'it' if len(refused) == 1 else 'them'} there is a plan for the rest"
    raise type(refused[0])(told)


def require_tolerance(tolerance: float) -> None:
    """Refuses a share of the outer radius that is not positive [-].

    Raises:
        ValueError: says what was found.
    """
    if not (np.isfinite(tolerance) and tolerance > 0):
        raise ValueError(f"tolerance must be positive, got {tolerance}")


def _inferred(
    model: RingModel, ring: Ring, order: int, tolerance: float
) -> tuple[PlannedPour, bool]:
    """The pour, and whether it is one of several heights that give the ring."""
    inner = model.reach.inner_with(ring.outer) if ring.inner is None else ring.inner
    posterior = model.bayes.posterior([inner, ring.outer])
    mean = float(np.clip(posterior.mean()[0], model.reach.low, model.reach.high))
    height, is_of_two = _nearest(model.reach, np.array([inner, ring.outer]), mean)
    pour = _planned(model.reach, ring, order, height, posterior.credible_region(0.9)[HEIGHT])
    missed = max(abs(pour.expected_inner - inner), abs(pour.expected_outer - ring.outer))
    if missed > tolerance * ring.outer:
        low, high = model.reach.at(model.reach.low), model.reach.at(model.reach.high)
        raise UnreachableRingError(
            f"no height gives a {ring} to within {tolerance:g} of the outer radius; the nearest, "
            f"{100 * height:.1f} cm, gives {100 * pour.expected_inner:.2f} / "
            f"{100 * pour.expected_outer:.2f} cm; heights of "
            f"{_centimetres(model.reach.low, model.reach.high)} give from "
            f"{100 * low.radii[0]:.2f} / {100 * low.radii[1]:.2f} to "
            f"{100 * high.radii[0]:.2f} / {100 * high.radii[1]:.2f} cm"
        )
    return pour, is_of_two


def _nearest(reach: Reach, wanted: Array, mean: float) -> tuple[float, bool]:
    """The posterior's mean, or the height whose radii come nearest where the mean's do not.

    Radii that two heights give have a posterior of two peaks, and its mean lies between them.
    """

    def distance(expected: Expected) -> float:
        off = wanted - expected.radii
        return float(off @ np.linalg.solve(expected.covariance, off))

    nearest = min(reach.curve(), key=distance)
    if distance(reach.at(mean)) <= distance(nearest) + _BETWEEN:
        return mean, False
    return nearest.height, True


def _extrapolated(reach: Reach, ring: Ring, order: int, allowed: bool) -> PlannedPour:
    from_end = min(
        (reach.low, reach.high), key=lambda h: abs(reach.beside(h).radii[1] - ring.outer)
    )
    end = reach.beside(from_end)
    if ring.inner is None:
        height = end.height + (ring.outer - end.radii[1]) / end.slope[1]
    else:
        radii = np.array([ring.inner, ring.outer])
        height, from_end = reach.beyond(radii), reach.nearer_end(radii)
    outer = sorted(each.radii[1] for each in reach.curve())
    told = (
        f"a {ring} lies outside the training: heights of {_centimetres(reach.low, reach.high)} "
        f"give outer radii of {_centimetres(outer[0], outer[-1])}"
    )
    # Where the radii have turned within the training the tangent goes back into it.
    if not reach.is_beyond(from_end, height):
        raise ExtrapolationError(f"{told}; the trend at its end leads away from it")
    if not allowed:
        raise ExtrapolationError(
            f"{told}; the trend at its end would reach it at {100 * height:.1f} cm: train on "
            "heights that include it, or extrapolate (--extrapolate, extrapolate=True)"
        )
    if not height > 0:
        raise ExtrapolationError(f"{told}; the trend at its end reaches it at no height")
    half = _HALF_90 * end.floor
    return _planned(reach, ring, order, height, (height - half, height + half), outside=True)


def _planned(
    reach: Reach,
    ring: Ring,
    order: int,
    height: float,
    interval: tuple[float, float],
    *,
    outside: bool = False,
) -> PlannedPour:
    expected = reach.at(height)
    spread = np.sqrt(np.diag(expected.covariance))
    return PlannedPour(
        order=order,
        height=height,
        height_low=float(interval[0]),
        height_high=float(interval[1]),
        wanted_inner=ring.inner,
        wanted_outer=ring.outer,
        expected_inner=float(expected.radii[0]),
        expected_outer=float(expected.radii[1]),
        inner_sd=float(spread[0]),
        outer_sd=float(spread[1]),
        is_extrapolated=outside,
    )


def _is_outside(reach: Reach, ring: Ring) -> bool:
    curve = reach.curve()
    ends = [(each.radii[1], each.covariance[1, 1] ** 0.5) for each in curve]
    least = min(radius - _NOISE_SPREADS * spread for radius, spread in ends)
    most = max(radius + _NOISE_SPREADS * spread for radius, spread in ends)
    return not least <= ring.outer <= most


def _centimetres(low: float, high: float) -> str:
    return f"{100 * low:.1f} to {100 * high:.1f} cm"
