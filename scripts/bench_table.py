"""Prints what criterion has measured as one table, with the bars of benches/bars.toml.

`make bench` runs the benchmarks and then this; it can also be run by itself. Python's standard
library is enough.
"""

import argparse
import json
import os
import platform
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
HEADINGS = ("benchmark", "median", "95 %", "each", "bar", "met")
# Criterion's name of a throughput, as the unit of one.
THROUGHPUTS = ("Elements", "Bytes", "BytesDecimal", "Bits")


@dataclass(frozen=True)
class Measured:
    """One benchmark: its name, the median of an iteration [s] with its interval, its elements."""

    name: str
    median: float
    low: float
    high: float
    elements: float | None
    written: float


def main() -> int:
    """Prints the table; 1 if nothing was measured or a bar names no benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    parser.add_argument("--criterion", type=Path, default=target / "criterion")
    parser.add_argument("--bars", type=Path, default=ROOT / "benches" / "bars.toml")
    parser.add_argument(
        "--newer-than", type=Path, metavar="FILE", help="only what was measured after FILE was"
    )
    arguments = parser.parse_args()
    since = arguments.newer_than.stat().st_mtime if arguments.newer_than else 0.0
    measured = [each for each in read(arguments.criterion) if each.written >= since]
    if not measured:
        print(f"no benchmark in {arguments.criterion}; run `cargo bench`", file=sys.stderr)
        return 1
    bars = tomllib.loads(arguments.bars.read_text(encoding="utf-8"))["at_most_s"]
    print(f"{machine()}\n")
    print(table([HEADINGS, *(row(each, bars.get(each.name)) for each in measured)]))
    missing = sorted(set(bars) - {each.name for each in measured})
    if missing and not since:
        print(f"\nbars without a benchmark: {', '.join(missing)}", file=sys.stderr)
        return 1
    return 0


def read(folder: Path) -> list[Measured]:
    """Returns the last run of every benchmark below `folder`, in order of their names."""
    found = []
    for path in folder.rglob("new/benchmark.json"):
        about = json.loads(path.read_text(encoding="utf-8"))
        estimates = path.with_name("estimates.json")
        median = json.loads(estimates.read_text(encoding="utf-8"))["median"]
        interval = median["confidence_interval"]
        throughput = about.get("throughput") or {}
        elements = next((throughput[kind] for kind in THROUGHPUTS if kind in throughput), None)
        seconds = [
            1e-9 * value
            for value in (
                median["point_estimate"],
                interval["lower_bound"],
                interval["upper_bound"],
            )
        ]
        found.append(Measured(about["full_id"], *seconds, elements, estimates.stat().st_mtime))
    return sorted(found, key=lambda each: natural(each.name))


def natural(name: str) -> list[tuple[bool, int, str]]:
    """Returns a key that sorts numbers in a name by value."""
    parts = name.replace("_", "/").split("/")
    return [(part.isdigit(), int(part) if part.isdigit() else 0, part) for part in parts]


def row(each: Measured, bar: float | None) -> tuple[str, ...]:
    """Returns the cells of one benchmark; the bar holds the median."""
    half = max(each.high - each.median, each.median - each.low) / each.median
    per_element = seconds(each.median / each.elements) if each.elements else ""
    met = "" if bar is None else "yes" if each.median <= bar else f"NO, {each.median / bar:.2f}x"
    shown = "" if bar is None else f"{seconds(bar)}"
    return (each.name, seconds(each.median), f"±{100 * half:.0f} %", per_element, shown, met)


def seconds(value: float) -> str:
    """Returns a time with a unit that leaves three digits."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if value >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value / 1e-9:.3g} ns"


def table(rows: list[tuple[str, ...]]) -> str:
    """Returns rows as aligned columns, the first one to the left."""
    widths = [max(len(cells[column]) for cells in rows) for column in range(len(rows[0]))]

    def line(cells: tuple[str, ...]) -> str:
        rest = (cell.rjust(width) for cell, width in zip(cells[1:], widths[1:], strict=True))
        return "  ".join([cells[0].ljust(widths[0]), *rest]).rstrip()

    rule = "  ".join("-" * width for width in widths)
    return "\n".join([line(rows[0]), rule, *map(line, rows[1:])])


def machine() -> str:
    """Returns the processor, its number of cores and how busy it is."""
    model = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        lines = cpuinfo.read_text(encoding="utf-8").splitlines()
        model = next((x.split(":", 1)[1].strip() for x in lines if "model name" in x), model)
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return f"{model}, {os.cpu_count()} cores{load}"


if __name__ == "__main__":
    sys.exit(main())
