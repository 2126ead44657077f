"""The archive: every pour that the loop has ever run, as data sets in one folder.

    archive/
      archive.json        scene, prior, conditions, library; written first, refused if another
      base/               pours of the plain model, conditions and parameters from their priors
      effect-NAME/        the same with one effect at a strength from its prior
      images/             further pours of the plain model, whose images are read again under the
                          effects of the image; npz, see `image_rows.py`
      images-NAME/        the same of pours with one effect
      base-at-0/, ...     instead of base/ where pours are at the conditions alone, a part for each

Each other part is a data set of `generate`: it is stopped and continued anywhere and has the same
rows.
"""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from granulcal import _native
from granulcal.cores import cores
from granulcal.documents import ListOf, Number, OneOf, Table, Text, read_json
from granulcal.errors import TrainingDataError
from granulcal.files import write_beside
from granulcal.loop.effects.image_faults import require_image
from granulcal.loop.effects.series_faults import require_series
from granulcal.loop.pours.cube import cube
from granulcal.loop.pours.image_rows import ImageRows
from granulcal.loop.pours.measures import Measures
from granulcal.loop.pours.parts import Part, parts_of
from granulcal.loop.pours.plan import ArchivePlan, Pours
from granulcal.loop.pours.reread import of_free_effects, with_tolerances
from granulcal.loop.pours.rows import Rows
from granulcal.pours.dataset import Dataset, generate
from granulcal.pours.left_out import LeftOut

__all__ = ["Archive", "ArchivePlan", "Pours", "require_same"]

# A list of lists holds a path and two numbers; the rest is compared and not read.
_SCHEMA = Table(
    {"conditions": ListOf(ListOf(OneOf((Text(), Number())), least=3))},
    {"effects": ListOf(Text()), "each_effect": ListOf(Text())},
    open=True,
)

_RECORD = "archive.json"
# What the record says of the library.
_OF_LIBRARY = ("library", "effects", "each_effect")


class Archive:
    """A folder of pours.

    Args:
        folder: where it is, or will be.
        plan: what it is of.
        begin: whether its record is written, where there is none or a shorter one.

    Raises:
        ObservationError: effects of the image for a scene that has none.
        TrainingDataError: the folder holds the archive of something else, or of another version.
    """

    def __init__(self, folder: Path, plan: ArchivePlan, *, begin: bool = True) -> None:
        """Opens or begins it."""
        require_image(plan.scene, (effect.name for effect in plan.library if effect.image))
        require_series(plan.scene, ((e.name, e.series) for e in plan.library if e.series))
        self.folder, self.plan = folder, plan
        path = folder / _RECORD
        mine = plan.record()
        if path.exists():
            try:
                theirs = {"places": [], **read_json(path, _SCHEMA)}
            except ValueError as error:
                raise TrainingDataError(str(error)) from None
            if _covers(theirs.get("conditions"), mine["conditions"]):
                # A wider archive serves as well.
                wider = tuple((p, float(low), float(high)) for p, low, high in theirs["conditions"])
                self.plan = replace(plan, conditions=wider)
                mine = self.plan.record()
            longer = _continued(theirs, mine)
            if longer is mine and begin:
                write_beside(path, json.dumps(mine, indent=1))
            if theirs.get("effects") != mine["effects"] and longer is None:
                _refuse_effects(path, theirs, mine)
            for key, value in mine.items():
                if longer is not None and key in _OF_LIBRARY:
                    continue
                if theirs.get(key) != value:
                    raise TrainingDataError(
                        f"{path} is of another {key}: it has {_short(theirs.get(key))}, this run "
                        f"{_short(value)}; give another folder with --archive"
                    )
            return
        if folder.exists() and any(folder.iterdir()):
            raise TrainingDataError(f"{folder} is not empty and has no {_RECORD}")
        if begin:
            write_beside(path, json.dumps(mine, indent=1))

    def fill(
        self,
        *,
        threads: int | None = None,
        say: Callable[[str], None] = print,
        progress: bool = True,
    ) -> None:
        """Runs every pour that is planned and missing; stops and resumes anywhere."""
        parts = parts_of(self.plan)
        for number, part in enumerate(parts, start=1):
            say(f"archive {number}/{len(parts)}: {part.name}, {part.count} pours")
            generate(
                part.scene,
                part.prior,
                part.count,
                seed=part.seed,
                out=self.folder / part.name,
                threads=threads,
                progress=progress,
            )
        for images in self._image_rows():
            images.fill(threads=threads or cores(), say=say)

    @property
    def missing(self) -> int:
        """Pours that are planned and not there yet."""
        count = sum(images.missing for images in self._image_rows())
        for part in parts_of(self.plan):
            folder = self.folder / part.name
            # A run that was killed at once may have left a folder without a data set.
            is_begun = (folder / _native.MANIFEST).exists()
            there = len(Dataset.load(folder)) if is_begun else 0
            count += max(part.count - there, 0)
        return count

    def pours(self) -> Pours:
        """Returns all usable rows.

        Raises:
            TrainingDataError: a part is missing.
        """
        plan, measures = self.plan, Measures.of(self.plan.scene)
        rows: list[Rows] = []
        left_out = LeftOut()
        for part in parts_of(plan):
            found, unusable = self._rows_of(part, measures)
            rows.append(found)
            left_out += unusable
        # The first parts are the base model's, one for each place.
        many = max(len(plan.places), 1)
        base = Rows.joined(rows[:many])
        rows = [base, *rows[many:], *of_free_effects(plan, base), *self._rows_of_images()]
        whole = Rows.joined(with_tolerances(plan, rows, measures.names))
        return Pours(whole.theta, whole.condition, whole.psi, whole.x, measures.names, left_out)

    def _rows_of(self, part: Part, measures: Measures) -> tuple[Rows, LeftOut]:
        """Returns the usable rows of a part, and what is left out of it."""
        plan, folder = self.plan, self.folder / part.name
        if not folder.exists():
            raise TrainingDataError(f"{folder} is missing: fill the archive first")
        data = Dataset.load(folder)
        x, usable = measures.of_dataset(data)
        usable[part.count :] = False
        left_out = LeftOut.of(data.status[: part.count].tolist(), usable[: part.count].tolist())
        columns = {path: data.theta[usable, i] for i, path in enumerate(data.theta_names)}
        count = int(usable.sum())
        theta = np.column_stack([columns[path] for path in plan.prior.names])
        inputs = [
            np.full(count, part.place[path]) if path in part.place else columns[path]
            for path, _, _ in plan.conditions
        ]
        condition = np.column_stack(inputs) if inputs else np.zeros((count, 0))
        psi = np.zeros((count, len(plan.library)))
        for number, effect in enumerate(plan.library):
            if part.effect == effect.name:
                psi[:, number] = part.strengths(data, usable, effect.at(plan.scene))
        rows = Rows(cube(plan.prior, theta), plan.unit_condition(condition), psi, x[usable])
        return rows, left_out

    def _image_rows(self) -> tuple[ImageRows, ...]:
        """Pours that are read under effects of the image; none where no effect is one."""
        plan = self.plan
        if not plan.images:
            return ()
        of_base = ImageRows(
            folder=self.folder / "images",
            scene=plan.scene,
            prior=plan.prior,
            conditions=plan.conditions,
            places=plan.places,
            effects=tuple(effect for effect in plan.library if effect.image),
            count=plan.images,
            seed=plan.seed,
        )
        of_effects = (
            replace(
                of_base,
                folder=self.folder / f"images-{effect.name}",
                count=plan.images_each,
                poured=effect,
            )
            for effect in plan.library
            if plan.is_crossed(effect)
        )
        return (of_base, *of_effects)

    def _rows_of_images(self) -> list[Rows]:
        """Rows of `images/`, plain ones first, then those of `images-NAME/`."""
        names = [effect.name for effect in self.plan.library]
        rows = []
        for images in self._image_rows():
            found = images.rows()
            if found is None:
                raise TrainingDataError(f"{images.folder} is not whole: fill the archive first")
            for effects, read in found:
                psi = np.zeros((len(read), len(names)))
                psi[:, [names.index(name) for name in effects]] = read.psi
                rows.append(Rows(read.theta, read.condition, psi, read.x))
        return rows


