"""A posterior as materials of an engine: one at its mode, one for each draw."""

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal.arrays import unmasked
from granulcal.documents import ListOf, Table, Text, read_json
from granulcal.export.engines import MATERIAL_ENDINGS, material_text
from granulcal.export.mark import is_marked, require_replaceable
from granulcal.files import write_beside
from granulcal.pours.scene import Scene

__all__ = ["export_posterior"]

Array = NDArray[np.float64]

_TABLE = "draws.json"
_DRAWS = ListOf(Table({"file": Text()}, open=True))
_OURS = re.compile(r"(mode|draw-\d{3,})\.(in|py|xml|usda|sdf)")


def export_posterior(
    names: Sequence[str],
    mode: ArrayLike,
    draws: ArrayLike,
    scene: Scene,
    to: str,
    folder: str | Path,
    *,
    fixed: Mapping[str, float] | None = None,
    young: float | None = None,
    source: Sequence[str] = (),
) -> list[Path]:
    """Writes a posterior for an engine: the material at its mode, and one for each draw.

    Of a `Posterior` p the arguments are p.names, p.mode(), p.sample(n) and fixed=p.prior.fixed.

    draws.json has every draw in our own coefficients beside the name of its file. What an earlier
    call left in the folder is removed, of other engines too; nothing changes before all is made.

    Args:
        names: paths of the parameters in the scene.
        mode: most probable parameters, own units, shape (p,).
        draws: samples, own units, shape (n, p); none is enough where the mode is.
        scene: what is poured.
        to: the engine.
        folder: made if it does not exist.
        fixed: numbers that the prior fixed, by path: part of the material, too; where they are left
            out they are the scene's.
        young: as for `export_material`.
        source: further lines for the heads that say where the posterior comes from.

    Raises:
        ValueError: as `export_material`, mode or draws of another shape, a number that is both fixed
            and a parameter, or the folder has files of these names that granulcal did not export.
    """
    place, ending = Path(folder), MATERIAL_ENDINGS.get(to, "")
    listed, held = ", ".join(names), dict(fixed or {})
    if both := [name for name in names if name in held]:
        raise ValueError(f"{', '.join(both)} must be a parameter or fixed, got both")
    by_prior = [f"fixed by its prior: {', '.join(held)}"] if held else []

    def text_of(values: Array, what: str) -> str:
        there = scene.with_({**held, **dict(zip(names, values.tolist(), strict=True))})
        lines = [f"{what} of a posterior: {listed}", *by_prior, *source]
        return material_text(there, to, young=young, source=lines)

    most, rows = _mode(mode, names), _rows(draws, names)
    texts = {f"mode{ending}": text_of(most, "the mode")}
    table = []
    for i, row in enumerate(rows):
        file = f"draw-{i:03}{ending}"
        texts[file] = text_of(row, f"draw {i}")
        table.append({"file": file, **dict(zip(names, row.tolist(), strict=True))})
    require_replaceable(place / file for file in texts)
    _remove_earlier(place)
    place.mkdir(parents=True, exist_ok=True)
    # The table first: whatever stops the rest, no file stands in the folder that it does not list.
    if table:
        write_beside(place / _TABLE, json.dumps(table, indent=1) + "\n")
    for file, text in texts.items():
        write_beside(place / file, text)
    return [*(place / file for file in texts), *([place / _TABLE] if table else [])]


def _mode(mode: ArrayLike, names: Sequence[str]) -> Array:
    found = np.asarray(unmasked("mode", mode), float)
    if found.shape != (len(names),):
        raise ValueError(
            f"mode must have shape ({len(names)},), a number for each of {', '.join(names)}; got "
            f"{found.shape}"
        )
    return found


def _rows(draws: ArrayLike, names: Sequence[str]) -> Array:
    found = np.asarray(unmasked("draws", draws), float)
    if found.shape == (0,):
        # An empty list has no columns.
        return found.reshape(0, len(names))
    if found.ndim != 2 or found.shape[1] != len(names):
        raise ValueError(
            f"draws must have shape (n, {len(names)}), a column for each of {', '.join(names)}; got "
            f"{found.shape}"
        )
    return found


def _remove_earlier(place: Path) -> None:
    """Removes an earlier posterior: its table and its files, and none that another program wrote.

    Raises:
        ValueError: draws.json is not a table of draws.
    """
    table = place / _TABLE
    if table.is_file():
        for row in read_json(table, _DRAWS):
            if not _OURS.fullmatch(row["file"]):
                raise ValueError(
                    f"{table} is left as it is: it lists {row['file']!r}, no draw of an export"
                )
        table.unlink()
    if not place.is_dir():
        return
    for path in place.iterdir():
        if _OURS.fullmatch(path.name) and is_marked(path):
            path.unlink()
