"""What the loop is asked: a scene, a prior, and recordings under several conditions.

`task_file.py` says how a TOML file states it.
"""

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from granulcal.documents import meant
from granulcal.errors import ObservationError
from granulcal.loop.condition import FIT, SEALED, Condition, by_each, require_different
from granulcal.loop.effects.askable import (
    of_heights,
    refuse_drawn,
    refuse_stated,
    refuse_unpourable,
    refuse_unread,
    refuse_whole,
)
from granulcal.loop.effects.definitions import Definition, check_definitions, definition_inputs
from granulcal.loop.effects.image_faults import require_image
from granulcal.loop.effects.library import LibraryEffect
from granulcal.loop.effects.series_faults import require_series
from granulcal.loop.effects.tolerance import Tolerances
from granulcal.loop.effects.untried import untried
from granulcal.loop.pours.forward import Coarse
from granulcal.loop.recorded import doubts_of, require_no_copies
from granulcal.loop.task_file import read_task
from granulcal.pours.scene import Scene
from granulcal.pours.statistics import DIAGNOSTIC_NAMES, NAMES
from granulcal.prior import Prior

__all__ = ["FIT", "SEALED", "Condition", "Task"]

# Fewest pours over all fit conditions from which something may be said.
_FEWEST_POURS = 3


