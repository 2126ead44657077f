"""Spheres and cylinders out of a slot: rates as ratios, cylinders as spheres and as cylinders."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granulcal.measured import DischargeCurve
from granulcal.pours.scene import Scene
from granulcal.pours.simulate import simulate

__all__ = ["reproduce"]

_HERE = Path(__file__).parent
_CURVES = Path("hopper-discharge") / "hopper_discharge_percent.csv"
_SEED = 1
# Simulated rates are those between these shares [%]: what lies beside the slot comes last and
# slowly, and of fewer grains it is a larger share than of the measured ones.
_RANGE = (5.0, 50.0)
# The rolling friction that stands for the shape of a sphere of a cylinder's volume.
_CYLINDER_ROLLING = 0.3
_AS_SPHERES = "spheres of their volume"


@dataclass(frozen=True)
class _Series:
    """Grains whose discharge was measured.

    Attributes:
        name: of the curve.
        count: of the measured grains.
        diameter: of spheres and cylinders [mm].
        length: of cylinders [mm]; 0: spheres.
    """

    name: str
    count: int
    diameter: float
    length: float = 0.0

    @property
    def volume(self) -> float:
        """Of a grain [mm3]."""
        if self.length:
            return np.pi / 4 * self.diameter**2 * self.length
        return np.pi / 6 * self.diameter**3

    def scenes(self) -> dict[str, Scene]:
        """Returns what stands for the grains."""
        round_one = Scene.load(_HERE / "hopper.toml")
        if not self.length:
            return {"spheres": round_one.with_({"grains.diameter": 1e-3 * self.diameter})}
        as_wide = 1e-3 * (6 / np.pi * self.volume) ** (1 / 3)
        as_sphere = {"grains.diameter": as_wide, "material.rolling_friction": _CYLINDER_ROLLING}
        aspect = self.length / self.diameter
        shaped = Scene.load(_HERE / "hopper_cylinders.toml").with_({"grains.shape.aspect": aspect})
        return {_AS_SPHERES: round_one.with_(as_sphere), "cylinders": shaped}


_SERIES = (
    _Series("plastic_sphere_6mm", 14000, 6.0),
    _Series("plastic_cylinder_4x8mm", 22000, 4.0, 8.0),
    _Series("wooden_cylinder_4x8p5mm", 20000, 4.0, 8.5),
)


@dataclass(frozen=True)
class _Curve:
    """What has run out [L] against the time since the gate was drawn [s]."""

    label: str
    time: NDArray[np.float64]
    volume: NDArray[np.float64]


def reproduce(out_dir: Path, data_dir: Path) -> str:
    """Compares rates of grain volume; returns Markdown."""
    lines = [
        "## Hopper",
        "",
        "| grains | measured [%/s] | measured [L/s] | ratio to the spheres: %/s, L/s "
        "| simulated as | simulated [L/s] | ratio to the spheres: L/s |",
        "|---|---|---|---|---|---|---|",
    ]
    references = None
    percent_reference = DischargeCurve.open(data_dir / _CURVES, _SERIES[0].name).rate()
    curves = []
    for series in _SERIES:
        curve = DischargeCurve.open(data_dir / _CURVES, series.name)
        measured = 1e-8 * curve.rate() * series.count * series.volume
        simulated = []
        for label, scene in series.scenes().items():
            rate, found = _simulated(label, scene, series.volume)
            references = references or (measured, rate)
            lines.append(
                f"| {series.name} | {curve.rate():.1f} | {measured:.3f} "
                f"| {curve.rate() / percent_reference:.2f}, {measured / references[0]:.2f} "
                f"| {label} | {rate:.3f} | {rate / references[1]:.2f} |"
            )
            simulated.append(found)
        total = 1e-8 * series.count * series.volume
        curves.append((_Curve(series.name, curve.time, total * curve.percent), simulated))
    _picture(out_dir / "measured-hopper.png", curves)
    return "\n".join(lines)


def _simulated(label: str, scene: Scene, volume: float) -> tuple[float, _Curve]:
    """The rate [L/s] of a pour of grains of a volume [mm3], and its curve."""
    time, percent = simulate(scene, seed=_SEED).series("discharged")
    within = (percent >= _RANGE[0]) & (percent <= _RANGE[1])
    total = 1e-8 * scene.get("grains.count") * volume
    rate = total * np.polyfit(time[within], percent[within], 1)[0]
    return rate, _Curve(label, time - time[0], total * percent)


def _picture(path: Path, curves: list[tuple[_Curve, list[_Curve]]]) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axis = plt.subplots(figsize=(6, 4), layout="constrained")
    for index, (measured, simulated) in enumerate(curves):
        colour = f"C{index}"
        axis.plot(measured.time, measured.volume, ".", color=colour, label=measured.label)
        for found in simulated:
            style = ":" if found.label == _AS_SPHERES else "-"
            axis.plot(found.time, found.volume, style, color=colour)
    axis.set(xlabel="time [s]", ylabel="grains that have run out [L]")
    title = f"points: measured, lines: simulated,\ndotted: as {_AS_SPHERES}"
    axis.legend(title=title, fontsize=8)
    figure.savefig(path, dpi=80)
    plt.close(figure)
