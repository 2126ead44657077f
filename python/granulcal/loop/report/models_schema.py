"""What `models.json` of a closed loop must be, checked before anything of it is used."""

from pathlib import Path
from typing import Any

from granulcal.documents import (
    ListOf,
    Mapping,
    Maybe,
    Number,
    OneOf,
    Schema,
    Table,
    Text,
    Whole,
    check,
)
from granulcal.errors import ObservationError

__all__ = ["check_models"]

_NUMBERS = ListOf(Number())
_ROWS = ListOf(_NUMBERS, least=1)
_POSITIVE = Number(1e-300)
_MAKER = Table(
    {"numbers": Mapping(Number()), "shifts": Mapping(Number()), "faults": Mapping(Number())}
)
_TRANSFORM = Table(
    {
        "kind": Text(("identity", "log", "reciprocal", "asinh")),
        "centre": Number(),
        "width": _POSITIVE,
        "shift": Number(),
        "spread": _POSITIVE,
    }
)
_CORRECTION = Table(
    {"conditions": ListOf(_NUMBERS), "variances": _NUMBERS, "weights": _NUMBERS, "precision": _ROWS}
)
# The fit, and at least one draw of it.
_MAKERS = ListOf(_MAKER, least=2)
_SCHEMA: Schema = Table(
    {
        "scene": Text(),
        "verdict": Table({"kind": Text(), "named": ListOf(Text())}),
        "paths": ListOf(Text()),
        "inputs": ListOf(ListOf(OneOf((Text(), Number())), least=3)),
        "names": ListOf(Text(), least=1),
        "makers": Table({"base": _MAKERS, "named": _MAKERS}),
        "columns": ListOf(Whole(0, 1_000_000)),
        "transforms": ListOf(_TRANSFORM),
        "correction": Maybe(_CORRECTION),
        "known": ListOf(_NUMBERS, least=1),
        "means": _ROWS,
        "scatter": ListOf(ListOf(Number(0)), least=1),
        "pours": ListOf(Number(1), least=1),
        "coarse": Maybe(Table({"numbers": Mapping(Number()), "held": Number(high=0)})),
    },
    {
        "law": Whole(0, 2**32 - 1),
        "engine": Maybe(Text()),
        "shared": Mapping(Number()),
        "strengths": Mapping(Number()),
    },
)


def check_models(document: Any, where: Path) -> None:
    """Checks the document, and that the sizes of its tables fit each other.

    Raises:
        ObservationError: names the file, the place, what was found and what is allowed.
    """
    check(document, _SCHEMA, where, error=ObservationError)
    for i, row in enumerate(document["inputs"]):
        path, *ends = row
        numbers = [end for end in ends if not isinstance(end, str)]
        if not isinstance(path, str) or len(numbers) != 2 or not numbers[0] < numbers[1]:
            raise ObservationError(f"{where}: inputs[{i}] must be a path, a low and a high number")
    fitted, inputs = len(document["known"]), len(document["inputs"])
    statistics, columns = len(document["names"]), len(document["columns"])
    sizes = {
        "known": (document["known"], (fitted, inputs)),
        "means": (document["means"], (fitted, statistics)),
        "scatter": (document["scatter"], (fitted, statistics)),
        "pours": (document["pours"], (fitted,)),
        "transforms": (document["transforms"], (columns,)),
    }
    if (correction := document["correction"]) is not None:
        tested = len(correction["conditions"])
        whole = tested * columns
        sizes |= {
            "correction.conditions": (correction["conditions"], (tested, inputs)),
            "correction.variances": (correction["variances"], (columns,)),
            "correction.weights": (correction["weights"], (whole,)),
            "correction.precision": (correction["precision"], (whole, whole)),
        }
        if not tested:
            raise ObservationError(f"{where}: correction.conditions must be at least one, got none")
    for name, (rows, wanted) in sizes.items():
        found = (len(rows), *sorted({len(row) for row in rows} if len(wanted) == 2 else ()))
        if found != wanted and not (wanted[0] == 0 == found[0]):
            raise ObservationError(f"{where}: {name} must have the shape {wanted}, got {found}")
    if any(column >= statistics for column in document["columns"]):
        raise ObservationError(f"{where}: columns must be below {statistics}, the number of names")
