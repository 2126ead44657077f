"""The archive: every pour that the loop has ever run, as data sets in one folder.

    archive/
      archive.json        scene, prior, conditions, library; written first, refused if another
      base/               pours of the plain model, conditions and parameters from their priors
      effect-NAME/        the same with one effect at a strength from its prior
      images/             further pours of the plain model, whose images are read again under each
                          effect of the image; npz, see `image_rows.py`
      base-at-0/, ...     instead of base/ where pours are at the conditions alone, a part for each

Each other part is a data set of `generate`: it is stopped and continued anywhere and has the same
rows.
"""

import json
import os
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal.documents import ListOf, Number, OneOf, Table, Text, read_json
from granulcal.errors import TrainingDataError
from granulcal.files import write_beside
from granulcal.loop.effects.image_faults import require_image
from granulcal.loop.effects.series_faults import require_series, reread
from granulcal.loop.pours.cube import cube
from granulcal.loop.pours.image_rows import ImageRows
from granulcal.loop.pours.measures import Measures
from granulcal.loop.pours.plan import ArchivePlan, Pours
from granulcal.pours.dataset import Dataset, generate
from granulcal.pours.left_out import LeftOut
from granulcal.pours.scene import Scene
from granulcal.prior import Parameter, Prior

__all__ = ["Archive", "ArchivePlan", "Pours"]

Array = NDArray[np.float64]

# A list of lists holds a path and two numbers; the rest is compared and not read.
_SCHEMA = Table(
    {"conditions": ListOf(ListOf(OneOf((Text(), Number())), least=3))},
    {"effects": ListOf(Text()), "each_effect": ListOf(Text())},
    open=True,
)

_RECORD = "archive.json"
# What the record says of the library.
_OF_LIBRARY = ("library", "effects", "each_effect")
# Strengths at which an effect of a whole number is tried.
_WHOLE_STRENGTHS = (0.25, 0.5, 0.75, 1.0)
# Seeds of the parts, so that no two share a pour.
_SEED_STEP, _PLACE_STEP = 1009, 101
# Base pours that are read anew for an effect that needs none of its own.
_FREE_COPIES = 400


