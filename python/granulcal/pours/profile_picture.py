"""The profile of a formation: its height against the distance from its middle, with a band."""

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO

import numpy as np
from numpy.typing import NDArray

from granulcal.pours.formation_image import common_field, neighbour_distances

__all__ = ["ProfileBand", "profile_band", "profile_figure", "radial_profile"]

Array = NDArray[np.float64]

_RINGS = 20
_PARTS = 4
_SIDE_BY_SIDE = 0.05
_LEVELS = (0.05, 0.95)
_MM = 1e3


def radial_profile(points: Array, edges: Array) -> Array:
    """Returns the mean height of rings of ground about the origin [m], shape (k,).

    Each point is a pixel of the image; ground without grains counts as zero, so that the profile
    times the rings' areas is the volume in view.

    Args:
        points: of the formation [m], shape (n, 3).
        edges: radii between the rings [m], rising, shape (k + 1,).
    """
    if len(points) < 2:
        return np.zeros(len(edges) - 1)
    side = _pixel(points)
    # Parts of a square may lie in different rings: the innermost are few squares wide.
    part = side * (np.arange(_PARTS) - (_PARTS - 1) / 2) / _PARTS
    x, y = (points[:, i, None] + part for i in (0, 1))
    r = np.hypot(x[:, :, None], y[:, None, :]).reshape(len(points), -1)
    heights = np.repeat(points[:, 2], r.shape[1])
    volume, _ = np.histogram(r.ravel(), edges, weights=heights * side**2 / r.shape[1])
    return volume / (np.pi * np.diff(edges**2))


def _pixel(points: Array) -> float:
    """Width of a pixel on the ground [m]: how near neighbours are where grains lie side by side.

    Pixels of grains that lie alone have no neighbours: most of a thin formation.
    """
    return float(np.quantile(neighbour_distances(points), _SIDE_BY_SIDE))


@dataclass(frozen=True)
class ProfileBand:
    """Profiles of a measured formation and of simulated ones, in the same rings.

    Attributes:
        edges: radii between the rings [m], shape (k + 1,).
        measured: profile of the measured formation [m], shape (k,).
        fitted: mean profile of the pours at the posterior's mode [m], shape (k,).
        draws: profiles of pours at draws of the posterior [m], shape (n, k).
    """

    edges: Array
    measured: Array
    fitted: Array
    draws: Array

    @property
    def band(self) -> tuple[Array, Array]:
        """Low and high end of 90 % of the draws [m], each of shape (k,)."""
        low, high = np.quantile(self.draws, _LEVELS, axis=0)
        return low, high

    @property
    def inside(self) -> float:
        """Share of the rings in which the measured profile is within the draws."""
        low, high = self.draws.min(axis=0), self.draws.max(axis=0)
        return float(np.mean((self.measured >= low) & (self.measured <= high)))


def profile_band(
    measured: Array, fitted: Sequence[Array], draws: Sequence[Array], *, rings: int = _RINGS
) -> ProfileBand:
    """Returns the profiles of clouds of points, each about its own mean place.

    Args:
        measured: points of the measured formation [m], shape (n, 3).
        fitted: of pours at the posterior's mode.
        draws: of pours at draws of the posterior, at least one.
        rings: how many, out to where the outermost formation ends but for stray grains.
    """
    clouds = [_centred(cloud) for cloud in (measured, *fitted, *draws)]
    edges = np.linspace(0.0, common_field(clouds) / 2, rings + 1)
    found = np.array([radial_profile(cloud, edges) for cloud in clouds])
    n = 1 + len(fitted)
    return ProfileBand(edges, found[0], found[1:n].mean(axis=0), found[n:])


def profile_figure(band: ProfileBand) -> bytes:
    """Returns a PNG of the profiles [mm]."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 3.2), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    middle = _MM * (band.edges[:-1] + band.edges[1:]) / 2
    low, high = band.band
    axes.fill_between(
        middle,
        _MM * low,
        _MM * high,
        color="#9dbdd6",
        label=f"90 % of {len(band.draws)} pours at draws of the posterior",
    )
    axes.plot(middle, _MM * band.fitted, color="#1f4e79", label="pours at the posterior's mode")
    axes.plot(middle, _MM * band.measured, "o", color="#b03a2e", markersize=4, label="measured")
    axes.set(xlabel="distance from the middle [mm]", ylabel="mean height [mm]")
    axes.set_xlim(0, _MM * band.edges[-1])
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False, fontsize=9)
    buffer = BytesIO()
    figure.savefig(buffer, format="png", dpi=130)
    return buffer.getvalue()


def _centred(points: Array) -> Array:
    return points - np.array([*points[:, :2].mean(axis=0), 0.0]) if len(points) else points
