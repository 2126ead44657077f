"""Scenes and materials: what is poured, onto what, and who looks at it."""

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, fields
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from granulcal import _native
from granulcal.pours.statistics import UNITS
from granulcal.real import check_real
from granulcal.whole import check_seed, check_whole
from granulcal.words import not_there

if TYPE_CHECKING:
    from granulcal.measured.segmentation import SegmentationSettings

__all__ = ["BUILT_IN", "Material", "Scene", "require_scene"]

BUILT_IN = ("funnel", "drop")
"""Scenes that are asked for by name."""


@dataclass(frozen=True, kw_only=True)
class Material:
    """Coefficients of a contact between two grains, and of every wall that states none.

    Attributes:
        sliding_friction: Coulomb's coefficient mu_s [-], in [0, 10].
        rolling_friction: rolling friction mu_r [-], relative to the effective radius, in
            [0, 1000]; above about 1 rolling is locked.
        restitution: Newton's coefficient e [-], in [0, 1].
        tangential_restitution: e_t [-], in [0, 1].
        torsional_friction: resistance to spinning about the normal mu_t [-], relative to the
            effective radius, in [0, 1000].
        softness: gap below which grains touch when one of them is struck, over their mean
            radius [-], in [0, 0.2].
        touching_exponent: contacts that touched before a blow have the restitution e^q, q [-], in
            [0, 10].
        impact_friction: friction cones in impacts over those in lasting contacts [-], in [0, 10].
        rolling_dashpot: dashpot on rolling in impacts over the critical one [-], in [0, 10].

    Examples:
        >>> Material(sliding_friction=0.5, rolling_friction=0.1, restitution=0.5).restitution
        0.5
    """

    sliding_friction: float
    rolling_friction: float
    restitution: float
    tangential_restitution: float = 0.0
    torsional_friction: float = 0.02
    softness: float = 0.05
    touching_exponent: float = 1.0
    impact_friction: float = 1.0
    rolling_dashpot: float = 0.0

    def __post_init__(self) -> None:
        """Checks the types; which numbers may be is the scene's to say."""
        for name, value in asdict(self).items():
            check_real(name, value)

    def values(self) -> dict[str, float]:
        """Returns the coefficients by their path in a scene."""
        return {f"material.{name}": float(value) for name, value in asdict(self).items()}