class Archive:
    """A folder of pours.

    Args:
        folder: where it is, or will be.
        plan: what it is of.

    Raises:
        ObservationError: effects of the image for a scene that has none.
        TrainingDataError: the folder holds the archive of something else, or of another version.
    """

    def __init__(self, folder: Path, plan: ArchivePlan) -> None:
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
            if longer is mine:
                write_beside(path, json.dumps(mine, indent=1))
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
        write_beside(path, json.dumps(mine, indent=1))

    def fill(
        self,
        *,
        threads: int | None = None,
        say: Callable[[str], None] = print,
        progress: bool = True,
    ) -> None:
        """Runs every pour that is planned and missing; stops and resumes anywhere."""
        parts = self._parts()
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
        if self.plan.images:
            self._image_rows().fill(threads=threads or os.cpu_count() or 1, say=say)

    @property
    def missing(self) -> int:
        """Pours that are planned and not there yet; those with images count as missing."""
        count = self.plan.images
        for part in self._parts():
            folder = self.folder / part.name
            there = len(Dataset.load(folder)) if folder.exists() else 0
            count += max(part.count - there, 0)
        return count

    def pours(self) -> Pours:
        """Returns all usable rows.

        Raises:
            TrainingDataError: a part is missing.
        """
        plan, measures = self.plan, Measures.of(self.plan.scene)
        rows: list[tuple[Array, Array, Array, Array]] = []
        left_out = LeftOut()
        for part in self._parts():
            scene, count, folder = part.scene, part.count, self.folder / part.name
            if not folder.exists():
                raise TrainingDataError(f"{folder} is missing: fill the archive first")
            data = Dataset.load(folder)
            values, usable = measures.of_dataset(data)
            usable[count:] = False
            left_out += LeftOut.of(data.status[:count].tolist(), usable[:count].tolist())
            columns = {path: data.theta[usable, i] for i, path in enumerate(data.theta_names)}
            n = int(usable.sum())
            theta = np.column_stack([columns[path] for path in plan.prior.names])
            inputs = [
                np.full(n, part.place[path]) if path in part.place else columns[path]
                for path, _, _ in plan.conditions
            ]
            condition = np.column_stack(inputs) if inputs else np.zeros((n, 0))
            psi = np.zeros((n, len(plan.library)))
            for k, effect in enumerate(plan.library):
                own = effect.at(plan.scene)
                if part.effect != effect.name:
                    continue
                if effect.held is not None:
                    psi[:, k] = 1.0
                elif effect.whole:
                    # A whole number may lie half a grain beyond full strength.
                    strength = own.strength(np.full(n, scene.get(effect.path)))
                    psi[:, k] = np.clip(strength, -1.0, 1.0)
                else:
                    psi[:, k] = own.strength(columns[effect.path])
            rows.append(
                (cube(plan.prior, theta), plan.unit_condition(condition), psi, values[usable])
            )
        names = measures.names
        # The first parts are the base model's, one for each place.
        many = max(len(plan.places), 1)
        theta, condition, psi, x = (np.concatenate(c) for c in zip(*rows[:many], strict=True))
        rows = [(theta, condition, psi, x), *rows[many:]]
        rows.extend(self._free_rows(rows[0], measures.powers))
        rows.extend(self._rows_of_images())
        rows = self._with_tolerances(rows, names)
        theta, condition, psi, x = (np.concatenate(part) for part in zip(*rows, strict=True))
        return Pours(theta, condition, psi, x, names, left_out)

    def _free_rows(
        self, base: tuple[Array, Array, Array, Array], powers: Array | None
    ) -> list[tuple[Array, Array, Array, Array]]:
        """Base pours read anew, for each effect that needs none of its own.

        With other lengths, for an effect of the camera; as pours of another condition than theirs,
        for one that is stated wrongly.
        """
        paths = [path for path, _, _ in self.plan.conditions]
        found = []
        for k, effect in enumerate(self.plan.library):
            if not (effect.camera or effect.shift or effect.series) or (
                effect.shift and (effect.path not in paths or self.plan.places)
            ):
                continue
            random = np.random.default_rng(self.plan.seed + k)
            rows = random.permutation(len(base[0]))[:_FREE_COPIES]
            strength = random.uniform(-1.0 if effect.is_two_sided else 0.0, 1.0, len(rows))
            theta, condition, psi, x = (part[rows].copy() for part in base)
            psi[:, k] = strength
            if effect.series:
                x = reread(self._names, x, {effect.series: effect.full * strength})
            elif effect.camera:
                if powers is None:
                    continue
                x *= (1.0 + effect.full * strength[:, None]) ** powers
            else:
                column = paths.index(effect.path)
                _, low, high = self.plan.conditions[column]
                condition[:, column] -= effect.full * strength / (high - low)
            inside = ((condition >= 0.0) & (condition <= 1.0)).all(axis=1)
            found.append((theta[inside], condition[inside], psi[inside], x[inside]))
        return found

    @property
    def _names(self) -> tuple[str, ...]:
        return Measures.of(self.plan.scene).names

    def _image_rows(self) -> ImageRows:
        plan = self.plan
        return ImageRows(
            folder=self.folder / "images",
            scene=plan.scene,
            prior=plan.prior,
            conditions=plan.conditions,
            places=plan.places,
            effects=tuple(effect for effect in plan.library if effect.image),
            count=plan.images,
            seed=plan.seed,
        )

    def _rows_of_images(self) -> list[tuple[Array, Array, Array, Array]]:
        """Rows of `images/`: plain ones, then those under each effect."""
        if not self.plan.images:
            return []
        found = self._image_rows().rows()
        if found is None:
            raise TrainingDataError(
                f"{self.folder / 'images'} is not whole: fill the archive first"
            )
        names = [effect.name for effect in self.plan.library]
        rows = []
        for name, (theta, condition, strength, x) in found.items():
            psi = np.zeros((len(x), len(names)))
            if name:
                psi[:, names.index(name)] = strength
            rows.append((theta, condition, psi, x))
        return rows

    def _with_tolerances(
        self, rows: list[tuple[Array, Array, Array, Array]], names: tuple[str, ...]
    ) -> list[tuple[Array, Array, Array, Array]]:
        """The rows with a column of strengths for each tolerance, and base pours that are off."""
        tolerances = self.plan.tolerances
        if tolerances is None:
            return rows
        many = len(tolerances.directions)
        padded = [(t, c, np.pad(p, ((0, 0), (0, many))), x) for t, c, p, x in rows]
        column = [path for path, _, _ in self.plan.conditions].index(tolerances.path)
        _, low, high = self.plan.conditions[column]
        for number in range(many):
            random = np.random.default_rng([self.plan.seed, number])
            chosen = random.permutation(len(rows[0][0]))[:_FREE_COPIES]
            theta, condition, psi, x = (part[chosen].copy() for part in padded[0])
            psi[:, len(self.plan.library) + number] = random.uniform(-1.0, 1.0, len(chosen))
            at = low + condition[:, column] * (high - low)
            strength = psi[:, [len(self.plan.library) + number]]
            padded.append(
                (theta, condition, psi, x + strength * tolerances.shift(number, at, names))
            )
        return padded

    def _parts(self) -> list["_Part"]:
        """The data sets, the base model's first."""
        plan = self.plan
        # At the conditions alone their numbers are set, and definitions still drawn.
        placed = plan.places[0] if plan.places else {}
        drawn = [condition for condition in plan.conditions if condition[0] not in placed]
        inputs = [
            Parameter(path=path, distribution="uniform", low=low, high=high)
            for path, low, high in drawn
        ]
        common = [*plan.prior.parameters, *inputs]
        parts = [_Part("base", plan.scene, Prior(common), plan.base - plan.images, plan.seed)]
        for k, entry in enumerate(plan.library, start=1):
            if entry.is_free:
                continue
            effect, seed = entry.at(plan.scene), plan.seed + _SEED_STEP * k
            name = f"effect-{effect.name}"
            there = plan.scene.with_(dict(effect.also)) if effect.also else plan.scene
            if effect.held is not None:
                parts.append(_Part(name, there, Prior(common), plan.each, seed, effect.name))
                continue
            if effect.whole:
                share = -(-plan.each // len(_WHOLE_STRENGTHS))
                for number, psi in enumerate(_WHOLE_STRENGTHS):
                    scene = plan.scene.with_({effect.path: effect.value(psi)})
                    parts.append(
                        _Part(
                            f"{name}-{number}",
                            scene,
                            Prior(common),
                            share,
                            seed + number + 1,
                            effect.name,
                        )
                    )
                continue
            prior = Prior([*common, effect.parameter()])
            parts.append(_Part(name, there, prior, plan.each, seed, effect.name))
        return [piece for part in parts for piece in part.at(plan.places)]


@dataclass(frozen=True)
class _Part:
    """One data set: its folder's name, what is poured, and of which effect and place, if any."""

    name: str
    scene: Scene
    prior: Prior
    count: int
    seed: int
    effect: str = ""
    place: dict[str, float] = field(default_factory=dict)

    def at(self, places: tuple[dict[str, float], ...]) -> list["_Part"]:
        """Returns the part at each of `places`, its pours dealt out; itself if there are none."""
        if not places:
            return [self]
        share = -(-self.count // len(places))
        return [
            _Part(
                f"{self.name}-at-{i}",
                self.scene.with_(place),
                self.prior,
                share,
                self.seed + _PLACE_STEP * i,
                self.effect,
                place,
            )
            for i, place in enumerate(places)
        ]


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


def _covers(theirs: Any, mine: Any) -> bool:
    """Whether an archive over the ranges `theirs` holds every condition within `mine`."""
    if not isinstance(theirs, list) or [t[0] for t in theirs] != [m[0] for m in mine]:
        return False
    pairs = zip(theirs, mine, strict=True)
    return all(low <= m_low and m_high <= high for (_, low, high), (_, m_low, m_high) in pairs)


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) < 80 else text[:77] + "..."
