"""A simulator of one's own as a command: a folder with the scene in, a file of grains or points out."""

import json
import shlex
import subprocess
import tempfile
from pathlib import Path

from granulcal.arrays import read_array
from granulcal.engines.files import read_grains
from granulcal.engines.protocol import Fewer, Left, left
from granulcal.pours.scene import Scene

__all__ = ["CommandEngine", "last_words"]


class CommandEngine:
    """A command that is called with a folder and leaves grains or points there.

    The folder has `scene.toml`, all parameters set, and `request.json`: `seed`, `material`, and
    `grains` with count, diameter and density. The command leaves one of `grains.npy` or `grains.csv`
    (x, y, z and perhaps radius [m]), `grains.dump` (LAMMPS), or `points.npy` (n, 3).

    Args:
        text: the command with its arguments; the folder is put after them.
        timeout_s: longest time of a pour [s].
    """

    def __init__(self, text: str, *, timeout_s: float | None = None) -> None:
        self.words = shlex.split(text)
        if not self.words:
            raise ValueError("an engine must be a name, module:function or a command, got nothing")
        self.name = text
        """The command."""
        self.timeout_s = timeout_s
        self._fewer = Fewer(self.name)

    def __call__(self, scene: Scene, seed: int) -> Left:
        """Returns what the command left; warns, once, of fewer grains than the scene's.

        Raises:
            ValueError: it failed, or left nothing; with its last words.
        """
        with tempfile.TemporaryDirectory(prefix="granulcal-engine-") as place:
            folder = Path(place)
            (folder / "scene.toml").write_text(scene.to_toml(), encoding="utf-8")
            (folder / "request.json").write_text(json.dumps(_request(scene, seed)))
            try:
                done = subprocess.run(
                    [*self.words, str(folder)],
                    capture_output=True,
                    text=True,
                    # Words for people; what counts is in the folder.
                    errors="replace",
                    check=False,
                    timeout=self.timeout_s,
                )
            except (FileNotFoundError, PermissionError) as error:
                raise ValueError(f"engine {self.name!r}: {error.strerror}") from None
            except subprocess.TimeoutExpired:
                raise ValueError(
                    f"engine {self.name!r} took longer than {self.timeout_s} s"
                ) from None
            if done.returncode != 0:
                raise ValueError(
                    f"engine {self.name!r} ended with {done.returncode}: {last_words(done)}"
                )
            points = folder / "points.npy"
            if points.exists():
                return left(self.name, read_array(points))
            grains = read_grains(folder, 0.5 * scene.get("grains.diameter"))
            if grains is None:
                raise ValueError(
                    f"engine {self.name!r} left no grains.npy, .csv, .dump or points.npy"
                )
            found = left(self.name, grains)
            self._fewer(found, scene)
            return found


def last_words(done: subprocess.CompletedProcess[str]) -> str:
    """Returns the last line that a command said."""
    lines = [line for line in (done.stderr + "\n" + done.stdout).splitlines() if line.strip()]
    errors = [line for line in lines if "ERROR" in line]
    return (errors or (done.stderr.strip().splitlines() or lines or ["it said nothing"]))[
        -1
    ].strip()


def _request(scene: Scene, seed: int) -> dict[str, object]:
    grains = {name: scene.get(f"grains.{name}") for name in ("diameter", "density")}
    grains = {"count": round(scene.get("grains.count")), **grains}
    return {"seed": seed, "material": vars(scene.material), "grains": grains}
