"""How often is close-loop right, with rivals poured and all other checks? Whole runs of known sets.

    python benches/loop_rate.py run OUT                   # all sets in turn; resumable
    python benches/loop_rate.py run OUT --only null-0 blur-1
    python benches/loop_rate.py table OUT                 # the sets, and rates with exact intervals
    python benches/loop_rate.py form OUT                  # what effects leave of the surrogate
    python benches/loop_rate.py seen OUT                  # is what is seen in 80 % seen so often?

The scene is that of benches/blind with 150 grains and pixels of 1.6 mm: three pours from each of 4,
8 and 12 cm, two of 6 and 10 cm that are sealed. Nulls and sets with one effect come in turn, so
that any first part of them is fair; half of each kind is seen by a camera with noise and blur,
which the model has as well. Materials are draws of the task's own prior, the sliding friction
of nulls spread evenly over its range. A task tries what is tried by itself and `clump` with the
default budget, the archive of each camera is shared. A set takes one to four minutes of a core, an
archive three.
"""

import argparse
import json
import time
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import rates
from scipy.ndimage import gaussian_filter

import granulcal as gc
from granulcal.loop.analysis import Analysis
from granulcal.loop.close import fit_surrogate, planned
from granulcal.loop.effects.library import by_name
from granulcal.loop.pours.archive import Archive
from granulcal.loop.pours.cube import from_cube
from granulcal.loop.pours.forward import Forward
from granulcal.loop.surrogate.stacked_means import StackedMeans
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.task import FIT, SEALED
from granulcal.loop.test.base_test import base_test
from granulcal.loop.test.thresholds import Thresholds
from granulcal.loop.test.trace import power
from granulcal.loop.test.verdict import NAMING
from granulcal.pours.camera import Camera

BLIND = Path(__file__).parent / "blind"
HEIGHTS = {FIT: (0.04, 0.08, 0.12), SEALED: (0.06, 0.10)}
POURS = {FIT: 3, SEALED: 2}
ABOVE, FIELD, PIXELS, THRESHOLD = 0.29, 0.32, 200, 1e-3
CAMERAS: dict[str, dict[str, float]] = {
    "plain": {"depth_noise": 0.0, "blur": 0.0},
    "noisy": {"depth_noise": 2e-4, "blur": 0.6},
}
"""Noise [m] and blur [px] of the camera, of the recordings and of the model."""
NULLS, REPEATS = 32, 10
# So many nulls have each a part of the range of sliding friction.
_SPREAD = 24
ALARMS = (*NAMING, "RESIDUAL", "UNEXPLAINED")


@dataclass(frozen=True)
class Kind:
    """What a set has that the model lacks, at two strengths in turn.

    Attributes:
        truth: the effect's name in the library.
        values: of the number that it is.
        path: of that number in the scene; of an image "offset" [m] or "blur" [px].
    """

    truth: str
    values: tuple[float, float]
    path: str

    @property
    def is_of_image(self) -> bool:
        """Whether it is a fault of the recordings."""
        return self.path in ("offset", "blur")

    def strength(self, value: float) -> float:
        """Returns psi of a value."""
        (effect,) = by_name([self.truth])
        return float(effect.at(scene_of("plain")).strength(np.array(value)))


KINDS = {
    "offset": Kind("camera.offset", (3e-4, -2e-4), "offset"),
    "rods": Kind("clump", (1.3, 1.15), "effects.clump.aspect"),
    "diameter": Kind("diameter", (4.1e-3, 3.94e-3), "grains.diameter"),
    "blur": Kind("camera.blur", (0.6, 0.4), "blur"),
    "drag": Kind("drag", (2e-3, 1e-3), "effects.fluid.viscosity"),
    "tilt": Kind("tilt.x", (0.04, -0.025), "effects.tilt.x"),
}


@dataclass(frozen=True)
class Set:
    """One set: its name, number, camera, and place among those of its kind."""

    name: str
    seed: int
    camera: str
    of_kind: int
    kind: Kind | None = None

    @property
    def value(self) -> float:
        """The number of what the model lacks; 0 of a null."""
        return self.kind.values[self.of_kind % 2] if self.kind else 0.0


