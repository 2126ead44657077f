"""A pour as an animated GIF or an MP4: shaded balls and the lines of walls, from a little above."""

import itertools
from collections.abc import Callable
from fractions import Fraction
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from granulcal import _native
from granulcal.pours.scene import Scene
from granulcal.pours.simulation import Simulation

if TYPE_CHECKING:
    from PIL import Image

__all__ = ["film"]

Array = NDArray[np.float64]
_PAPER, _GROUND, _WALL = (250, 250, 248), (226, 224, 218), (120, 130, 160)
_GRAIN = (214, 168, 96)
_RING = 40
_EASE = 1.08
_HOLD_MS = 1500
_MOST_FRAMES = 2000


class _Eye:
    """An orthographic look at a box of space.

    Args:
        low, high: corners of what must be in the picture [m], shape (3,).
        width: of the picture [px].
        rise_deg: how far above the horizon the eye stands [deg].
    """

    def __init__(self, low: Array, high: Array, width: int, rise_deg: float) -> None:
        rise = np.radians(rise_deg)
        self.right = np.array([1.0, 0.0, 0.0])
        self.up = np.array([0.0, np.sin(rise), np.cos(rise)])
        self.away = np.array([0.0, np.cos(rise), -np.sin(rise)])
        corners = np.array(list(itertools.product(*zip(low, high, strict=True))))
        flat = np.stack([corners @ self.right, corners @ self.up], axis=1)
        centre, span = (flat.max(axis=0) + flat.min(axis=0)) / 2, np.ptp(flat, axis=0) * _EASE
        self.scale = width / max(span[0], 1e-9)
        # Even numbers: what makes films of pictures wants them.
        self.size = (width, max(2, 2 * round(span[1] * self.scale / 2)))
        self.origin = centre

    def project(self, points: Array) -> tuple[Array, Array]:
        """Returns places in the picture [px], shape (n, 2), and distances from the eye [m]."""
        flat = np.stack([points @ self.right, points @ self.up], axis=-1) - self.origin
        place = flat * self.scale * [1, -1] + np.array(self.size) / 2
        return place, points @ self.away


def film(
    scene: Scene,
    path: str | PathLike[str],
    *,
    seed: int = 0,
    fps: float = 15.0,
    slow: float = 2.0,
    width: int = 480,
    rise_deg: float = 20.0,
    most_frames: int = 120,
    progress: Callable[[float], object] | None = None,
    dropped: Callable[[int], object] | None = None,
) -> int:
    """Pours a scene, writes an animated GIF or an MP4 and returns the number of its frames.

    Args:
        scene: what is poured.
        path: the film, .gif or .mp4 (H.264).
        seed: of the pour.
        fps: frames a second of the film, 0.01 to 100: a GIF has no more.
        slow: seconds of the film for a second of the pour, 0.01 to 1000.
        width: of the picture [px], 64 to 4096.
        rise_deg: how far above the horizon one looks from [deg].
        most_frames: the film ends there, a long pour with its last frame.
        progress: called with the simulated time of each frame [s].
        dropped: called at the end with how many frames the film lacks, where it was cut short.

    Raises:
        ModuleNotFoundError: Pillow, which comes with the extra `plot`, is not installed, or for an
            MP4 PyAV, which comes with `film`.
        ValueError: a name that is neither .gif nor .mp4, or numbers out of their range.
    """
    ending = Path(path).suffix.lower()
    if ending not in _WRITERS:
        raise ValueError(f"{path} must end in {' or '.join(_WRITERS)}")
    limits = {"fps": (fps, 0.01, 100), "slow": (slow, 0.01, 1000), "width": (width, 64, 4096)}
    for name, (value, low, high) in limits.items():
        if not low <= value <= high:
            raise ValueError(f"{name} must be from {low:g} to {high:g}, got {value:g}")
    if not 1 <= most_frames <= _MOST_FRAMES:
        raise ValueError(f"most_frames must be from 1 to {_MOST_FRAMES}, got {most_frames}")
    if ending == ".mp4":
        # Before a pour that may take minutes.
        import av  # noqa: F401
    lines = _outlines(scene)
    start, radii = scene.start(seed)
    everything = np.concatenate([start, *lines, [[-0.1, -0.1, 0.0], [0.1, 0.1, 0.0]]])
    pad = float(radii.max())
    eye = _Eye(everything.min(axis=0) - pad, everything.max(axis=0) + pad, width, rise_deg)
    frames: list[Image.Image] = []
    last: list[Image.Image] = []
    over = 0

    simulation = Simulation(scene, seed)
    for number in itertools.count(1):
        if progress is not None:
            progress(simulation.time)
        has_ended = simulation.status is not None
        if len(frames) < most_frames:
            frames.append(_picture(eye, simulation.positions, simulation.radii, lines))
        else:
            over += 1
            if has_ended:
                last = [_picture(eye, simulation.positions, simulation.radii, lines)]
        if has_ended:
            break
        simulation.advance_to(number / (fps * slow))
    frames += last
    _WRITERS[ending](Path(path), frames, fps)
    # The last one is there.
    if over > 1 and dropped is not None:
        dropped(over - 1)
    return len(frames)


