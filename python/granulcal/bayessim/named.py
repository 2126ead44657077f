"""Values that carry names, matched by name: statistics, dicts, and series and frames of pandas."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from granulcal.bayessim.arrays import as_real

__all__ = ["by_name", "names_of", "placeholders"]

_MOST_TOLD = 6


def placeholders(count: int) -> tuple[str, ...]:
    """Returns the names of statistics that nobody named."""
    return tuple(f"statistic_{i}" for i in range(count))


def names_of(value: Any) -> tuple[str, ...] | None:
    """Returns the names along the last axis of `value`, or None where it has none.

    They are the columns of a frame, the index of a series, the keys of a dict or of statistics.
    Labels that are not all text, as whole numbers, are no names.
    """
    labels: Any
    if hasattr(value, "columns"):
        labels = value.columns
    elif hasattr(value, "keys"):
        labels = value.keys()
    elif hasattr(value, "to_numpy"):
        labels = getattr(value, "index", ())
    else:
        return None
    # Somebody else's class may have methods of these names.
    found = tuple(labels) if isinstance(labels, Iterable) else ()
    return found if found and all(isinstance(label, str) for label in found) else None


def by_name(
    argument: str,
    value: Any,
    names: Sequence[str],
    *,
    whose: str,
    error: type[ValueError],
    may_have_more: bool = False,
) -> Any:
    """Returns `value` with its last axis in the order of `names`; as it is where it has no names.

    Args:
        argument: what the caller calls it.
        value: numbers with names, a list of such, or plain numbers.
        names: the names wanted, each of them and, unless `may_have_more`, no other.
        whose: owner of the names, for messages.
        error: raised where the names differ.
        may_have_more: whether what has further names is taken, without their values.

    Raises:
        TypeError: no real numbers.
        error: `value` has other names, or one of them twice.
    """
    if isinstance(value, list | tuple) and any(names_of(each) is not None for each in value):
        options: Any = dict(whose=whose, error=error, may_have_more=may_have_more)
        return [by_name(argument, each, names, **options) for each in value]
    found = names_of(value)
    if found is None:
        return value
    numbers = _numbers(argument, value, error)
    is_enough = may_have_more and set(names) <= set(found)
    if set(found) != set(names) and not is_enough:
        # Nobody named the statistics of this model: the order is all there is.
        if tuple(names) == placeholders(len(names)) and not isinstance(value, Mapping):
            return numbers
        lacking = [name for name in names if name not in found]
        unknown = [name for name in found if name not in names]
        told = [f"{argument} lacks {_listed(lacking)}"] if lacking else []
        told += [f"{whose} has no {_listed(unknown)}"] if unknown else []
        raise error(f"{argument} must have the names of {whose}: {'; '.join(told)}")
    if len(set(found)) != len(found):
        twice = sorted({name for name in found if found.count(name) > 1})
        raise error(f"{argument} has {_listed(twice)} more than once")
    return numbers[..., [found.index(name) for name in names]]


def _numbers(argument: str, value: Any, error: type[ValueError]) -> Any:
    if not isinstance(value, Mapping):
        return as_real(argument, value.to_numpy() if hasattr(value, "to_numpy") else value)
    columns = [as_real(f"{argument}[{name!r}]", each) for name, each in value.items()]
    try:
        return np.stack(columns, axis=-1)
    except ValueError:
        raise error(f"{argument} must have as many values of each name") from None


def _listed(names: Sequence[str]) -> str:
    more = len(names) - _MOST_TOLD
    return ", ".join(names[:_MOST_TOLD]) + (f" and {more} more" if more > 0 else "")
