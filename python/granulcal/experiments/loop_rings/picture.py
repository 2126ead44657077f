"""Measured rings beside pours of the verdict's model at its fit, and all their profiles."""

from pathlib import Path

import numpy as np

from granulcal.experiments.loop_rings.seen import Seen
from granulcal.experiments.loop_rings.shape import profile

__all__ = ["picture"]

# What is shown each way from the middle, and the range of the colours [m], [mm].
_HALF, _COLOURS = 0.18, 12


def picture(path: Path, seen: dict[str, Seen]) -> None:
    """Draws a column for each group: a map, a pour, the profiles."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(
        3, len(seen), figsize=(3.3 * len(seen), 9), squeeze=False, layout="constrained"
    )
    image = None
    for (group, one), column in zip(seen.items(), axes.T, strict=True):
        first = next(iter(one.maps))
        shown = ((f"{group}: {first}", one.maps[first]), ("ball on a loose bed", one.pours[0]))
        for axis, (title, (heights, spacing)) in zip(column[:2], shown, strict=True):
            side = 0.5 * spacing * np.array(heights.shape[::-1])
            image = axis.imshow(
                1e3 * np.nan_to_num(heights),
                origin="lower",
                extent=(-side[0], side[0], -side[1], side[1]),
                vmin=-_COLOURS,
                vmax=_COLOURS,
                cmap="RdBu_r",
            )
            axis.set(title=title, xlim=(-_HALF, _HALF), ylim=(-_HALF, _HALF))
            axis.title.set_fontsize(9)
            axis.set_axis_off()
        for pour in one.pours:
            column[2].plot(*(1e3 * np.array(profile(*pour))), color="C0", lw=0.7, alpha=0.6)
        for name, measured in one.maps.items():
            style = "k--" if name in one.sealed else "k"
            column[2].plot(*(1e3 * np.array(profile(*measured))), style, lw=1)
        column[2].axhline(0, color="0.7", lw=0.8)
        column[2].set(xlabel="radius [mm]", ylabel="mean height [mm]", xlim=(0, 150))
        for style, label in (("k", "fitted"), ("k--", "sealed"), ("C0", "pours at the fit")):
            column[2].plot([], [], style, label=label)
        column[2].legend(fontsize=7)
    assert image is not None
    figure.colorbar(image, ax=axes[:2], label="after less before [mm]", shrink=0.6)
    figure.savefig(path, dpi=62)
    plt.close(figure)
