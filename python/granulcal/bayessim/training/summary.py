"""What a training run did, as numbers and in plain words."""

from dataclasses import asdict, dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from granulcal.files import save_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["TrainingSummary"]


@dataclass(frozen=True, kw_only=True)
class TrainingSummary:
    """Counts and losses of one training run.

    Attributes:
        method: how the posterior is made: `stacked`, `emulated`, `distilled`, `mdrff` or `plain`.
        choice: what was chosen by held-out pairs, in words.
        pair_count: pairs given, before any was excluded.
        train_count: pairs that the emulator, or each member of the network, was trained on.
        test_count: pairs of the calibration check.
        excluded: number of pairs left out by reason: `unhealthy`, `jammed`,
            `no_grains_in_view`, `non_finite`, `repeated` and, where the pairs were drawn from
            another proposal, `outside_prior`.
        horizon_count: pairs kept although their simulation ended at its time limit.
        status: of the network: `diverged` if a member never had a finite validation loss,
            `stopped_early` if every member ran out of patience, `epoch_limit`, or `none`.
        validation_count: pairs that decided when each member stopped.
        epoch_count: passes over the pairs until the last member stopped.
        best_epochs: pass whose weights were kept, for each member.
        train_losses: mean negative log density of a member's last pass, standardised [nat].
        validation_losses: lowest validation loss of each member, standardised [nat].
        curve: mean training and validation loss of each pass, standardised [nat].
        fit_seconds: processor time of the whole fit [s].
        notes: what else a reader should know, for example statistics that never changed.
    """

    method: str
    choice: str
    pair_count: int
    train_count: int
    test_count: int
    excluded: dict[str, int]
    horizon_count: int
    status: str = "none"
    validation_count: int = 0
    epoch_count: int = 0
    best_epochs: tuple[int, ...] = ()
    train_losses: tuple[float, ...] = ()
    validation_losses: tuple[float, ...] = ()
    curve: tuple[tuple[float, float], ...] = ()
    fit_seconds: float = float("nan")
    notes: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Returns plain values, for JSON; the time is left out so that equal fits are equal.

        JSON has no NaN or infinity: such losses of a diverged member become None.
        """
        values = asdict(self)
        del values["fit_seconds"]
        for name in ("train_losses", "validation_losses"):
            values[name] = [_finite(loss) for loss in values[name]]
        values["curve"] = [[_finite(loss) for loss in pair] for pair in values["curve"]]
        return values

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> "TrainingSummary":
        """Returns what `as_dict` gave; the time is not known any more."""
        nan = float("nan")
        losses = {
            name: tuple(nan if each is None else each for each in values[name])
            for name in ("train_losses", "validation_losses")
        }
        curve = tuple(
            (nan if a is None else a, nan if b is None else b) for a, b in values["curve"]
        )
        rest = {"best_epochs": tuple(values["best_epochs"]), "notes": tuple(values["notes"])}
        return cls(**{**values, **losses, **rest, "curve": curve})

    def plot(self, path: str | PathLike[str]) -> "Figure | None":
        """Writes the losses of each pass of the network to `path`; nothing without a network."""
        if not self.curve:
            return None
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(5, 3.2), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots()
        training, validation = np.array(self.curve, dtype=float).T
        # As `best_epochs` counts them.
        passes = np.arange(1, len(self.curve) + 1)
        axes.plot(passes, training, label="training")
        axes.plot(passes, validation, label="validation, decides when to stop")
        for number, best in enumerate(self.best_epochs):
            label = "weights kept, by member" if number == 0 else None
            axes.axvline(best, color="0.6", linewidth=0.8, zorder=0, label=label)
        axes.set(xlabel="pass over the pairs", ylabel="mean negative log density [nat]")
        axes.legend(frameon=False)
        save_figure(figure, path, dpi=120)
        return figure

    def __str__(self) -> str:
        """The counts in a few lines."""
        dropped = ", ".join(f"{n} {why}" for why, n in self.excluded.items() if n) or "none"
        lines = [
            f"BayesSim ({self.method}): {self.pair_count} pours, left out: {dropped}; trained on "
            f"{self.train_count}{self._time()}",
            f"  {self.choice}",
        ]
        if self.best_epochs:
            lines.append(
                f"  {len(self.best_epochs)} network(s), {self.epoch_count} passes ({self.status}), "
                f"{self.validation_count} pours decided when to stop"
            )
        if self.horizon_count:
            lines.append(f"  {self.horizon_count} pours ended at the time limit, kept")
        return "\n".join(lines + [f"  note: {note}" for note in self.notes])

    def _time(self) -> str:
        known = np.isfinite(self.fit_seconds)
        return f", {self.fit_seconds:.1f} s of processor time" if known else ""


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
