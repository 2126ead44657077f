"""The pour of scene.toml for LAMMPS, and what the scene's camera sees of its piles."""

import tomllib
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from engine import Funnel, Law, Pile, Setup

import granulcal as gc

HERE = Path(__file__).parent
SCENE, PRIOR = HERE / "scene.toml", HERE / "prior.toml"
PARAMETERS = ("sliding_friction", "rolling_friction", "restitution")
SEGMENTATION = """
[segmentation]
downsample = {downsample}
flying_deg = 90.0
height_threshold = {{ absolute = {threshold} }}
"""
"""What the camera's file says beside the lens: grains as the simulated camera finds them."""


@dataclass(frozen=True)
class Observed:
    """The noise-free statistics of a pile: the 16, and the diagnostics about the pour axis."""

    paper16: np.ndarray
    diagnostics: np.ndarray


def setup_of(table: dict, material: tuple[float, float, float], height: float, seed: int) -> Setup:
    """Returns a pour of equal spheres in LAMMPS, started as in a scene's table.

    Args:
        table: the scene as TOML holds it.
        material: mu_s, mu_r, e [-].
        height: of the funnel's tip [m].
        seed: of the jitter at the start.
    """
    grains, start = table["grains"], table["start"]
    names = ("rim_radius", "stem_radius", "cone_length", "stem_length")
    funnel = Funnel(height=height, **{name: table["funnel"][name] for name in names})
    nx, ny, nz = start["counts"]
    z, y, x = np.indices((nz, ny, nx)).reshape(3, -1)[:, : grains["count"]]
    corner = np.array([-0.5 * (nx - 1), -0.5 * (ny - 1), 0.0]) * start["spacing"]
    corner[2] = funnel.rim + start["base"]
    jitter = np.random.default_rng(seed).uniform(-1.0, 1.0, (len(x), 3)) * start["jitter"]
    sliding, rolling, restitution = material
    law = Law(
        sliding_friction=sliding,
        rolling_friction=rolling,
        restitution=restitution,
        wall_rolling_friction=rolling,
    )
    return Setup(
        centres=start["spacing"] * np.stack([x, y, z], axis=1) + corner + jitter,
        radii=np.full(len(x), 0.5 * grains["diameter"]),
        density=grains["density"],
        grains=law,
        ground=law,
        walls=law,
        funnel=funnel,
    )


@dataclass(frozen=True)
class Bench:
    """The experiment: scene.toml, read once; further numbers of granulcal's material, by name."""

    text: str
    law: dict[str, float] = field(default_factory=dict)

    @classmethod
    def load(cls, law: dict[str, float] | None = None) -> "Bench":
        """Returns the experiment of this folder; granulcal's pours have further numbers `law`."""
        return cls(SCENE.read_text(), law or {})

    @cached_property
    def table(self) -> dict:
        """The scene as TOML holds it."""
        return tomllib.loads(self.text)

    @cached_property
    def eye(self) -> gc.Camera:
        """The camera at its full resolution."""
        camera = self.table["camera"]
        keys = ("height", "field_width", "pixels")
        return gc.Camera.overhead(**{key: camera[key] for key in keys})

    def setup(self, theta: np.ndarray, height: float, seed: int) -> Setup:
        """Returns a pour of LAMMPS without any effect.

        Args:
            theta: mu_s, mu_r, e [-], shape (3,).
            height: of the funnel's tip [m].
            seed: of the jitter at the start.
        """
        return setup_of(self.table, tuple(map(float, theta)), height, seed)

    def pour(self, theta: np.ndarray, height: float, seed: int) -> gc.Pour:
        """Returns the same pour of granulcal, its default preset."""
        values = dict(zip(PARAMETERS, map(float, theta), strict=True)) | self.law
        changes = {f"material.{name}": value for name, value in values.items()}
        scene = gc.Scene.from_toml(self.text).with_({**changes, "funnel.height": height})
        return gc.simulate(scene, seed=seed)

    def observe(self, centres: np.ndarray, radii: np.ndarray) -> Observed:
        """Returns the statistics of spheres as the camera would see them without noise.

        The ground is known, as for `Pour.statistics`; ValueError if too few grains are in view.
        """
        camera = self.table["camera"]
        depth = self.eye.render(centres, radii).astype(float)
        step = camera["downsample"]
        middle = slice(step // 2, None, step)
        pixels = np.arange(camera["pixels"])[middle] + 0.5 - 0.5 * camera["pixels"]
        scale = depth[middle, middle] * camera["field_width"]
        scale /= camera["pixels"] * camera["height"]
        z = camera["height"] - depth[middle, middle]
        seen = (depth[middle, middle] > 0.0) & (z > camera["height_threshold"])
        x, y = pixels[None, :] * scale, -pixels[:, None] * scale
        points = np.stack([x[seen], y[seen], z[seen]], axis=1)
        diagnostics = gc.diagnostic_statistics(
            points,
            grain_diameter=2.0 * float(radii.mean()),
            spacing=camera["field_width"] / camera["pixels"] * step,
            pour_axis=(0.0, 0.0),
        )
        return Observed(gc.statistics(points).paper16, diagnostics.values)

    def record(self, pile: Pile, folder: Path, name: str, seed: int) -> None:
        """Writes the depth image `folder`/`name` of a pile and, once, camera.toml beside loop.toml.

        Args:
            pile: what the camera sees.
            folder: of the set.
            name: of the image, relative to the folder.
            seed: of the sensor's noise.
        """
        camera = self.table["camera"]
        sensor, draft = folder / "sensor.toml", folder / ".draft"
        sensor.write_text(self.text[self.text.index("[camera.sensor]") :])
        image, lens = self.eye.record(
            pile.centres,
            pile.radii,
            draft,
            sensor=sensor,
            seed=seed,
            depth_unit=camera["sensor"]["depth_unit"],
        )
        options = SEGMENTATION.format(
            downsample=camera["downsample"], threshold=camera["height_threshold"]
        )
        lens.write_text(lens.read_text() + options)
        (folder / name).parent.mkdir(exist_ok=True)
        image.replace(folder / name)
        lens.replace(folder / "camera.toml")
        sensor.unlink()
        draft.rmdir()
