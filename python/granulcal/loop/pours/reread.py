"""Rows that need no pours of their own: base pours read anew, as an effect would have them."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.effects.library import LibraryEffect
from granulcal.loop.effects.series_faults import reread
from granulcal.loop.pours.measures import Measures
from granulcal.loop.pours.plan import ArchivePlan
from granulcal.loop.pours.rows import Rows

__all__ = ["of_free_effects", "with_tolerances"]

Array = NDArray[np.float64]

# Base pours that are read anew for an effect that needs none of its own.
_COPIES = 400


def of_free_effects(plan: ArchivePlan, base: Rows) -> list[Rows]:
    """Returns base pours read anew, for each effect that needs none of its own.

    With other lengths, for an effect of the camera; as pours of another condition than theirs, for
    one that is stated wrongly.
    """
    measures = Measures.of(plan.scene)
    found = []
    for number, effect in enumerate(plan.library):
        if not _is_read(plan, effect, measures):
            continue
        random = np.random.default_rng(plan.seed + number)
        rows = base.taken(random.permutation(len(base))[:_COPIES])
        strength = random.uniform(-1.0 if effect.is_two_sided else 0.0, 1.0, len(rows))
        rows.psi[:, number] = strength
        if effect.series:
            x = reread(measures.names, rows.x, {effect.series: effect.full * strength})
            rows = replace(rows, x=x)
        elif effect.camera and measures.powers is not None:
            rows.x[:] *= (1.0 + effect.full * strength[:, None]) ** measures.powers
        else:
            column = [path for path, _, _ in plan.conditions].index(effect.path)
            _, low, high = plan.conditions[column]
            rows.condition[:, column] -= effect.full * strength / (high - low)
        inside = np.all((rows.condition >= 0.0) & (rows.condition <= 1.0), axis=1)
        found.append(rows.taken(inside))
    return found


def _is_read(plan: ArchivePlan, effect: LibraryEffect, measures: Measures) -> bool:
    """Whether base pours are read anew for an effect."""
    if effect.shift:
        paths = [path for path, _, _ in plan.conditions]
        return effect.path in paths and not plan.places
    return bool(effect.series) or (effect.camera and measures.powers is not None)


def with_tolerances(plan: ArchivePlan, rows: list[Rows], names: tuple[str, ...]) -> list[Rows]:
    """Returns the rows with a strength for each tolerance, and base pours that are off by it."""
    tolerances = plan.tolerances
    if tolerances is None:
        return rows
    many, own = len(tolerances.directions), len(plan.library)
    found = [each.wider(many) for each in rows]
    column = [path for path, _, _ in plan.conditions].index(tolerances.path)
    _, low, high = plan.conditions[column]
    for number in range(many):
        random = np.random.default_rng([plan.seed, number])
        off = found[0].taken(random.permutation(len(rows[0]))[:_COPIES])
        off.psi[:, own + number] = random.uniform(-1.0, 1.0, len(off))
        at = low + off.condition[:, column] * (high - low)
        off.x[:] += off.psi[:, [own + number]] * tolerances.shift(number, at, names)
        found.append(off)
    return found
