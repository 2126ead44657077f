"""What a height spills: probabilities with their band, as table, JSON and picture."""

import csv
import io
import json
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granulcal import _native
from granulcal.design.lines import line_of
from granulcal.files import save_figure, write_beside
from granulcal.pours.left_out import LeftOut

__all__ = ["SpillForecast"]

Array = NDArray[np.float64]

_CM = 1e2
# What is nearer to the lowest height than this share of the range may be advised by chance.
_NEAR = 0.1
_ROWS = 9


@dataclass(frozen=True, kw_only=True)
class SpillForecast:
    """P(spilled >= k | height).

    Attributes:
        heights: of the funnel's tip [m], shape (h,).
        grains: numbers k.
        probability: mean over what is believed of material and model, shape (k, h).
        low: lower end of the 90 % band, shape (k, h).
        high: upper end of it, shape (k, h).
        expected: mean number of spilled grains, shape (h,).
        poured_heights: of the pours [m], shape (m,).
        spilled: grains that they spilled, shape (m,).
        total: grains of a pour.
        rho: correlation of two grains of one pour [-]; 0 is a binomial count.
        names: paths of the parameters that were drawn from a posterior.
        unusable: pours besides that could not be used, by why.
    """

    heights: Array
    grains: tuple[int, ...]
    probability: Array
    low: Array
    high: Array
    expected: Array
    poured_heights: Array
    spilled: Array
    total: int
    rho: float
    names: tuple[str, ...]
    unusable: LeftOut

    def highest(self, k: int, at_most: float) -> float | None:
        """Returns the height up to which P(spilled >= k) stays within `at_most` [m], or None.

        Upper ends of the band count, so that what is not known makes the height lower, and the
        probability itself where a few draws lift it above them.
        """
        i = self.grains.index(k)
        within = np.maximum(self.high[i], self.probability[i]) <= at_most
        last = len(within) if within.all() else int(np.argmin(within))
        return float(self.heights[last - 1]) if last else None

    def advice(self, k: int, at_most: float) -> str:
        """Returns in a sentence up to which height k grains are spilled at most that often."""
        top = self.highest(k, at_most)
        wanted = f"P(spilled >= {k}) <= {at_most:g}, at the upper end of the band, too"
        if top is None:
            return f"{wanted}: at no height from {_CM * self.heights[0]:.1f} cm on"
        if top == self.heights[-1]:
            return f"{wanted}: at all heights up to {_CM * top:.1f} cm"
        said = f"{wanted}: up to {_CM * top:.1f} cm"
        if top - self.heights[0] < _NEAR * (self.heights[-1] - self.heights[0]):
            said += ", near the lowest height poured: pours from lower would tell"
        return said

    def save(self, folder: str | PathLike[str], at_most: float | None = None) -> None:
        """Writes spill.csv (one row for each k and height), spill.json and spill.png.

        With `at_most` spill.json has the `highest` height of each k, null where there is none.
        """
        rows = [
            {
                "height": float(height),
                "grains": k,
                "probability": float(self.probability[i, j]),
                "low": float(self.low[i, j]),
                "high": float(self.high[i, j]),
            }
            for i, k in enumerate(self.grains)
            for j, height in enumerate(self.heights)
        ]
        text = io.StringIO()
        writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        write_beside(Path(folder) / "spill.csv", text.getvalue())
        document = {
            "granulcal": _native.__version__,
            "unit": "m",
            "total": self.total,
            "pours": len(self.spilled),
            "unusable": self.unusable.to_dict(),
            "correlation": self.rho,
            "drawn": list(self.names),
            "heights": self.heights.tolist(),
            "expected": self.expected.tolist(),
            "probabilities": [
                {
                    "grains": k,
                    "probability": self.probability[i].tolist(),
                    "interval90": [self.low[i].tolist(), self.high[i].tolist()],
                    **({} if at_most is None else {"highest": self.highest(k, at_most)}),
                }
                for i, k in enumerate(self.grains)
            ],
        }
        if at_most is not None:
            document["at_most"] = at_most
        write_beside(Path(folder) / "spill.json", json.dumps(document, indent=1) + "\n")
        self.plot(Path(folder) / "spill.png")

    def plot(self, path: str | PathLike[str]) -> None:
        """Writes a PNG: the pours with the expected number, and the probabilities."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(11, 4.5), layout="constrained")
        FigureCanvasAgg(figure)
        counts, chances = figure.subplots(1, 2)
        counts.plot(_CM * self.poured_heights, self.spilled, ".", color="#5b5b5b", label="pours")
        counts.plot(_CM * self.heights, self.expected, color="#b3202a", label="expected")
        counts.set(xlabel="height of the funnel [cm]", ylabel=f"spilled grains of {self.total}")
        counts.legend()
        for i, k in enumerate(self.grains):
            colour, style = line_of(i)
            heights, curve = _CM * self.heights, self.probability[i]
            chances.fill_between(heights, self.low[i], self.high[i], color=colour, alpha=0.25)
            chances.plot(heights, curve, color=colour, linestyle=style, label=f"at least {k}")
        chances.set(xlabel="height of the funnel [cm]", ylabel="probability", ylim=(-0.02, 1.02))
        # Beside the curves, which may be anywhere between 0 and 1.
        figure.legend(
            *chances.get_legend_handles_labels(),
            loc="outside right center",
            title="spilled grains;\n90 % band",
        )
        save_figure(figure, path, dpi=90)

    def __str__(self) -> str:
        """A table of some heights."""
        known = (
            f"{', '.join(self.names)} drawn from a posterior" if self.names else "material known"
        )
        lines = [
            f"{len(self.spilled)} pours of {self.total} grains (besides, not usable: "
            f"{self.unusable}), {known}; correlation of two grains {self.rho:.2g}",
            f"{'height [cm]':>12}{'expected':>10}"
            + "".join(f"{f'P(>= {k})':>24}" for k in self.grains),
        ]
        for j in np.linspace(0, len(self.heights) - 1, _ROWS).astype(int):
            cells = [
                f"{p[j]:.3f} ({low[j]:.3f} to {high[j]:.3f})"
                for p, low, high in zip(self.probability, self.low, self.high, strict=True)
            ]
            lines.append(
                f"{_CM * self.heights[j]:>12.1f}{self.expected[j]:>10.1f}"
                + "".join(f"{cell:>24}" for cell in cells)
            )
        return "\n".join(lines)
