"""The commands of README.md, run as they are written, on pours of a few grains."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from granulcal.engines import installed

ROOT = Path(__file__).parents[2]
# What makes the commands small: the words that are replaced, and by what. Nothing else is changed.
SMALL = {
    "granulcal init couscous": "granulcal init couscous --set grains.count=120 --preset fast",
    "-n 1000": "-n 64",
    "n=1000": "n=64",
    "--budget 100": "--budget 60",
    "-o report.html": "-o report.html --seeds 1 --draws 2",
    "close-loop loop.toml -o loop": "close-loop loop.toml -o loop --budget 200",
    "--pile 0.04 -o plan": "--pile 0.04 -o plan --pours 60 --extrapolate",
    "wall.bag --baseline 0.05": "wall.bag --baseline 0.05 --frames 3 --sessions 2",
}
# May end with 3: so few pours make no model that may be trusted.
MAY_END_WITH_3 = [
    "train",
    "check",
    "infer",
    "calibrate",
    "report",
    "close-loop",
    "design",
    "generate",
]
# May be refused: no height of so few grains makes these rings, so few pours no verdict.
MAY_BE_REFUSED = ("design rings", "close-loop")


def blocks(language: str = "") -> list[str]:
    """Returns the code blocks of README.md in a language."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.S | re.M)


def commands() -> list[str]:
    """Returns the lines of the block that begins with `granulcal init`, without their comments."""
    block = next(block for block in blocks() if block.startswith("granulcal init"))
    lines = (re.sub(r"\s+#.*", "", line).strip() for line in block.splitlines())
    return [line for line in lines if line]


def small(line: str) -> str:
    for words, fewer in SMALL.items():
        line = line.replace(words, fewer)
    return line


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with `granulcal` on the path, this environment's."""
    folder = tmp_path_factory.mktemp("newcomer")
    tool = folder / "bin" / "granulcal"
    tool.parent.mkdir()
    tool.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m granulcal.cli "$@"\n')
    tool.chmod(0o755)
    return folder


def run(line: str, place: Path, folder: str = "couscous") -> subprocess.CompletedProcess[str]:
    cwd = place / folder if (place / folder).exists() else place
    environment = {**os.environ, "PATH": f"{place / 'bin'}:{os.environ['PATH']}"}
    words = ["bash", "-c", line]
    done = subprocess.run(
        words, cwd=cwd, env=environment, capture_output=True, text=True, check=False
    )
    word = line.split()[1]
    allowed = (0, 3) if word in MAY_END_WITH_3 else (0,)
    if line.startswith(tuple(f"granulcal {words}" for words in MAY_BE_REFUSED)):
        allowed = (0, 2, 3)
    assert done.returncode in allowed, f"{line}\n{done.stdout}\n{done.stderr}"
    assert "Traceback" not in done.stderr, done.stderr
    return done


def test_every_replacement_is_of_words_in_the_readme() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert [words for words in SMALL if words not in text] == []


def test_the_first_commands_run_as_written(place: Path) -> None:
    pytest.importorskip("rosbags")
    lines = commands()
    until = next(i for i, line in enumerate(lines) if line.startswith("granulcal generate"))
    for line in lines[:until]:
        run(small(line), place)
    assert (place / "couscous" / "sensor.toml").exists()
    run("granulcal --help", place)


@pytest.mark.slow
def test_all_commands_run_as_written(place: Path) -> None:
    pytest.importorskip("torch")
    pytest.importorskip("rosbags")
    lines = commands()
    start = 0 if not (place / "couscous").exists() else next(
        i for i, line in enumerate(lines) if line.startswith("granulcal generate")
    )  # fmt: skip
    for line in lines[start:]:
        if "--engine lammps" in line and not installed("lammps"):
            # The one command that needs another program; the workflow `newcomer` has it.
            continue
        run(small(line), place)
    folder = place / "couscous"
    for name in ("report.html", "posterior.json", "pair.png", "materials/mode.xml", "pile.vtk"):
        assert (folder / name).stat().st_size > 0
    (folder / "readme.py").write_text(small(blocks("python")[0]))
    run(f'"{sys.executable}" readme.py', place)
