"""What no task can be asked about, told before anything is registered or poured.

A number of a pour is known, unknown or looked for: what a condition states is no parameter of the
prior and no effect, and what the scene does not take, or takes in whole numbers alone, is not drawn
between.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from granulcal.errors import ObservationError
from granulcal.loop.effects.definitions import is_definition
from granulcal.loop.effects.library import LibraryEffect
from granulcal.pours.scene import Scene
from granulcal.prior import Prior

__all__ = [
    "is_whole",
    "of_heights",
    "refuse_both",
    "refuse_drawn",
    "refuse_stated",
    "refuse_unpourable",
    "refuse_unread",
    "refuse_whole",
]

Input = tuple[str, float, float]

_FUNNEL, _FALL = "funnel.height", "start.height"
# Between two whole numbers wherever it is added to one.
_BETWEEN = 0.4142


def of_heights(
    library: Iterable[LibraryEffect], stated: Sequence[str]
) -> tuple[LibraryEffect, ...]:
    """Returns the effects, that of a funnel's height as one of a fall's where that is stated.

    Raises:
        ObservationError: an effect on a number that no condition states.
    """
    found = []
    for effect in library:
        if effect.shift and effect.path not in stated:
            if effect.path != _FUNNEL or _FALL not in stated:
                others = f" or {_FALL}" if effect.path == _FUNNEL else ""
                raise ObservationError(
                    f"{effect.name} is how far {effect.path}{others} is off what the conditions "
                    f"state; they state {', '.join(stated) or 'no number'}: leave it out of "
                    "effects and nuisances"
                )
            doc = "grains begin to fall from higher than stated"
            effect = replace(effect, path=_FALL, doc=doc)
        found.append(effect)
    return tuple(found)


def refuse_both(
    candidates: Sequence[LibraryEffect], nuisances: Sequence[LibraryEffect], named: Sequence[str]
) -> None:
    """Refuses a number that is to be found and is a tolerance.

    Args:
        candidates: effects to find, without those that are tolerances by name.
        nuisances: tolerances.
        named: names of effects in the task's file.

    Raises:
        ObservationError: the effect.
    """
    for nuisance in nuisances:
        if nuisance.name in named:
            raise ObservationError(
                f"{nuisance.name} is in effects and in nuisances: a tolerance can be no finding; "
                "leave it out of one of them"
            )
        for effect in candidates:
            if nuisance.path and nuisance.path == effect.path and nuisance.doc != effect.doc:
                raise ObservationError(
                    f"nuisance {nuisance.name} is the number {effect.path} of the effect "
                    f"{effect.name}, which is looked for: declare it as {effect.name}, or leave "
                    f"{effect.name} out of effects"
                )


def refuse_drawn(prior: Prior, name: str, at: Mapping[str, float]) -> None:
    """Refuses a number that condition `name` states and the prior draws, or fixes elsewhere.

    Raises:
        ObservationError: the condition, the number, and what the prior says of it.
    """
    for path, value in at.items():
        if path in prior.names:
            what = "the prior draws"
        elif prior.fixed.get(path, value) != value:
            what = f"the prior fixes at {prior.fixed[path]:g}"
        else:
            continue
        raise ObservationError(
            f"condition {name!r} states {path} = {value:g}, which {what} in every pour: leave it "
            "out of at, or out of prior, nuisance and law"
        )


def refuse_stated(library: Iterable[LibraryEffect], ats: Sequence[Mapping[str, float]]) -> None:
    """Refuses effects on a number that the conditions state: pours of a model have it as stated.

    A tolerance may be of such a number where every condition states the one that it begins from.

    Args:
        library: effects with the scene's own numbers put in.
        ats: numbers of each condition, by each definition.

    Raises:
        ObservationError: the effect and the number.
    """
    for effect in library:
        if effect.is_free or effect.held is not None:
            continue
        values = sorted({at[effect.path] for at in ats if effect.path in at})
        listed = ", ".join(f"{value:g}" for value in values)
        if values and effect.nuisance_sd is None:
            raise ObservationError(
                f"{effect.name} is the number {effect.path}, which the conditions state as "
                f"{listed}: what is known can be no finding; leave {effect.name} out of effects, "
                f"or {effect.path} out of at"
            )
        if values and values != [effect.off]:
            raise ObservationError(
                f"nuisance {effect.name} is {effect.path} off {effect.off:g}, and the conditions "
                f"state {listed}: they must all state {effect.off:g}, or leave it out of nuisances"
            )
        for path, value in effect.also:
            others = sorted({at[path] for at in ats if path in at} - {value})
            if others:
                raise ObservationError(
                    f"{effect.name} sets {path} to {value:g}, and the conditions state "
                    f"{', '.join(f'{one:g}' for one in others)}: leave {effect.name} out of "
                    f"effects and nuisances, or {path} out of at"
                )


def refuse_unread(library: Iterable[LibraryEffect], inputs: Sequence[Input], between: bool) -> None:
    """Refuses effects on a condition's own number where no pour lies beside the conditions.

    Raises:
        ObservationError: the effect or the tolerance, and why.
    """
    for effect in library:
        if not effect.shift:
            continue
        ends = [(low, high) for path, low, high in inputs if path == effect.path]
        if between and ends:
            continue
        why = "between = false has none" if not between else "all conditions state the same"
        is_declared = effect.nuisance_sd is not None
        raise ObservationError(
            f"{'nuisance' if is_declared else 'effect'} {effect.name} needs pours at further "
            f"values of {effect.path}, and {why}: leave it out of "
            + ("nuisances" if is_declared else "effects")
            + (f', or declare it by its path, "{effect.path}"' * (between and is_declared))
        )


def refuse_unpourable(
    scene: Scene,
    prior: Prior,
    library: Iterable[LibraryEffect],
    ats: Sequence[Mapping[str, float]],
) -> None:
    """Refuses effects that the scene does not take under any condition.

    Raises:
        ObservationError: the effect, and what the scene says.
    """
    drawn = dict(zip(prior.names, prior.sample(1, seed=0)[0].tolist(), strict=True))
    unknown = {**prior.fixed, **drawn}
    for effect in library:
        ends = (1.0, -1.0) if effect.is_two_sided else (1.0,)
        numbers = [found for psi in ends if (found := effect.at(scene).numbers(psi))]
        places = ({**more, **at, **n} for n in numbers for at in ats for more in ({}, unknown))
        first: ValueError | None = None
        for place in places:
            refusal = scene.refusal(place)
            if refusal is None:
                break
            first = first or refusal
        else:
            if first is not None:
                key = "effects" if effect.nuisance_sd is None else "nuisances"
                value = effect.at(scene).value(1.0)
                raise ObservationError(
                    f"{effect.name} cannot be {value:g} in this scene: {first}; leave it out of "
                    f"{key}"
                )


def refuse_whole(scene: Scene, inputs: Sequence[Input], between: bool) -> None:
    """Refuses whole numbers that pours would have any value between.

    Raises:
        ObservationError: the number.
    """
    for path, low, _ in inputs:
        of_definitions = is_definition(path)
        if not (between or of_definitions) or not is_whole(scene, path, low):
            continue
        what = (
            "and definitions are drawn between: let no two differ in it"
            if of_definitions
            else "and pours lie between the conditions: between = false has them there alone"
        )
        raise ObservationError(f"{path} is a whole number, {what}")


def is_whole(scene: Scene, path: str, value: float) -> bool:
    """Returns whether a number of the scene must be a whole one, `value` being one it takes."""
    return "whole number" in str(scene.refusal({path: int(value) + _BETWEEN}))
