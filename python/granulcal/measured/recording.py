"""Measured depth images and height maps, and other measurements of a scene's statistics."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal import _native
from granulcal.arrays import unmasked
from granulcal.measured import (
    DischargeCurve,
    DrumImage,
    NamedValues,
    RunOut,
    is_of_named_values,
)
from granulcal.measured.formation import EdgePixelsWarning, Formation, Levelled, Plane, plane_of
from granulcal.measured.ros_files import SATURATED
from granulcal.measured.segmentation import SegmentationSettings
from granulcal.pours.camera import Camera
from granulcal.pours.scene import Scene
from granulcal.pours.statistics import (
    ObservedStatistics,
    Statistics,
)
from granulcal.real import check_real

if TYPE_CHECKING:
    from granulcal.prior import Prior

__all__ = [
    "Camera",
    "DamagedRecordingWarning",
    "EdgePixelsWarning",
    "Formation",
    "Levelled",
    "Lost",
    "Plane",
    "Recording",
    "SegmentationSettings",
    "UnlikeFramesWarning",
]

Array = NDArray[np.float64]

# Frames that are averaged unless told otherwise: as many as Matl et al. 2020 average.
FRAMES = 10


class DamagedRecordingWarning(UserWarning):
    """A recording is cut off or damaged; the frames that are whole were used."""


class UnlikeFramesWarning(UserWarning):
    """Frames that are averaged do not look like images of one formation at rest."""


@dataclass(frozen=True)
class Lost:
    """Frames of a damaged recording that are lost.

    Attributes:
        frames: their number.
        how: how well it is known: `exactly`, `about` (by the bytes that are missing) or `at least`.
    """

    frames: int
    how: str

    def __str__(self) -> str:
        """Returns a phrase for messages."""
        if self.how == "at least" and self.frames == 0:
            return "an unknown number of frames lost"
        known = "" if self.how == "exactly" else f"{self.how} "
        return f"{known}{self.frames} frame{'' if self.frames == 1 else 's'} lost"


class Recording:
    """One measured formation: a height map, or a depth image with its camera.

    Reads ROS 1 .bag files as the RealSense viewer saves them, .mcap files of ROS 2 and of Foxglove,
    16-bit depth PNGs, folders of such frames, depth arrays as .npy, and .npz height maps. Of
    several frames the mean of each pixel is taken over those that have data there. PNGs and .npy
    need the TOML of their camera.

    Examples:
        >>> import tempfile
        >>> import granulcal
        >>> pour = granulcal.simulate(granulcal.Scene.drop(0.02, count=60), seed=1)
        >>> camera = Camera.overhead(height=0.3, field_width=0.2, pixels=200)
        >>> folder = tempfile.mkdtemp()
        >>> image, toml = camera.record(pour.positions, pour.radii, folder)
        >>> recording = Recording.open(image, camera=toml)
        >>> 0 < recording.statistics()["max_z"] < 0.02
        True
    """

    def __init__(self, native: _native.Recording, path: Path) -> None:
        self._native = native
        self.path = path
        """The file or folder."""

    @property
    def native(self) -> _native.Recording:
        """The Rust side of it."""
        return self._native

    @classmethod
    def open(
        cls,
        path: str | PathLike[str],
        camera: str | PathLike[str] | None = None,
        *,
        topic: str | None = None,
        camera_topic: str | None = None,
        colour_topic: str | None = None,
        frames: int | None = FRAMES,
        first_frame: int | None = None,
    ) -> Recording:
        """Returns the recording at `path`.

        A file that is cut off or damaged gives the frames that are whole, with a warning; `lost`
        says how many are not.

        Args:
            path: .bag, .mcap, .npz, .png, .npy, or a folder of .png.
            camera: TOML of the camera, which height maps have not; of .png and .npy that under the
                image's own name, or camera.toml in its folder or the one above, if None; of a
                .bag or .mcap it replaces lens, depth unit and segmentation, key by key.
            topic: topic of the depth images, where several fit.
            camera_topic: topic of the lens, where several fit.
            colour_topic: topic of the colour images, where several fit; they are read when the
                camera's TOML marks grains by colour.
            frames: most frames that are averaged; None for all. The paper averages ten.
            first_frame: index of the first of them, from 0; by default the last `frames` are taken.

        Raises:
            FileNotFoundError: a file does not exist.
            ValueError: a file is no recording, or none or several topics fit; the message says what
                is wrong and lists the topics.
        """
        if frames is not None and frames < 1:
            raise ValueError(f"frames must be at least 1, got {frames}")
        if first_frame is not None and first_frame < 0:
            raise ValueError(f"first_frame must be at least 0, got {first_frame}")
        native = _native.Recording.open(
            path,
            camera,
            topic=topic,
            camera_topic=camera_topic,
            colour_topic=colour_topic,
            frames=frames,
            first_frame=first_frame,
        )
        recording = cls(native, Path(path))
        if recording.lost is not None:
            text = f"{path}: {recording.lost}; {'; '.join(recording.damage)}"
            warnings.warn(text, DamagedRecordingWarning, stacklevel=2)
        if recording.unlike is not None:
            warnings.warn(f"{path}: {recording.unlike}", UnlikeFramesWarning, stacklevel=2)
        return recording

    @classmethod
    def from_depth(
        cls,
        depth: ArrayLike,
        *,
        fx: float,
        fy: float,
        cx: float,
        cy: float,
        unit: float | None = None,
    ) -> Recording:
        """Returns the recording of depth images in memory, as a camera's software hands them out.

        Args:
            depth: one image or frames of one, shape (h, w) or (k, h, w): metres, or counts with
                their `unit`. 0, NaN, infinities and a count of 65535 are no data.
            fx: focal length along the rows [px].
            fy: the same along the columns [px].
            cx: column of the principal point [px], the centre of the first pixel at (0, 0).
            cy: its row [px].
            unit: metres per count; None for depths in metres.

        Raises:
            TypeError: no array of real numbers, or a lens that is no numbers.
            ValueError: another shape, masked entries, whole numbers without a unit, a unit or a
                lens that none is, or depths of more than 100 m.

        Warns:
            UnlikeFramesWarning: the frames do not look like images of one formation at rest.
        """
        given = unmasked("depth", depth)
        if given.dtype.kind not in "fiu":
            raise TypeError(f"depth must be an array of real numbers, got dtype {given.dtype}")
        for name, value in (("fx", fx), ("fy", fy), ("cx", cx), ("cy", cy)):
            check_real(name, value)
        if unit is not None:
            check_real("unit", unit)
        if unit is None and np.issubdtype(given.dtype, np.integer):
            raise ValueError(
                f"depth is of whole numbers ({given.dtype}): say what one is, unit=0.001 for "
                "millimetres, or give metres as floats"
            )
        if unit is not None and not 0 < unit < np.inf:
            raise ValueError(f"unit must be positive and finite, got {unit}")
        if given.ndim == 3 and given.shape[2] == 1 and given.shape[1] > 1:
            given = given[:, :, 0]  # As some readers keep their one channel.
        images = given[None] if given.ndim == 2 else given
        # The channels of a colour image come last.
        is_colour = images.ndim == 3 and images.shape[2] in (3, 4) and images.shape[1] > 4
        if images.ndim != 3 or images.size == 0 or is_colour:
            raise ValueError(f"depth must have shape (h, w) or (k, h, w), got {np.shape(depth)}")
        metres = images.astype(np.float32)
        if unit is not None:
            metres *= np.float32(unit)
            metres[images == SATURATED] = 0.0
        native = _native.Recording.of_depths(np.ascontiguousarray(metres), (fx, fy, cx, cy), unit)
        if native.unlike is not None:
            warnings.warn(f"depth array: {native.unlike}", UnlikeFramesWarning, stacklevel=2)
        return cls(native, Path("depth array"))

    @property
    def frames(self) -> int:
        """Number of frames that were averaged."""
        return self._native.frames

    @property
    def whole_frames(self) -> int:
        """Number of frames of the recording that are whole."""
        return self._native.whole_frames

    @property
    def topic(self) -> str | None:
        """Topic of the depth images; None for a recording without topics."""
        return self._native.topic

    @property
    def lost(self) -> Lost | None:
        """Frames that are lost; None for a whole recording."""
        found = self._native.lost
        return None if found is None else Lost(*found)

    @property
    def unlike(self) -> str | None:
        """That the frames do not look like images of one formation at rest; None if they do.

        Also what of the recording's own lens and unit the camera's file contradicts.
        """
        return self._native.unlike

    @property
    def damage(self) -> list[str]:
        """What is cut off or damaged, a line each."""
        return self._native.damage

    @property
    def lens(self) -> dict[str, float] | None:
        """Lens of a depth image: width, height, fx, fy, cx, cy [px]; None for a height map.

        As OpenCV and the RealSense SDK give it: the centre of the first pixel is (0, 0).
        """
        found = self._native.lens
        names = ("width", "height", "fx", "fy", "cx", "cy")
        return None if found is None else dict(zip(names, found, strict=True))

    @property
    def depth_unit(self) -> float | None:
        """Metres per count of a depth image; None for a height map and for depths in metres."""
        return self._native.depth_unit

    @cached_property
    def depth(self) -> NDArray[np.float32] | None:
        """Depth [m], 0 is no data, shape (h, w); None for a height map."""
        return self._native.depth

    @cached_property
    def heights(self) -> Array | None:
        """Heights [m], NaN is no data, shape (h, w); None for a depth image."""
        return self._native.heights

    def formation(self, **settings: Unpack[SegmentationSettings]) -> Formation:
        """Returns the points of the formation, levelled and centred.

        Args:
            settings: what differs from the camera's file, else from the default; see
                `SegmentationSettings`.

        Raises:
            ValueError: no pixel belongs to a grain, an image without data, a setting out of range,
                or both a fixed threshold and a floor.

        Warns:
            EdgePixelsWarning: pixels at the edge of a height map are taken for grains.
        """
        _refuse_two_thresholds(settings)
        found = self._native.formation(**settings)
        if self.depth is None and settings.get("border_px") is None and found.edge is not None:
            self._tell_edge(*found.edge, found.downsample)
        return Formation(
            points=found.points,
            mask=found.mask,
            heights=found.heights,
            plane=plane_of(found.plane),
            ground_sd=found.ground_sd,
            valid_count=found.valid_count,
            threshold=found.threshold,
            centroid=found.centroid,
            volume=found.volume,
            kind=found.kind,
            half_volume_radius=found.half_volume_radius,
            profile=found.profile,
            downsample=found.downsample,
            resolution=found.resolution,
            spacing=found.spacing,
        )

    def _tell_edge(self, count: int, frame: int, downsample: int) -> None:
        """Warns of pixels at the edge of a height map that are taken for grains."""
        width = frame * downsample
        warnings.warn(
            f"{self.path}: {count} pixels at the edge of the map, apart from the formation, are "
            f"taken for grains; border_px={width} (--border {width}) leaves them out, "
            "border_px=0 keeps them without a word",
            EdgePixelsWarning,
            stacklevel=3,
        )

    def level(self, **settings: Unpack[SegmentationSettings]) -> Levelled:
        """Returns ground, heights and mask, also of a flat bed; settings as `formation`.

        Raises:
            ValueError: an image without data, a setting out of range, or both a fixed threshold
                and a floor.
        """
        _refuse_two_thresholds(settings)
        found = self._native.level(**settings)
        return Levelled(
            heights=found.heights,
            mask=found.mask,
            plane=plane_of(found.plane),
            ground_sd=found.ground_sd,
            threshold=found.threshold,
            valid_count=found.valid_count,
            downsample=found.downsample,
            resolution=found.resolution,
        )

    @cached_property
    def _formation(self) -> Formation:
        return self.formation()

    def statistics(self) -> Statistics:
        """Returns the statistics under the recording's own segmentation; see `formation`."""
        return self._formation.statistics()

    def points(self) -> Array:
        """Returns the points under the recording's own segmentation [m], shape (n, 3)."""
        return self._formation.points

    def doubts(
        self, scene: Scene, prior: Prior, **settings: Unpack[SegmentationSettings]
    ) -> list[str]:
        """Returns why this can be no recording of the scene, and what makes it doubtful.

        A sentence each, as `granulcal infer` says them; none where nothing is known against it. The
        bounds hold over the whole prior: of the scene's own pours a few in a hundred are doubted.

        Args:
            scene: what was poured, with the camera that looked.
            prior: of its parameters.
            **settings: arguments of `formation`; `scene.reading` unless any is given.

        Raises:
            TypeError: no scene, or no prior.
        """
        if not isinstance(scene, Scene):
            raise TypeError(f"scene must be a Scene, as Scene.load reads it, got {scene!r}")
        if not hasattr(prior, "to_toml") or isinstance(prior, Scene):
            raise TypeError(f"prior must be a Prior, as Prior.load reads it, got {prior!r}")
        text, reading = prior.to_toml(), settings or scene.reading
        judges = (scene.native.violations, scene.native.doubts)
        return [told for judge in judges for told in judge(text, self.native, **reading)]

    @property
    def plane(self) -> Plane:
        """The ground under the recording's own segmentation."""
        return self._formation.plane

    @staticmethod
    def observed(
        path: str | PathLike[str],
        scene: Scene,
        *,
        width: float | None = None,
        fps: float | None = None,
        series: str | None = None,
        camera: int | None = None,
    ) -> ObservedStatistics:
        """Returns what a measurement that is no depth image says of a scene's own statistics.

        Time-averaged pictures of a drum (.bmp, .png) give `surface_z[x]` and `surface_slope`,
        run-out files (.txt) `front_radius[t]`, discharge curves (.csv) `discharged[t]` and
        `discharge_rate`. Numbers that were measured by other means have the names of the statistics
        in a table (.csv, columns statistic and value), or in the `observed` of a JSON document as
        `granulcal simulate --json` prints it. What the scene observes besides is NaN.

        Args:
            path: the file.
            scene: the scene whose statistics are asked for.
            width: width of a drum's picture [m]; needed there.
            fps: frames a second of a run-out file's video; 240 unless told otherwise.
            series: name of a discharge curve, where the file has several.
            camera: 1 or 2 for what this camera of a run-out file saw; the mean of both otherwise.

        Raises:
            FileNotFoundError: there is no such file.
            ValueError: it is not what its name says, the scene observes nothing of the kind, or an
                argument does not go with it.
        """
        kind = Path(path).suffix.lower()
        given = {"width": width, "fps": fps, "series": series, "camera": camera}
        takes = {
            ".bmp": ("width",),
            ".png": ("width",),
            ".txt": ("fps", "camera"),
            ".csv": ("series",),
            ".json": (),
        }
        if kind not in takes:
            raise ValueError(f"{path} must be one of {', '.join(takes)}")
        wrong = [name for name in given if given[name] is not None and name not in takes[kind]]
        if wrong:
            allowed = " and ".join(takes[kind]) or "nothing"
            raise ValueError(f"a {kind} file takes {allowed}, not {', '.join(wrong)}")
        if "width" in takes[kind]:
            if width is None:
                raise ValueError(f"{path}: width, the drum's inner diameter [m], is needed")
            return DrumImage.open(path, width=width).observed(scene)
        if "fps" in takes[kind]:
            run_out = RunOut.open(path) if fps is None else RunOut.open(path, fps=fps)
            return run_out.observed(scene, camera=camera)
        if series is None and is_of_named_values(path):
            return NamedValues.open(path).observed(scene)
        return DischargeCurve.open(path, series).observed(scene)

    def _repr_html_(self) -> str:
        from granulcal.html import page, picture, seen_from_above

        rows: dict[str, object] = {"frames": self.frames, "topic": self.topic or "-"}
        label = "z [m]" if self.depth is None else "depth [m]"
        image = self.heights if self.depth is None else self.depth
        if image is not None:
            rows["size"] = f"{image.shape[1]} x {image.shape[0]}"
        if self.lost is not None:
            rows["damage"] = str(self.lost)
        drawn = "" if image is None else picture(seen_from_above(image, label))
        return page(f"Recording {self.path.name}", rows, drawn)

    def __reduce__(self) -> NoReturn:
        raise TypeError(
            "a Recording stays in its process: hand over its path, or statistics() and doubts(...)"
        )

    def __repr__(self) -> str:
        kind = "height map" if self.depth is None else f"depth, {self.frames} frame(s)"
        return f"Recording({str(self.path)!r}, {kind})"


def _refuse_two_thresholds(settings: SegmentationSettings) -> None:
    both = settings.get("height_threshold"), settings.get("threshold_floor")
    if None not in both:
        raise ValueError("give height_threshold or threshold_floor, not both")
