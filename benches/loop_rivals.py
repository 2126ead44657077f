"""Is an effect of the world taken for a fault of the camera? The whole of close-loop on known sets.

    python benches/loop_rivals.py run OUT rods-1 null-11     # sets by name, all if none; resumable
    python benches/loop_rivals.py table OUT
    python benches/loop_rivals.py why OUT rods-51            # what the evidence of each model is of

The scene is that of benches/blind with pixels of 1 mm and without noise: 500 grains from 4, 8 and
12 cm, three pours each, and as many at 6 and 10 cm that are sealed. A task tries what is tried by
itself and `clump` with a budget of 2400 pours, the archive is shared. Materials and seeds go with
the names. A set takes 2 to 6 minutes of a core, the archive 8.
"""

import argparse
import json
from pathlib import Path

import numpy as np

import granulcal as gc
from granulcal.loop import Thresholds, trace
from granulcal.loop.analysis import Analysis
from granulcal.loop.close import fit_surrogate, planned
from granulcal.loop.pours.archive import Archive
from granulcal.loop.pours.forward import Forward
from granulcal.pours.camera import Camera

BLIND = Path(__file__).parent / "blind"
FIT, SEALED = (0.04, 0.08, 0.12), (0.06, 0.10)
POURS, BUDGET = 3, 2400
HEIGHT, WIDTH, PIXELS, THRESHOLD = 0.29, 0.32, 320, 1e-3
RODS = "effects.clump.aspect"
FIXED = "material.sliding_friction", "material.rolling_friction", "material.restitution"
SETS: dict[str, tuple[int, dict[str, float], float]] = {
    "rods-1": (1, {RODS: 1.4}, 0.0),
    "rods-2": (2, {RODS: 1.4}, 0.0),
    "rods-3": (3, {RODS: 1.4}, 0.0),
    "rods-51": (51, {RODS: 1.4} | dict(zip(FIXED, (0.7668, 0.4872, 0.4083), strict=True)), 0.0),
    "rods-52": (52, {RODS: 1.4} | dict(zip(FIXED, (0.7, 0.42, 0.3), strict=True)), 0.0),
    "null-11": (11, {}, 0.0),
    "null-12": (12, {}, 0.0),
    "null-13": (13, {}, 0.0),
    "offset-21": (21, {}, 6e-4),
    "offset-22": (22, {}, -5e-4),
    "diameter-31": (31, {"grains.diameter": 4.2e-3}, 0.0),
    "diameter-32": (32, {"grains.diameter": 3.8e-3}, 0.0),
}
"""Seed, numbers of the scene and offset of the camera [m] of each."""


def scene_text() -> str:
    """Returns blind's scene with coarser pixels, without noise, and with room for rods to start."""
    text = (BLIND / "scene.toml").read_text(encoding="utf-8")
    plain = text[: text.index("[camera.sensor]")]
    return plain.replace("pixels = 640", f"pixels = {PIXELS}").replace(
        "jitter = 1e-3", "jitter = 1e-4"
    )


def record(folder: Path, seed: int, numbers: dict[str, float], offset: float) -> Path:
    """Writes the recordings of a set and its task; returns the task's file."""
    file = folder / "loop.toml"
    if file.exists():
        return file
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scene.toml").write_text(scene_text())
    (folder / "prior.toml").write_text((BLIND / "prior.toml").read_text())
    generator = np.random.default_rng([seed, 7])
    low, high = np.array([[0.4, np.log(0.18), 0.2], [0.75, np.log(0.45), 0.45]])
    own = generator.uniform(low, high)
    own[1] = np.exp(own[1])
    material = dict(zip(FIXED, own.tolist(), strict=True))
    scene = gc.Scene.load(folder / "scene.toml").with_({**material, **numbers})
    camera = Camera.overhead(height=HEIGHT, field_width=WIDTH, pixels=PIXELS)
    lines = ['scene = "scene.toml"', 'prior = "prior.toml"', 'effects = ["usual", "clump"]']
    for height in (*FIT, *SEALED):
        name, use = f"{100 * height:g} cm", "fit" if height in FIT else "sealed"
        images = []
        for i in range(POURS):
            first = 10_000 * (seed + 1) + 100 * int(height * 100)
            pour = gc.simulate(scene.with_({"funnel.height": height}), seed=first + i)
            depth = camera.render(pour.positions, pour.radii)
            is_grain = (depth > 0) & (HEIGHT - depth > THRESHOLD)
            depth = np.where(is_grain, depth - np.float32(offset), depth).astype(np.float32)
            place = folder / f"{name.replace(' ', '')}-{i}"
            place.mkdir(exist_ok=True)
            camera.save(depth, place / "depth.png", place / "camera.toml")
            images.append(f"{place.name}/depth.png")
        lines += ["[[conditions]]", f'name = "{name}"', f'at = {{ "funnel.height" = {height} }}']
        lines += [f'use = "{use}"', f"recordings = {json.dumps(images)}"]
    file.write_text("\n".join(lines) + "\n")
    return file


