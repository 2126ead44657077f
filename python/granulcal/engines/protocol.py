"""What another simulator must do: take a scene and a seed, leave grains or points."""

import warnings
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from granulcal.arrays import unmasked
from granulcal.pours.scene import Scene

__all__ = [
    "CallableEngine",
    "Engine",
    "Fewer",
    "FewerGrainsWarning",
    "Left",
    "UnlikeGrainsWarning",
    "left",
]

Array = NDArray[np.float64]

# Coarse grains stand for finer ones, but not a hundred times; single grains may be pressed into it.
_OTHER_UNIT, _UNDER = 100.0, 0.1
Left = tuple[Array, Array] | Array


class Engine(Protocol):
    """A simulator that `generate`, `simulate` and `calibrate` may ask in place of ours.

    It is called from several threads at once. The same scene and seed should give the same pour.
    """

    @property
    def name(self) -> str:
        """What it is called, with its version; data sets of two names are never mixed."""
        ...

    def __call__(self, scene: Scene, seed: int) -> Left:
        """Returns what is left of a pour.

        Args:
            scene: with all parameters set; `scene.to_toml()` and `scene.get(path)` tell them.
            seed: of everything random.

        Returns:
            Centres [m] of shape (n, 3) and radii [m] of shape (n,), ground at z = 0, for the scene's
            camera to look at; or points of the surface [m] of shape (n, 3), as a camera of one's own
            saw them, with the pour axis at x = y = 0.
        """
        ...


class CallableEngine:
    """A Python function as an engine.

    Args:
        function: (scene, seed) to (centres, radii) or points.
        name: what it is called; the default is its qualified name.

    Examples:
        >>> from granulcal.pours.scene import Scene
        >>> flat = CallableEngine(lambda scene, seed: scene.start(seed), name="not moved")
        >>> flat(Scene.drop(0.02, count=5), 1)[0].shape
        (5, 3)
    """

    def __init__(self, function: Callable[[Scene, int], Any], *, name: str | None = None) -> None:
        self.function = function
        self.name = name or f"{function.__module__}:{getattr(function, '__qualname__', function)}"
        """What it is called."""
        self._fewer = Fewer(self.name)

    def __call__(self, scene: Scene, seed: int) -> Left:
        """Returns what the function left, checked; warns, once, of fewer grains than the scene's."""
        found = left(self.name, self.function(scene, seed))
        self._fewer(found, scene)
        return found


class UnlikeGrainsWarning(UserWarning):
    """An engine of one's own left grains in another unit, or under another ground."""


class FewerGrainsWarning(UserWarning):
    """An engine of one's own left fewer grains than the scene has."""


class Fewer:
    """Warns once of an engine that leaves fewer grains than the scene has, or other ones.

    It may: coarser grains stand for more. One that loses grains makes formations that are too small,
    one with another unit or another ground none at all.

    Args:
        name: of the engine.
    """

    def __init__(self, name: str) -> None:
        self.name, self._told = name, False

    def __call__(self, found: Left, scene: Scene) -> None:
        """Looks at what was left of a scene."""
        if self._told or not isinstance(found, tuple):
            return
        if unlike := _unlike(scene, *found):
            self._told = True
            warnings.warn(f"engine {self.name!r} {unlike}", UnlikeGrainsWarning, stacklevel=3)
            return
        table = scene.to_dict()
        if "outflow" in table or table["end"].get("rolled_away") == "leave":
            return
        wanted = round(scene.get("grains.count"))
        if len(found[0]) < wanted:
            self._told = True
            warnings.warn(
                f"engine {self.name!r} left {len(found[0])} grains of the scene's {wanted}: "
                "if it has lost them, what is seen of its pours is too small",
                FewerGrainsWarning,
                stacklevel=3,
            )


def _unlike(scene: Scene, centres: Array, radii: Array) -> str | None:
    """What grains show that are in another unit than metres, or over another ground than z = 0."""
    if not len(centres):
        return None
    radius, own = float(np.median(radii)), 0.5 * scene.get("grains.diameter")
    if not own / _OTHER_UNIT < radius < own * _OTHER_UNIT:
        return f"left grains with a radius of {radius:g} m, the scene's have {own:g} m: in metres?"
    under = int(np.sum(centres[:, 2] < 0))
    if scene.to_dict().get("outflow") is None and under > _UNDER * len(centres):
        return (
            f"left {under} of {len(centres)} grains under the ground, z = 0: is its own elsewhere?"
        )
    return None


def left(name: str, found: Any) -> Left:
    """Returns what an engine left as arrays.

    Raises:
        ValueError: neither (centres, radii) nor points, or masked entries.
    """
    if isinstance(found, tuple):
        if len(found) != 2:
            raise ValueError(
                f"{name} must leave (centres, radii) or points, got {len(found)} things"
            )
        centres = _vectors(name, found[0])
        radii = unmasked("radii", found[1]).astype(float)
        radii = np.ascontiguousarray(np.broadcast_to(radii, len(centres)))
        return centres, radii
    return _vectors(name, found)


def _vectors(name: str, values: Any) -> Array:
    array = np.ascontiguousarray(unmasked("positions", values), dtype=float)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"{name} must leave arrays of shape (n, 3), got {array.shape}")
    return array
