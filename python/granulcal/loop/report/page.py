"""The loop's report: one self-contained HTML page."""

from collections.abc import Sequence
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from granulcal.engines.in_use import version_of_pours
from granulcal.files import write_beside
from granulcal.loop.check.own_errors import in_told_sessions
from granulcal.loop.check.standing import Standing
from granulcal.loop.check.unseen import Seen
from granulcal.loop.closed import Closed
from granulcal.loop.effects.image_faults import Frame
from granulcal.loop.effects.library import LIBRARY
from granulcal.loop.pours.measures import Measures, formation_of
from granulcal.loop.task import Condition
from granulcal.loop.test.verdict import Verdict
from granulcal.pours.formation_image import formation_figure
from granulcal.pours.simulate import simulate
from granulcal.report import data_uri, template

__all__ = ["sentence_of", "write_page"]

_SENTENCES = {
    "NONE": "The model explains these pours: no residual was found.",
    "RESIDUAL": "Something is left that this model does not do; what it is cannot be told.",
    "EFFECT": "The grains do something that this model lacks, and one effect accounts for it.",
    "SET": "The grains do something that this model lacks; several effects would account for it.",
    "EFFECTS": "The grains do something that this model lacks; it takes two effects.",
    "UNEXPLAINED": "Something is left that neither this model nor any effect that was tried does.",
    "UNCONFIRMED": "Nothing may be said: what the fits say does not stand its own checks.",
    "OVERTURNED": "Nothing may be said: the verdict depends on how the pours are observed.",
}
# Where some of the names are how the grains were seen, and others what they do.
_SENTENCES_OF_BOTH = {
    "EFFECT": "The grains do something that this model lacks, or they were seen otherwise than it "
    "says; one effect accounts for it.",
    "SET": "What this model leaves is how the grains were seen, or something that they do and it "
    "lacks: which, cannot be told.",
    "EFFECTS": "It takes two effects to account for what this model leaves: something that the "
    "grains do, and how they were seen.",
}
# Share of an effect that the parameters must not mimic for its interval to hold what it says.
_QUOTABLE = 0.5
# Rightly named effects of the self study whose interval without pairs held the truth, of how many
# (docs/results/loop-self.md).
_HELD = (54, 63)
# Statistics that the picture of residuals shows, the largest ones.
_SHOWN = 24


def write_page(closed: Closed, path: Path, *, command: str, title: str) -> None:
    """Writes the page of a closed loop."""
    verdict = closed.verdict
    named = ", ".join(verdict.named)
    page = template("loop.html.j2").render(
        title=title,
        headline=f"{verdict.kind}: {named}" if named else verdict.kind,
        sentence=sentence_of(closed.standing, closed.seen),
        reason=verdict.reason[:1].upper() + verdict.reason[1:],
        made=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        version=version_of_pours(),
        registration=closed.registration,
        p=verdict.p,
        surrogate_p=closed.standing.surrogate_p,
        doubts=closed.doubts,
        beyond=closed.trace.beyond,
        totals=[("fit", closed.fit)] + ([("sealed", closed.sealed)] if closed.sealed else []),
        placebo=closed.placebo.verdict,
        errors=_errors(closed),
        told=[c.name for c in in_told_sessions(closed.task)],
        corrections=closed.corrections,
        standing=closed.standing,
        sealed_model=closed.sealed.total_after.square if closed.sealed else None,
        calibrated=closed.calibrated,
        held=_HELD,
        residuals=_residuals(closed),
        nearest=closed.trace.nearest,
        strengths=_strengths(closed),
        is_named=bool(verdict.named),
        word=verdict.kind,
        parameters=closed.parameters(),
        pictures=_pictures(closed),
        picture_of=f"A pour at {closed.task.conditions[0].name}",
        rivals=closed.trace.explanations[:8],
        hidden=_hidden(closed),
        untried=[effect.name for effect in closed.task.untried],
        experiments=closed.experiments[:5],
        pours=closed.pours,
        command=command,
        number=_number,
    )
    write_beside(path, page)


def sentence_of(standing: Standing, seen: Sequence[Seen] = ()) -> str:
    """Returns what the verdict says, in a sentence."""
    if standing.verdict.kind == "UNEXPLAINED" and any(one.lacks for one in seen):
        return (
            "Something is left that neither this model nor any effect that was tried does as far "
            "as the archive has usable pours of it."
        )
    if standing.verdict.kind == "NONE" and standing.surrogate_p is not None:
        return "The model explains these pours: pours of it leave no more than chance does."
    said = _sentence_of(standing.verdict)
    if standing.is_no_nearer:
        return f"{said} Nothing shows that it predicts better where nothing was fitted."
    return said