class Scene:
    """A whole experiment but for its seed; immutable, checked when it is made. SI units.

    Examples:
        >>> scene = Scene.funnel(height=0.12)
        >>> scene.get("grains.count")
        2000.0
        >>> scene.with_({"material.sliding_friction": 0.3}).get("material.sliding_friction")
        0.3
    """

    __slots__ = ("native",)

    def __init__(self, native: _native.Scene) -> None:
        self.native = native
        """The scene as the Rust side holds it."""

    @classmethod
    def funnel(
        cls,
        height: float = 0.12,
        *,
        count: int | None = None,
        material: Material | None = None,
        preset: str | None = None,
    ) -> "Scene":
        """Returns the paper's pour: grains of 4 mm through a funnel.

        Args:
            height: height of the funnel's tip above the ground [m].
            count: number of grains, at most 2000 in this start; the default is 2000.
            material: the grains' material; the default is a middling dry grain.
            preset: `fast`, `default`, `accurate` or `paper`; the default is `default`.

        Raises:
            TypeError: the height is no number.
            ValueError: a number is out of its range; the message says which.
        """
        check_real("height", height)
        return cls(_native.Scene.funnel(height))._with_options(count, material, preset)

    @classmethod
    def drop(
        cls,
        height: float,
        *,
        count: int | None = None,
        material: Material | None = None,
        preset: str | None = None,
    ) -> "Scene":
        """Returns a ball of grains of 4 mm let go with its lowest point at `height` [m].

        Args:
            height: height of the lowest point above the ground [m].
            count: number of grains; the default is 2000.
            material: the grains' material; the default is a middling dry grain.
            preset: `fast`, `default`, `accurate` or `paper`; the default is `default`.

        Raises:
            TypeError: the height is no number.
            ValueError: a number is out of its range; the message says which.
        """
        check_real("height", height)
        return cls(_native.Scene.drop(height))._with_options(count, material, preset)

    @classmethod
    def load(cls, path: str | PathLike[str]) -> "Scene":
        """Returns the scene in a TOML file.

        Raises:
            FileNotFoundError: there is no such file.
            ValueError: the file is not a scene; the message names the key.
        """
        return cls(_native.Scene.load(path))

    @classmethod
    def built_in(cls, name: str) -> "Scene":
        """Returns the built-in scene `funnel` (tip at 12 cm) or `drop` (from 10 cm).

        Raises:
            ValueError: there is none of this name.
        """
        makers = {"funnel": cls.funnel, "drop": lambda: cls.drop(0.1)}
        if name not in makers:
            raise ValueError(f"built-in scenes are {', '.join(makers)}; got {name!r}")
        return makers[name]()

    @classmethod
    def named(cls, name: str | PathLike[str]) -> "Scene":
        """Returns the scene that a command line names: a built-in one by its word, or a TOML file.

        Raises:
            FileNotFoundError: neither the word nor a file.
            ValueError: the file is not a scene; the message names the key.
        """
        if str(name) in BUILT_IN:
            return cls.built_in(str(name))
        if not Path(name).exists():
            raise FileNotFoundError(not_there(str(name), "scene", BUILT_IN))
        return cls.load(name)

    @classmethod
    def from_toml(cls, text: str) -> "Scene":
        """Returns the scene written in `text`.

        Raises:
            ValueError: the text is not a scene; the message names the key.
        """
        return cls(_native.Scene.from_toml(text))

    def to_toml(self) -> str:
        """Returns the scene as TOML; `from_toml` reads it back unchanged."""
        return self.native.to_toml()

    def to_dict(self) -> dict[str, Any]:
        """Returns the tables of `to_toml`."""
        return tomllib.loads(self.to_toml())

    def with_(
        self, changes: Mapping[str, float | str] | None = None, /, **more: float | str
    ) -> "Scene":
        """Returns a copy with other values.

        Args:
            changes: new values by path, for example `{"funnel.height": 0.06}`; numbers, or words
                for `preset` and `name`.
            more: the same, for paths without a dot: `scene.with_(preset="fast")`.

        Raises:
            ValueError: a path does not exist or a value is out of its range.
            TypeError: what is no number where a number belongs, or no mapping.
        """
        if changes is not None and not isinstance(changes, Mapping):
            raise TypeError(f"changes must be values by path, a dict, got {changes!r}")
        wanted = {**(changes or {}), **more}
        native = self.native
        if "preset" in wanted:
            native = native.with_preset(_word("preset", wanted.pop("preset")))
        if "name" in wanted:
            native = native.with_name(_word("name", wanted.pop("name")))
        numbers = [(path, _number(path, value)) for path, value in wanted.items()]
        return Scene(native.with_values(numbers))

    def refusal(self, changes: Mapping[str, float]) -> ValueError | None:
        """Returns why `with_` refuses these values; None if it takes them."""
        try:
            self.with_(changes)
        except ValueError as error:
            return error
        return None

    def with_material(self, material: Material) -> "Scene":
        """Returns a copy whose grains have this material."""
        return self.with_(material.values())

    def with_sensor(self, path: str | PathLike[str]) -> "Scene":
        """Returns a copy whose camera has the sensor that `granulcal fit-sensor` wrote.

        Raises:
            OSError: the file cannot be read.
            ValueError: it is no sensor, or not one of this camera.
        """
        return Scene(self.native.with_sensor(path))

    def start(self, seed: int = 0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Returns where the grains are when the pour begins.

        Args:
            seed: seed of the pour, which decides the jitter.

        Returns:
            Centres [m], shape (n, 3), and radii [m], shape (n,).

        Raises:
            TypeError: the seed is no whole number.
            ValueError: the seed is not from 0 to 2^64 - 1, or the grains do not fit.
        """
        check_seed(seed)
        return self.native.start(seed)

    def body_vertices(self, on_rim: int = 64) -> NDArray[np.float64]:
        r"""Returns points whose hull every grain with a shape is, in the body's own axes.

        The body's origin is its centre of mass. A box has its axes along its edges, in the order
        of `aspect`; a cylinder's axis is y; a superquadric and a hull have their principal axes,
        in no set order, of which `body_frame` tells where they are. In the scene a point v of grain
        i of a pour is at `positions[i] + R @ v`, with R the turn of `orientations[i]`.

        Args:
            on_rim: points on each rim of a cylinder.

        Returns:
            Points [m], shape (k, 3); (0, 3) if the grains are round or clumps of spheres.

        Raises:
            TypeError: `on_rim` is no whole number.
            ValueError: it is below 3 or above 100,000.

        Examples:
            >>> box = 'shape = { kind = "box", aspect = [1.0, 2.0, 0.5] }'
            >>> text = Scene.drop(0.02, count=5).to_toml().replace("[grains]", f"[grains]\n{box}")
            >>> Scene.from_toml(text).body_vertices().max(axis=0)
            array([0.002, 0.004, 0.001])
        """
        check_whole("on_rim", on_rim, at_least=3, at_most=100_000)
        body = self.native.body(on_rim)
        return np.zeros((0, 3)) if body is None else body[0]

    def body_frame(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Returns where a grain's own axes are in its shape as the scene states it.

        A stated point p [m] is `(p - centre) @ axes` in the body's axes: of a hull p is one of its
        `points` times the diameter over their longest extent, of a superquadric one of its formula.
        That brings a mesh of the user's own into the axes that `Pour.orientations` turns.

        Returns:
            The centre of mass [m], shape (3,), and the axes, a column each, right-handed, shape
            (3, 3).

        Raises:
            ValueError: the grains have no shape.
        """
        body = self.native.body(3)
        if body is None:
            raise ValueError(
                f"{self.name}: the grains have no grains.shape, so no axes of their own"
            )
        return body[1], body[2]

    def get(self, path: str) -> float:
        """Returns the number at `path`, for example `scene.get("funnel.height")`.

        Those of an effect that is off are known, too.

        Raises:
            ValueError: no number stands there.
        """
        return self.native.get(path)

    def has(self, path: str) -> bool:
        """Returns whether a number stands at `path`, of an effect that is off, too."""
        try:
            self.native.get(path)
        except ValueError:
            return False
        return True

    @property
    def observed_names(self) -> tuple[str, ...]:
        """Names of the statistics that the scene observes, for example `front_radius[0.1]`."""
        return tuple(name for name, _, _ in self.native.observed_statistics())

    @property
    def observed_units(self) -> dict[str, str]:
        """Unit of each statistic that the scene observes."""
        return {name: unit for name, unit, _ in self.native.observed_statistics()}

    def units_of(self, names: Iterable[str]) -> dict[str, str]:
        """Returns the unit of each of these statistics, of images or observed; `-` if none."""
        known = UNITS | self.observed_units
        return {name: known[name] for name in names}

    @property
    def observed_docs(self) -> dict[str, str]:
        """What each statistic that the scene observes is, in a line."""
        return {name: doc for name, _, doc in self.native.observed_statistics()}

    @property
    def ground_resolution(self) -> float:
        """Width of a pixel of the camera's down-sampled image on the ground [m]."""
        width = self.get("camera.field_width") / self.get("camera.pixels")
        return width * self.get("camera.downsample")

    @property
    def reading(self) -> "SegmentationSettings":
        """Arguments of `Recording.formation` that make a recording like this scene's images.

        Pixels as wide on the ground, where a recording shows more of it, the square that the images
        show, about the formation, and unless the camera's file states one, the height from which
        their pixels count as grain.
        """
        found: SegmentationSettings = {
            "ground_resolution": self.ground_resolution,
            "field_width": self.get("camera.field_width"),
        }
        if self.to_dict()["camera"].get("mask", "height") == "height":
            found["scene_threshold"] = self.get("camera.height_threshold")
        return found

    @property
    def name(self) -> str:
        """What the scene is called in data sets and reports."""
        return self.native.name

    @property
    def preset(self) -> str:
        """Name of the solver settings."""
        return self.native.preset

    @property
    def material(self) -> Material:
        """The grains' material."""
        names = [field.name for field in fields(Material)]
        return Material(**{name: self.get(f"material.{name}") for name in names})

    def _with_options(
        self, count: int | None, material: Material | None, preset: str | None
    ) -> "Scene":
        changes: dict[str, float | str] = {} if material is None else {**material.values()}
        if count is not None:
            changes["grains.count"] = count
        if preset is not None:
            changes["preset"] = preset
        return self.with_(changes)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scene) and self.to_toml() == other.to_toml()

    def __hash__(self) -> int:
        return hash(self.to_toml())

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return Scene.from_toml, (self.to_toml(),)

    def __repr__(self) -> str:
        count = int(self.get("grains.count"))
        return f"Scene({self.name!r}, {count} grains, preset {self.preset!r})"


def require_scene(scene: object) -> None:
    """Refuses what is no scene, a file's name above all.

    Raises:
        TypeError: not a scene.
    """
    if not isinstance(scene, Scene):
        raise TypeError(f"scene must be a Scene, as Scene.load reads it, got {scene!r}")


def _word(path: str, value: float | str) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{path} must be a word, got {value!r}")
    return value


def _number(path: str, value: float | str) -> float:
    check_real(path, value)
    try:
        return float(value)
    except OverflowError:
        raise ValueError(f"{path} must be a number below 1.8e308, got a larger one") from None
