"""Ctrl-C and SIGTERM end every command, with code 130 and no traceback; twice forces it.

Each command runs in a process of its own that says when its work has begun and then never comes to
an end by itself: `train` fits again and again, `calibrate` has a budget that nobody waits for. So
there is no race with the clock. How long the end took is printed; `pytest -s` shows it.
"""

import gc as gc_module
import os
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import granulcal as gc
from granulcal.bayessim import BayesSim

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")

# Marks the begin of the work in `what`, which is then repeated for ever.
DRIVER = """
import importlib, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
# A job that outlives its terminal (nohup) ignores it, and so would this one.
if hasattr(signal, "SIGHUP"):
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
from granulcal import cli
owner, name, repeats = {owner!r}, {name!r}, {repeats!r}
module, _, inner = owner.partition(":")
place = importlib.import_module(module)
place = getattr(place, inner) if inner else place
real = getattr(place, name)
def work(*args, **kwargs):
    print("begun", flush=True)
    while True:
        found = real(*args, **kwargs)
        if not repeats:
            return found
if isinstance(place, type):
    is_of_class = isinstance(place.__dict__[name], classmethod)
    setattr(place, name, staticmethod(work) if is_of_class else work)
else:
    setattr(place, name, work)
sys.argv = ["granulcal", *{words!r}]
sys.exit(cli.console())
"""
QUICK: dict[str, Any] = {
    "features": 8,
    "ensemble": 2,
    "components": 2,
    "emulator_features": 8,
    "max_epochs": 10,
}
TASK = """
scene = "scene.toml"
prior = "prior.toml"
effects = ["drag"]
camera = "camera.toml"
[[conditions]]
name = "low"
at = { "start.height" = 0.02 }
use = "fit"
recordings = ["depth.png", "second.png"]
[[conditions]]
name = "high"
at = { "start.height" = 0.04 }
use = "fit"
recordings = ["third.png", "fourth.png"]
"""


@pytest.fixture(scope="module")
def folder(small_data, small_scene, small_prior, tmp_path_factory) -> Path:
    """A scene, a prior, pours, a model and a recording."""
    place = tmp_path_factory.mktemp("interrupted")
    (place / "scene.toml").write_text(small_scene.to_toml())
    (place / "prior.toml").write_text(small_prior.to_toml())
    small_data.save(place / "pours.parquet")
    model = BayesSim.fit(small_data, quiet=True, **QUICK)
    model.save(place / "model")
    camera = gc.Camera.overhead(
        height=small_scene.get("camera.height"),
        field_width=small_scene.get("camera.field_width"),
        pixels=int(small_scene.get("camera.pixels")),
    )
    pour = gc.simulate(small_scene, seed=11)
    camera.record(pour.positions, pour.radii, place)
    for seed, name in enumerate(("second", "third", "fourth"), start=12):
        pour = gc.simulate(small_scene, seed=seed)
        image, _ = camera.record(pour.positions, pour.radii, place / name)
        image.rename(place / f"{name}.png")
    (place / "loop.toml").write_text(TASK)
    return place


CALIBRATE = "calibrate scene.toml prior.toml depth.png"
# Command line, and what of it marks the begin: owner, name, whether it is repeated for ever.
COMMANDS = {
    "train": (
        ["train", "pours.parquet", "-o", "new"],
        ("granulcal.bayessim:BayesSim", "fit", True),
    ),
    "check": (
        ["check", "model", "--data", "pours.parquet"],
        ("granulcal.bayessim:BayesSim", "examine", True),
    ),
    "infer": (
        ["infer", "model", "depth.png", "--camera", "camera.toml"],
        ("granulcal._native", "run_cli", True),
    ),
    "generate": (
        ["generate", "scene.toml", "prior.toml", "-n", "100000", "-o", "batch"],
        ("granulcal._native", "run_cli", False),
    ),
    "calibrate": (
        [*CALIBRATE.split(), "--camera", "camera.toml", "--budget", "20000", "-o", "run"],
        ("granulcal._native", "simulate", False),
    ),
    "close-loop": (
        ["close-loop", "loop.toml", "-o", "loop", "--budget", "20000"],
        ("granulcal._native", "generate", False),
    ),
    "reproduce": (
        ["reproduce", "paper", "--quick", "--out", "out"],
        ("granulcal._native", "simulate", False),
    ),
}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("times", [1, 2])
@pytest.mark.parametrize("command", COMMANDS)
def test_a_signal_ends_the_command(
    folder: Path, tmp_path: Path, command: str, times: int, number: signal.Signals
) -> None:
    words, (owner, name, repeats) = COMMANDS[command]
    # What is read is there, what is written is of this test alone.
    named = [str(folder / w) if (folder / w).exists() else w for w in words]
    code = DRIVER.format(owner=owner, name=name, repeats=repeats, words=named)
    process = subprocess.Popen(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"GRANULCAL_NO_LIMITS": "1"},
    )
    try:
        assert process.stdout is not None
        said = []
        for line in process.stdout:
            said.append(line)
            if line == "begun\n":
                break
        assert said and said[-1] == "begun\n", (said, process.communicate()[1])
        started = time.monotonic()
        for _ in range(times):
            process.send_signal(number)
            time.sleep(0.02)
        _, error = process.communicate(timeout=120)
        print(f"{command}, {number.name} {times}x: {time.monotonic() - started:.2f} s")
    finally:
        with process:
            process.kill()
    assert process.returncode == 130, error
    assert "Traceback" not in error, error
    # The second time ends it at once, whatever there was to say.
    assert times == 2 or "stopped" in error, error
    left = [path for path in tmp_path.rglob("*") if path.name.endswith(".tmp")]
    assert left == []


