"""One self-contained HTML page: what was measured, what was inferred, how well it fits."""

import base64
import platform
import re
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal import _native
from granulcal.arrays import unmasked
from granulcal.assumed import assumed
from granulcal.files import write_beside
from granulcal.pours.compare import Scale, comparison_table, nearest_row, standardised_distance
from granulcal.pours.dataset import Dataset
from granulcal.pours.formation_image import formation_figure
from granulcal.pours.profile_picture import profile_band, profile_figure
from granulcal.pours.simulate import Pour
from granulcal.pours.statistics import DOCS

if TYPE_CHECKING:
    from granulcal.bayessim import Calibration
    from granulcal.bayessim.check.identifiability import Identifiability
    from granulcal.bayessim.check.misfit import Misfit
    from granulcal.bayessim.posterior.posterior import Posterior

__all__ = ["HealthRow", "write_report"]

Array = NDArray[np.float64]

_TEMPLATE = "report.html.j2"
# Significant digits of every number on the page.
_DIGITS = 3


@dataclass(frozen=True, kw_only=True)
class HealthRow:
    """Health of a set of pours.

    Attributes:
        label: which pours.
        count: how many.
        statuses: how many ended in each status.
        worst_penetration: deepest overlap of any contact [radii].
        mean_residual: mean residual of the solver [-].
        energy_created: largest share of energy created [-].
        grains_lost: grains that passed through a wall, in all.
    """

    label: str
    count: int
    statuses: dict[str, int]
    worst_penetration: float
    mean_residual: float
    energy_created: float
    grains_lost: int

    @classmethod
    def of_dataset(cls, label: str, data: Dataset) -> "HealthRow":
        """Returns the health of a data set."""
        return cls._of(label, data.status_counts(), data.health)

    @classmethod
    def of_pours(cls, label: str, pours: Sequence[Pour]) -> "HealthRow":
        """Returns the health of pours."""
        columns = {key: [pour.health[key] for pour in pours] for key in pours[0].health}
        return cls._of(label, dict(sorted(Counter(p.status for p in pours).items())), columns)

    @classmethod
    def _of(cls, label: str, statuses: dict[str, int], columns: Any) -> "HealthRow":
        return cls(
            label=label,
            count=sum(statuses.values()),
            statuses=statuses,
            worst_penetration=float(np.max(columns["worst_penetration"])),
            mean_residual=float(np.mean(columns["mean_residual"])),
            energy_created=float(np.max(columns["energy_created"])),
            grains_lost=int(np.sum(columns["grains_lost"])),
        )


def write_report(
    path: str | PathLike[str],
    *,
    observed: ArrayLike,
    observed_points: ArrayLike | None = None,
    observed_count: int = 1,
    posterior: "Posterior",
    pours: Sequence[Pour],
    data: Dataset,
    prior_pours: Sequence[Pour] = (),
    drawn: Sequence[Pour] = (),
    calibration: "Calibration | None" = None,
    misfit: "Misfit | None" = None,
    truth: ArrayLike | None = None,
    title: str = "Calibration report",
    summary: str = "",
    notes: Sequence[str] = (),
    command: str = "",
) -> Path:
    """Writes the page and returns its path; it needs no other file and no network.

    Args:
        path: the HTML file.
        observed: measured statistics as `data` has them, of several measurements their mean,
            shape (s,).
        observed_points: points of the measured formation [m], of several the first, shape (n, 3),
            centred; None where what was measured is no image: pictures and profile are left out.
        observed_count: how many measurements there are.
        posterior: the inferred parameters.
        pours: pours at the posterior's mode, one for each seed, at least one.
        data: the pours that the model was trained on.
        prior_pours: pours at the prior's mean, for comparison.
        drawn: pours at draws of the posterior, for the band of the profile; none leaves it out.
        calibration: the model's check on pairs left out of its fit.
        misfit: whether any parameters explain the measurement.
        truth: the true parameters, where they are known, shape (p,).
        title: heading of the page.
        summary: one paragraph that says what was done.
        notes: further sentences that a reader must know.
        command: command line that makes the page again.

    Raises:
        ValueError: no pour, a pour without grains in view, or masked entries.
    """
    from granulcal.bayessim.check.identifiability import Identifiability

    if not pours:
        raise ValueError("a report needs at least one pour at the posterior's mode, got none")
    measured = np.asarray(unmasked("observed", observed), dtype=float)
    scale = Scale.of(data)
    simulated = [_of_pour(pour, data) for pour in pours]
    scene, known = data.scene, Identifiability.of(posterior)
    formations, profile = None, None
    if observed_points is not None:
        points = np.asarray(unmasked("observed_points", observed_points), dtype=float)
        formations, profile = _formations(points, pours[0]), _profile(points, pours, drawn)
    page = template(_TEMPLATE).render(
        title=title,
        summary=summary,
        notes=[*notes, *(str(warning) for warning in posterior.warnings)],
        command=command,
        observed_count=observed_count,
        formations=formations,
        profile=profile,
        drawn_count=len(drawn),
        pairs=_pair_plot(posterior, truth),
        parameters=_parameters(posterior, known, truth),
        directions=known.directions,
        assumed=assumed(data.scene_toml, posterior.prior),
        has_truth=truth is not None,
        statistics=comparison_table(measured, simulated, scale, scene.units_of(data.x_names)),
        docs=DOCS | scene.observed_docs,
        pour_count=len(pours),
        distances=_distances(measured, simulated, prior_pours, data, scale),
        health=_health(data, pours, prior_pours),
        calibration=calibration,
        misfit=misfit,
        data=data,
        scene_toml=data.scene_toml,
        versions=_versions(),
        made=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        number=_number,
    )
    target = Path(path)
    write_beside(target, page)
    return target


