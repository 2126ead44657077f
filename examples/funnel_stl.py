"""Writes the funnel of the other examples as a mesh: examples/funnel.stl, binary, in millimetres.

Run: python examples/funnel_stl.py
"""

from pathlib import Path

import numpy as np

SIDES = 64
# Radius and height of the tip, the neck and the rim [mm].
RINGS = [(16.0, 120.0), (16.0, 130.0), (60.0, 200.0)]
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def triangles() -> np.ndarray:
    """Returns the corners of all triangles, shape (n, 3, 3) [mm]."""
    angle = 2.0 * np.pi * np.arange(SIDES) / SIDES
    rings = np.array(
        [np.stack([r * np.cos(angle), r * np.sin(angle), 0 * angle + z], 1) for r, z in RINGS]
    )
    low, high = rings[:-1], rings[1:]
    next_low, next_high = np.roll(low, -1, axis=1), np.roll(high, -1, axis=1)
    both = [np.stack([low, next_low, next_high], 2), np.stack([low, next_high, high], 2)]
    return np.concatenate(both).reshape(-1, 3, 3)


def main() -> None:
    """Writes the file beside this script."""
    corners = triangles()
    records = np.zeros(len(corners), TRIANGLE)
    records["corners"] = corners
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    records["normal"] = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    header = b"funnel of the examples, mm".ljust(80) + np.uint32(len(corners)).tobytes()
    Path(__file__).with_name("funnel.stl").write_bytes(header + records.tobytes())


if __name__ == "__main__":
    main()
