"""What a pour costs beside an earlier commit: both binaries in one run, pour by pour in turn.

    python benches/before.py              # commit e175466, set P at 5 seeds, 40 draws of the prior

The earlier commit is checked out and built below build/before, once. Processor times of one core;
what counts are the ratios. Bars: BARS below.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import granulcal as gc

ROOT = Path(__file__).parents[1]
BUILD = ROOT / "build" / "before"
BARS = {"set P": 0.45, "default prior": 0.5}
"""Ratio of the mean times that is asked for at most."""
SET_P = """
[material]
sliding_friction = 0.5
rolling_friction = 0.6
restitution = 0.3

[ground.material]
rolling_friction = 0.3

[funnel.material]
rolling_friction = 0.3
"""


def binary_of(commit: str) -> Path:
    """Returns granulcal-cli of a commit, built below build/before unless it is there."""
    source, target = BUILD / commit, BUILD / "target"
    if not source.exists():
        subprocess.run(["git", "worktree", "add", "--detach", source, commit], cwd=ROOT, check=True)
    return build(source, target)


def build(source: Path, target: Path) -> Path:
    """Returns granulcal-cli of a checkout, as cargo has built it."""
    command = ["cargo", "build", "--release", "--locked", "--quiet", "-p", "granulcal-cli"]
    environment = {**os.environ, "CARGO_TARGET_DIR": str(target)}
    subprocess.run(command, cwd=source, env=environment, check=True)
    return target / "release" / "granulcal-cli"


def pour(binary: Path, scene: str | Path, seed: int, changes: dict[str, float]) -> dict[str, Any]:
    """Returns what `simulate` says of a pour: `cpu_s` [s], `status` and more."""
    sets = [word for path, value in changes.items() for word in ("--set", f"{path}={value!r}")]
    command = [binary, "simulate", scene, "--seed", str(seed), "--json", "--quiet", *sets]
    # An unhealthy or jammed pour ends with a code of its own and has cost what it cost.
    told = subprocess.run(command, capture_output=True, text=True, check=False)
    if not told.stdout:
        raise RuntimeError(told.stderr)
    return json.loads(told.stdout)


def set_p(folder: Path, seeds: int) -> Iterator[tuple[str | Path, int, dict[str, float]]]:
    """Gives the pours of set P."""
    text = (ROOT / "examples" / "funnel.toml").read_text(encoding="utf-8")
    head, tail = text.split("[material]", 1)
    tables = tail[tail.index("[grains]") :]
    scene = folder / "set_p.toml"
    scene.write_text(head + tables + SET_P, encoding="utf-8")
    yield from ((scene, seed, {}) for seed in range(1, seeds + 1))


def prior(count: int) -> Iterator[tuple[str | Path, int, dict[str, float]]]:
    """Gives pours of the built-in funnel with materials of the default prior."""
    draws = gc.Prior.default()
    values = draws.sample(count, seed=12)
    for number, theta in enumerate(values):
        yield "funnel", number, dict(zip(draws.names, map(float, theta), strict=True))


def compare(name: str, before: Path, now: Path, pours: list[tuple[str | Path, int, dict]]) -> str:
    """Pours all with both binaries in turn; returns a row of the table."""
    costs, ends = [], []
    for number, (scene, seed, changes) in enumerate(pours, 1):
        rows = [pour(binary, scene, seed, changes) for binary in (before, now)]
        costs.append([row["cpu_s"] for row in rows])
        ends.append([row["status"] for row in rows])
        print(f"{name}: {number}/{len(pours)}", end="\r", file=sys.stderr, flush=True)
    costs = np.array(costs)
    ratio = costs[:, 1].mean() / costs[:, 0].mean()
    each = costs[:, 1] / costs[:, 0]
    cut = [sum(end[side] == "horizon" for end in ends) for side in range(2)]
    met = "met" if ratio <= BARS[name] else "missed"
    mean, (low, high) = costs.mean(axis=0), np.quantile(each, [0.1, 0.9])
    return (
        f"| {name} | {len(pours)} | {mean[0]:.2f} | {mean[1]:.2f} | **{ratio:.2f}** "
        f"| {low:.2f} to {high:.2f} | {cut[0]}, {cut[1]} | {BARS[name]}: {met} |"
    )


def main() -> int:
    """Prints the table; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--commit", default="e175466", help="the earlier one")
    parser.add_argument("--seeds", type=int, default=5, help="pours of set P")
    parser.add_argument("--draws", type=int, default=40, help="pours of the prior")
    asked = parser.parse_args()
    before = binary_of(asked.commit)
    now = build(ROOT, Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")))
    print("| pours | number | before, s | now, s | ratio | 80 % of them | at the horizon | bar |")
    print("|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        print(compare("set P", before, now, list(set_p(Path(folder), asked.seeds))), flush=True)
    print(compare("default prior", before, now, list(prior(asked.draws))))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
