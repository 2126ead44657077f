"""The contact solver against the law in NumPy, and against siconos where it is installed."""

import importlib.util
import json
import os
import shlex
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

REFEREE = Path(__file__).parents[2] / "scripts" / "referee"
CLI = [sys.executable, "-m", "granulcal.cli"]
SICONOS_PYTHON = os.environ.get("SICONOS_PYTHON", "/usr/bin/python3")
SOLVED = 1e-12  # residual of the law [m/s]


def _load(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, REFEREE / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = sys.modules.setdefault(name, importlib.util.module_from_spec(spec))
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def siconos() -> str:
    """The Python that has siconos."""
    probe = [SICONOS_PYTHON, "-c", "import siconos.numerics"]
    try:
        subprocess.run(probe, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("siconos not installed")
    return SICONOS_PYTHON


@pytest.fixture(scope="module")
def frozen(tmp_path_factory: pytest.TempPathFactory):
    """Grains that land, with everything that a contact can do."""
    path = tmp_path_factory.mktemp("frozen") / "frozen.npz"
    cases = _load("cases")
    case = next(case for case in cases.CASES if case.name == "roll-slide")
    subprocess.run([*CLI, *case.arguments(path)], check=True, capture_output=True)
    return _load("frozen").FrozenProblem(path)


def test_arrays_follow_the_equations(frozen):
    v, impulses = frozen["velocity"], frozen["impulse"]
    t, n = frozen["tangents"], frozen["normal"]
    frame = np.stack([t[:, 0], t[:, 1], n], axis=1)
    assert np.allclose(frame @ frame.transpose(0, 2, 1), np.eye(3), atol=1e-14)
    assert np.allclose(np.linalg.det(frame), 1.0)
    assert np.allclose(frozen.velocities(impulses), v, atol=1e-14)
    # J v + bias from the kinematics is W r + q from the blocks.
    wall = frozen["partner"] < 0
    i, j = frozen["grain"], np.where(wall, 0, frozen["partner"])
    v_i, w_i = v[i, :3], v[i, 3:]
    v_j, w_j = (np.where(wall[:, None], 0.0, v[j, half]) for half in (slice(0, 3), slice(3, 6)))
    u = v_i - v_j + np.cross(n, w_i + w_j)
    rho = frozen["lever"][:, :1] * w_i - frozen["lever"][:, 1:] * w_j
    rows = [n, t[:, 0], t[:, 1]], [t[:, 0], t[:, 1], n]
    relative = [
        np.sum(d * vector, axis=1)
        for vector, side in zip((u, rho), rows, strict=True)
        for d in side
    ]
    y = np.stack(relative, axis=1) + frozen["bias"]
    assert np.allclose(frozen.relative_velocities(impulses), y, atol=1e-13)


def test_the_solution_is_that_of_the_law(frozen):
    impulses = frozen["impulse"]
    assert frozen.residual(impulses) <= SOLVED
    y, r = frozen.relative_velocities(impulses), impulses
    carries = r[:, 0] > 0
    assert np.count_nonzero(carries) > 20
    # The three statements of docs/theory/contact-problem.md, without projections.
    assert y[:, 0].min() >= -SOLVED
    assert np.abs(y[carries, 0]).max() <= SOLVED
    modes = set()
    for first, last, friction in ((1, 3, "sliding_friction"), (3, 5, "rolling_friction")):
        limit = frozen[friction] * r[:, 0]
        impulse, velocity = r[:, first:last], y[:, first:last]
        size = np.linalg.norm(impulse, axis=1)
        assert (size <= limit + SOLVED).all()
        inside = carries & (size < limit * (1 - 1e-6))
        assert np.abs(velocity[inside]).max(initial=0.0) <= 10 * SOLVED
        rim = carries & ~inside
        speed = np.linalg.norm(velocity, axis=1)
        opposed = np.sum(impulse * velocity, axis=1) + size * speed
        assert np.abs(opposed[rim]).max(initial=0.0) <= SOLVED
        modes |= {(friction, "stick", inside.any()), (friction, "slip", rim.any())}
    assert modes == {
        (friction, mode, True)
        for friction in ("sliding_friction", "rolling_friction")
        for mode in ("stick", "slip")
    }


def _examine(python: str, *names: str) -> list[dict]:
    words = [word for name in names for word in ("--case", name)]
    script = [python, str(REFEREE / "referee.py"), "--json", "--cli", shlex.join(CLI), *words]
    done = subprocess.run(script, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


def test_siconos_finds_the_same_velocities(siconos):
    rows = _examine(
        siconos, "drop-slide", "drop-smooth", "funnel-rough", "roll-easy", "roll-impact"
    )
    for row in rows:
        assert row["verdict"] == "agrees", row
        # A substep in which contacts do nothing would agree, too.
        assert row["carrying"] > 10 and row["change"] > 1e-3, row


@pytest.mark.slow
def test_siconos_in_every_case(siconos):
    cases = _load("cases").CASES
    rows = _examine(siconos, *(case.name for case in cases))
    assert [row["verdict"] for row in rows] == [case.expected for case in cases]
    assert sum(row["verdict"] == "agrees" for row in rows) >= 20
