"""Bodies that are not round in MuJoCo and Rapier, against the closed forms of our own exams.

    pip install mujoco
    python benches/peers/bodies.py                  # MuJoCo; ours; Rapier by cargo, with its build

Prints the table of docs/theory/bodies.md. The exams are those of `crates/dem/src/bodies/exams.rs`,
grains of 4 mm in steps of 1/2000 s; `cargo test -p granulcal-dem bodies::exams` holds ours to what
the column says.
"""

import argparse
import json
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

SIZE, DT, GRAVITY = 4e-3, 1 / 2000, 9.81
HEAP = 125
ROWS = {
    "slides": ("cube sliding down 0.5 rad, mu 0.3: speed over the closed form", "1 (1e-9)"),
    "held": ("cube on 0.5 rad at mu 0.55 (tan 0.5 = 0.546): way in 0.5 s [sizes]", "< 2.5e-5"),
    "stands": ("tower 1:1:2 at tan 0.48: its axis from upright after 0.6 s [rad]", "< 5e-5"),
    "topples": ("the same at tan 0.52: does it fall?", "yes"),
    "rolls": ("cylinder rolling down 0.2 rad: speed over the closed form", "1 (1e-3)"),
    "aside": ("stack of ten cubes after 10 s: farthest aside [sizes]", "< 0.01"),
    "sunk": ("the same: deepest sunk [sizes]", "< 0.05"),
    "drift": ("free body 1:2:3 about its middle axis, 3 s: change of its energy", "< 1e-4"),
    "deep": (f"heap of {HEAP} cubes dropped: deepest overlap, of peers at the ground [sizes]", ""),
    "cost": ("the same: microseconds of a core for a body and step", ""),
}  # fmt: skip


def model(bodies: str, friction: float, angle: float = 0.0, weight: float = GRAVITY) -> str:
    """Returns MJCF of bodies over a plane; gravity is turned by `angle` towards +x."""
    x, z = weight * np.sin(angle), -weight * np.cos(angle)
    # As stiff as MuJoCo allows at this step.
    return f"""<mujoco><option timestep="{DT}" gravity="{x} 0 {z}" cone="elliptic" impratio="10"
    integrator="implicitfast"/><default><geom condim="3" friction="{friction} 0 0" density="1300"
    solref="{2 * DT} 1"/></default>
    <worldbody><geom type="plane" size="1 1 1"/>{bodies}</worldbody></mujoco>"""


def body(kind: str, size: str, at: tuple[float, float, float], turned: str = "") -> str:
    """Returns one free body."""
    place = " ".join(f"{v:.9g}" for v in at)
    return f'<body pos="{place}" {turned}><freejoint/><geom type="{kind}" size="{size}"/></body>'