def _sentence_of(verdict: Verdict) -> str:
    named = [effect for effect in LIBRARY if effect.name in verdict.named]
    of_sight = [effect for effect in named if effect.is_of_sight]
    if named and len(of_sight) == len(named):
        return (
            "Of what was tried it is not the grains: how they were seen accounts for what this "
            "model leaves."
        )
    return (_SENTENCES_OF_BOTH if of_sight else _SENTENCES)[verdict.kind]


def _errors(closed: Closed) -> list[dict[str, Any]]:
    rows = []
    for use, improvement in (("fit", closed.fit), ("sealed", closed.sealed)):
        if improvement is not None:
            triples = zip(improvement.labels, improvement.before, improvement.after, strict=True)
            rows += [dict(label=n, use=use, before=b, after=a) for n, b, a in triples]
    return rows


def _residuals(closed: Closed) -> str:
    """Residuals of the base fit: conditions down, the statistics with the largest ones across."""
    from matplotlib.figure import Figure

    values = closed.trace.residuals
    order = np.sort(np.argsort(-np.abs(values).max(axis=0))[:_SHOWN])
    figure = Figure(figsize=(9.5, 2.4 + 0.35 * len(values)), layout="constrained")
    axes = figure.subplots()
    image = axes.imshow(values[:, order], cmap="RdBu_r", vmin=-5, vmax=5, aspect="auto")
    axes.set_yticks(range(len(values)), closed.trace.labels)
    names = [closed.trace.statistics[i] for i in order]
    axes.set_xticks(range(len(order)), names, rotation=60, ha="right", fontsize=8)
    figure.colorbar(image, label="measured less model\n[standard deviations]")
    buffer = BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    return data_uri(buffer.getvalue())


def _strengths(closed: Closed) -> list[dict[str, Any]]:
    sights = closed.trace.power
    known = zip(sights.effects, sights.kappa, strict=True)
    # NaN, an effect too weak to say, is mimicked as well.
    mimicked = [name for name, kappa in known if not kappa >= _QUOTABLE]
    rows = []
    for name, (low, middle, high) in closed.strengths().items():
        effect = closed.task.effect(name)
        rows.append(
            dict(name=name, path=effect.path, unit=effect.unit if effect.unit != "-" else "")
            | dict(low=low, middle=middle, high=high, doc=effect.doc)
            | dict(is_mimicked=name in mimicked)
        )
    return rows


def _hidden(closed: Closed) -> list[dict[str, str]]:
    # At the fit: what is seen at the middle of the prior may not be at the material's own numbers.
    rows, sights = [], closed.trace.power
    of = {one.effect: one for one in closed.seen}
    for name, kappa, least in zip(sights.effects, sights.kappa, sights.shown, strict=True):
        effect = closed.task.effect(name)
        is_seen = least <= 1
        value = f"{_number(effect.value(float(least)))} {effect.unit}" if is_seen else "-"
        value, has = value.removesuffix(" -"), of.get(name)
        rows.append(
            {
                "name": name,
                "path": effect.path,
                "kappa": "-" if np.isnan(kappa) else _number(float(kappa)),
                "strength": "-"
                if np.isnan(least)
                else _number(float(least))
                if is_seen
                else "not seen",
                "pours": f"{has.pours - has.left_out.total} of {has.pours}" if has else "-",
                "lacks": f"{has.lacks} ({has.left_out})" if has and has.lacks else "",
                "value": value if is_seen and not effect.camera else "-",
            }
        )
    return rows


def _pictures(closed: Closed) -> str:
    """A measured pour, the base model and the augmented one, of the first condition."""
    condition = closed.task.conditions[0]
    if Measures.of(closed.task.scene).observes:
        return ""
    clouds = {"measured": _measured_points(closed, condition)}
    models = {"base model": closed.trace.base}
    if closed.trace.best is not closed.trace.base:
        models["with " + " + ".join(closed.trace.best.effects)] = closed.trace.best
    for label, one in models.items():
        pour, faults = simulate(closed.scene(condition, one), seed=0), closed.faults(one)
        points = Frame.with_faults(pour, faults, 0).points() if faults else pour.points()
        clouds[label] = points - np.array([*points[:, :2].mean(axis=0), 0.0])
    return data_uri(formation_figure(clouds, resolution=closed.task.scene.ground_resolution))


def _measured_points(closed: Closed, condition: Condition) -> Any:
    there = closed.task.scene.with_(condition.at)
    return formation_of(condition.recordings[0], there, condition.camera, condition.reading)[
        1
    ].points


def _number(value: float) -> str:
    return f"{value:.3g}"
