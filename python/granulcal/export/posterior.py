"""A posterior as materials of an engine: one at its mode, one for each draw."""

import json
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from granulcal.arrays import unmasked
from granulcal.documents import ListOf, Table, Text, read_json
from granulcal.export.engines import MATERIAL_ENDINGS, material_text
from granulcal.export.mark import is_marked, require_replaceable
from granulcal.files import write_beside
from granulcal.pours.scene import Scene

__all__ = ["export_posterior"]

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
    young: float | None = None,
    source: Sequence[str] = (),
) -> list[Path]:
    """Writes a posterior for an engine: the material at its mode, and one for each draw.

    draws.json has every draw in our own coefficients beside the name of its file. What an earlier
    call left in the folder is removed, of other engines too; nothing changes before all is made.

    Args:
        names: paths of the parameters in the scene.
        mode: most probable parameters, own units, shape (p,).
        draws: samples, own units, shape (n, p); none is enough where the mode is.
        scene: what is poured.
        to: the engine.
        folder: made if it does not exist.
        young: as for `export_material`.
        source: further lines for the heads that say where the posterior comes from.

    Raises:
        ValueError: as `export_material`, or the folder has files of these names that granulcal did
            not export.
    """
    place, ending = Path(folder), MATERIAL_ENDINGS.get(to, "")
    listed = ", ".join(names)

    def text_of(values: np.ndarray, what: str) -> str:
        there = scene.with_(dict(zip(names, values.tolist(), strict=True)))
        lines = [f"{what} of a posterior: {listed}", *source]
        return material_text(there, to, young=young, source=lines)

    most = np.asarray(unmasked("mode", mode), float)
    rows = np.asarray(unmasked("draws", draws), float).reshape(-1, len(names))
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
