"""Fuzzes what reads the TOML of a closed loop: what breaks it is an error that is not its own.

    python fuzz/task.py 600

Python reads it, so libFuzzer cannot: copies of a task are damaged as `tests/python/mutations.py`
does, those that are read are damaged again, for so many seconds. What breaks the reader, or takes
it long, is left in `fuzz/found/task`.
"""

import sys
import tempfile
import time
import warnings
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests" / "python"))

import numpy as np  # noqa: E402
from mutations import mutations  # noqa: E402  # pyright: ignore[reportMissingImports]

import granulcal as gc  # noqa: E402
from granulcal.loop.task import Task  # noqa: E402

# Longest that a document of a task's size may take [s].
MOST_SECONDS = 5.0
TASK = (ROOT / "fuzz" / "corpus" / "task" / "loop.toml").read_bytes()


def fill(folder: Path) -> Path:
    """Writes what the task names beside where it will be; returns its path."""
    (folder / "scene.toml").write_text(gc.Scene.drop(0.01).to_toml())
    (folder / "prior.toml").write_text(gc.Prior.default().to_toml())
    camera = gc.Camera.overhead(height=0.4, field_width=0.2, pixels=40)
    generator = np.random.default_rng(0)
    grains = np.c_[generator.normal(0, 0.02, (60, 2)), np.full(60, 0.004)]
    camera.record(grains, np.full(60, 0.004), folder)
    for i in range(4):
        (folder / f"pour-{i}.png").write_bytes((folder / "depth.png").read_bytes())
    return folder / "loop.toml"


def main(seconds: float) -> int:
    """Fuzzes; returns how many damaged tasks broke the reader."""
    warnings.simplefilter("ignore")
    generator = np.random.default_rng()
    seeds, tried, read, broken = [TASK], 0, 0, 0
    end = time.monotonic() + seconds
    with tempfile.TemporaryDirectory() as name:
        path = fill(Path(name))
        while time.monotonic() < end:
            whole = seeds[generator.integers(len(seeds))]
            seed = int(generator.integers(2**31))
            for data in mutations(whole, 50, seed=seed, is_text=True):
                path.write_bytes(data)
                begun = time.monotonic()
                fault = ""
                try:
                    Task.load(path)
                    read += 1
                    if data and len(seeds) < 1000:
                        seeds.append(data)
                except (ValueError, OSError) as error:
                    fault = "" if str(error) else "an error without words"
                except Exception as error:
                    fault = f"{type(error).__name__}: {error}"
                if time.monotonic() - begun > MOST_SECONDS:
                    fault = f"{time.monotonic() - begun:.1f} s"
                tried += 1
                if fault:
                    broken += 1
                    found = ROOT / "fuzz" / "found" / "task"
                    found.mkdir(parents=True, exist_ok=True)
                    (found / f"{seed}-{tried}.toml").write_bytes(data)
                    print(f"{fault[:300]}: fuzz/found/task/{seed}-{tried}.toml")
    print(f"task: {tried} damaged tasks, {read} of them read, {broken} broke the reader")
    return broken


if __name__ == "__main__":
    sys.exit(1 if main(float(sys.argv[1]) if len(sys.argv) > 1 else 600.0) else 0)
