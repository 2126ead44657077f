r"""What a closed loop predicts where nothing was measured, from one file: `models.json`.

| model | prediction under a condition c |
|---|---|
| `base` | pours of the base model at draws of its fit |
| `named` | pours of the model that the fits name, at draws of its fit; else the base model |
| `corrected` | pours of the base model at its fit, moved by the correction without physics |
| `line` | the straight line through the measured means of the conditions to fit |
| `nearest` | the mean of the nearest of these |

The interval of a prediction is that of one pour. Of simulated models it is the spread of pours at
draws of the fit; of `corrected` that of pours at the fit and of $\hat\delta(c)$ (`discrepancy.py`)
together, on the scale z of the surrogate; of `line` and `nearest` the scatter of pours and, where
three conditions or more were fitted, the error with which the row tells each from the others.
`corrected`, `line` and `nearest` are refused farther from the tested conditions than the equation
of the correction holds, and where a number is stated that no condition of the loop states or that
is not the one that all of them share; `base` and `named` pour there, and warn.

`named` is the most probable candidate also where the checks have left no name (RESIDUAL, NONE):
what a model has stands beside each of its predictions.
"""

import contextlib
import json
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal.documents import LARGEST_DOCUMENT, parse_json, read_bytes
from granulcal.engines.in_use import engine_in_use, law_of_pours
from granulcal.errors import ObservationError, OtherLawWarning
from granulcal.files import write_beside
from granulcal.loop.check.discrepancy import Discrepancy
from granulcal.loop.check.trivial import line_weights, nearest_weights
from granulcal.loop.effects.definitions import is_definition
from granulcal.loop.pours.forward import Coarse, Forward
from granulcal.loop.report.asked import (
    condition_of,
    require_near,
    require_shared,
    require_stated,
    shown_outside,
    shown_unlike,
)
from granulcal.loop.report.interval import t_factor
from granulcal.loop.report.models_schema import check_models
from granulcal.loop.report.prediction import FEWEST, Prediction, require_level
from granulcal.loop.surrogate.transform import Transform
from granulcal.pours.scene import Scene
from granulcal.progress import steps

__all__ = ["MODELS", "Maker", "Models", "condition_of"]

Array = NDArray[np.float64]

MODELS = ("base", "named", "corrected", "line", "nearest")
"""What may predict."""
_ROWS = ("line", "nearest")
"""Those that pour nothing."""
_WITHOUT_PHYSICS = ("corrected", *_ROWS)

_NAME = "models.json"
# Seeds of pours, apart from those of the archive and of the replicates.
_SEED = 8_500_003
# Draws of the correction for each pour.
_EACH = 40


@dataclass(frozen=True)
class Maker:
    """Numbers of the scene that make one pour of a model.

    Attributes:
        numbers: by path.
        shifts: added to the condition's own numbers, by path.
        faults: of the image, by kind.
    """

    numbers: dict[str, float]
    shifts: dict[str, float]
    faults: dict[str, float]


