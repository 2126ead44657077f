"""The main job end to end: record a pour of an unknown material, infer it, check it, report it.

The recording is made by the project itself, so the truth is known: a hidden material is poured with
finer solver settings and another seed than any training pour, seen by a tilted, noisy camera, and
stored as a 16-bit PNG that is then opened like any other.
"""

import importlib
import os
import shlex
import time
from pathlib import Path

import numpy as np

from granulcal.bayessim.storage.place import require_place
from granulcal.calibrate import Calibrated, calibrate
from granulcal.files import write_toml
from granulcal.measured.recording import Recording
from granulcal.pours.camera import Camera
from granulcal.pours.dataset import generate
from granulcal.pours.scene import Material, Scene
from granulcal.pours.simulate import simulate
from granulcal.prior import Prior

__all__ = ["HIDDEN", "demo_scene", "main", "record", "run"]

HIDDEN = Material(sliding_friction=0.35, rolling_friction=0.08, restitution=0.4)
"""The material that the demo must find."""

_RECORDING_SEED = 20_231
_TILT_DEG = (2.5, -1.5)
_DEPTH_NOISE = 4e-4
_DEFAULT_POURS = 200
_DRAWS = 8


def demo_scene() -> Scene:
    """Returns the paper's pour under a camera that also exists: 40 cm above the ground."""
    return Scene.funnel(height=0.12).with_(
        {"camera.height": 0.4, "camera.field_width": 0.6, "camera.pixels": 600.0}
        | {"camera.downsample": 5.0, "camera.height_threshold": 1.5e-3}
    )


def record(folder: Path, scene: Scene) -> Recording:
    """Pours the hidden material, photographs it and returns the recording that was stored."""
    pour = simulate(scene, HIDDEN, seed=_RECORDING_SEED, preset="accurate")
    camera = Camera.overhead(
        height=scene.get("camera.height"),
        field_width=scene.get("camera.field_width"),
        pixels=int(scene.get("camera.pixels")),
    ).tilted(x_deg=_TILT_DEG[0], y_deg=_TILT_DEG[1])
    image, toml = camera.record(
        pour.positions, pour.radii, folder, depth_noise=_DEPTH_NOISE, seed=_RECORDING_SEED
    )
    settings = (
        "\n[segmentation]\n"
        f"downsample = {int(scene.get('camera.downsample'))}\n"
        f"height_threshold = {{ absolute = {scene.get('camera.height_threshold')} }}\n"
    )
    # A file of its own: the camera's is written anew by every run, unless somebody changed it.
    segmented = folder / "segmentation.toml"
    write_toml(segmented, toml.read_text(encoding="utf-8") + settings)
    return Recording.open(image, camera=segmented)


def run(out: Path, *, pours: int = _DEFAULT_POURS, threads: int | None = None) -> Calibrated:
    """Runs the demo into the folder `out`; pours that are there already are not repeated."""
    from granulcal.bayessim import BayesSim

    require_place(out / "model")
    scene, prior = demo_scene(), Prior.default()
    _say("1/4 recording a pour of a hidden material (tilted, noisy camera; accurate preset)")
    recording = record(out / "recording", scene)
    plane = recording.plane
    print(f"    ground fitted to {plane.inlier_count} pixels, tilt {plane.tilt_deg:.2f} deg")

    _say(f"2/4 simulating {pours} pours with parameters drawn from the prior")
    data = generate(scene, prior, pours, seed=1, out=out / "pours", threads=threads)
    print(f"    {data}")

    _say("3/4 training BayesSim")
    model = BayesSim.fit(data, seed=1)
    model.save(out / "model")
    data.save(out / "model" / "training.parquet")

    _say("4/4 inferring the material and pouring it")
    truth = np.array([HIDDEN.values()[name] for name in prior.names])
    result = calibrate(
        model,
        data,
        [recording],
        report=out / "report.html",
        draws=_DRAWS,
        threads=threads,
        truth=truth,
        title="Demo: a hidden material, found from one depth image",
        summary=(
            "A hidden material was poured with the accurate preset and a seed of its own, seen by "
            f"a camera tilted by {_TILT_DEG[0]} and {_TILT_DEG[1]} degrees with "
            f"{1e3 * _DEPTH_NOISE:g} mm of noise, and stored as a 16-bit PNG. Everything below "
            f"follows from that image and from {len(data)} simulated pours."
        ),
        command=shlex.join(["granulcal", "demo", "--out", str(out), "--pours", str(pours)]),
    )
    _print_table(result, truth)
    return result


def main(out: Path, *, pours: int = _DEFAULT_POURS, threads: int | None = None) -> int:
    """Runs the demo into `out`, measured maps too where they are at hand; returns the exit code."""
    started = time.monotonic()
    run(out, pours=pours, threads=threads)
    _measured_demo(out)
    print(f"done in {time.monotonic() - started:.0f} s; open {out / 'report.html'}")
    return 0


def measured_data() -> Path | None:
    """Returns the folder of measured data: $GRANULCAL_DATA, else ../shared/data/measured."""
    named = os.environ.get("GRANULCAL_DATA")
    folder = Path(named) if named else Path("../shared/data/measured")
    return folder if folder.is_dir() else None


def _measured_demo(out: Path) -> None:
    """Repeats the job on a measured map where measured data are at hand."""
    folder = measured_data()
    if folder is None or not (folder / "granular-impact-kinect").is_dir():
        print("measured maps: skipped, no granular-impact-kinect in $GRANULCAL_DATA")
        return
    name = "granulcal.experiments.kinect_mounds"
    _say("measured maps: one mound of the granular-impact-kinect set")
    importlib.import_module(name).demo(out / "kinect", folder)


def _print_table(result: Calibrated, truth: np.ndarray) -> None:
    posterior = result.posterior
    region, mode = posterior.credible_region(0.9), posterior.mode()
    print(f"\n    {'parameter':<28}{'true':>8}{'mode':>9}   90 % interval")
    for i, name in enumerate(posterior.names):
        low, high = region[name]
        print(f"    {name:<28}{truth[i]:>8.3g}{mode[i]:>9.3g}   {low:.3g} to {high:.3g}")
    for warning in posterior.warnings:
        print(f"    note: {warning}")
    print()


def _say(text: str) -> None:
    print(text, flush=True)
