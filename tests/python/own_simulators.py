"""Simulators of a user's own, for the tests of engines."""

import numpy as np

import granulcal as gc

# In a dozen lines: a pile that is the steeper, the rougher the grains are.
SIMULATOR = """\
import json, pathlib, sys
import numpy as np
folder = pathlib.Path(sys.argv[-1])
request = json.loads((folder / "request.json").read_text())
rng = np.random.default_rng(request["seed"])
count, diameter = int(request["grains"]["count"]), request["grains"]["diameter"]
slope = 0.2 + 0.5 * request["material"]["sliding_friction"]
r = 0.03 * np.sqrt(rng.random(count))
angle = 2 * np.pi * rng.random(count)
z = diameter / 2 + slope * (0.03 - r)
centres = np.column_stack([r * np.cos(angle), r * np.sin(angle), z])
np.savetxt(folder / "grains.csv", centres, delimiter=",", header="x,y,z", comments="")
"""


def cone(scene: gc.Scene, seed: int) -> np.ndarray:
    """Points of a cone, as a camera of one's own would see them."""
    rng = np.random.default_rng(seed)
    r, angle = 0.05 * np.sqrt(rng.random(300)), 2 * np.pi * rng.random(300)
    slope = scene.get("material.sliding_friction")
    return np.column_stack([r * np.cos(angle), r * np.sin(angle), 0.03 - slope * 0.5 * r])
