"""Recordings of a pour whose material is known, as cameras' software would have written them."""

import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from granulcal.documents import (
    LARGEST_DOCUMENT,
    Number,
    Table,
    Whole,
    check,
    parse_toml,
    read_bytes,
)
from granulcal.measured.ros_files import DepthFrame, write_bag, write_mcap
from granulcal.pours.camera import Camera
from granulcal.pours.scene import Material, Scene
from granulcal.pours.simulate import simulate
from granulcal.starter.truth import require_own, write_truth

__all__ = ["HIDDEN", "Samples", "write_samples"]

HIDDEN = Material(sliding_friction=0.35, rolling_friction=0.08, restitution=0.4)
"""The material of the samples, unless another is asked for."""
_SEED = 20_231
_FRAMES, _FEW_FRAMES = 10, 4
_FRAME_NS = 33_333_333
_START_NS = 1_700_000_000_000_000_000
_TILT_DEG = (1.5, -1.0)
_DEPTH_UNIT = 1e-4
_PIXELS, _LENGTH = Whole(1, 10_000), Number(0, 1e6)
_LENS = Table(
    {
        "width": _PIXELS,
        "height": _PIXELS,
        "fx": _LENGTH,
        "fy": _LENGTH,
        "cx": _LENGTH,
        "cy": _LENGTH,
    },
    open=True,
)

_PNG, _MESSAGES = "couscous.png", ("couscous.bag", "wall.bag", "couscous.mcap")

SENSOR = """\
# The camera of the sample recordings: a stereo camera with a baseline of 5 cm, its errors in px of disparity.
[camera.sensor]
kind = "stereo"
focal_length = {focal:.6g}
baseline = 0.05
depth_unit = {unit:g}
pattern_seed = 435

[camera.sensor.noise]
white = 0.02
correlated = 0.03
correlation_x = 3.0
correlation_y = 3.0

[camera.sensor.fixed_pattern]
broad = 0.02
broad_x = 14.0
broad_y = 14.0
"""


@dataclass(frozen=True)
class Samples:
    """What was written.

    Attributes:
        paths: the recordings.
        missing: recordings that need rosbags, which is not installed.
    """

    paths: tuple[Path, ...]
    missing: tuple[Path, ...]


@dataclass(frozen=True)
class _Studio:
    """A camera with the sensor of the samples over a table."""

    camera: Camera
    lens: dict[str, float]
    sensor: Path

    def frame(self, grains: tuple[np.ndarray, np.ndarray], seed: int, index: int) -> DepthFrame:
        depth = self.camera.render(*grains, sensor=self.sensor, seed=seed + index)
        return DepthFrame(depth, _START_NS + index * _FRAME_NS)

    def frames(self, grains: tuple[np.ndarray, np.ndarray], seed: int) -> Iterator[DepthFrame]:
        return (self.frame(grains, seed, index) for index in range(_FRAMES))

    def mean(self, grains: tuple[np.ndarray, np.ndarray], seed: int) -> np.ndarray:
        """Returns the mean of a few frames, of each pixel over those that have data there [m]."""
        frames = np.stack([self.frame(grains, seed, i).depth for i in range(_FEW_FRAMES)])
        seen = (frames > 0).sum(axis=0)
        return np.where(seen > 0, frames.sum(axis=0) / np.maximum(seen, 1), 0.0)


def write_samples(
    folder: Path,
    *,
    material: Material = HIDDEN,
    seed: int = _SEED,
    conditions: Mapping[str, Mapping[str, float]] | None = None,
    pours: int = 2,
) -> Samples:
    """Pours a material in the folder's scene and records it with the folder's camera.

    Written: couscous.bag (RealSense viewer, ten frames), couscous.mcap (ROS 2, ten frames),
    couscous.png (mean of four frames), wall.bag (the empty table, for `fit-sensor`), pours/NAME-i.png (each
    condition), truth.json (the material). The camera is tilted by 1.5 and -1 degrees and has the
    noise and the fixed pattern of a stereo camera.

    Args:
        folder: with scene.toml and camera.toml, as `granulcal init` writes them.
        material: what is poured; a recording that knows its truth.
        seed: of the pours and of the noise.
        conditions: numbers of the scene of further pours, by name.
        pours: of each condition.

    Raises:
        FileNotFoundError: the folder has no scene.toml or camera.toml.
        ValueError: a recording stands there that this did not write, or that was changed.
    """
    targets = [folder / name for name in (_PNG, *_MESSAGES)]
    targets += [_of_condition(folder, name, i) for name in conditions or {} for i in range(pours)]
    require_own(folder, targets)
    scene = Scene.load(folder / "scene.toml").with_material(material)
    path = folder / "camera.toml"
    lens = parse_toml(read_bytes(path, most=LARGEST_DOCUMENT), path)
    check(lens, _LENS, path)
    height = scene.get("camera.height")
    camera = Camera.load(folder / "camera.toml", height=height)
    with tempfile.TemporaryDirectory(prefix="granulcal-sample-") as place:
        sensor = Path(place) / "sensor.toml"
        sensor.write_text(SENSOR.format(focal=lens["fx"], unit=_DEPTH_UNIT), encoding="utf-8")
        studio = _Studio(camera.tilted(x_deg=_TILT_DEG[0], y_deg=_TILT_DEG[1]), lens, sensor)
        try:
            return _write(folder, scene, studio, seed, conditions or {}, pours)
        finally:
            # What a full disk has stopped can be made again.
            there = [path for path in targets if path.exists()]
            write_truth(folder, scene.material.values(), seed, there)


def _write(
    folder: Path,
    scene: Scene,
    studio: _Studio,
    seed: int,
    conditions: Mapping[str, Mapping[str, float]],
    pours: int,
) -> Samples:
    grains = _poured(scene, seed)
    nothing = (np.zeros((0, 3)), np.zeros(0))
    written = [folder / _PNG]
    _save_png(studio, grains, seed, written[0])
    for name, at in conditions.items():
        for i in range(pours):
            path = _of_condition(folder, name, i)
            path.parent.mkdir(exist_ok=True)
            own = seed + 1000 * (i + 1)
            _save_png(studio, _poured(scene.with_(at), own), own, path)
            written.append(path)
    missing = []
    for name, seen in zip(_MESSAGES, (grains, nothing, grains), strict=True):
        path, frames = folder / name, studio.frames(seen, seed + len(name))
        try:
            if path.suffix == ".bag":
                write_bag(path, frames, studio.lens, depth_unit=_DEPTH_UNIT, replace=True)
            else:
                write_mcap(path, frames, studio.lens, replace=True)
        except ModuleNotFoundError:
            missing.append(path)
            continue
        written.append(path)
    return Samples(tuple(written), tuple(missing))


def _of_condition(folder: Path, name: str, i: int) -> Path:
    return folder / "pours" / f"{name}-{i}.png"


def _poured(scene: Scene, seed: int) -> tuple[np.ndarray, np.ndarray]:
    pour = simulate(scene, seed=seed)
    return pour.positions, pour.radii


def _save_png(
    studio: _Studio, grains: tuple[np.ndarray, np.ndarray], seed: int, path: Path
) -> None:
    depth = studio.mean(grains, seed).astype(np.float32)
    lens = path.with_suffix(".lens")
    studio.camera.save(depth, path, lens, depth_unit=_DEPTH_UNIT)
    # The folder's camera.toml says the same, and how the image is segmented.
    lens.unlink()
