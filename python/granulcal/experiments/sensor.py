"""Sensor models fitted to measured flat frames, and compared with frames that the fit did not see.

A RealSense D435 on a wall and on boards (`realsense-d435-frames`), and a Kinect v2 on sixteen flat
beds (`granular-impact-kinect`, `plane_*`). The parts of a frame, or the maps, on which a model is
fitted are never those on which it is judged.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal import _native
from granulcal.files import write_beside, write_toml

__all__ = ["SURFACES", "Judged", "Surface", "fit_surface", "reproduce", "write_d435_camera"]

Array = NDArray[np.float64]

_D435 = Path("realsense-d435-frames")
_KINECT = Path("granular-impact-kinect") / "data"
_BAR = 0.15
# The D435's noise is "correlated over some 10 px"; beyond twice that chance rules.
_NEAR_LAG, _FAR_LAG = 10, 20


@dataclass(frozen=True, kw_only=True)
class Surface:
    """A flat surface, where a model is fitted to it and where it is judged.

    Attributes:
        title: what it is.
        fit: names of the frames of the fit.
        check: names of the frames of the judgement; empty for those of the fit.
        fit_regions: parts of those frames, `X,Y,WIDTH,HEIGHT`.
        check_regions: parts of the other frames.
        options: further options of `fit-sensor`.
    """

    title: str
    fit: tuple[str, ...]
    check: tuple[str, ...] = ()
    fit_regions: tuple[str, ...]
    check_regions: tuple[str, ...]
    options: tuple[str, ...] = ()


_FRAMES = ("depth0.png", "depth1.png")
_PLANES = [f"plane_{i}.npz" for i in range(1, 17)]
_MAP_REGION = ("12,12,133,133",)

SURFACES = {
    # Tiles like a chessboard's: the noise of the wall changes by a fifth from one part of it to
    # another, that of the boards by a third.
    "wall": Surface(
        title="D435, wall at 1.7 m",
        fit=_FRAMES,
        fit_regions=("30,10,100,145", "130,155,100,145"),
        check_regions=("130,10,100,145", "30,155,100,145"),
    ),
    "board": Surface(
        title="D435, boards at 0.4 to 0.7 m",
        fit=_FRAMES,
        fit_regions=("530,245,76,57", "530,359,76,57", "460,10,65,50", "525,60,65,50"),
        check_regions=("530,302,76,57", "530,416,76,57", "525,10,65,50", "460,60,65,50"),
    ),
    "kinect": Surface(
        title="Kinect v2, flat beds",
        fit=tuple(_PLANES[::2]),
        check=tuple(_PLANES[1::2]),
        fit_regions=_MAP_REGION,
        check_regions=_MAP_REGION,
        options=("--max-shift", "8"),
    ),
}
"""What is fitted and judged, by name."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Judged:
    """A fitted model beside the frames that it did not see.

    Attributes:
        report: what `fit-sensor --report` wrote.
        ratio: standard deviation of the model over the measured one.
        near: largest difference of the correlations up to 10 px.
        far: the same up to 20 px.
        half: lags at which the correlations fall to a half [px]: measured and model along x, then
            along y.
        chance: standard deviation that chance alone gives the ratio.
    """

    report: dict[str, Any]
    ratio: float
    near: float
    far: float
    half: tuple[float, float, float, float]
    chance: float


def write_d435_camera(out_dir: Path, data_dir: Path) -> tuple[Path, float]:
    """Writes the D435's camera as TOML; returns its path and the baseline [m]."""
    facts = json.loads((data_dir / _D435 / "camera.json").read_text(encoding="utf-8"))
    lens = facts["depth"]
    path = out_dir / "d435.toml"
    write_toml(
        path,
        f"width = {facts['width']}\nheight = {facts['height']}\n"
        f"fx = {lens['fx']}\nfy = {lens['fy']}\ncx = {lens['cx']}\ncy = {lens['cy']}\n"
        f"depth_unit = {lens['units_m']}\n",
    )
    return path, lens["stereo_baseline_mm"] / 1000


def fit_surface(name: str, out_dir: Path, data_dir: Path, *, sessions: int = 24) -> Judged:
    """Fits one of `SURFACES` and judges it; writes `NAME.toml` and `NAME.json` to `out_dir`.

    Raises:
        RuntimeError: the command failed; it said why.
    """
    surface = SURFACES[name]
    is_kinect = name == "kinect"
    folder = data_dir / (_KINECT if is_kinect else _D435)
    words = ["fit-sensor", *(str(folder / frame) for frame in surface.fit)]
    if not is_kinect:
        camera, baseline = write_d435_camera(out_dir, data_dir)
        words += ["--camera", str(camera), "--baseline", str(baseline)]
    for option, regions in [
        ("--region", surface.fit_regions),
        ("--check-region", surface.check_regions),
    ]:
        words += [word for region in regions for word in (option, region)]
    if surface.check:
        words += ["--check", *(str(folder / frame) for frame in surface.check)]
    report = out_dir / f"{name}.json"
    words += [*surface.options, "--sessions", str(sessions), "--report", str(report)]
    words += ["--out", str(out_dir / f"{name}.toml")]
    if _native.run_cli(["granulcal", *words]) != 0:
        raise RuntimeError(f"fit-sensor failed on {name}: granulcal {' '.join(words)}")
    return judge(json.loads(report.read_text(encoding="utf-8")))


