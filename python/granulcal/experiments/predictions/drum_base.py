r"""The drum's base model at speeds without a picture, without a closed loop.

| model | at a speed |
|---|---|
| `base` | pours of the drum at the settings of `drum_fit.py`, their mean |
| `corrected` | each of these plus its own residual, on the straight line through both pictures |

What settings share is how the bed bends with speed, which two pictures cannot tell. So `base` has
the largest residual of the two pictures as its error, and `corrected` what the settings differ by
and what the residual does in the forms of `between_speeds.py` in place of the line.

How far `corrected` may be trusted is asked of simulated drums: two stated settings, near the
pictures and not fitted to them, each told at a speed from its own surfaces at the pictures' speeds
and from the pours of the other.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granulcal.cores import cores
from granulcal.experiments.loop_drum.task import SPEEDS as PICTURED
from granulcal.experiments.loop_drum.task import at_speed, task
from granulcal.experiments.predictions.between_speeds import between_speeds, in_drum
from granulcal.experiments.predictions.interval import HALF_90
from granulcal.loop.pours.forward import Forward
from granulcal.pours.scene import Scene

__all__ = ["SETTINGS", "DrumBase"]

Array = NDArray[np.float64]

_VOLUME = "grains.volume"
SETTINGS: tuple[dict[str, float], ...] = (
    {
        "material.sliding_friction": 1.0,
        "material.rolling_friction": 0.1,
        "walls.1.material.sliding_friction": 1.0,
        _VOLUME: 2.8e-5,
    },
    {
        "material.sliding_friction": 0.3,
        "material.rolling_friction": 0.15,
        "walls.1.material.sliding_friction": 1.0,
        _VOLUME: 2.95e-5,
    },
)
"""Stated drums: friction of grains and end walls, the grains' volume, of grains of 1.7 mm."""

_SEED, _TRIES = 8_600_011, 3


class DrumBase:
    """Pours of the settings at any speed.

    Args:
        data: folder of measured data.
        pours: folder of the kept pours.
    """

    def __init__(self, data: Path, pours: Path) -> None:
        """Begins; nothing is poured yet."""
        self.scene = task(data).scene
        self._forward = Forward(pours, cores())

    def fill(
        self, what: str, asked: Sequence[tuple[Mapping[str, float], float, tuple[float, float]]]
    ) -> None:
        """Pours what `at` will be asked for, several at once.

        Args:
            what: names the steps of the progress.
            asked: setting, speed, and when the mean begins and ends [s].
        """
        scenes = [self._scene(setting, rpm, *window) for setting, rpm, window in asked]
        self._forward.fill(what, [(scene, [_SEED]) for scene in scenes])

    def at(self, setting: Mapping[str, float], rpm: float, begin: float, end: float) -> Array:
        """Returns the statistics of a setting at a speed, examined from begin to end [s].

        Of the first usable pour.

        Raises:
            ValueError: none of `_TRIES` pours is usable.
        """
        scene = self._scene(setting, rpm, begin, end)
        for seed in range(_SEED, _SEED + _TRIES):
            for row in self._forward.pours(scene, [seed]):
                return np.asarray(row, dtype=np.float64)
        raise ValueError(f"the drum has no usable pour at {rpm} rpm with {dict(setting)}")

    def pictured(self, setting: Mapping[str, float], speeds: Array) -> Array:
        """Returns a setting's statistics at the pictures' speeds, shape (2, s)."""
        self.fill("drum: pours", [(setting, n, PICTURED[int(n)]) for n in speeds.tolist()])
        return np.array([self.at(setting, n, *PICTURED[int(n)]) for n in speeds.tolist()])

    def held(
        self,
        windows: Mapping[int, tuple[float, float]],
        speeds: Array,
        places: Sequence[float | None],
    ) -> dict[str, tuple[float, float, float]]:
        """Returns how `line` and `corrected` tell simulated drums from these at two speeds.

        Root mean square error of the heights [m] and of the slope [degrees] over settings and
        speeds, and the share in the 90 % intervals. `corrected` tells each setting from the others.

        Args:
            windows: from when to when the mean is taken, by rounds a minute.
            speeds: of the pictures, shape (2,).
            places: as in `tell`.
        """
        self.fill(
            "stated drums: pours",
            [(one, n, window) for one in SETTINGS for n, window in {**PICTURED, **windows}.items()],
        )
        is_slope = np.array([x is None for x in places])
        gaps: dict[str, list[Array]] = {"line": [], "corrected": []}
        inside: dict[str, list[NDArray[np.bool_]]] = {"line": [], "corrected": []}
        for truth in SETTINGS:
            values = self.pictured(truth, speeds)
            others = [one for one in SETTINGS if one is not truth]
            for rpm, window in windows.items():
                there = self.at(truth, rpm, *window)
                rows = {"line": between_speeds("line", speeds, values, rpm, places)}
                rows |= self.tell(others, rpm, window, speeds, values, places)
                for model in gaps:
                    middle, low, high = rows[model]
                    gaps[model].append(there - middle)
                    inside[model].append((there >= low) & (there <= high))
        found = {}
        for model, rows in gaps.items():
            squares = np.mean(np.square(rows), axis=0)
            heights, slope = (float(np.sqrt(squares[w].mean())) for w in (~is_slope, is_slope))
            found[model] = (heights, slope, float(np.mean(inside[model])))
        return found

    def tell(
        self,
        settings: Sequence[Mapping[str, float]],
        rpm: float,
        window: tuple[float, float],
        speeds: Array,
        values: Array,
        places: Sequence[float | None],
    ) -> dict[str, tuple[Array, Array, Array]]:
        """Returns middle, low and high of `base` and `corrected`, shape (s,) each.

        Args:
            settings: numbers of the scene, by path.
            rpm: the speed.
            window: from when to when the mean is taken [s].
            speeds: of the pictures, shape (2,).
            values: their heights [m] and slope [degrees], shape (2, s).
            places: x of each height [m]; None for the slope, s of them.
        """
        plain, moved, low, high, gaps = [], [], [], [], []
        for setting in settings:
            there = self.at(setting, rpm, *window)
            residual = values - self.pictured(setting, speeds)
            line, below, above = between_speeds("line", speeds, residual, rpm, places)
            plain.append(there)
            moved.append(there + line)
            low.append(there + below)
            high.append(there + above)
            gaps.append(np.abs(residual).max(axis=0))
        base, corrected = np.mean(plain, axis=0), np.mean(moved, axis=0)
        half = HALF_90 * np.mean(gaps, axis=0)
        told = {
            "base": (base, base - half, base + half),
            "corrected": (corrected, np.min(low, axis=0), np.max(high, axis=0)),
        }
        return {model: in_drum(rows, places) for model, rows in told.items()}

    def _scene(self, setting: Mapping[str, float], rpm: float, begin: float, end: float) -> Scene:
        return self.scene.with_({**setting, **at_speed(rpm, begin, end)})
