"""Every measured image through one segmentation: ground, noise, mask, kind, volume, statistics.

57 height maps of a Kinect v2 rig (`granular-impact-kinect`), five frames of a sand-box
(`ar-sandbox-kinect`), two frames of a RealSense D435 (`realsense-d435-frames`). What is set
belongs to a rig, never to a file: lens, unit and scale, and a border for the dead edge of the
Kinect's maps.
"""

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from granulcal.arrays import read_array
from granulcal.experiments.sensor import write_d435_camera
from granulcal.files import write_beside, write_toml
from granulcal.measured.recording import Formation, Levelled, Recording
from granulcal.measured.segmentation import SegmentationSettings

__all__ = ["Rig", "Seen", "images", "reproduce", "see"]

_KINECT = Path("granular-impact-kinect")
_SANDBOX = Path("ar-sandbox-kinect") / "raw"
_D435 = Path("realsense-d435-frames")
_KINDS = {"compacted": "pile", "fluidized": "ring", "plane": "flat"}

# Kinect v2, nominal: f about 365 px, principal point about (256, 212), depth in mm.
_KINECT_V2 = {"width": 512, "height": 424, "fx": 365.0, "fy": 365.0, "cx": 256.0, "cy": 212.0}
# The sand-box's own crop of it, about the middle.
_CROP = {**_KINECT_V2, "width": 273, "height": 212, "cx": 136.0, "cy": 105.5}
# Ground of a pixel of that crop by the sand-box's own calibration: 1000 x 800 mm over 267 x 203 px.
_CROP_RESOLUTION_MM = 3.85


@dataclass(frozen=True, kw_only=True)
class Rig:
    """What is known of the camera or rig that took images; the same for all of its files.

    Attributes:
        title: what it is called in the table.
        options: options of `Recording.level` and `Recording.formation`.
    """

    title: str
    options: SegmentationSettings


