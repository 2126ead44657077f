"""Writes the commented files of `granulcal init`, fitted to the lens of a recording where there is one."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil
from pathlib import Path

from granulcal.files import replace_file
from granulcal.measured.recording import Recording
from granulcal.pours.scene import BUILT_IN, Scene
from granulcal.starter.numbers import with_numbers
from granulcal.starter.texts import CAMERA, DROP_START, FUNNEL_START, LOOP, PRIOR, SCENE

__all__ = ["CONDITIONS", "FILES", "Lens", "doubt_of_pixels", "lens_of", "write_folder"]

FILES = ("scene.toml", "prior.toml", "camera.toml", "loop.toml")
"""What a folder begins with."""
CONDITIONS = {"low": 0.06, "high": 0.12}
"""Conditions of loop.toml and what their one number is [m]."""
# Path of the height [m] that each scene pours from.
_TIPS = {"funnel": "funnel.height", "drop": "start.height"}
_POURS = 2
# Height above which nothing is data, over that of the funnel's tip.
_BELOW_TIP = 0.8
# Width of a pixel on the ground that images are compared at, over a grain's diameter.
_PIXEL = 1.25
_LEAST_THRESHOLD = 1e-3


@dataclass(frozen=True, kw_only=True)
class Lens:
    """A depth camera that looks down.

    Attributes:
        width, height: of its image [px].
        fx, fy, cx, cy: focal lengths and principal point, the first pixel's centre at 0 [px].
        unit: metres per count of its 16-bit images.
        distance: from the ground, along the axis [m].
        noise: robust standard deviation of the ground about its plane [m].
        origin: where the numbers come from, a sentence.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    unit: float
    distance: float
    noise: float
    origin: str

    @property
    def pixels(self) -> int:
        """Side of the largest square in the image [px]."""
        return min(self.width, self.height)

    @property
    def field_width(self) -> float:
        """Side of the ground that this square sees [m]."""
        return self.pixels * self.distance / min(self.fx, self.fy)

    @property
    def pixel(self) -> float:
        """Width of one of its pixels on the ground [m]."""
        return self.field_width / self.pixels

    @property
    def threshold(self) -> float:
        """Height from which a pixel counts as grain [m]."""
        least = max(3.0 * self.noise, _LEAST_THRESHOLD)
        # Up to the next tenth of a millimetre: one that was rounded down would be within the noise,
        # which `features` warns of.
        return ceil(round(1e4 * least, 6)) / 1e4


D435 = Lens(
    width=640, height=480, fx=390.43, fy=390.43, cx=319.5, cy=239.5, unit=1e-4,
    distance=0.4, noise=3.3e-4,
    origin="A RealSense D435 at 640 x 480, 40 cm above the ground: replace all of it by your own,\n"
    "# or let `granulcal init FOLDER --recording FILE` read it.",
)  # fmt: skip
"""A camera to begin with."""


def lens_of(path: Path, camera: Path | None = None) -> Lens:
    """Returns the lens of a recording, and what its ground tells of distance and noise.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is a height map, which has no lens, or shows no ground.
    """
    recording = Recording.open(path, camera=camera)
    lens = recording.lens
    if lens is None:
        raise ValueError(f"{path} is a height map and has no lens; give a depth recording")
    levelled = recording.level()
    return Lens(
        width=int(lens["width"]),
        height=int(lens["height"]),
        fx=lens["fx"],
        fy=lens["fy"],
        cx=lens["cx"],
        cy=lens["cy"],
        unit=recording.depth_unit or D435.unit,
        distance=round(abs(levelled.plane.offset), 4),
        noise=levelled.ground_sd,
        origin=f"Read from {path.name}.",
    )