def _frame_times(count: int, fps: float) -> list[int]:
    """Returns how long a GIF shows each frame [ms]: hundredths of a second, k / fps in sum."""
    ends = [round(100 * k / fps) for k in range(count + 1)]
    return [10 * (b - a) for a, b in itertools.pairwise(ends)]


def _write_gif(path: Path, frames: "list[Image.Image]", fps: float) -> None:
    times = [*_frame_times(len(frames) - 1, fps), _HOLD_MS]
    options: dict[str, Any] = {"append_images": frames[1:], "duration": times, "loop": 0}
    buffer = BytesIO()
    frames[0].save(buffer, "GIF", save_all=True, optimize=True, **options)
    _native.write_file(path, "gif", buffer.getvalue())


def _write_mp4(path: Path, frames: "list[Image.Image]", fps: float) -> None:
    import av

    held = [frames[-1]] * round(fps * _HOLD_MS / 1000)
    buffer = BytesIO()
    with av.open(buffer, "w", format="mp4") as container:
        stream = container.add_stream("libx264", rate=Fraction(fps).limit_denominator(1000))
        # H.264 has half as many pixels of colour: sides are even.
        stream.width, stream.height = (side - side % 2 for side in frames[0].size)
        stream.pix_fmt = "yuv420p"
        for image in (*frames, *held):
            picture = image.convert("RGB").crop((0, 0, stream.width, stream.height))
            container.mux(stream.encode(av.VideoFrame.from_image(picture)))
        container.mux(stream.encode())
    _native.write_file(path, "mp4", buffer.getvalue())


_WRITERS = {".gif": _write_gif, ".mp4": _write_mp4}


def _picture(eye: _Eye, centres: Array, radii: Array, lines: list[Array]) -> "Image.Image":
    from PIL import Image, ImageDraw

    image = Image.new("RGB", eye.size, _PAPER)
    draw = ImageDraw.Draw(image)
    reach = 4.0
    corners = reach * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    draw.polygon([tuple(p) for p in eye.project(corners)[0]], fill=_GROUND)
    places, away = eye.project(centres)
    for i in np.argsort(-away):
        r = max(radii[i] * eye.scale, 1.0)
        _ball(draw, places[i], r)
    for line in lines:
        draw.line([tuple(p) for p in eye.project(line)[0]], fill=_WALL, width=2)
    return image.quantize(64)


def _ball(draw: Any, at: Array, r: float) -> None:
    """Draws a ball lit from the upper left: its rim dark, its light side bright."""
    x, y = at
    for share, shade in ((1.0, 0.55), (0.82, 0.85), (0.45, 1.1)):
        shift = (1.0 - share) * 0.45 * r
        rr = r * share
        colour = tuple(int(min(255, c * shade)) for c in _GRAIN)
        left, top = x - shift - rr, y - shift - rr
        draw.ellipse([left, top, left + 2 * rr, top + 2 * rr], fill=colour)


def _outlines(scene: Scene) -> list[Array]:
    """Returns lines along the walls at rest [m], each of shape (k, 3)."""
    from granulcal.export.law import Contact
    from granulcal.export.walls import still_walls_of

    table = scene.to_dict()
    found: list[Array] = []
    # Walls that move are not drawn; the grains show them.
    for body in still_walls_of(table, Contact.of(table["material"])):
        found += _outline(body.shape)
    return found


def _outline(shape: dict[str, Any]) -> list[Array]:
    from granulcal.export.mesh import triangles

    if shape["kind"] not in ("cone", "cylinder"):
        mesh = triangles(shape)
        return [mesh.vertices[[*face, face[0]]] for face in mesh.faces]
    open_shape = {key: value for key, value in shape.items() if key != "closed"}
    rings = triangles(open_shape, sides=_RING).vertices.reshape(2, _RING, 3)
    closed = [np.concatenate([ring, ring[:1]]) for ring in rings]
    sides = [rings[:, i] for i in (int(rings[0, :, 0].argmin()), int(rings[0, :, 0].argmax()))]
    return [*closed, *sides]