def run(out: Path, names: list[str], threads: int) -> None:
    """Closes the loop on sets, by name."""
    for name in names or list(SETS):
        task = gc.Task.load(record(out / "sets" / name, *SETS[name]))
        if not (out / name / "verdict.json").exists():
            gc.close_loop(
                task, out / name, archive=out / "archive", budget=BUDGET, threads=threads, pairs=0
            )


def why(out: Path, names: list[str]) -> None:
    """Prints what the evidence of the models is made of, by the surrogate of the archive."""
    # Here, so that the rest runs on commits that had none of it.
    from granulcal.loop.check.rivals import within_reach
    from granulcal.loop.test.refit import root_at

    rules, fitted = Thresholds(), None
    for name in names:
        task = gc.Task.load(record(out / "sets" / name, *SETS[name]))
        plan = planned(task, BUDGET, 0, 0, 0, rules)
        store = Archive(out / "archive", plan)
        fitted = fit_surrogate(store, seed=0) if fitted is None else fitted
        analysis = Analysis(task, store.plan, Forward(out / "pours", 1), rules, 0, print)
        found = trace(fitted, analysis.observed(analysis.measured()), rules, seed=0)
        print(f"{name}: {found.verdict.kind} {', '.join(found.verdict.named)}")
        half = float(np.log(np.diag(found.base_fit.root)).sum())
        reached = {rival.one.effects: rival for rival in within_reach(found, rules)}
        print("| model | nat | misfit | half log V over V_0 | psi | reach | at psi |")
        for one, model in zip(found.explanations, found.models, strict=True):
            root = root_at(found.local, found.base_fit, model.fit.psi)
            left = np.linalg.solve(root, model.fit.residual)
            unsure = float(np.log(np.diag(root)).sum()) - half
            rival = reached.get(one.effects)
            at = (
                "" if rival is None else f"{rival.reach:.1f} | {rival.fit.psi[list(model.effects)]}"
            )
            print(
                f"| {' + '.join(one.effects)} | {one.log_probability:.1f} | {left @ left:.1f} "
                f"| {unsure:.1f} | {one.best_strengths} | {at} |"
            )


def table(out: Path) -> None:
    """Prints the word of each set."""
    print("| set | word | nat over no effect | pours |\n|---|---|---|---|")
    for name in SETS:
        file = out / name / "verdict.json"
        if file.exists():
            found = json.loads(file.read_text())
            named = ", ".join(found["named"])
            gain = max((e["log_probability"] for e in found["trace"]["explanations"]), default=0.0)
            word = f"{found['verdict']} {named}".strip()
            print(f"| {name} | {word} | {gain:.1f} | {found['pours']} |")


def main() -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("do", choices=("run", "table", "why"))
    parser.add_argument("out", type=Path)
    parser.add_argument("names", nargs="*", help=", ".join(SETS))
    parser.add_argument("--threads", type=int, default=1)
    options = parser.parse_args()
    if options.do == "table":
        table(options.out)
    elif options.do == "why":
        why(options.out, options.names)
    else:
        run(options.out, options.names, options.threads)


if __name__ == "__main__":
    main()