@pytest.mark.parametrize("number", ["SIGHUP", "SIGXCPU"])
def test_a_closed_terminal_and_used_up_time_end_the_command(
    folder: Path, tmp_path: Path, number: str
) -> None:
    test_a_signal_ends_the_command(folder, tmp_path, "calibrate", 1, signal.Signals[number])


def test_a_second_run_into_the_same_pours_is_refused(
    small_scene, small_prior, tmp_path: Path
) -> None:
    from granulcal.pours.kept_pours import KeptPours

    path = tmp_path / "run" / "pours.json"
    code = (
        "import sys, time\nfrom pathlib import Path\nfrom granulcal.pours.one_run import OneRun\n"
        f"held = OneRun.of(Path({str(path)!r}))\nprint('held', flush=True)\ntime.sleep(600)\n"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as other:
        try:
            assert other.stdout is not None and other.stdout.readline() == "held\n"
            with pytest.raises(BlockingIOError, match="another run is pouring into this file"):
                KeptPours(small_scene, small_prior, path, threads=1)
        finally:
            other.kill()
            other.wait()
    # What was killed holds nothing, and one process may look twice.
    first = KeptPours(small_scene, small_prior, path, threads=1)
    second = KeptPours(small_scene, small_prior, path, threads=1)
    assert first.rows == second.rows == {}


def test_what_holds_pours_is_let_go_when_a_circle_is_collected(tmp_path: Path) -> None:
    """A file in the circle was collected before what would have closed it, with a warning."""
    from granulcal.pours.one_run import OneRun

    circle: list[Any] = [OneRun.of(tmp_path / "pours.json")]
    circle.append(circle)
    del circle
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        gc_module.collect()
    assert not said
    assert OneRun.of(tmp_path / "pours.json") is not None


def test_finished_pours_of_an_interrupted_calibration_are_kept(
    small_scene, small_prior, tmp_path: Path
) -> None:
    from granulcal.pours.kept_pours import KeptPours

    kept = KeptPours(small_scene, small_prior, tmp_path / "pours.json", threads=1)

    def stop(count: int) -> None:
        if count == 3:
            raise KeyboardInterrupt

    kept.progress = stop
    theta = np.repeat(small_prior.mean()[None], 6, axis=0)
    with pytest.raises(KeyboardInterrupt):
        kept(theta, 0)
    again = KeptPours(small_scene, small_prior, tmp_path / "pours.json", threads=1)
    assert len(again.rows) >= 3


def test_pours_that_lack_a_statistic_are_kept(small_scene, small_prior, tmp_path: Path) -> None:
    from granulcal.pours.kept_pours import KeptPours

    path, theta = tmp_path / "pours.json", small_prior.sample(2, seed=1)
    # What a pour does not show is no number, and no number of JSON.
    look = ("radius", "late"), lambda _: [0.01, np.nan]
    made = KeptPours(small_scene, small_prior, path, threads=1, look=look)(theta, 0)
    again = KeptPours(small_scene, small_prior, path, threads=1, look=look)
    assert again.kept_of(theta) == 2 and again.left_out(2).unseen == 2
    assert np.array_equal(again(theta, 0), made, equal_nan=True)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_after_a_command_signals_do_what_they_did_before(number: signal.Signals) -> None:
    code = (
        "import os, signal, time\nfrom granulcal import cli\n"
        # What a shell starts in the background ignores SIGINT.
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)\n"
        "assert cli.main(['features', '--list']) == 0\n"
        "assert cli.main(['infer', 'none', 'none.png']) == 2\n"
        "assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before\n"
        f"os.kill(os.getpid(), {int(number)})\ntime.sleep(60)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=50)
    # SIGINT raises a KeyboardInterrupt, of which Python dies by the signal; SIGTERM ends at once.
    assert done.returncode == -number, done.stderr
    assert number == signal.SIGTERM or done.stderr.endswith("KeyboardInterrupt\n"), done.stderr


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_before_or_after_a_command_ends_the_process_with_the_same_code(
    number: signal.Signals,
) -> None:
    for begin, end in (("ask()", ""), ("", "ask()")):
        code = (
            "import os, signal, sys\nfrom granulcal import cli\n"
            "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
            f"def ask(): os.kill(os.getpid(), {int(number)})\n"
            "real = cli.main\n"
            f"def main():\n    {begin or 'pass'}\n    code = real(['features', '--list'])\n"
            f"    {end or 'pass'}\n    return code\n"
            "cli.main = main\nsys.exit(cli.console())\n"
        )
        words = [sys.executable, "-c", code]
        done = subprocess.run(words, capture_output=True, text=True, timeout=50)
        assert (done.returncode, done.stderr) == (130, ""), (begin, end)
