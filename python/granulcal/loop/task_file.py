"""How a TOML file states a task of the loop.

    scene = "scene.toml"            # paths are relative to this file
    prior = "prior.toml"
    effects = ["drag", "tilt.x"]    # of the library; all that a funnel's pour may lack if left out,
                                    # ["usual", "clump"] are these and one more

    [[conditions]]
    name = "4 cm"
    at = { "funnel.height" = 0.04 }
    use = "fit"                     # or "sealed": opened once, after the verdict
    recordings = ["04cm/pour-0.png", "04cm/pour-1.png"]   # a pour each

`nuisances = { "tilt.x" = 0.005, "height" = 0.001 }` declares tolerances by the library's names: one
standard deviation of each number in its unit. They are random effects of every fit and can never be
a finding. `tolerances = "tolerances.json"` declares in which directions the statistics may be off.

`camera = "camera.toml"` of a condition, or once for all, is the camera of PNGs; where it is left
out it is looked for beside the recording. `reading = { width = 0.084 }`, likewise, are arguments of
`Recording.observed`, or of `Recording.formation` where the scene observes nothing.

`[[definitions]]` are ways to observe the same pours, thresholds and levels moved: the first is the
one that the verdict is of, and a verdict that another overturns is none; see `definitions.py`.

`[[nuisance]]` tables, written like those of a prior, are numbers of the model that nobody knows and
that are never a finding: free numbers of the contact law, a drive's speed. Every pour of the
archive has a value of its own, and every fit has them free.

`law = ["softness"]` is short for such a table of a free number of the contact law; see `law.py`.

`[resolution]` names the real grains' diameter and a coarser one to extrapolate from: see
`resolution.py`.

`averaged = true` of a condition: each recording is a mean over a time in which the grains forgot
themselves many times (a drum's picture), so that one is enough.

`session = "monday"` of conditions: what each condition has of its own (a nuisance with `shared =
false`: a clock, a camera's tilt) is the same under all conditions of one session. What the fitted
ones tell of it is known under the sealed ones as well; see `own_errors.py`.

`between = false`: the archive has pours at the conditions alone and not between them. Numbers of a
condition may then depend on each other (two walls that turn together). With
`sealed_in_archive = false` as well it has none at sealed conditions: no fit needs them there, and
all pours are where the fits are.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypedDict

from granulcal.documents import (
    LARGEST_DOCUMENT,
    Flag,
    ListOf,
    Mapping,
    Number,
    OneOf,
    Table,
    Text,
    check,
    parse_toml,
    read_bytes,
)
from granulcal.errors import ObservationError
from granulcal.loop.condition import FIT, SEALED, Condition, by_each, condition_of
from granulcal.loop.effects.askable import refuse_both
from granulcal.loop.effects.chosen import chosen, declared, with_alike
from granulcal.loop.effects.definitions import Definition
from granulcal.loop.effects.image_faults import require_image
from granulcal.loop.effects.law import law_numbers
from granulcal.loop.effects.library import LIBRARY, LibraryEffect
from granulcal.loop.effects.resolution import Resolution
from granulcal.loop.effects.tolerance import Tolerances
from granulcal.pours.scene import Scene
from granulcal.prior import Prior

__all__ = ["Stated", "read_task"]

_AT = Mapping(Number())
_READING = Mapping(OneOf((Text(), Flag(), ListOf(Number()), Number())))
_CONDITION = Table(
    {"name": Text(), "at": _AT, "use": Text((FIT, SEALED)), "recordings": ListOf(Text(), least=1)},
    {"camera": Text(), "known": _AT, "reading": _READING, "averaged": Flag(), "session": Text()},
)
_TOLERANCE = Table({"sd": Number(0)}, {"shared": Flag()})
_SCHEMA = Table(
    {"scene": Text(), "prior": Text(), "conditions": ListOf(_CONDITION, least=1)},
    {
        "effects": ListOf(Text(), least=1),
        "camera": Text(),
        "nuisances": Mapping(OneOf((_TOLERANCE, Number(0)))),
        "tolerances": Text(),
        "reading": _READING,
        "between": Flag(),
        "sealed_in_archive": Flag(),
        "definitions": ListOf(Table({"name": Text()}, {"at": _AT, "reading": _READING})),
        # As a prior's, which checks them.
        "nuisance": ListOf(Mapping(OneOf((Text(), Number())))),
        "resolution": Table({"diameter": Number(0), "coarse": Number(0)}, {"scales": _AT}),
        "law": OneOf((Flag(), ListOf(Text()))),
    },
)


class Stated(TypedDict):
    """What a file states, by the attributes of a task."""

    scene: Scene
    prior: Prior
    conditions: tuple[Condition, ...]
    library: tuple[LibraryEffect, ...]
    path: Path
    tolerances: Tolerances | None
    between: bool
    sealed_in_archive: bool
    definitions: tuple[Definition, ...]


def read_task(file: Path) -> Stated:
    """Returns what a file states, each part checked by itself; `Task` checks them together.

    Raises:
        FileNotFoundError: a file that it names is not there.
        ObservationError: unknown or missing keys.
    """
    document = parse_toml(read_bytes(file, most=LARGEST_DOCUMENT), file, error=ObservationError)
    check(document, _SCHEMA, file, error=ObservationError)
    folder = file.parent
    shared = {key: document[key] for key in ("camera", "reading") if key in document}
    scene = Scene.load(folder / document["scene"])
    conditions = tuple(condition_of(file, {**shared, **table}) for table in document["conditions"])
    definitions = tuple(Definition.of(table) for table in document.get("definitions", []))
    prior = Prior.load(folder / document["prior"])
    stated = Stated(
        scene=scene,
        prior=_with_unknown(prior, document, scene),
        conditions=conditions,
        library=(),
        path=file,
        tolerances=None,
        between=document.get("between", True),
        sealed_in_archive=document.get("sealed_in_archive", True),
        definitions=definitions,
    )
    if "tolerances" in document:
        stated["tolerances"] = Tolerances.load(folder / document["tolerances"])
    # What the prior fixes is known, as what the conditions state.
    known = [prior.fixed | one.at for one in conditions]
    stated["library"] = _library(document, stated, known)
    return stated


def _with_unknown(prior: Prior, document: dict[str, Any], scene: Scene) -> Prior:
    """The material's prior with the numbers that every fit has free besides."""
    law = law_numbers(document.get("law", False), scene)
    tables = document.get("nuisance")
    unknown = () if tables is None else Prior.from_tables(tables).parameters
    return Prior([*prior.parameters, *law, *unknown])


def _library(
    document: dict[str, Any], stated: Stated, known: Sequence[dict[str, float]]
) -> tuple[LibraryEffect, ...]:
    """The effects that a file asks, its tolerances, its second size of grains."""
    scene, file = stated["scene"], stated["path"]
    named = document.get("effects", [])
    asked = chosen(named, scene, known, stated["between"], file)
    ats = [one.at for one in by_each(stated["conditions"], stated["definitions"])]
    tolerated = declared(document.get("nuisances", {}), scene, ats, file)
    names = {effect.name for effect in tolerated}
    if scene.observed_names:
        # What is observed has no power of a length: such a tolerance would forgive nothing.
        told = {*names, *named}
        require_image(scene, (e.name for e in LIBRARY if e.camera and e.name in told))
    candidates = tuple(effect for effect in asked if effect.name not in names)
    refuse_both(candidates, tolerated, named)
    library = (*candidates, *tolerated)
    if "resolution" in document:
        library = (*library, Resolution.of(document["resolution"]).effect(scene))
    return with_alike(library, scene)