def _continued(theirs: dict[str, Any], mine: dict[str, Any]) -> dict[str, Any] | None:
    """Returns the record with the longer library, if it begins with all of the shorter one's.

    Seeds of an effect's pours go by its place in the library, so the shorter one's pours are those
    of the longer. None if neither begins with the other.
    """
    a, b = theirs.get("each_effect"), mine["each_effect"]
    if a is None or any(theirs.get(k) != v for k, v in mine.items() if k not in _OF_LIBRARY):
        return None
    if b[: len(a)] == a:
        return mine
    return theirs if a[: len(b)] == b else None


def _refuse_effects(path: Path, theirs: dict[str, Any], mine: dict[str, Any]) -> None:
    """Refuses an archive that differs in its effects alone, by their names.

    Raises:
        TrainingDataError: what it has, and what is asked for.
    """
    others = (k for k in mine if k not in _OF_LIBRARY)
    if "effects" not in theirs or any(theirs.get(k) != mine[k] for k in others):
        return
    has, asked = (", ".join(one["effects"]) or "none" for one in (theirs, mine))
    raise TrainingDataError(
        f"{path} is of other effects: it has {has}; this run asks for {asked}. The shorter list "
        "must begin the longer, in order and with the same numbers: give another folder with "
        "--archive"
    )


def require_same(folder: Path, plan: ArchivePlan) -> None:
    """Refuses a folder whose archive is of something else, and writes nothing.

    Raises:
        TrainingDataError: as `Archive`.
    """
    if folder.exists() and any(folder.iterdir()):
        Archive(folder, plan, begin=False)


def _covers(theirs: Any, mine: Any) -> bool:
    """Whether an archive over the ranges `theirs` holds every condition within `mine`."""
    if not isinstance(theirs, list) or [t[0] for t in theirs] != [m[0] for m in mine]:
        return False
    pairs = zip(theirs, mine, strict=True)
    return all(low <= m_low and m_high <= high for (_, low, high), (_, m_low, m_high) in pairs)


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) < 80 else text[:77] + "..."
