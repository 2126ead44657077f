"""The collapse of a column of 4 mm glass beads in water at 1 g, simulated dry."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granulcal.measured import RunOut
from granulcal.pours.scene import Scene
from granulcal.pours.simulate import simulate

__all__ = ["compare", "reproduce"]

_HERE = Path(__file__).parent
_FOLDER = Path("column-collapse-webb") / "runout"
_TESTS = ("20210420_04g_010w_050_050_001", "20210816_04g_010w_050_050_001")
# Glass on glass in the literature lies between these; nothing is fitted.
_FRICTIONS = (0.2, 0.3, 0.5)
_SEED = 1

Array = NDArray[np.float64]


def compare(
    time: Array, radius: Array, measured_time: Array, measured: Array, *, shift: float
) -> tuple[float, float]:
    """Returns rms and mean of simulated less measured front radius [m], at the measured frames.

    Args:
        time: times of the simulated front, after the tube began to rise [s], shape (n,).
        radius: simulated front [m], shape (n,).
        measured_time: times of the measured front [s], shape (m,).
        measured: measured front [m], shape (m,); NaN is left out.
        shift: what is added to the measured times [s].
    """
    known = np.isfinite(measured) & (measured_time + shift <= time[-1])
    simulated = np.interp(measured_time[known] + shift, time, radius)
    off = simulated - measured[known]
    return float(np.sqrt(np.mean(off**2))), float(np.mean(off))


def first_passage(time: Array, radius: Array, at: float) -> float:
    """Returns when the front first reaches the radius `at` [s]; NaN if it never does."""
    beyond = np.flatnonzero(radius >= at)
    if len(beyond) == 0 or beyond[0] == 0:
        return float("nan")
    last = beyond[0]
    share = (at - radius[last - 1]) / (radius[last] - radius[last - 1])
    return float(time[last - 1] + share * (time[last] - time[last - 1]))


def reproduce(out_dir: Path, data_dir: Path) -> str:
    """Compares fronts against time; returns Markdown."""
    scene = Scene.load(_HERE / "column.toml")
    measured = {name: RunOut.open(data_dir / _FOLDER / f"{name}.txt") for name in _TESTS}
    lines = [
        "## Column",
        "",
        "| sliding friction | test | rms, from the tube's start [mm] | mean "
        "| shift [ms] | rms, fronts met [mm] | mean | end: simulated, measured [mm] |",
        "|---|---|---|---|---|---|---|---|",
    ]
    fronts = {}
    for friction in _FRICTIONS:
        pour = simulate(scene.with_({"material.sliding_friction": friction}), seed=_SEED)
        time, radius = pour.series("front_radius")
        fronts[friction] = time, radius
        for name, run_out in measured.items():
            front = run_out.front_radius()
            first = np.flatnonzero(np.isfinite(front))[0]
            begin = float(run_out.time[first])
            shift = first_passage(time, radius, float(front[first])) - begin
            plain = compare(time, radius, run_out.time, front, shift=0.0)
            met = compare(time, radius, run_out.time, front, shift=shift)
            end = front[np.isfinite(front)][-8:].mean()
            lines.append(
                f"| {friction} | {name[:12]} | {1e3 * plain[0]:.1f} | {1e3 * plain[1]:+.1f} "
                f"| {1e3 * shift:.0f} | {1e3 * met[0]:.1f} | {1e3 * met[1]:+.1f} "
                f"| {1e3 * radius[-1]:.0f}, {1e3 * end:.0f} |"
            )
    _picture(out_dir / "measured-column.png", fronts, measured)
    return "\n".join(lines)


def _picture(
    path: Path, fronts: dict[float, tuple[Array, Array]], measured: dict[str, RunOut]
) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axis = plt.subplots(figsize=(6, 4), layout="constrained")
    for name, run_out in measured.items():
        axis.plot(run_out.time, 1e3 * run_out.front_radius(), ".", ms=3, label=f"in water, {name}")
    for friction, (time, radius) in fronts.items():
        axis.plot(time, 1e3 * radius, label=f"simulated dry, sliding friction {friction}")
    axis.set(xlabel="time [s]", ylabel="front radius [mm]")
    axis.legend(fontsize=7)
    figure.savefig(path, dpi=80)
    plt.close(figure)