def write_folder(
    folder: Path,
    *,
    scene: str = "funnel",
    lens: Lens = D435,
    changes: Mapping[str, float | str] | None = None,
    force: bool = False,
) -> Scene:
    """Writes scene, prior, camera and task into `folder` and returns the scene.

    What is refused is refused before anything is written.

    Args:
        folder: made if it does not exist.
        scene: `funnel` or `drop`.
        lens: of the camera that will look.
        changes: other values in scene.toml by path, as `Scene.with_` takes them.
        force: overwrite files of these names.

    Raises:
        ValueError: no built-in scene has this name, a value does not fit it, or the lens of a
            recording is below what is poured from.
        FileExistsError: a file is there already.
    """
    if scene not in BUILT_IN:
        raise ValueError(f"scene must be one of {', '.join(BUILT_IN)}, got {scene!r}")
    there = [name for name in FILES if (folder / name).exists()]
    if there and not force:
        raise FileExistsError(f"{folder} has {', '.join(there)} already; --force writes them anew")
    path, changes = _TIPS[scene], changes or {}
    if lens != D435:
        tip = Scene.built_in(scene).get(path)
        _require_above(float(changes.get(path, tip)), scene, lens)
    file = folder / "scene.toml"
    given = changes.get("grains.diameter")
    # What is no diameter is refused by name with the other numbers.
    diameter = given if isinstance(given, float | int) and given > 0 else None
    if diameter is not None:
        _require_in_view(diameter, lens)
    text = with_numbers(scene_text(scene, lens, diameter), changes, file)
    written = Scene.from_toml(text)
    replace_file(file, text)
    replace_file(folder / "prior.toml", PRIOR)
    replace_file(folder / "camera.toml", camera_text(lens, written.get(path)))
    names = {
        name: json.dumps([f"pours/{name}-{i}.png" for i in range(_POURS)]) for name in CONDITIONS
    }
    replace_file(
        folder / "loop.toml",
        LOOP.format(path=path, **CONDITIONS, low_names=names["low"], high_names=names["high"]),
    )
    return written


def _require_above(tip: float, name: str, lens: Lens) -> None:
    """Refuses the lens of a recording that is not above what a built-in scene pours from.

    Args:
        tip: height that is poured from [m].
        name: of the scene.
        lens: of the recording.

    Raises:
        ValueError: it is not above; names both heights.
    """
    if lens.distance <= tip:
        what = "the funnel's tip" if name == "funnel" else "the grains that are let go"
        raise ValueError(
            f"the ground of the recording is {lens.distance:g} m from the camera, which is not "
            f"above {what} at {tip:g} m ({_TIPS[name]}): is the depth unit right, "
            f"{lens.unit:g} m per count? A PNG has it from depth_unit in the TOML of --camera. "
            f"If it is, give the true height by --set {_TIPS[name]}=METRES"
        )


def _require_in_view(diameter: float, lens: Lens) -> None:
    """Refuses grains of a diameter [m] that no pixel of the lens's image is as wide as."""
    most = lens.field_width / _PIXEL
    if diameter > most:
        raise ValueError(
            f"grains.diameter must be at most {most:.3g} m, for the camera sees "
            f"{lens.field_width:.3g} m of the ground; got {diameter:g}"
        )


def doubt_of_pixels(lens: Lens, diameter: float) -> list[str]:
    """Returns whether a camera's pixels miss grains of a diameter [m], as where its unit is another."""
    if lens.pixel <= _PIXEL * diameter:
        return []
    return [
        f"a pixel is {1e3 * lens.pixel:.3g} mm wide on the ground, {lens.distance:.3g} m from the "
        f"camera, and grains are {1e3 * diameter:g} mm: single grains and tops are missed; bring the "
        f"camera nearer. Or is the depth unit another than {lens.unit:g} m per count? A PNG has it "
        "from depth_unit in the TOML of --camera"
    ]


def scene_text(name: str, lens: Lens, diameter: float | None = None) -> str:
    """Returns the commented TOML of a built-in scene under this camera.

    Args:
        name: of the scene.
        lens: of the camera.
        diameter: of the grains that its images are to show [m], if not the scene's; the text states
            the scene's.
    """
    built_in = Scene.built_in(name)
    stated = built_in.get("grains.diameter")
    diameter = stated if diameter is None else diameter
    paths = {"jitter": "start.jitter", "tip": _TIPS[name]}
    start, wanted = DROP_START, paths
    if name == "funnel":
        start, wanted = FUNNEL_START, paths | {"spacing": "start.spacing", "base": "start.base"}
    downsample = max(1, round(_PIXEL * diameter / lens.pixel))
    resolution = lens.pixel * downsample
    return SCENE.format(
        name=name,
        preset=built_in.preset,
        count=int(built_in.get("grains.count")),
        diameter=stated,
        start=start.format(**{key: built_in.get(path) for key, path in wanted.items()}),
        height=lens.distance,
        field_width=round(lens.field_width, 4),
        pixels=lens.pixels,
        downsample=downsample,
        threshold=lens.threshold,
        resolution_mm=1e3 * resolution,
        in_grains=resolution / diameter,
    )


def camera_text(lens: Lens, tip: float) -> str:
    """Returns the commented TOML of a camera above what is poured from a height `tip` [m]."""
    shown = {
        key: getattr(lens, key)
        for key in ("width", "height", "fx", "fy", "cx", "cy", "unit", "threshold", "origin")
    }
    return CAMERA.format(**shown, max_height=round(_BELOW_TIP * tip, 3))