def sets() -> list[Set]:
    """Returns all sets, nulls and effects in turn."""
    cameras = list(CAMERAS)
    nulls = [Set(f"null-{i}", i, cameras[i % 2], i) for i in range(NULLS)]
    others = [
        Set(f"{name}-{i}", 1000 + 100 * i + k, cameras[(k + (i + 1) // 2) % 2], i, kind)
        for i in range(REPEATS)
        for k, (name, kind) in enumerate(KINDS.items())
    ]
    order = [*zip(np.linspace(0, 1, NULLS, endpoint=False), nulls, strict=True)]
    order += [*zip(np.linspace(0, 1, len(others), endpoint=False) + 1e-3, others, strict=True)]
    return [one for _, one in sorted(order, key=lambda pair: pair[0])]


def scene_of(camera: str) -> gc.Scene:
    """Returns blind's scene with few grains, coarse pixels, and room for rods to start."""
    text = (BLIND / "scene.toml").read_text(encoding="utf-8")
    seen = {f"camera.{name}": value for name, value in CAMERAS[camera].items()}
    return gc.Scene.from_toml(text[: text.index("[camera.sensor]")]).with_(
        {"grains.count": 150, "camera.pixels": PIXELS, "start.jitter": 1e-4, **seen}
    )


def material(one: Set) -> dict[str, float]:
    """Returns the true material; the sliding friction of nulls is spread evenly."""
    prior = gc.Prior.load(BLIND / "prior.toml")
    unit = np.random.default_rng([one.seed, 47]).uniform(size=len(prior.names))
    if one.kind is None:
        order = np.random.default_rng(53).permutation(_SPREAD)
        unit[prior.names.index("material.sliding_friction")] = (
            order[one.of_kind % _SPREAD] + unit[0]
        ) / _SPREAD
    return dict(zip(prior.names, from_cube(prior, unit[None])[0].tolist(), strict=True))


def record(folder: Path, one: Set) -> Path:
    """Writes the recordings of a set and its task; returns the task's file."""
    file = folder / "loop.toml"
    if file.exists():
        return file
    folder.mkdir(parents=True, exist_ok=True)
    plain, kind = scene_of(one.camera), one.kind
    (folder / "scene.toml").write_text(plain.to_toml())
    (folder / "prior.toml").write_text((BLIND / "prior.toml").read_text())
    numbers = {kind.path: one.value} if kind and not kind.is_of_image else {}
    image = {kind.path: one.value} if kind and kind.is_of_image else {}
    scene = plain.with_({**material(one), **numbers})
    camera = Camera.overhead(height=ABOVE, field_width=FIELD, pixels=PIXELS)
    own = CAMERAS[one.camera]
    lines = ['scene = "scene.toml"', 'prior = "prior.toml"', 'effects = ["usual", "clump"]']
    for use, heights in HEIGHTS.items():
        for height in heights:
            images = []
            for i in range(POURS[use]):
                seed = 7_000_000 + 1000 * one.seed + 10 * round(100 * height) + i
                pour = gc.simulate(scene.with_({"funnel.height": height}), seed=seed)
                depth = camera.render(
                    pour.positions,
                    pour.radii,
                    depth_noise=own["depth_noise"],
                    blur_px=own["blur"],
                    seed=seed,
                )
                # What a driver smooths is the image with its noise.
                depth = gaussian_filter(depth, image.get("blur", 0.0), mode="nearest")
                is_grain = (depth > 0) & (ABOVE - depth > THRESHOLD)
                off = np.float32(image.get("offset", 0.0))
                place = folder / f"{round(100 * height)}cm-{i}"
                place.mkdir(exist_ok=True)
                camera.save(
                    np.where(is_grain, depth - off, depth).astype(np.float32),
                    place / "depth.png",
                    place / "camera.toml",
                    depth_unit=1e-5,
                )
                images.append(f"{place.name}/depth.png")
            lines += ["[[conditions]]", f'name = "{round(100 * height)} cm"']
            lines += [f'at = {{ "funnel.height" = {height} }}', f'use = "{use}"']
            lines += [f"recordings = {json.dumps(images)}"]
    file.write_text("\n".join(lines) + "\n")
    return file


def archive(out: Path, camera: str, budget: int, threads: int) -> Archive:
    """Returns the pours that all sets of a camera share."""
    first = next(one for one in sets() if one.camera == camera)
    task = gc.Task.load(record(out / "sets" / first.name, first))
    store = Archive(out / f"archive-{camera}", planned(task, budget, 0, 0, 0, Thresholds()))
    store.fill(threads=threads, say=print)
    return store


def form(out: Path, budget: int, threads: int) -> None:
    """Prints by how much the surrogate misses pours of an effect alone, by its strength.

    With the mean of what it leaves of the n pours within a band, in standard deviations of a pour,
    the sum of its squares over the m axes less m / n, which noise alone would give.
    """
    edges = (0.0, 0.1, 0.2, 0.35, 0.5, 0.75, 1.001)
    bands = [*pairwise(edges)]
    print("| camera | effect | " + " | ".join(f"{a:g} to {min(b, 1):g}" for a, b in bands) + " |")
    print("|---|---|" + "---|" * len(bands))
    for camera in CAMERAS:
        store = archive(out, camera, budget, threads)
        known, rows = fit_surrogate(store, seed=0), store.pours()
        where = rows.theta, rows.condition, rows.psi
        left = (known.standardise(rows.x) - known.mean(*where)) / known.scale(*where)
        alone = np.count_nonzero(rows.psi, axis=1) == 1
        for k, effect in enumerate(known.design.effects):
            strength = np.abs(rows.psi[:, k])
            cells = []
            for low, high in bands:
                within = left[alone & (strength > 0) & (strength >= low) & (strength < high)]
                if len(within) == 0:
                    cells.append("")
                    continue
                miss = float(np.sum(within.mean(axis=0) ** 2)) - left.shape[1] / len(within)
                cells.append(f"{max(miss, 0.0):.1f} ({len(within)})")
            print(f"| {camera} | {effect.name} | {' | '.join(cells)} |")
        largest = np.sort(np.abs(known.white).max(axis=0))[::-1]
        print(f"\nlargest residual of the axes: {', '.join(f'{x:.0f}' for x in largest[:10])}\n")


def run(out: Path, only: list[str], budget: int, threads: int) -> None:
    """Closes the loop on the sets that have no row yet."""
    file = out / "rows.jsonl"
    done = {row["set"] for row in rows_of(file)}

    @cache
    def surrogate(camera: str) -> Surrogate:
        return fit_surrogate(archive(out, camera, budget, threads), seed=0)

    for one in sets():
        if one.name in done or (only and one.name not in only):
            continue
        task = gc.Task.load(record(out / "sets" / one.name, one))
        known, begin = surrogate(one.camera), time.process_time()
        closed = gc.close_loop(
            task,
            out / one.name,
            archive=out / f"archive-{one.camera}",
            budget=budget,
            threads=threads,
            pairs=0,
            surrogate=known,
        )
        row = _row(one, closed.to_dict(), time.process_time() - begin)
        with file.open("a", encoding="utf-8") as rows:
            rows.write(json.dumps(row) + "\n")
        print(f"== {one.name}: {row['verdict']} {', '.join(row['named'])}", flush=True)


def _row(one: Set, said: dict[str, Any], seconds: float) -> dict[str, Any]:
    found, power = said["trace"], said["power_before_data"]
    seen = dict(zip(power["effects"], power["detectable_strength"], strict=True))
    return {
        "set": one.name,
        "truth": one.kind.truth if one.kind else "",
        "psi": one.kind.strength(one.value) if one.kind else 0.0,
        "seen_from": seen.get(one.kind.truth) if one.kind else None,
        "camera": one.camera,
        "material": material(one),
        "verdict": said["verdict"],
        "named": said["named"],
        "fits": said["verdict_before_checks"],
        "gain": max((e["log_probability"] for e in found["explanations"]), default=0.0),
        "p": said["p_before_checks"],
        "base_p": said["base_pours_p"],
        "confirmed": said["confirmed_p"],
        "anchors": said["anchors"],
        "looked": said["looked_again"],
        "weighed": said["rivals_by_pours"],
        "strength": said["strength"],
        "placebo": said["placebo"],
        "reason": said["reason"],
        "pours": said["pours"],
        "seconds": seconds,
    }


def table(out: Path) -> None:
    """Prints the word of each set, and the rates."""
    rows = rows_of(out / "rows.jsonl")
    print("| set | camera | material | psi, seen from | word | nat | p, of the base | pours |")
    print("|---|---|---|---|---|---|---|---|")
    for row in rows:
        own = ", ".join(f"{value:.2f}" for value in row["material"].values())
        word = f"{row['verdict']} {', '.join(row['named'])}".strip()
        psi = f"{row['psi']:.2f}, {row['seen_from'] or np.nan:.2f}" if row["truth"] else ""
        p = ", ".join(f"{p:.2g}" for p in (row["p"], row["base_p"]) if p is not None)
        print(
            f"| {row['set']} | {row['camera']} | {own} | {psi} | {word} | {row['gain']:.1f} | {p} "
            f"| {row['pours']} |"
        )
    nulls = [row for row in rows if not row["truth"]]
    others = [row for row in rows if row["truth"]]
    named = [row for row in others if row["verdict"] in NAMING]
    print("\n| what | rate | 95 %, exact |\n|---|---|---|")
    rate("null: named", [row["verdict"] in NAMING for row in nulls])
    rate("null: alarm", [row["verdict"] in ALARMS for row in nulls])
    rate("null: alarm of the fits", [row["fits"] in ALARMS for row in nulls])
    rate("null: no word (UNCONFIRMED)", [row["verdict"] == "UNCONFIRMED" for row in nulls])
    rate("effect: alarm", [row["verdict"] in ALARMS for row in others])
    rate("effect: named", [row["verdict"] in NAMING for row in others])
    rate("effect: no word (UNCONFIRMED)", [row["verdict"] == "UNCONFIRMED" for row in others])
    rate("named: the truth alone", [row["named"] == [row["truth"]] for row in named])
    rate("named: the truth first", [row["named"][0] == row["truth"] for row in named])
    rate("named: the truth among them", [row["truth"] in row["named"] for row in named])
    seconds = [row["seconds"] for row in rows]
    print(f"\n{len(rows)} sets, {np.median(seconds):.0f} s each (median, one core)")


def seen(out: Path, budget: int, threads: int) -> None:
    """Prints from which strength on effects are seen in 80 %, and what the test says of all rows.

    The test is that of the fit without effects, by the present program; nothing is poured for it.
    """
    rules = Thresholds()
    found: list[tuple[bool | None, float]] = []
    print("| set | camera | psi | seen from | p | word of the run |\n|---|---|---|---|---|---|")
    for camera in CAMERAS:
        store = archive(out, camera, budget, threads)
        units = store.plan.unit_condition(np.array(HEIGHTS[FIT])[:, None])
        known = fit_surrogate(store, seed=0)
        middle = np.full(len(known.design.parameters), 0.5)
        sights = power(known, middle, units, np.full(len(units), POURS[FIT]))
        least = dict(zip(sights.effects, sights.shown, strict=True))
        for row in (row for row in rows_of(out / "rows.jsonl") if row["camera"] == camera):
            p = _p_of_base(out, row["set"], known, store, rules)
            size, needed = row["psi"], least.get(row["truth"])
            is_seen = None if needed is None else bool(abs(size) >= needed)
            found.append((is_seen, p))
            least_seen = "" if needed is None else f"{needed:.2f}"
            print(
                f"| {row['set']} | {camera} | {size:.2f} | {least_seen} | {p:.3g} "
                f"| {row['verdict']} |",
                flush=True,
            )
    print("\n| what | rate | 95 %, exact |\n|---|---|---|")
    for what, kind in (("strengths seen in 80 %", True), ("weaker ones", False), ("nulls", None)):
        rate(f"p <= {rules.name}, {what}", [p <= rules.name for k, p in found if k is kind])
    rate("p <= 0.05, nulls", [p <= 0.05 for k, p in found if k is None])


def _p_of_base(out: Path, name: str, known: Surrogate, store: Archive, rules: Thresholds) -> float:
    """What the test says of the fit without effects to a set."""
    task = gc.Task.load(out / "sets" / name / "loop.toml")
    forward = Forward(out / name / "pours", 1)
    analysis = Analysis(task, store.plan, forward, rules, 0, lambda line: None)
    stack = StackedMeans.of(known, analysis.observed(analysis.measured()))
    return base_test(known, stack, rules).test.p


def rate(what: str, hits: list[bool]) -> None:
    """Prints the rate of something, with its exact interval."""
    rates.rate(what, hits, method="exact")


def rows_of(file: Path) -> list[dict[str, Any]]:
    """Returns the rows of a file, none if it is not there."""
    return [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []


def main() -> None:
    """Runs sets or prints their table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("do", choices=("run", "table", "form", "seen"))
    parser.add_argument("out", type=Path)
    parser.add_argument("--only", nargs="+", default=[], metavar="SET")
    parser.add_argument("--budget", type=int, default=4000)
    parser.add_argument("--threads", type=int, default=1)
    options = parser.parse_args()
    if options.do == "table":
        table(options.out)
    elif options.do == "form":
        form(options.out, options.budget, options.threads)
    elif options.do == "seen":
        seen(options.out, options.budget, options.threads)
    else:
        run(options.out, options.only, options.budget, options.threads)


if __name__ == "__main__":
    main()
