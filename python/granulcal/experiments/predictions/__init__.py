"""What drum and columns do where nothing was measured here, for others to judge: three CSV files.

    granulcal reproduce loop_drum --out out          # once; writes out/loop_drum/both/models.json
    granulcal reproduce loop_column --out out        # once; writes out/loop_column/models.json
    granulcal reproduce predictions --out out        # out/predictions/*.csv

Every file has what needs no model at all (`line`, `nearest`, and `between` for columns), told from
the measurements alone. The columns' beads are fitted to the measured tests, dry and with their
liquid (`fitted_columns.py`: 2,600 pours, three quarters of an hour of one core). A loop that has
been closed adds the verdict's model (`named`), the base model (`base`) and the base model with its
own residual (`corrected`); where the drum's has not, the last two are of the drum fitted to both
pictures at the true size of its grains (`drum_fit.py`: 94 pours, an hour of one core). Each row has
the 90 % interval of one measurement. Where a model has nothing to say it has no row, and the
command says so.
"""

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from granulcal.experiments.predictions.column_picture import draw
from granulcal.experiments.predictions.column_tests import read_fronts
from granulcal.experiments.predictions.columns import (
    column_rows,
    column_rows_without_physics,
)
from granulcal.experiments.predictions.drum import (
    drum_rows,
    drum_rows_without_loop,
    poured_of_drum,
)
from granulcal.experiments.predictions.fitted_columns import fitted_rows, poured_of_columns
from granulcal.files import write_beside
from granulcal.loop.report.models import Models
from granulcal.pours.pour_time import PourKind

__all__ = ["poured", "reproduce", "write_csv"]


def reproduce(out: Path, data: Path) -> None:
    """Writes `drum.csv`, `drum_slopes.csv` and `columns.csv` to `out`/predictions."""
    folder = out / "predictions"
    drum = _models(out / "loop_drum" / "both", "loop_drum")
    pours = out / "predictions-pours" if drum is None else None
    profiles, slopes = drum_rows_without_loop(data, pours, say=print)
    if drum is not None:
        more = drum_rows(drum, out / "loop_drum" / "pours", say=print)
        profiles, slopes = more[0] + profiles, more[1] + slopes
    write_csv(folder / "drum.csv", ("model", "rpm", "x_mm", "z_mm", "low", "high"), profiles)
    write_csv(folder / "drum_slopes.csv", ("model", "rpm", "slope_deg", "low", "high"), slopes)
    fronts = column_rows_without_physics(data, say=print)
    fronts = fitted_rows(data, out / "predictions-pours" / "columns", say=print) + fronts
    column = _models(out / "loop_column", "loop_column")
    if column is not None:
        fronts = column_rows(column, out / "loop_column" / "pours", data, say=print) + fronts
    header = ("model", "test", "time_s", "radius_mm", "low", "high")
    write_csv(folder / "columns.csv", header, fronts)
    draw(folder / "columns.png", read_fronts(data), fronts)
    print(folder)


def poured(data: Path) -> list[PourKind]:
    """Returns what is poured where no loop has been closed, for `--dry-run`."""
    return [*poured_of_drum(data), *poured_of_columns(data)]


def write_csv(path: Path, header: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """Writes a table; numbers have five digits."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows([f"{v:.5g}" if isinstance(v, float) else v for v in row] for row in rows)
    write_beside(path, text.getvalue())


def _models(folder: Path, study: str) -> Models | None:
    try:
        return Models.load(folder)
    except FileNotFoundError:
        print(f"no rows of models: {folder / 'models.json'} is made by granulcal reproduce {study}")
        return None
