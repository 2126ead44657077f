"""Frozen contact problems solved by siconos' own non-smooth Gauss-Seidel methods.

Without rolling friction the problem is siconos' `FrictionContactProblem` (3 rows) as it stands.

With it, siconos' `RollingFrictionContactProblem` has 5 rows: normal, two tangents, two rolling
rows. It demands Coulomb's law of the tangents and the same law of the rolling rows, each in its
disk; granulcal's rolling impulse has three components, torsion included, in one ball. Both laws
agree for a contact whose rolling impulse and rolling velocity lie in the plane of its two rolling
rows. So siconos is given a plane for each contact, the planes are turned towards
lambda_r - rho / A_r of its solution, and so on: where they come to rest siconos has solved the law
of the ball, from nothing and without knowing what granulcal found
(docs/theory/contact-problem.md).
"""

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import siconos.numerics as sn
from frozen import FrozenProblem

TOLERANCE = 1e-14  # of siconos, relative to the norm of q
SOLVED = 1e-12  # residual of the law of the ball at which the planes rest [m/s]
MOST_TURNS = 300
MOST_PRODUCTS = 8e8  # of a block and an impulse, dense, of all turns together: some minutes at most


@dataclass
class Solution:
    """What siconos found."""

    impulses: np.ndarray  # (contacts, 6) [m/s]
    law: str
    turns: int
    sweeps: int
    residual: float  # of granulcal's law [m/s]


def solve(problem: FrozenProblem) -> Solution:
    """Solve from zero impulses."""
    if np.any(problem["rolling_friction"]):
        return _solve_turning(problem)
    nothing = np.zeros((problem.count, 6))
    impulses, sweeps = _solve_in(problem, _coulomb_rows(problem), nothing)
    return Solution(impulses, "coulomb", 1, sweeps, problem.residual(impulses))


def solve_in_planes_of(problem: FrozenProblem, impulses: np.ndarray) -> Solution:
    """Solve from zero impulses with the rolling rows in planes that hold these rolling impulses."""
    rows = _rolling_rows(impulses[:, 3:])
    found, sweeps = _solve_in(problem, rows, np.zeros_like(impulses))
    return Solution(found, "given planes", 1, sweeps, problem.residual(found))


def go_on_from(problem: FrozenProblem, impulses: np.ndarray) -> np.ndarray:
    """Solve from these impulses, in planes that hold them: a solution is where siconos stays."""
    is_rolling = np.any(problem["rolling_friction"])
    rows = _rolling_rows(impulses[:, 3:]) if is_rolling else _coulomb_rows(problem)
    return _solve_in(problem, rows, impulses)[0]


def _solve_turning(problem: FrozenProblem) -> Solution:
    impulses = np.zeros((problem.count, 6))
    # The first planes are tangential: no torsion.
    directions = np.tile([1.0, 0.0, 0.0], (problem.count, 1))
    sweeps, residual, turn, most = 0, np.inf, 0, _most_sweeps(problem)
    while residual > SOLVED and turn < MOST_TURNS and sweeps < most:
        rows = _rolling_rows(directions)
        impulses, more = _solve_in(problem, rows, impulses, most - sweeps)
        residual = problem.residual(impulses)
        sweeps, turn = sweeps + more, turn + 1
        aim = impulses - problem.relative_velocities(impulses) / problem.diagonal
        directions = np.where(impulses[:, :1] > 0.0, aim[:, 3:], directions)
    return Solution(impulses, "turned planes", turn, sweeps, residual)


def _most_sweeps(problem: FrozenProblem) -> int:
    return int(MOST_PRODUCTS / max(1, problem.count) ** 2)


def _coulomb_rows(problem: FrozenProblem) -> np.ndarray:
    return np.tile(np.eye(6)[:, :3], (problem.count, 1, 1))


def _rolling_rows(directions: np.ndarray) -> np.ndarray:
    """Return rows (contacts, 6, 5) whose rolling plane holds the directions (contacts, 3)."""
    norms = np.linalg.norm(directions, axis=1, keepdims=True)
    first = np.where(norms > 0.0, directions / np.where(norms > 0.0, norms, 1.0), [1.0, 0.0, 0.0])
    # In the tangent plane if it can be: across the torsion axis, the third.
    second = np.cross([0.0, 0.0, 1.0], first)
    lengths = np.linalg.norm(second, axis=1, keepdims=True)
    second = np.where(
        lengths > 1e-6, second / np.where(lengths > 0.0, lengths, 1.0), [0.0, 1.0, 0.0]
    )
    second -= first * np.sum(first * second, axis=1, keepdims=True)
    second /= np.linalg.norm(second, axis=1, keepdims=True)
    rows = np.zeros((len(directions), 6, 5))
    rows[:, [0, 1, 2], [0, 1, 2]] = 1.0
    rows[:, 3:, 3], rows[:, 3:, 4] = first, second
    return rows


def _solve_in(
    problem: FrozenProblem, rows: np.ndarray, guess: np.ndarray, most: int | None = None
) -> tuple[np.ndarray, int]:
    """Solve in these rows; return impulses (contacts, 6) and the sweeps of siconos."""
    dimension = rows.shape[2]
    matrix, q = problem.in_rows(rows)
    reactions = np.einsum("aik,ai->ak", rows, guess).ravel()
    velocities = np.zeros_like(reactions)
    coefficients = [problem["sliding_friction"]]
    if dimension == 5:
        coefficients.append(problem["rolling_friction"])
        options = sn.SolverOptions(sn.SICONOS_ROLLING_FRICTION_3D_NSGS)
        read, drive = sn.rollingFrictionContact_new_from_filename, sn.rolling_fc3d_driver
    else:
        options = sn.SolverOptions(sn.SICONOS_FRICTION_3D_NSGS)
        read, drive = sn.frictionContact_new_from_filename, sn.fc3d_driver
    options.dparam[sn.SICONOS_DPARAM_TOL] = TOLERANCE
    options.iparam[sn.SICONOS_IPARAM_MAX_ITER] = most or _most_sweeps(problem)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "problem.dat"
        _write(path, dimension, matrix, q, coefficients)
        drive(read(str(path)), reactions, velocities, options)
    impulses = np.einsum("aik,ak->ai", rows, reactions.reshape(-1, dimension))
    return impulses, int(options.iparam[sn.SICONOS_IPARAM_ITER_DONE])


def _write(
    path: Path, dimension: int, matrix: np.ndarray, q: np.ndarray, coefficients: list[np.ndarray]
) -> None:
    """Write siconos' text format, dense: 4.4 takes no rolling coefficients from Python."""
    size = len(q)
    entries = matrix.ravel(order="F")
    words = ["0"] * entries.size
    for at in np.flatnonzero(entries):
        words[at] = f"{entries[at]:.17e}"
    head = f"{dimension}\n{size // dimension}\n0\n{size}\n{size}\n{size}\t{size}\n"
    lines = [" ".join(f"{value:.17e}" for value in row) for row in (q, *coefficients)]
    path.write_text(head + "\n".join([" ".join(words), *lines]) + "\n")