def judge(report: dict[str, Any]) -> Judged:
    """Returns the judgement of a report on the frames that the fit did not see."""
    covariances = report["check"]["covariances"]
    measured, model = _total(covariances["measured"]), _total(covariances["model"])
    spread = _total(covariances["spread"], squares=True)
    ratio = float(np.sqrt(model[0, 0] / measured[0, 0]))
    off = np.abs(measured / measured[0, 0] - model / model[0, 0])
    half = [_half_lag(values) for axis in (0, 1) for values in (measured[axis], model[axis])]
    return Judged(
        report=report,
        ratio=ratio,
        near=float(off[:, : _NEAR_LAG + 1].max()),
        far=float(off[:, : _FAR_LAG + 1].max()),
        half=(half[0], half[1], half[2], half[3]),
        chance=float(0.5 * spread[0, 0] / model[0, 0]),
    )


def reproduce(out_dir: Path, data_dir: Path) -> dict[str, Judged]:
    """Fits and judges every surface; writes sensors, `results.md` and `sensor.png` to `out_dir`."""
    out_dir.mkdir(parents=True, exist_ok=True)
    judged = {}
    for name, surface in SURFACES.items():
        print(f"{name}: {surface.title}", flush=True)
        judged[name] = fit_surface(name, out_dir, data_dir)
        print(flush=True)
    write_beside(out_dir / "results.md", _table(judged))
    _plot(out_dir / "sensor.png", judged)
    print(f"sensors, table and picture in {out_dir}")
    return judged


def _total(split: dict[str, Any], *, squares: bool = False) -> Array:
    """Covariances of a single frame along x and y, shape (2, lags); spreads add in squares."""
    parts = [
        np.array([split[part][axis] for axis in ("x", "y")]) for part in ("noise", "fixed_pattern")
    ]
    return np.hypot(*parts) if squares else parts[0] + parts[1]


def _half_lag(covariances: Array) -> float:
    """Lag at which a correlation first falls below a half [px]."""
    correlation = covariances / covariances[0]
    below = np.flatnonzero(correlation < 0.5)
    if below.size == 0:
        return float("inf")
    after = int(below[0])
    high, low = correlation[after - 1], correlation[after]
    return after - 1 + float((high - 0.5) / (high - low))


def _table(judged: dict[str, Judged]) -> str:
    lines = [
        "| surface | sd measured | sd model | model/measured | chance | largest difference of the "
        "correlation to 10 px | to 20 px | half-lag x: measured, model | half-lag y: measured, "
        "model | within 15 % |",
        "|---" * 10 + "|",
    ]
    for name, found in judged.items():
        check = found.report["check"]
        scale, unit = (1.0, "px") if check["covariances"]["unit"] == "px" else (1e3, "mm")
        passes = abs(found.ratio - 1) <= _BAR and found.near <= _BAR
        cells = [
            SURFACES[name].title,
            f"{scale * check['sd_measured']:.4f} {unit}",
            f"{scale * check['sd_model']:.4f} {unit}",
            f"{found.ratio:.3f}",
            f"± {found.chance:.3f}",
            f"{found.near:.3f}",
            f"{found.far:.3f}",
            f"{found.half[0]:.1f}, {found.half[1]:.1f} px",
            f"{found.half[2]:.1f}, {found.half[3]:.1f} px",
            "yes" if passes else "no",
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _plot(path: Path, judged: dict[str, Judged]) -> None:
    """Draws the autocorrelations of every surface, measured and of the model, along x and y."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    columns = len(judged)
    figure, axes = plt.subplots(
        2, columns, figsize=(3.6 * columns, 5.2), sharey=True, layout="constrained", squeeze=False
    )
    for column, (name, found) in enumerate(judged.items()):
        covariances = found.report["check"]["covariances"]
        measured, model = _total(covariances["measured"]), _total(covariances["model"])
        spread = _total(covariances["spread"], squares=True)
        for row, label in enumerate(("along the rows", "along the columns")):
            axis = axes[row, column]
            lags = np.arange(measured.shape[1])
            middle, width = model[row] / model[0, 0], spread[row] / model[0, 0]
            axis.fill_between(
                lags, middle - width, middle + width, color="#f2a65a", alpha=0.35, lw=0,
                label="model, ± what chance does",
            )  # fmt: skip
            axis.plot(lags, middle, color="#d95f02", label="model")
            seen = measured[row] / measured[0, 0]
            axis.plot(lags, seen, "k.", ms=5, label="measured, not fitted")
            axis.axhline(0, color="0.7", lw=0.6)
            axis.set_xlabel(f"lag {label} [px]")
            if row == 0:
                axis.set_title(SURFACES[name].title, fontsize=10)
    for row in (0, 1):
        axes[row, 0].set_ylabel("autocorrelation")
    axes[0, 0].legend(fontsize=8, frameon=False)
    figure.savefig(path, dpi=110)
    plt.close(figure)
