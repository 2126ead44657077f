"""A frozen contact problem as `granulcal-cli inspect --contact-problem` writes it.

The equations and every array are described in docs/theory/contact-problem.md. Rows of a contact:
normal, two tangents, rolling along the two tangents, torsion. Only NumPy is needed.
"""

from pathlib import Path

import numpy as np

FORMAT = 1
SPIN = 2.5  # inverse inertia of a solid sphere times its mass and squared radius


class FrozenProblem:
    """The arrays of one file, the Delassus matrix as (contacts, 6, contacts, 6)."""

    def __init__(self, path: Path) -> None:
        with np.load(path) as arrays:
            self.arrays = {name: arrays[name] for name in arrays.files}
        if self["format"] != FORMAT:
            raise ValueError(f"{path}: format must be {FORMAT}, got {self['format']}")
        self.count = len(self["grain"])
        self.delassus = np.zeros((self.count, 6, self.count, 6))
        self.delassus[self["delassus_row"], :, self["delassus_column"], :] = self["delassus"]
        self.diagonal = np.einsum("aiai->ai", self.delassus)

    def __getitem__(self, name: str) -> np.ndarray:
        """Return the array of that name."""
        return self.arrays[name]

    def relative_velocities(self, impulses: np.ndarray) -> np.ndarray:
        """Return y = W r + q [m/s], shape (contacts, 6)."""
        moved = np.tensordot(self.delassus, impulses, axes=([2, 3], [0, 1]))
        return moved + self["right_hand_side"]

    def residual(self, impulses: np.ndarray) -> float:
        """Return the largest natural-map residual [m/s]: how far the law would move an impulse."""
        aim = impulses - self.relative_velocities(impulses) / self.diagonal
        normal = impulses[:, 0]
        slide = _project(aim[:, 1:3], self["sliding_friction"] * normal)
        roll = _project(aim[:, 3:5], self["rolling_friction"] * normal)
        twist = _project(aim[:, 5:], self["torsional_friction"] * normal)
        return max(
            np.abs(normal - np.maximum(0.0, aim[:, 0])).max(initial=0.0),
            np.linalg.norm(impulses[:, 1:3] - slide, axis=1).max(initial=0.0),
            np.linalg.norm(impulses[:, 3:5] - roll, axis=1).max(initial=0.0),
            np.abs(impulses[:, 5:] - twist).max(initial=0.0),
        )

    def velocities(self, impulses: np.ndarray) -> np.ndarray:
        """Return velocity and spin of each grain [m/s], v_free + M^-1 J^T r, shape (grains, 6)."""
        t1, t2, n = self["tangents"][:, 0], self["tangents"][:, 1], self["normal"]
        r_n, r_1, r_2, m_1, m_2, m_n = (impulses[:, [row]] for row in range(6))
        friction = r_1 * t1 + r_2 * t2
        force, moment = r_n * n + friction, m_1 * t1 + m_2 * t2 + m_n * n
        motion = self["free_velocity"].copy()
        is_pair = self["partner"] >= 0
        for side, sign, at in (
            ("grain", 1.0, np.full(self.count, True)),
            ("partner", -1.0, is_pair),
        ):
            body = self[side][at]
            mass = self["inverse_mass"][body][:, None]
            lever = self["lever"][at][:, [0 if sign > 0 else 1]]
            turn = sign * lever * moment[at] - np.cross(n, friction)[at]
            np.add.at(motion, (body, slice(0, 3)), sign * mass * force[at])
            np.add.at(motion, (body, slice(3, 6)), SPIN * mass * turn)
        return motion

    def in_rows(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return W and q in other rows: `rows` (6, k) times k numbers are an impulse."""
        k = rows.shape[2]
        right = np.einsum("aibj,bjl->aibl", self.delassus, rows, optimize=True)
        matrix = np.einsum("aik,aibl->akbl", rows, right, optimize=True)
        q = np.einsum("aik,ai->ak", rows, self["right_hand_side"])
        return matrix.reshape(k * self.count, k * self.count), q.ravel()


def _project(vectors: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Return the nearest points of balls of these radii."""
    norms = np.linalg.norm(vectors, axis=1)
    outside = norms > radii
    return vectors * np.where(outside, radii / np.where(outside, norms, 1.0), 1.0)[:, None]
