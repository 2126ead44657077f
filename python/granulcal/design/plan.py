"""A pour plan: which heights to pour from, in which order, and what is expected."""

import csv
import io
import json
from dataclasses import asdict, dataclass, fields
from os import PathLike
from pathlib import Path

from granulcal import _native
from granulcal.design.ring import Ring
from granulcal.documents import Flag, ListOf, Maybe, Number, Table, Text, Whole, read_json
from granulcal.files import write_beside

__all__ = ["CSV", "JSON", "Plan", "PlannedPour"]

CSV, JSON = "plan.csv", "plan.json"
_FORMAT = 1


_LENGTH = Number(0)
_POUR = Table(
    {
        "order": Whole(0),
        "height": _LENGTH,
        "height_low": _LENGTH,
        "height_high": _LENGTH,
        "wanted_inner": Maybe(_LENGTH),
        "wanted_outer": _LENGTH,
        "expected_inner": _LENGTH,
        "expected_outer": _LENGTH,
        "inner_sd": _LENGTH,
        "outer_sd": _LENGTH,
        "is_extrapolated": Flag(),
    }
)
_SCHEMA = Table(
    {
        "format": Whole(),
        "trained": Table({"heights": ListOf(Number(), least=2), "pours": Whole()}),
        "notes": ListOf(Text()),
        "pours": ListOf(_POUR),
        "scene": Text(),
    },
    open=True,
)


@dataclass(frozen=True, kw_only=True)
class PlannedPour:
    """One pour of a plan; lengths in metres.

    Attributes:
        order: 1 is poured first.
        height: of the funnel's tip: the mean of its posterior given the wanted radii.
        height_low: lower end of the central 90 % interval.
        height_high: upper end of it.
        wanted_inner: wanted inner radius, or None where none was asked for.
        wanted_outer: wanted outer radius.
        expected_inner: mean inner radius of pours from this height.
        expected_outer: mean outer radius of them.
        inner_sd: standard deviation of the inner radius between such pours.
        outer_sd: standard deviation of the outer radius between them.
        is_extrapolated: whether the height lies outside those of the training.
    """

    order: int
    height: float
    height_low: float
    height_high: float
    wanted_inner: float | None
    wanted_outer: float
    expected_inner: float
    expected_outer: float
    inner_sd: float
    outer_sd: float
    is_extrapolated: bool

    @property
    def ring(self) -> Ring:
        """What was asked for."""
        return Ring(outer=self.wanted_outer, inner=self.wanted_inner)


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Pours about one axis, the widest first, so that none falls onto the grains of a wider one.

    Attributes:
        pours: in their order.
        trained_low: lowest height of a usable training pour [m].
        trained_high: highest height of one [m].
        pour_count: pours that the model was trained on, the unusable ones too.
        scene_toml: the scene of one pour, with its material.
        notes: what is to be known before it is used.
    """

    pours: tuple[PlannedPour, ...]
    trained_low: float
    trained_high: float
    pour_count: int
    scene_toml: str
    notes: tuple[str, ...] = ()

    @property
    def is_extrapolated(self) -> bool:
        """Whether any pour lies outside the heights of the training."""
        return any(pour.is_extrapolated for pour in self.pours)

    def save(self, folder: str | PathLike[str]) -> None:
        """Writes plan.csv (one row a pour, columns as in `PlannedPour`) and plan.json."""
        rows = [asdict(pour) for pour in self.pours]
        text = io.StringIO()
        writer = csv.DictWriter(text, [f.name for f in fields(PlannedPour)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        write_beside(Path(folder) / CSV, text.getvalue())
        document = {
            "format": _FORMAT,
            "granulcal": _native.__version__,
            "unit": "m",
            "trained": {
                "heights": [self.trained_low, self.trained_high],
                "pours": self.pour_count,
            },
            "notes": list(self.notes),
            "pours": rows,
            "scene": self.scene_toml,
        }
        write_beside(Path(folder) / JSON, json.dumps(document, indent=1) + "\n")

    @classmethod
    def load(cls, path: str | PathLike[str]) -> "Plan":
        """Returns the plan in a folder that `save` wrote to, or in its JSON file.

        Raises:
            FileNotFoundError: there is no such file.
            ValueError: it is no plan, or one of another format.
        """
        file = Path(path) / JSON if Path(path).is_dir() else Path(path)
        try:
            document = read_json(file, _SCHEMA)
        except ValueError as error:
            raise ValueError(f"{error}: it is damaged or not a pour plan") from None
        if document["format"] != _FORMAT:
            raise ValueError(
                f"{file} is a plan of format {document['format']}, this reads {_FORMAT}"
            )
        low, high = document["trained"]["heights"][:2]
        return cls(
            pours=tuple(PlannedPour(**row) for row in document["pours"]),
            trained_low=low,
            trained_high=high,
            pour_count=document["trained"]["pours"],
            scene_toml=document["scene"],
            notes=tuple(document["notes"]),
        )

    def __str__(self) -> str:
        """A table in centimetres, and the notes."""
        lines = [
            f"{'pour':>4}{'height':>9}{'90 % interval':>18}   {'wanted':<16}{'expected':<26}[cm]"
        ]
        for p in self.pours:
            inner = "any" if p.wanted_inner is None else f"{100 * p.wanted_inner:.2f}"
            interval = f"{100 * p.height_low:.2f} to {100 * p.height_high:.2f}"
            lines.append(
                f"{p.order:>4}{100 * p.height:>9.2f}{interval:>18}   "
                f"{inner + ' / ' + f'{100 * p.wanted_outer:.2f}':<16}"
                f"{100 * p.expected_inner:.2f} ± {100 * p.inner_sd:.2f} / "
                f"{100 * p.expected_outer:.2f} ± {100 * p.outer_sd:.2f}"
                + ("   EXTRAPOLATED" if p.is_extrapolated else "")
            )
        lines += [f"note: {note}" for note in self.notes]
        return "\n".join(lines)