def mujoco_exams() -> dict[str, float | str]:
    """Returns what MuJoCo does."""
    import mujoco

    half = 0.5 * SIZE
    cube = f"{half} {half} {half}"

    def run(text: str, seconds: float, look: Callable | None = None):
        m = mujoco.MjModel.from_xml_string(text)
        d = mujoco.MjData(m)
        for _ in range(round(seconds / DT)):
            mujoco.mj_step(m, d)
            if look is not None:
                look(m, d)
        return m, d

    def upright(d) -> float:
        return float(np.arccos(np.clip(d.xmat[1].reshape(3, 3)[2, 2], -1, 1)))

    found: dict[str, float | str] = {}
    _, d = run(model(body("box", cube, (0, 0, half)), 0.3, 0.5), 0.2)
    found["slides"] = d.qvel[0] / (0.2 * GRAVITY * (np.sin(0.5) - 0.3 * np.cos(0.5)))
    _, d = run(model(body("box", cube, (0, 0, half)), 0.55, 0.5), 0.5)
    found["held"] = np.hypot(*d.qpos[:2]) / SIZE
    tower = body("box", f"{half} {half} {SIZE}", (0, 0, SIZE))
    _, d = run(model(tower, 2.0, np.arctan(0.48)), 0.6)
    found["stands"] = upright(d)
    _, d = run(model(tower, 2.0, np.arctan(0.52)), 0.6)
    found["topples"] = "yes" if upright(d) > np.pi / 3 else "no"
    lying = body("cylinder", f"{half} {half}", (0, 0, half), 'euler="90 0 0"')
    _, d = run(model(lying, 0.8, 0.2), 0.3)
    found["rolls"] = d.qvel[0] / (0.3 * GRAVITY * np.sin(0.2) / 1.5)
    stack = "".join(body("box", cube, (0, 0, (k + 0.5) * SIZE)) for k in range(10))
    _, d = run(model(stack, 0.5), 10.0)
    places = d.qpos.reshape(-1, 7)[:, :3] / SIZE
    found["aside"] = np.hypot(places[:, 0], places[:, 1]).max()
    found["sunk"] = (np.arange(10) + 0.5 - places[:, 2]).max()
    spun = body("box", f"{half} {2 * half} {3 * half}", (0, 0, 1.0))
    text = model(spun, 0.0, weight=0.0).replace("implicitfast", "RK4")
    m = mujoco.MjModel.from_xml_string(text)
    d = mujoco.MjData(m)
    d.qvel[3:] = (0.02, 20.0, 0.02)
    energy = []
    for _ in range(6000):
        mujoco.mj_step(m, d)
        mujoco.mj_energyVel(m, d)
        energy.append(d.energy[1])
    found["drift"] = float(np.ptp(energy) / energy[0])
    heap = "".join(
        body("box", cube, tuple(2.2 * SIZE * np.array([k % 5 - 2, k // 5 % 5 - 2, k // 25 + 1])),
             f'euler="{37 * k} {71 * k} {13 * k}"')
        for k in range(HEAP)
    )  # fmt: skip
    deepest = [0.0]

    def look(m, d) -> None:
        if d.ncon:
            ground = (d.contact.geom[:, 0] == 0) | (d.contact.geom[:, 1] == 0)
            if ground.any():
                deepest[0] = max(deepest[0], -float(d.contact.dist[ground].min()))

    began = time.process_time()
    run(model(heap, 0.4), 0.5, look)
    found["cost"] = 1e6 * (time.process_time() - began) / (HEAP * round(0.5 / DT))
    found["deep"] = deepest[0] / SIZE
    return found


def our_heap() -> dict[str, float | str]:
    """Returns what the heap is in ours, by `granulcal.simulate`; the exams are cargo's."""
    import granulcal as gc

    drop = gc.Scene.drop(0.02, count=HEAP).with_(
        {
            "material.sliding_friction": 0.4,
            "material.restitution": 0.0,
            "end.horizon": 0.5,
            "end.kinetic_energy": 1e-30,
        }
    )
    shape = '[grains]\nshape = { kind = "box", aspect = [1.0, 1.0, 1.0] }'
    pour = gc.simulate(gc.Scene.from_toml(drop.to_toml().replace("[grains]", shape)), seed=1)
    steps = pour.health["substeps"]
    return {
        # In grains' radii, which are half of a cube's size.
        "deep": 0.5 * pour.health["worst_penetration"],
        "cost": 1e6 * pour.cpu_seconds / (HEAP * steps),
    }


def rapier_exams() -> dict[str, float | str]:
    """Returns what Rapier does: `src/bin/bodies.rs`."""
    manifest = Path(__file__).with_name("Cargo.toml")
    words = ["cargo", "run", "--release", "--quiet", "--manifest-path", str(manifest)]
    done = subprocess.run([*words, "--bin", "bodies"], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def cell(value: float | str | None) -> str:
    """Returns a number as printed."""
    return value if isinstance(value, str) else "" if value is None else f"{value:.3g}"


def main() -> None:
    """Runs the exams and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--without-rapier", action="store_true", help="leave Rapier out")
    args = parser.parse_args()
    ours = our_heap()
    engines = {"MuJoCo": mujoco_exams()}
    if not args.without_rapier:
        engines["Rapier"] = rapier_exams()
    print(f"| exam | ours | {' | '.join(engines)} |\n|---|---|{'---|' * len(engines)}")
    for name, (title, held) in ROWS.items():
        cells = [cell(each.get(name)) for each in engines.values()]
        print(f"| {title} | {held or cell(ours[name])} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
