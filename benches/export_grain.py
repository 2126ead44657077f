"""One grain in MuJoCo under the exported material, beside the closed forms of our law.

    python -m venv build/engines-venv
    build/engines-venv/bin/pip install mujoco numpy threadpoolctl
    PYTHONPATH=python build/engines-venv/bin/python benches/export_grain.py

It falls 5 cm and rebounds with e; it slides and is slowed by mu_s g; it rolls and is slowed by
5/7 mu_r g.
"""

import mujoco

import granulcal as gc
from granulcal.export.mujoco import mjcf
from granulcal.export.setup import Setup

GRAVITY = 9.81


def one_grain(height: float, **material: float) -> mujoco.MjModel:
    """Returns a grain above the ground [m] under a material."""
    scene = gc.Scene.drop(height, count=1, material=gc.Material(**material))
    return mujoco.MjModel.from_xml_string(mjcf(Setup.of(scene)))


def rebound(restitution: float) -> tuple[float, float]:
    """Returns the restitution of a fall from 5 cm and the depth of the impact over the radius."""
    model = one_grain(0.05, sliding_friction=0.5, rolling_friction=0.1, restitution=restitution)
    data, radius = mujoco.MjData(model), float(model.geom_size[-1, 0])
    before, deepest = 0.0, radius
    while True:
        mujoco.mj_step(model, data)
        z, v = data.qpos[2], data.qvel[2]
        deepest = min(deepest, z)
        if deepest == radius:
            before = -v
        if deepest < radius < z and v > 0:
            return v / before, 1 - deepest / radius


def slowed(speed: float, spin: float, seconds: float, **material: float) -> float:
    """Returns the deceleration of a grain on the ground [m/s^2]."""
    model = one_grain(0.0, restitution=0.5, **material)
    data, radius = mujoco.MjData(model), float(model.geom_size[-1, 0])
    data.qpos[2] = radius
    data.qvel[0], data.qvel[4] = speed, spin / radius
    while data.time < seconds:
        mujoco.mj_step(model, data)
    return (speed - data.qvel[0]) / data.time


def main() -> None:
    """Prints the table."""
    print(f"MuJoCo {mujoco.__version__}")
    print("| what | asked for | found |\n|---|---|---|")
    for e in (0.1, 0.3, 0.5, 0.8):
        found, depth = rebound(e)
        print(f"| restitution | {e} | {found:.3f}, {100 * depth:.0f} % of the radius deep |")
    a = slowed(1.0, 0.0, 0.03, sliding_friction=0.5, rolling_friction=0.0)
    print(f"| sliding, over mu_s g | 1 | {a / (0.5 * GRAVITY):.3f} |")
    a = slowed(0.3, 0.3, 0.2, sliding_friction=0.5, rolling_friction=0.1)
    print(f"| rolling, over 5/7 mu_r g | 1 | {a / (5 / 7 * 0.1 * GRAVITY):.3f} |")


if __name__ == "__main__":
    main()