@dataclass(frozen=True)
class Task:
    """What is asked.

    Attributes:
        scene: the base model.
        prior: of its material.
        conditions: at least one to fit.
        library: effects to test.
        path: the file that it was read from.
        tolerances: of the statistics.
        between: whether the archive's pours lie between the conditions, their numbers drawn
            independently; if not, they are at the conditions alone.
        sealed_in_archive: whether they are at sealed conditions, too; with `between` they must be.
        definitions: ways to observe the pours, the first is the verdict's; none: the scene's own.
        stated: the conditions as they were before the first definition was put in.
    """

    scene: Scene
    prior: Prior
    conditions: tuple[Condition, ...]
    library: tuple[LibraryEffect, ...]
    path: Path | None = None
    tolerances: Tolerances | None = None
    between: bool = True
    definitions: tuple[Definition, ...] = ()
    stated: tuple[Condition, ...] = ()
    sealed_in_archive: bool = True

    def __post_init__(self) -> None:
        """Checks that the conditions can be asked about.

        Raises:
            ObservationError: too few pours, conditions without the same paths or with a number that
                the scene refuses, a name twice, tolerances over a number that does not differ
                between conditions, effects of the image for a scene that observes statistics of its
                own, effects on numbers that the conditions state or that the scene does not take,
                conditions that state what the prior draws.
        """
        check_definitions(self.definitions)
        if self.definitions and not self.stated:
            object.__setattr__(self, "stated", self.conditions)
            first = self.definitions[0]
            observed = tuple(condition.under(first) for condition in self.conditions)
            object.__setattr__(self, "conditions", observed)
        if self.between and not self.sealed_in_archive:
            raise ObservationError(
                "sealed_in_archive = false needs between = false: pours that lie between the "
                "conditions lie at the sealed ones, too"
            )
        require_image(self.scene, (effect.name for effect in self.library if effect.image))
        require_series(self.scene, ((e.name, e.series) for e in self.library if e.series))
        self._refuse_fitted()
        self._refuse_unlike()
        given = tuple(self.conditions[0].at) if self.conditions else ()
        object.__setattr__(self, "library", of_heights(self.library, given))
        names = [condition.name for condition in self.conditions]
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            raise ObservationError(f"conditions need names of their own, twice: {repeated}")
        require_different(self.conditions)
        self._refuse_idle_sessions()
        pours = sum(len(c.recordings) for c in self.of(FIT))
        # One odd pour of one or two passes for an effect; a mean over time cannot be odd.
        is_steady = pours > 0 and all(c.averaged for c in self.of(FIT))
        if pours < _FEWEST_POURS and not is_steady:
            raise ObservationError(
                f"a verdict needs at least {_FEWEST_POURS} pours in conditions to fit, got {pours} "
                "(fewer are enough where each recording is a mean over time: averaged = true)"
            )
        for condition in self.conditions:
            if set(condition.at) != set(self.paths):
                raise ObservationError(
                    f"{condition.name}: conditions must state the same numbers, "
                    f"{sorted(self.paths)}; got {sorted(condition.at)}"
                )
        self._refuse_impossible()
        self._refuse_unaskable()
        known = [path for path, _, _ in self.inputs]
        if self.tolerances is not None and self.tolerances.path not in known:
            raise ObservationError(
                "tolerances must be over a number that differs between conditions, "
                f"{known or 'none'}; got {self.tolerances.path!r}"
            )
        self._refuse_unknown_statistics()

    @classmethod
    def load(cls, path: str | PathLike[str]) -> "Task":
        """Returns the task in a TOML file.

        Raises:
            FileNotFoundError: a file that it names is not there.
            ObservationError: unknown or missing keys.
        """
        return cls(**read_task(Path(path)))

    def under(self, definition: Definition, use: str) -> tuple[Condition, ...]:
        """Returns the conditions of one use, by a definition."""
        return tuple(c.under(definition) for c in self.stated if c.use == use)

    def _refuse_unknown_statistics(self) -> None:
        """Refuses tolerances of what no scene has: they would forgive nothing.

        Raises:
            ObservationError: the names.
        """
        names = (*self.scene.observed_names, *NAMES, *DIAGNOSTIC_NAMES)
        given = () if self.tolerances is None else self.tolerances.names
        unknown = [f"{name!r}{meant(name, names)}" for name in given if name not in names]
        if unknown:
            raise ObservationError(f"tolerances are of no statistic {', '.join(unknown)}")

    def _refuse_idle_sessions(self) -> None:
        """Refuses sessions where nothing is each condition's own: they would say nothing."""
        named = [c.name for c in self.conditions if c.session]
        own = [e.name for e in self.library if e.nuisance_sd is not None and not e.is_shared]
        if named and not own:
            raise ObservationError(
                f"the session of {named[0]} says nothing: no nuisance of the task is each "
                "condition's own; declare one with shared = false, or leave session out"
            )

    def _refuse_impossible(self) -> None:
        """Refuses numbers of a condition, by whatever definition, that the scene does not take.

        Raises:
            ObservationError: the condition, the number, and what the scene allows.
        """
        for condition in self._by_each_definition:
            try:
                self.scene.with_(condition.at)
            except (TypeError, ValueError) as error:
                raise ObservationError(f"condition {condition.name!r}: {error}") from None

    def _refuse_unaskable(self) -> None:
        """Refuses what `askable.py` does, once every condition is one of the scene."""
        everywhere = self._by_each_definition
        ats = [condition.at for condition in everywhere]
        for condition in everywhere:
            refuse_drawn(self.prior, condition.name, condition.at)
        refuse_stated((effect.at(self.scene) for effect in self.library), ats)
        refuse_whole(self.scene, self.inputs, self.between)
        refuse_unread(self.library, self.inputs, self.between)
        refuse_unpourable(self.scene, self.prior, self.library, ats)

    def _refuse_fitted(self) -> None:
        """Refuses effects whose number every fit has free, or the prior has fixed in every pour.

        Raises:
            ObservationError: the effect and the number.
        """
        for effect in self.library:
            fixed = [] if effect.is_free else [effect.path, *dict(effect.also)]
            for path in fixed:
                if path in self.prior.fixed:
                    raise ObservationError(
                        f"{effect.name} sets {path}, which the prior fixes in every pour: say it "
                        f"in the scene and leave it out of prior, or leave {effect.name} out"
                    )
            if effect.path in self.prior.names and not effect.is_free and effect.held is None:
                raise ObservationError(
                    f"{effect.name} is the number {effect.path}, which the prior has free in every "
                    "fit: it can be no finding; leave it out of effects"
                )

    def _refuse_unlike(self) -> None:
        """Refuses candidates that do not go with the material's numbers that are free.

        Raises:
            ObservationError: the effect, and the number that it does not go with.
        """
        drawn = zip(self.prior.names, self.prior.sample(1, seed=0)[0].tolist(), strict=True)
        material = {path: value for path, value in drawn if path.startswith("material.")}
        for effect in self.library:
            numbers = effect.at(self.scene).numbers(1.0)
            refusal = self.scene.refusal({**material, **numbers})
            # What is refused without them, too, is not theirs.
            if refusal is not None and self.scene.refusal(numbers) is None:
                raise ObservationError(
                    f"{effect.name} can be no candidate with numbers that every fit has free: "
                    f"{refusal}; leave it out of effects, or the number out of law and prior"
                ) from refusal

    def of(self, use: str) -> tuple[Condition, ...]:
        """Returns the conditions of one use."""
        return tuple(condition for condition in self.conditions if condition.use == use)

    @property
    def paths(self) -> tuple[str, ...]:
        """The numbers that the conditions state."""
        return tuple(self.conditions[0].at)

    @property
    def inputs(self) -> tuple[tuple[str, float, float], ...]:
        """Path, least and largest value of each number that differs between conditions.

        Where pours are at the conditions alone: of as many as tell the conditions apart.
        """
        found: list[tuple[str, float, float]] = []
        for path in self._differing:
            values = [condition.at[path] for condition in self.conditions]
            if self.between or self._told_apart([p for p, _, _ in found]) < self._told_apart(
                [*(p for p, _, _ in found), path]
            ):
                found.append((path, min(values), max(values)))
        return (*found, *definition_inputs(self.definitions))

    @property
    def places(self) -> tuple[dict[str, float], ...]:
        """Numbers of each condition once, where the archive has pours there alone; else none."""
        if self.between:
            return ()
        found: list[dict[str, float]] = []
        for condition in self.conditions if self.sealed_in_archive else self.of(FIT):
            there = {path: condition.at[path] for path in self._differing}
            if there not in found:
                found.append(there)
        return tuple(found)

    @property
    def untried(self) -> tuple[LibraryEffect, ...]:
        """The library's effects of the world that the scene takes and that are not tried."""
        known = (*self.paths, *self.prior.names, *self.prior.fixed)
        return untried(self.scene, self.library, known)

    @property
    def _by_each_definition(self) -> tuple[Condition, ...]:
        """The conditions by every definition."""
        return by_each(self.stated or self.conditions, self.definitions)

    @property
    def _differing(self) -> list[str]:
        """Paths whose numbers are not the same under all conditions."""
        return [p for p in self.paths if len({c.at[p] for c in self.conditions}) > 1]

    def _told_apart(self, paths: list[str]) -> int:
        """Number of conditions that the numbers `paths` distinguish."""
        return len({tuple(c.at[path] for path in paths) for c in self.conditions})

    @property
    def coarse(self) -> Coarse | None:
        """The second size of grains, if the task names one."""
        held = next((effect for effect in self.library if effect.held is not None), None)
        return None if held is None else Coarse(dict(held.also), held.held or 0.0)

    @property
    def read_scene(self) -> Scene:
        """The scene by which recordings are read: with what the prior fixes in every pour."""
        return self.scene.with_(self.prior.fixed) if self.prior.fixed else self.scene

    def effect(self, name: str) -> LibraryEffect:
        """Returns an effect of the library with the scene's own numbers put in."""
        return next(e for e in self.library if e.name == name).at(self.at_first())

    def require_readable(self) -> tuple[str, ...]:
        """Reads every recording and lets go what it says: what cannot be read fails before pours.

        Returns what makes recordings doubtful, a sentence each.

        Raises:
            FileNotFoundError: a file that a condition names is not there.
            ObservationError: a recording that cannot be one of the scene, or a copy of another.
        """
        rows = [condition.statistics(self.read_scene) for condition in self.conditions]
        # The few numbers that a scene observes may be the same of two pours.
        is_image = not self.scene.observed_names
        require_no_copies(self.conditions, rows if is_image else [row[:0] for row in rows])
        return tuple(doubts_of(self.conditions, self.scene, self.prior, self.library))

    def at_first(self) -> Scene:
        """Returns the scene with the numbers that all conditions share."""
        differing = set(self._differing)
        shared = {p: v for p, v in self.conditions[0].at.items() if p not in differing}
        return self.scene.with_(shared) if shared else self.scene