@dataclass(frozen=True)
class Models:
    """The models of a closed loop.

    Attributes:
        scene: without a condition's numbers.
        verdict: the word and the names.
        paths: numbers that a condition states.
        inputs: path, least and largest value of each input of the archive.
        names: of the statistics, s of them.
        makers: of `base` and `named`: at the fit first, then draws of it.
        columns: statistics that the surrogate has, m of them.
        transforms: of these.
        correction: the discrepancy of the base fit; None where it was not made.
        known: unit coordinates of the conditions to fit, shape (H, q).
        means: measured, shape (H, s).
        scatter: standard deviation of one pour under each, shape (H, s).
        pours: measured under each, shape (H,).
        coarse: the second size of grains; None without.
        engine: name of the simulator that poured for the loop; None is ours, and empty another one
            that an older file does not name.
        shared: numbers that all conditions state, and each the same.
        strengths: psi of the effects of `named` at its fit, by name; an older file tells none.
    """

    scene: Scene
    verdict: dict[str, Any]
    paths: tuple[str, ...]
    inputs: tuple[tuple[str, float, float], ...]
    names: tuple[str, ...]
    makers: dict[str, tuple[Maker, ...]]
    columns: tuple[int, ...]
    transforms: tuple[Transform, ...]
    correction: Discrepancy | None
    known: Array
    means: Array
    scatter: Array
    pours: Array
    coarse: Coarse | None = None
    engine: str | None = None
    shared: dict[str, float] = field(default_factory=dict)
    strengths: dict[str, float] = field(default_factory=dict)

    @property
    def units(self) -> dict[str, str]:
        """Unit of each statistic; `-` if it has none."""
        return self.scene.units_of(self.names)

    def write(self, folder: Path) -> Path:
        """Writes `models.json` into a folder and returns its path."""
        document = {
            "law": law_of_pours(self.scene),
            "engine": self.engine,
            "scene": self.scene.to_toml(),
            "verdict": self.verdict,
            "paths": self.paths,
            "inputs": self.inputs,
            "names": self.names,
            "makers": {k: [asdict(one) for one in v] for k, v in self.makers.items()},
            "columns": self.columns,
            "transforms": [asdict(one) for one in self.transforms],
            "correction": None if self.correction is None else self.correction.to_dict(),
            "known": self.known.tolist(),
            "means": self.means.tolist(),
            "scatter": self.scatter.tolist(),
            "pours": self.pours.tolist(),
            "coarse": None if self.coarse is None else asdict(self.coarse),
            "shared": self.shared,
            "strengths": self.strengths,
        }
        path = folder / _NAME
        write_beside(path, json.dumps(document) + "\n")
        return path

    @classmethod
    def load(cls, folder: str | PathLike[str]) -> "Models":
        """Returns the models in the folder of a report.

        Raises:
            FileNotFoundError: there is no `models.json`.
            ObservationError: it is damaged; the message says where.
        """
        path = Path(folder) / _NAME
        if not path.exists():
            raise FileNotFoundError(
                f"{path} is not there: is {folder} the -o of close-loop? From what `infer -o` or "
                "`calibrate` wrote, `predict posterior.json SCENE --at ...` predicts"
            )
        data = read_bytes(path, most=LARGEST_DOCUMENT)
        d = parse_json(data, path, error=ObservationError)
        check_models(d, path)
        scene = Scene.from_toml(d["scene"])
        today = scene.native.law
        if d.get("law") not in (0, today):
            warnings.warn(
                f"{path} is of another law of the solver than today's {today}: what it "
                "fitted is not what is poured now; close the loop again",
                OtherLawWarning,
                stacklevel=2,
            )
        inputs = tuple((str(p), float(a), float(b)) for p, a, b in d["inputs"])
        # What the conditions share is the scene's, and older files do not say it again.
        beside = [path for path in d["paths"] if path not in [p for p, _, _ in inputs]]
        known = np.array(d["known"], dtype=float).reshape(len(d["means"]), len(inputs))
        return cls(
            scene=scene,
            verdict=d["verdict"],
            paths=tuple(d["paths"]),
            inputs=inputs,
            names=tuple(d["names"]),
            makers={k: tuple(Maker(**one) for one in v) for k, v in d["makers"].items()},
            columns=tuple(d["columns"]),
            transforms=tuple(Transform(**one) for one in d["transforms"]),
            correction=Discrepancy.from_dict(d["correction"]) if d["correction"] else None,
            known=known,
            means=np.array(d["means"], dtype=float),
            scatter=np.array(d["scatter"], dtype=float),
            pours=np.array(d["pours"], dtype=float),
            coarse=Coarse(**d["coarse"]) if d["coarse"] else None,
            # Older files name none; their law tells ours from others.
            engine=d.get("engine", "" if d.get("law") == 0 else None),
            shared=d["shared"] if "shared" in d else _known(scene, beside),
            strengths=d.get("strengths", {}),
        )

    def predict(
        self,
        model: str,
        at: Mapping[str, float],
        forward: Forward,
        *,
        level: float = 0.9,
        pours: int = 20,
    ) -> Prediction:
        """Returns what a model says of a condition.

        Args:
            model: one of `MODELS`.
            at: numbers that the condition states; those that it leaves out are the scene's own.
            forward: runs and keeps the pours.
            level: of the interval.
            pours: of a simulated model.

        Raises:
            ObservationError: an unknown model, a condition that lacks an input of the archive, one
                that a model without physics would ignore in part, that is too far from the tested
                ones or not like all of them, too few pours or usable ones, or another engine in use
                than that of the loop.
        """
        if model not in MODELS:
            raise ObservationError(f"model must be one of {', '.join(MODELS)}, got {model!r}")
        require_level(level)
        # How a pour is observed goes without saying.
        observed = {p: self.scene.get(p) for p, _, _ in self.inputs if is_definition(p)}
        inputs = [path for path, _, _ in self.inputs]
        others = [path for path in at if path not in inputs]
        at = {**observed, **at}
        missing = [path for path in inputs if path not in at]
        if missing:
            besides = f", and {', '.join(others)} is none of them" if others else ""
            raise ObservationError(
                f"the condition must state {', '.join(inputs)}; it lacks "
                f"{', '.join(missing)}{besides}"
            )
        if model in _WITHOUT_PHYSICS:
            known = list(dict.fromkeys((*self.paths, *inputs)))
            require_stated(model, at, known)
            require_shared(model, at, self.shared)
        self.require_engine(model)
        if model in _ROWS:
            require_near(model, self._unit(at), self.known)
            return self._row(model, self._unit(at), level)
        if pours < FEWEST:
            raise ObservationError(f"{model}: pours must be at least {FEWEST}, got {pours}")
        if model == "corrected":
            return self._corrected(at, forward, level, pours)
        makers = self.makers[model]
        rows = [
            self._pours(makers[1 + i % (len(makers) - 1)], at, [_SEED + i], forward)
            for i in steps("pours", range(pours))
        ]
        whole = np.concatenate(rows)
        return Prediction.of_pours(model, self.names, whole, level, asked=pours)

    def require_engine(self, model: str) -> None:
        """Refuses a model that pours where another engine is in use than that of the loop.

        Raises:
            ObservationError: says which it was.
        """
        used = engine_in_use()
        name = None if used is None else used.name
        if model in _ROWS or name == self.engine or (self.engine == "" and name):
            return
        was, now = (
            "another engine" if each == "" else "our own simulator" if each is None else repr(each)
            for each in (self.engine, name)
        )
        raise ObservationError(
            f"{model}: the loop was closed with pours by {was}, and what it fitted is of that "
            f"alone; got {now}: pour with the same (`predict --engine`), or ask for line or nearest"
        )

    def added(self) -> dict[str, float]:
        """Returns what `named` has at its fit and `base` has not, by path or kind of fault.

        Of an effect on a condition's own number it is what is added to that number.
        """
        plain, own = self.makers["base"][0], self.makers["named"][0]
        numbers = {path: v for path, v in own.numbers.items() if path not in plain.numbers}
        return {**numbers, **own.shifts, **own.faults}

    def _moved(self) -> set[str]:
        """Numbers of a condition that the effect of `named` adds to: stated, and not fitted."""
        return set(self.makers["named"][0].shifts)

    def described(self, model: str, at: Mapping[str, float]) -> dict[str, Any]:
        """Returns what a model has at its fit, for JSON.

        Args:
            model: one of `MODELS`.
            at: numbers that are asked for in place of the fit's.
        """
        if model in _ROWS:
            return {"numbers": {}, "effects": {}, "strengths": {}, "is_named": False}
        has = self.added() if model == "named" else {}
        numbers = self.makers["named" if model == "named" else "base"][0].numbers
        return {
            "numbers": {path: at.get(path, value) for path, value in numbers.items()},
            "effects": has,
            "strengths": self.strengths if has else {},
            "is_named": bool(has and self.verdict["named"]),
        }

    def said(self, model: str, at: Mapping[str, float]) -> str:
        """Returns what a model has, in a line.

        Args:
            model: one of `MODELS`.
            at: numbers that are asked for in place of the fit's.
        """
        if model in _ROWS:
            return "no physics: the measured means of the conditions to fit"
        has = self.added() if model == "named" else {}
        if not has:
            beside = ", moved by its own interpolated residual" if model == "corrected" else ""
            return f"the base model at its fit, without any effect{beside}"
        asked = {p: f" ({at[p]:g} asked for)" for p in has if p in at and p not in self._moved()}
        numbers = ", ".join(f"{p} = {value:.4g}{asked.get(p, '')}" for p, value in has.items())
        names = " + ".join(self.strengths or self.verdict["named"]) or "one effect more"
        if self.verdict["named"]:
            return f"the base model with {names}: {numbers} at its fit"
        return (
            f"the base model with {names}, the most probable candidate, which the verdict does not "
            f"name: {numbers} at its fit"
        )

    def doubts(self, model: str, at: Mapping[str, float]) -> list[str]:
        """Returns what is to be said of a condition before anything is poured under it.

        Args:
            model: one of `MODELS`.
            at: numbers that the condition states.
        """
        if model not in ("base", "named"):
            return []
        inputs = [path for path, _, _ in self.inputs]
        maker = self.makers[model][0]
        own = _known(self.scene, [p for p in at if p not in {*self.paths, *inputs, *maker.numbers}])
        outside = shown_outside(at, self.inputs)
        told = [f"{one}, the conditions of the loop: nothing was measured there" for one in outside]
        for one in shown_unlike(at, {**own, **self.shared}):
            told.append(f"{one}, outside the conditions of the loop: nothing was measured there")
        fitted = {p: v for p, v in maker.numbers.items() if p not in (*inputs, *self.shared)}
        for one in shown_unlike(at, fitted, "the fit"):
            told.append(f"{one}: it is what was asked for, no longer what was fitted")
        return told

    def scenes(self, model: str, at: Mapping[str, float]) -> list[Scene]:
        """Returns the scenes that one pour of a prediction needs: none, one, or one of each size.

        Args:
            model: one of `MODELS`.
            at: numbers that the condition states.
        """
        if model in _ROWS:
            return []
        maker = self.makers["base" if model == "corrected" else model][0]
        scene = self._scene(maker, at)
        if self.coarse is None:
            return [scene]
        return [scene, scene.with_(self.coarse.numbers)] * self.coarse.repeats

    def _unit(self, at: Mapping[str, float]) -> Array:
        return np.array([(at[p] - low) / (high - low) for p, low, high in self.inputs])

    def _scene(self, maker: Maker, at: Mapping[str, float]) -> Scene:
        """The scene of a pour under a condition, at its own size of grains."""
        there = {path: value + maker.shifts.get(path, 0.0) for path, value in at.items()}
        return self.scene.with_({**maker.numbers, **there})

    def _pours(
        self, maker: Maker, at: Mapping[str, float], seeds: Sequence[int], forward: Forward
    ) -> Array:
        return forward.limit(self._scene(maker, at), seeds, maker.faults, self.coarse)

    def _corrected(
        self, at: Mapping[str, float], forward: Forward, level: float, pours: int
    ) -> Prediction:
        """Statistics that the surrogate does not have are those of the base model."""
        if self.correction is None:
            raise ObservationError("this loop has no correction: its base fit leaves nothing")
        delta, sd = self.correction.predict(self._unit(at))
        seeds = [_SEED + i for i in range(pours)]
        rows = self._pours(self.makers["base"][0], at, seeds, forward)
        generator = np.random.default_rng(_SEED)
        drawn = np.repeat(rows, _EACH, axis=0)
        shift = delta + sd * generator.standard_normal((len(drawn), len(delta)))
        for j, (column, transform) in enumerate(zip(self.columns, self.transforms, strict=True)):
            z = transform(drawn[:, column]) + shift[:, j]
            drawn[:, column] = transform.inverse(z)
        return Prediction.of_pours("corrected", self.names, drawn, level, len(rows), pours)

    def _row(self, model: str, at: Array, level: float) -> Prediction:
        of = {"line": line_weights, "nearest": nearest_weights}[model]
        weights = of(self.known, at)
        if weights is None:
            raise ObservationError(
                "no straight line: the conditions that were measured differ in fewer places than "
                "it needs; ask for nearest"
            )
        own = self.scatter**2
        variance = (weights**2 / self.pours) @ own + own.mean(axis=0) + self._left_out(of)
        half = t_factor(level, max(int((self.pours - 1).sum()), 1)) * np.sqrt(variance)
        middle = weights @ self.means
        return Prediction(model, self.names, middle, middle - half, middle + half, level)

    def _left_out(self, of: Any) -> Array:
        """Mean square error with which each condition is told from the others, (s,)."""
        squares = []
        for h in range(len(self.known)):
            rest = np.arange(len(self.known)) != h
            weights = of(self.known[rest], self.known[h]) if rest.sum() > 1 else None
            if weights is not None:
                squares.append((self.means[h] - weights @ self.means[rest]) ** 2)
        return np.mean(squares, axis=0) if squares else np.zeros(self.means.shape[1])


def _known(scene: Scene, paths: Sequence[str]) -> dict[str, float]:
    """Numbers of a scene by path, without those that it has none of."""
    found = {}
    for path in paths:
        with contextlib.suppress(ValueError):
            found[path] = scene.get(path)
    return found