_RIGS = {
    "kinect": Rig(title="Kinect v2 maps", options={"border_px": 6}),
    "sandbox": Rig(title="sand-box, Kinect v2", options={}),
    "sandbox crop": Rig(title="sand-box, Kinect v2, cropped", options={"border_px": 12}),
    "d435": Rig(title="D435", options={}),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Seen:
    """What the segmentation saw in one image.

    Attributes:
        name: name of the image.
        rig: the rig's name.
        label: `pile`, `ring` or `flat` where the data say so.
        levelled: ground, heights, mask.
        formation: the formation, None on a flat bed.
        volume_reference: volume that stands beside the data [m^3], NaN where none does.
    """

    name: str
    rig: str
    label: str | None
    levelled: Levelled
    formation: Formation | None
    volume_reference: float

    @property
    def kind(self) -> str:
        """What was found: `pile`, `ring` or `flat`."""
        return "flat" if self.formation is None else self.formation.kind


def images(out_dir: Path, data_dir: Path) -> Iterator[tuple[str, str, str | None, Recording]]:
    """Yields rig, name, label and recording of every measured image.

    Raw arrays of the sand-box are first written as a camera would, into `out_dir`.
    """
    maps = sorted((data_dir / _KINECT / "data").glob("*.npz"), key=_by_number)
    for path in maps:
        yield "kinect", path.stem, _KINDS[path.stem.partition("_")[0]], Recording.open(path)
    for rig, name, image, camera in _sandbox(out_dir, data_dir / _SANDBOX):
        yield rig, name, None, Recording.open(image, camera=camera)
    camera, _ = write_d435_camera(out_dir, data_dir)
    for name in ("depth0", "depth1"):
        path = data_dir / _D435 / f"{name}.png"
        yield "d435", name, None, Recording.open(path, camera=camera)


def see(rig: str, name: str, label: str | None, recording: Recording, volume: float) -> Seen:
    """Returns what the segmentation sees in a recording with what is known of its rig."""
    options = _RIGS[rig].options
    levelled = recording.level(**options)
    formation = recording.formation(**options) if levelled.mask.any() else None
    return Seen(
        name=name,
        rig=rig,
        label=label,
        levelled=levelled,
        formation=formation,
        volume_reference=volume,
    )


def reproduce(out_dir: Path, data_dir: Path) -> list[Seen]:
    """Segments every image; writes table, statistics and contact sheets to `out_dir`."""
    out_dir.mkdir(parents=True, exist_ok=True)
    volumes = reference_volumes(data_dir)
    seen = []
    for rig, name, label, recording in images(out_dir, data_dir):
        seen.append(see(rig, name, label, recording, volumes.get(name, float("nan"))))
        print(_row(seen[-1]), flush=True)
    write_beside(out_dir / "results.md", _table(seen))
    _write_statistics(out_dir / "statistics.csv", seen)
    formations = [each for each in seen if each.label in ("pile", "ring")]
    others = [each for each in seen if each not in formations]
    _sheet(out_dir / "formations.png", formations, columns=9)
    _sheet(out_dir / "others.png", others, columns=8)
    print(f"table, statistics and contact sheets in {out_dir}")
    return seen


def reference_volumes(data_dir: Path) -> dict[str, float]:
    """Returns the volumes above the bed that stand beside the maps [m^3], by name."""
    path = data_dir / _KINECT / "derived_summary.csv"
    with path.open(newline="", encoding="utf-8") as table:
        rows = csv.DictReader(table)
        return {Path(r["file"]).stem: 1e-6 * float(r["volume_above_bed_cm3"]) for r in rows}


def _by_number(path: Path) -> tuple[str, int]:
    word, _, number = path.stem.rpartition("_")
    return word, int(number)


def _sandbox(out_dir: Path, folder: Path) -> Iterator[tuple[str, str, Path, Path | None]]:
    """Yields rig, name, file and camera of the sand-box's frames, as 16-bit PNG or height map."""
    from PIL import Image

    for camera, lens in [("kinect_v2", _KINECT_V2), ("kinect_v2_crop", _CROP)]:
        text = "".join(f"{key} = {value}\n" for key, value in lens.items())
        write_toml(out_dir / f"{camera}.toml", text + "depth_unit = 0.0001\n")
    for rig, name, camera in [
        ("sandbox", "depth_raw_a", "kinect_v2"),
        ("sandbox", "depth_raw_b", "kinect_v2"),
        ("sandbox crop", "frame_cropped", "kinect_v2_crop"),
    ]:
        millimetres = read_array(folder / f"{name}.npy")
        tenths = np.where(millimetres < 6500, 10 * millimetres, 0).round().astype(np.uint16)
        path = out_dir / f"{name}.png"
        Image.fromarray(tenths).save(path)
        yield rig, name, path, out_dir / f"{camera}.toml"
    for name in ("topo_cone", "topo_ring"):
        path = out_dir / f"{name}.npz"
        heights, side = read_array(folder / f"{name}.npy"), _CROP_RESOLUTION_MM
        np.savez(path, depthmap=heights, scale="mm", xres=side, yres=side, zres=1.0)
        yield "sandbox crop", name, path, None


def _row(seen: Seen) -> str:
    """One line of the table, in millimetres and cubic centimetres."""
    plane, levelled, formation = seen.levelled.plane, seen.levelled, seen.formation
    volume = radius = top = spread = "-"
    if formation is not None:
        statistics = formation.statistics()
        volume = f"{1e6 * formation.volume:.1f}"
        if seen.label == "pile":
            volume += f" ({100 * (formation.volume / seen.volume_reference - 1):+.1f} %)"
        radius = f"{1e3 * formation.half_volume_radius:.0f}"
        top, spread = f"{1e3 * statistics['max_z']:.1f}", f"{1e3 * statistics['sd_r']:.1f}"
    verdict = seen.kind if seen.label in (None, seen.kind) else f"{seen.kind} (is {seen.label})"
    cells = [
        seen.name,
        f"{plane.tilt_deg:.2f}",
        f"{1e3 * plane.offset:.1f}",
        f"{1e3 * plane.rms:.2f}",
        f"{1e3 * levelled.ground_sd:.2f}",
        f"{1e3 * levelled.threshold:.2f}",
        f"{int(levelled.mask.sum())} of {levelled.valid_count}",
        verdict,
        volume,
        radius,
        top,
        spread,
    ]
    return f"| {' | '.join(cells)} |"


def _table(seen: list[Seen]) -> str:
    head = (
        "| image | tilt [deg] | offset [mm] | rms of inliers [mm] | noise [mm] | threshold [mm] | "
        "grain pixels | kind | volume [cm³] (against the reference) | half-volume radius [mm] | "
        "max_z [mm] | sd_r [mm] |"
    )
    lines = [head, "|---" * 12 + "|", *(_row(each) for each in seen), ""]
    labelled = [each for each in seen if each.label is not None]
    right = sum(each.kind == each.label for each in labelled)
    lines.append(f"- kinds right: {right} of {len(labelled)} labelled maps")
    off = [
        abs(each.formation.volume / each.volume_reference - 1)
        for each in seen
        if each.label == "pile" and each.formation is not None
    ]
    lines.append(
        f"- volumes of the {len(off)} mounds: off by {100 * np.mean(off):.1f} % on average, by "
        f"{100 * max(off):.1f} % at most"
    )
    return "\n".join(lines) + "\n"


def _write_statistics(path: Path, seen: list[Seen]) -> None:
    """Writes the 16 statistics of every formation."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        for each in seen:
            if each.formation is None:
                continue
            statistics = each.formation.statistics()
            if file.tell() == 0:
                writer.writerow(["image", *statistics.names])
            writer.writerow([each.name, *(f"{value:.6g}" for value in statistics.paper16)])


def _sheet(path: Path, seen: Sequence[Seen], columns: int) -> None:
    """Draws every image's heights with the mask outlined, each on a scale of its own."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from PIL import Image

    rows = -(-len(seen) // columns)
    figure, axes = plt.subplots(
        rows, columns, figsize=(1.25 * columns, 1.42 * rows), squeeze=False, layout="constrained"
    )
    for axis in axes.flat:
        axis.set_axis_off()
    for axis, each in zip(axes.flat, seen, strict=False):
        heights, mask = each.levelled.heights, each.levelled.mask
        top = np.nanpercentile(heights[mask], 99) if mask.any() else 4 * each.levelled.ground_sd
        axis.imshow(heights, vmin=-top, vmax=top, cmap="RdBu_r", interpolation="nearest")
        if mask.any():
            axis.contour(mask, levels=[0.5], colors="k", linewidths=0.5)
        axis.set_title(f"{each.name}: {each.kind}, {1e3 * top:.0f} mm", fontsize=5.5, pad=2)
    figure.savefig(path, dpi=84)
    plt.close(figure)
    with Image.open(path) as picture:
        picture.convert("RGB").quantize(32).save(path, optimize=True)
