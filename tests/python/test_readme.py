"""The commands of README.md, run as they are written, on pours of a few grains."""

import json
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
    # The least that its library of effects affords.
    "close-loop loop.toml -o loop": "close-loop loop.toml -o loop --budget 1300",
    "budget=4000": "budget=1300",
    "--corrected`": "--corrected --pours 4`",
    "predict posterior.json scene.toml": "predict posterior.json scene.toml --pours 4",
    # What so few grains make.
    "--ring 0.04 0.073 --pile 0.04 -o plan": "--pile 0.03 -o plan --pours 60 --extrapolate",
    "simulate examples/drum.toml": "simulate examples/drum.toml --set grains.count=400 "
    "--set grains.diameter=5e-3 --set start.spacing=5.3e-3 --set end.horizon=1.6",
    "-o spill": "-o spill --pours 30 --set grains.count=150",
    "wall.bag --baseline 0.05": "wall.bag --baseline 0.05 --frames 3 --sessions 2",
}
# From nothing to a run in another engine: lines of the block as they are, but for the model that
# ships in place of one that takes half an hour, and few grains for the engine.
ROAD = (
    "granulcal init",
    "granulcal sample",
    "granulcal check",
    "granulcal infer model couscous.bag",
    "granulcal export posterior",
    "granulcal export scene",
    "granulcal simulate scene.toml --engine",
)
SHIPPED = {
    "check model": "check funnel",
    "infer model": "infer funnel",
    "--engine lammps": "--engine lammps --set grains.count=40",
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
    "predict",
]
# Commands within sentences that are run here.
SHORT = (
    "granulcal infer funnel couscous.bag",
    "granulcal predict loop --at funnel.height=0.07 --corrected",
)
# Commands within sentences that are not, and why.
ELSEWHERE = {
    "granulcal pick-colour": "needs a picture in colours; crates/cli/tests/camera.rs has one",
    "granulcal model SCENE": "half an hour; test_models.py makes a small one",
    "granulcal generate --ray": "needs a cluster; test_cluster.py has one",
    "granulcal reproduce paper": "hours; test_paper.py runs small ones",
}
# Blocks that are not run here, and why.
BLOCKS_ELSEWHERE = {
    "git clone": "make test is what runs this, make demo a job of the workflow",
    "python3 -m venv": "a job of the workflow installs so",
}


def blocks(language: str = "") -> list[str]:
    """Returns the code blocks of README.md in a language."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    found = re.findall(r"^```(\w*)\n(.*?)^```", text, flags=re.S | re.M)
    return [block for name, block in found if name == language]


def commands(first: str = "granulcal init") -> list[str]:
    """Returns the lines of the block that begins with `first`, without their comments."""
    block = next(block for block in blocks() if block.startswith(first))
    lines = (re.sub(r"\s+#.*", "", line).strip() for line in block.splitlines())
    return [line for line in lines if line]


def within_sentences() -> list[str]:
    """Returns the commands that stand between backquotes in the text, on one line or on two."""
    text = re.sub(
        r"^```.*?^```", "", (ROOT / "README.md").read_text(encoding="utf-8"), flags=re.S | re.M
    )
    found = re.findall(r"`(granulcal\s[^`]+)`", text)
    return [" ".join(words.split()) for words in dict.fromkeys(found)]


def small(line: str, table: dict[str, str] = SMALL) -> str:
    for words, fewer in table.items():
        line = line.replace(words, fewer)
    return line


def in_another_engine(line: str) -> str:
    """Returns a line with an engine that is installed, of those beside LAMMPS in the README."""
    if "--engine lammps" not in line or installed("lammps"):
        return line
    there = next((name for name in ("mujoco", "yade") if installed(name)), None)
    if there is None:
        pytest.skip(f"{line}: neither LAMMPS nor MuJoCo nor YADE is installed")
    return line.replace("--engine lammps", f"--engine {there}")


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with `granulcal` on the path, this environment's."""
    if sys.platform == "win32":
        pytest.skip("the README's lines are those of a POSIX shell")
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
    assert done.returncode in allowed, f"{line}\n{done.stdout}\n{done.stderr}"
    assert "Traceback" not in done.stderr, done.stderr
    return done


