import doctest
import importlib
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

_EXAMPLES = Path(__file__).parents[2] / "examples"


def _run(name: str, *words: str) -> None:
    before = sys.argv
    sys.argv = [name, *words]
    try:
        runpy.run_path(str(_EXAMPLES / name), run_name="__main__")
    finally:
        sys.argv = before


def test_every_example_is_run_here():
    text = Path(__file__).read_text()
    scripts = sorted(path.name for path in _EXAMPLES.glob("*.py"))
    assert scripts
    assert [name for name in scripts if f'"{name}"' not in text] == []


def test_one_pour(capsys):
    _run("one_pour.py", "--count", "100")
    assert "chi_df" in capsys.readouterr().out


@pytest.mark.slow
def test_neighbours_in_a_packing(capsys):
    _run("neighbours.py")
    counts = [
        float(line.split(": ")[1].split()[0]) for line in capsys.readouterr().out.splitlines()
    ]
    # The fluid takes eight for crowded (docs/theory/effects.md).
    assert len(counts) == 2
    assert all(abs(count - 8) < 1 for count in counts)


def test_side_view(tmp_path):
    pytest.importorskip("matplotlib")
    np.save(tmp_path / "at.npy", np.random.default_rng(0).uniform(0.0, 0.05, (40, 3)))
    out = tmp_path / "side.png"
    _run("side_view.py", str(tmp_path / "at.npy"), "-o", str(out))
    assert out.read_bytes().startswith(b"\x89PNG")


def test_funnel_stl_is_what_stands_there(tmp_path, monkeypatch):
    script = tmp_path / "funnel_stl.py"
    script.write_text((_EXAMPLES / "funnel_stl.py").read_text())
    monkeypatch.setattr(sys, "argv", [str(script)])
    runpy.run_path(str(script), run_name="__main__")
    made = (tmp_path / "funnel.stl").read_bytes()
    there = (_EXAMPLES / "funnel.stl").read_bytes()
    assert len(made) == len(there)
    # Sines may differ by a rounding from machine to machine.
    numbers = [np.frombuffer(stl[84:], np.uint8).reshape(-1, 50)[:, :48] for stl in (made, there)]
    made, there = (np.ascontiguousarray(n).view("<f4") for n in numbers)
    np.testing.assert_allclose(made, there, rtol=1e-6, atol=1e-5)


def test_describe_recording(capsys):
    _run("describe_recording.py", "--count", "200")
    assert "ground tilted by 3.0" in capsys.readouterr().out


def test_calibrate(tmp_path, capsys):
    pytest.importorskip("torch")
    _run("calibrate.py", "--pours", "60", "--count", "60", "--out", str(tmp_path / "pours"))
    assert "material.restitution" in capsys.readouterr().out


@pytest.mark.parametrize(
    "name",
    [
        "granulcal",
        "granulcal.design.ring",
        "granulcal.prior",
        "granulcal.pours.contacts",
        "granulcal.pours.pour",
        "granulcal.pours.scene",
        "granulcal.pours.simulation",
        "granulcal.pours.statistics",
        "granulcal.pours.trajectory",
    ],
)
def test_docstrings(name):
    found = doctest.testmod(importlib.import_module(name))
    assert found.attempted > 0
    assert found.failed == 0


def test_docstrings_that_write(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    for name in (
        "granulcal.pours.dataset",
        "granulcal.measured.recording",
        "granulcal.design.rings",
    ):
        found = doctest.testmod(importlib.import_module(name))
        assert (found.attempted > 0, found.failed) == (True, 0), capsys.readouterr().out


def test_peers(capsys):
    _run("peers.py", "--set", "P", "--seeds", "1", "--count", "100")
    assert "| 1 | at_rest |" in capsys.readouterr().out
