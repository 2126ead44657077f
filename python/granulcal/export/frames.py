"""A pour over time as files, one a frame, that ParaView and Blender read."""

import json
from pathlib import Path

import numpy as np

from granulcal.export.mark import require_replaceable
from granulcal.export.points import ENDINGS, is_frame, points_text
from granulcal.files import write_beside
from granulcal.pours.scene import Scene
from granulcal.pours.trajectory import Trajectory

__all__ = ["export_frames", "require_frames"]

_SERIES = "frames.vtk.series"


def export_frames(trajectory: Trajectory, kind: str, folder: str | Path) -> list[Path]:
    """Writes the frames of a pour; returns the files.

    `frame-00000.vtk` and so on hold what is in the scene at that time: centres, radii, velocities,
    and the grains' numbers at the start. Beside VTK there is `frames.vtk.series`, which ParaView
    opens as one animation with the times of the pour, and beside the others `times.csv`. Frames of
    an earlier call that this one does not replace are removed.

    Args:
        trajectory: `Pour.trajectory`.
        kind: `vtk`, `ply` or `csv`.
        folder: made if it does not exist.

    Raises:
        ValueError: another format, grains with a shape, or a file stands there that granulcal did
            not export.
    """
    _require_points(kind, has_shape=bool(trajectory.orientations.shape[1]))
    place = Path(folder)
    files = [place / f"frame-{i:05}{ENDINGS[kind]}" for i in range(len(trajectory))]
    if kind != "csv":
        require_replaceable(files)
    place.mkdir(parents=True, exist_ok=True)
    for frame, file in enumerate(files):
        there = np.flatnonzero(np.isfinite(trajectory.positions[frame]).all(axis=1))
        text = points_text(
            kind,
            trajectory.positions[frame, there],
            trajectory.radii[there],
            numbers=there,
            velocities=trajectory.velocities[frame, there],
        )
        write_beside(file, text)
    # Those of a longer pour of before would pass for frames of this one.
    for other in sorted(place.glob(f"frame-*{ENDINGS[kind]}")):
        if other not in files and other.is_file() and is_frame(other):
            other.unlink()
    return [*files, _write_times(place, files, trajectory)]


def require_frames(scene: Scene, kind: str) -> None:
    """Refuses before a pour what `export_frames` would refuse after it.

    Raises:
        ValueError: another format, or grains with a shape.
    """
    _require_points(kind, has_shape="shape" in scene.to_dict()["grains"])


def _require_points(kind: str, *, has_shape: bool) -> None:
    if kind not in ENDINGS:
        raise ValueError(f"frames are written as one of {', '.join(ENDINGS)}, got {kind!r}")
    if has_shape:
        raise ValueError(
            "frames are written of round grains alone: points have no shape; "
            "Trajectory.orientations and Scene.body_vertices have it"
        )


def _write_times(place: Path, files: list[Path], trajectory: Trajectory) -> Path:
    named = list(zip((file.name for file in files), trajectory.times, strict=True))
    if files[0].suffix == ".vtk":
        listed = [{"name": name, "time": round(float(time), 9)} for name, time in named]
        text = json.dumps({"file-series-version": "1.0", "files": listed}, indent=1) + "\n"
        path = place / _SERIES
    else:
        text = "\n".join(["file,time", *(f"{name},{time:.9g}" for name, time in named)]) + "\n"
        path = place / "times.csv"
    write_beside(path, text)
    return path