def test_every_replacement_is_of_words_in_the_readme() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert [words for words in SMALL if words not in text] == []


def test_every_block_and_every_command_within_a_sentence_is_run_or_told_why_not() -> None:
    runs = ("granulcal init", "granulcal simulate examples/", "import granulcal", "task = ")
    starts = [block.splitlines()[0] for block in [*blocks(), *blocks("python")]]
    assert [s for s in starts if not s.startswith((*runs, *BLOCKS_ELSEWHERE))] == []
    assert set(within_sentences()) == {*ELSEWHERE, *SHORT}


def test_the_python_route_asks_for_the_misfit_before_the_posterior() -> None:
    block = next(block for block in blocks("python") if "import granulcal" in block)
    assert 0 < block.find("print(model.misfit(") < block.find("model.posterior(")


def test_the_first_commands_run_as_written(place: Path) -> None:
    pytest.importorskip("rosbags")
    lines = commands()
    until = next(i for i, line in enumerate(lines) if line.startswith("granulcal generate"))
    for line in lines[:until]:
        run(small(line), place)
    assert (place / "couscous" / "sensor.toml").exists()
    run("granulcal --help", place)


def test_a_newcomer_gets_from_init_to_a_run_in_another_engine(place: Path) -> None:
    pytest.importorskip("rosbags")
    road = place / "road"
    road.mkdir()
    (road / "bin").symlink_to(place / "bin")
    lines = [line for line in commands() if line.startswith(ROAD)]
    assert len(lines) == len(ROAD)
    done = [run(in_another_engine(small(line, SHIPPED)), road) for line in lines]
    assert [process.returncode for process in done] == [0] * len(ROAD)
    folder = road / "couscous"
    found = json.loads((folder / "posterior.json").read_text(encoding="utf-8"))["parameters"]
    truth = json.loads((folder / "truth.json").read_text(encoding="utf-8"))["material"]
    for name, told in found.items():
        low, high = told["interval90"]
        assert low < truth[name] < high
    head = (folder / "materials" / "mode.xml").read_text(encoding="utf-8")
    for name, told in found.items():
        assert float(re.findall(rf"{name} = (\S+)", head)[0]) == pytest.approx(told["mode"])
    assert (folder / "pour" / "in.pour").exists()
    theirs = json.loads(done[-1].stdout)
    # A grain of 4 mm lies on the ground at least, and few lie on others.
    assert theirs["status"] == "at_rest" and 0.002 < theirs["statistics"]["max_z"] < 0.02


@pytest.mark.slow
def test_all_commands_run_as_written(place: Path) -> None:
    pytest.importorskip("torch")
    pytest.importorskip("rosbags")
    lines = commands()
    start = 0 if not (place / "couscous").exists() else next(
        i for i, line in enumerate(lines) if line.startswith("granulcal generate")
    )  # fmt: skip
    for line in lines[start:]:
        run(small(in_another_engine(line)), place)
    folder = place / "couscous"
    for name in ("report.html", "posterior.json", "pair.png", "materials/mode.xml", "pile.vtk"):
        assert (folder / name).stat().st_size > 0
    for line in SHORT:
        run(small(f"{line}`").removesuffix("`"), place)
    python = blocks("python")
    assert len(python) == 2
    for number, block in enumerate(python):
        # The second goes on with what the first imports, and with the loop that is closed already.
        (folder / f"readme-{number}.py").write_text(
            small("import granulcal as gc\n" * number + block)
        )
        run(f'"{sys.executable}" readme-{number}.py', place)


@pytest.mark.slow
def test_the_commands_of_what_ships_in_examples_run_as_written(place: Path) -> None:
    (place / "repository").mkdir()
    (place / "repository" / "examples").symlink_to(ROOT / "examples")
    for line in commands("granulcal simulate examples/"):
        run(small(line), place, "repository")
    assert (place / "repository" / "spill" / "spill.json").exists()
