"""Predictions of the closed loops of drum and columns, for others to judge: three CSV files.

    granulcal reproduce loop_drum --out out          # once; writes out/loop_drum/both/models.json
    granulcal reproduce loop_column --out out        # once; writes out/loop_column/models.json
    granulcal reproduce predictions --out out        # out/predictions/*.csv

Every file has the verdict's model (`named`), the base model (`base`), the base model with its own
residual (`corrected`) and what needs no model at all (`line`, `nearest`), each with the 90 %
interval of one measurement. Where a model has nothing to say, because the correction would reach
too far or no straight line is spanned, it has no row, and the command says so.
"""

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from granulcal.experiments.predictions.columns import column_rows
from granulcal.experiments.predictions.drum import drum_rows
from granulcal.files import write_beside
from granulcal.loop.report.models import Models

__all__ = ["reproduce", "write_csv"]


def reproduce(out: Path, data: Path) -> None:
    """Writes `drum.csv`, `drum_slopes.csv` and `columns.csv` to `out`/predictions.

    Raises:
        FileNotFoundError: a loop that has not been closed yet.
    """
    folder = out / "predictions"
    drum, column = (_models(out / "loop_drum" / "both"), _models(out / "loop_column"))
    profiles, slopes = drum_rows(drum, out / "loop_drum" / "pours", say=print)
    write_csv(folder / "drum.csv", ("model", "rpm", "x_mm", "z_mm", "low", "high"), profiles)
    write_csv(folder / "drum_slopes.csv", ("model", "rpm", "slope_deg", "low", "high"), slopes)
    fronts = column_rows(column, out / "loop_column" / "pours", data, say=print)
    header = ("model", "test", "time_s", "radius_mm", "low", "high")
    write_csv(folder / "columns.csv", header, fronts)
    print(folder)


def write_csv(path: Path, header: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """Writes a table; numbers have five digits."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows([f"{v:.5g}" if isinstance(v, float) else v for v in row] for row in rows)
    write_beside(path, text.getvalue())


def _models(folder: Path) -> Models:
    study = "loop_drum" if folder.name == "both" else "loop_column"
    try:
        return Models.load(folder)
    except FileNotFoundError:
        raise FileNotFoundError(
            f"{folder / 'models.json'} is not there: granulcal reproduce {study} makes it"
        ) from None
