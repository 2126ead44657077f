"""Spheres and cylinders out of a slot: rates as ratios."""

from pathlib import Path

import numpy as np

from granulcal.measured import DischargeCurve
from granulcal.pours.scene import Scene
from granulcal.pours.simulate import simulate

__all__ = ["reproduce"]

_HERE = Path(__file__).parent
_CURVES = Path("hopper-discharge") / "hopper_discharge_percent.csv"
_SEED = 1
# Name of the curve, grains that were measured, volume of a grain [mm3]: spheres of 6 mm, cylinders
# of 4 x 8 and 4 x 8.5 mm.
_SERIES = (
    ("plastic_sphere_6mm", 14000, np.pi / 6 * 6.0**3),
    ("plastic_cylinder_4x8mm", 22000, np.pi / 4 * 4.0**2 * 8.0),
    ("wooden_cylinder_4x8p5mm", 20000, np.pi / 4 * 4.0**2 * 8.5),
)
# Simulated rates are those between these shares [%]: what lies beside the slot comes last and
# slowly, and of fewer grains it is a larger share than of the measured ones.
_RANGE = (5.0, 50.0)
# A cylinder is simulated as the sphere of its volume whose rolling friction stands for its shape.
_CYLINDER_ROLLING = 0.3


def reproduce(out_dir: Path, data_dir: Path) -> str:
    """Compares rates of grain volume; returns Markdown."""
    scene = Scene.load(_HERE / "hopper.toml")
    spheres = scene.get("grains.count")
    lines = [
        "## Hopper",
        "",
        "| grains | measured [%/s] | measured [L/s] | ratio to the spheres: %/s, L/s "
        "| simulated [L/s] | ratio to the spheres: L/s |",
        "|---|---|---|---|---|---|",
    ]
    references = None
    percent_reference = DischargeCurve.open(data_dir / _CURVES, _SERIES[0][0]).rate()
    curves = []
    for name, count, volume in _SERIES:
        curve = DischargeCurve.open(data_dir / _CURVES, name)
        measured = 1e-8 * curve.rate() * count * volume
        changes = {"grains.diameter": 1e-3 * (6 / np.pi * volume) ** (1 / 3)}
        if references is not None:
            changes["material.rolling_friction"] = _CYLINDER_ROLLING
        pour = simulate(scene.with_(changes), seed=_SEED)
        time, percent = pour.series("discharged")
        within = (percent >= _RANGE[0]) & (percent <= _RANGE[1])
        slope = np.polyfit(time[within], percent[within], 1)[0]
        simulated = 1e-8 * slope * spheres * volume
        references = references or (measured, simulated)
        lines.append(
            f"| {name} | {curve.rate():.1f} | {measured:.3f} "
            f"| {curve.rate() / percent_reference:.2f}, {measured / references[0]:.2f} "
            f"| {simulated:.3f} | {simulated / references[1]:.2f} |"
        )
        curves.append((name, curve, count * volume, time, percent, spheres * volume))
    _picture(out_dir / "measured-hopper.png", curves)
    return "\n".join(lines)


def _picture(path: Path, curves: list) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axis = plt.subplots(figsize=(6, 4), layout="constrained")
    for index, (name, curve, total, time, percent, simulated) in enumerate(curves):
        colour = f"C{index}"
        axis.plot(curve.time, 1e-8 * curve.percent * total, ".", color=colour, label=name)
        axis.plot(time, 1e-8 * percent * simulated, "-", color=colour)
    axis.set(xlabel="time [s]", ylabel="grains that have run out [L]")
    axis.legend(title="points: measured, lines: simulated", fontsize=8)
    figure.savefig(path, dpi=80)
    plt.close(figure)
