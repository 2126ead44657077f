"""Scenes that others have measured: a drum, a column, a hopper. docs/results/measured-scenes.md.

Nothing is fitted but the drum's friction coefficients, and that by a prior over its scene. What
comes out is written down as it is.
"""

from pathlib import Path

from granulcal.experiments.measured_scenes import column, drum, hopper
from granulcal.files import write_beside

__all__ = ["reproduce"]


def reproduce(out_dir: Path, data_dir: Path) -> None:
    """Runs the three comparisons and writes `results.md` and a picture each to `out_dir`."""
    out_dir.mkdir(parents=True, exist_ok=True)
    parts = []
    for study in (column, hopper, drum):
        parts.append(study.reproduce(out_dir, data_dir))
        print(parts[-1], flush=True)
    write_beside(out_dir / "results.md", "\n\n".join(parts) + "\n")
    print(f"table and pictures in {out_dir}")