def template(name: str) -> Any:
    """Returns a page's template of the folder `templates`."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("granulcal", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["code"] = _with_code
    return environment.get_template(name)


def _with_code(text: str) -> Any:
    """Returns a sentence for a page, what stands between backticks as code."""
    from markupsafe import Markup, escape

    return Markup(re.sub("`([^`]+)`", r"<code>\1</code>", str(escape(text))))


def _of_pour(pour: Pour, data: Dataset) -> Array:
    """The statistics of a pour that the data set has, in its order."""
    found = pour.observed() if pour.scene.observed_names else pour.statistics()
    return np.array([found[name] for name in data.x_names])


def _formations(measured: Array, pour: Pour) -> str:
    simulated = pour.points()
    centred = simulated - np.array([*simulated[:, :2].mean(axis=0), 0.0])
    clouds = {"measured": measured, "simulated": centred}
    return data_uri(formation_figure(clouds, resolution=pour.scene.ground_resolution))


def _profile(measured: Array, pours: Sequence[Pour], drawn: Sequence[Pour]) -> str | None:
    seen = [points for pour in drawn if len(points := pour.points())]
    if not seen:
        return None
    band = profile_band(measured, [pour.points() for pour in pours], seen)
    return data_uri(profile_figure(band))


def _pair_plot(posterior: "Posterior", truth: ArrayLike | None) -> str:
    buffer = BytesIO()
    posterior.pair_plot(truth=truth).savefig(buffer, format="png", dpi=120)
    return data_uri(buffer.getvalue())


def data_uri(png: bytes) -> str:
    """Returns a picture as the source of an `img`."""
    return "data:image/png;base64," + base64.b64encode(png).decode("ascii")


def _parameters(
    posterior: "Posterior", identifiability: "Identifiability", truth: ArrayLike | None
) -> list[dict[str, Any]]:
    from granulcal.bayessim.check.identifiability import NO_TRACE

    region, mode, mean = posterior.credible_region(0.9), posterior.mode(), posterior.mean()
    true_values = [None] * len(posterior.names) if truth is None else np.asarray(truth).tolist()
    rows = []
    for i, parameter in enumerate(posterior.prior.free):
        low, high = region[parameter.path]
        known = true_values[i]
        rows.append(
            {
                "name": parameter.path,
                "mode": float(mode[i]),
                "mean": float(mean[i]),
                "low": low,
                "high": high,
                "prior": parameter.in_words,
                "gain": float(identifiability.gains[i]),
                "has_no_trace": bool(identifiability.gains[i] < NO_TRACE),
                "truth": known,
                "is_inside": None if known is None else low <= known <= high,
            }
        )
    return rows


def _distances(
    measured: Array,
    simulated: Sequence[Array],
    prior_pours: Sequence[Pour],
    data: Dataset,
    scale: Scale,
) -> list[tuple[str, float]]:
    """Distance to the measurement of each way to choose parameters, with a label."""
    rows = []
    if prior_pours:
        vectors = [_of_pour(pour, data) for pour in prior_pours]
        distance = standardised_distance(np.mean(vectors, axis=0), measured, scale)
        rows.append((f"prior mean, {_pours(len(vectors))}", distance))
    best = nearest_row(measured, data)
    distance = standardised_distance(data.x[best], measured, scale)
    rows.append((f"best of the {len(data)} training pours (row {int(data.row[best])})", distance))
    distance = standardised_distance(np.mean(simulated, axis=0), measured, scale)
    rows.append((f"posterior mode, {_pours(len(simulated))}", distance))
    return rows


def _health(data: Dataset, pours: Sequence[Pour], prior_pours: Sequence[Pour]) -> list[HealthRow]:
    rows = [
        HealthRow.of_dataset("training data", data),
        HealthRow.of_pours("posterior mode", pours),
    ]
    if prior_pours:
        rows.append(HealthRow.of_pours("prior mean", prior_pours))
    return rows


def _pours(count: int) -> str:
    return "1 pour" if count == 1 else f"mean of {count} pours"


def _versions() -> dict[str, str]:
    versions = {"granulcal": _native.__version__, "Python": platform.python_version()}
    for name in ("numpy", "torch", "matplotlib", "jinja2"):
        module = sys.modules.get(name)
        if module is not None and (version := _version_of(name)):
            versions[name] = version
    return versions


def _version_of(distribution: str) -> str | None:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(distribution)
    except PackageNotFoundError:
        return None


def _number(value: float) -> str:
    """Returns `value` with three significant digits, an exponent only where it is shorter."""
    return f"{value:.{_DIGITS}g}"
