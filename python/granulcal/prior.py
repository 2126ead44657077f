"""Prior over any numbers of a scene or a material, each named by its path."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from os import PathLike
from pathlib import Path
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal.bayessim.arrays import as_matrix, known
from granulcal.documents import ENCODING, LARGEST_DOCUMENT, read_bytes
from granulcal.errors import PriorError
from granulcal.parameter import Parameter
from granulcal.real import check_real
from granulcal.whole import check_seed, check_whole
from granulcal.words import not_there

__all__ = ["Parameter", "Prior", "require_prior"]

Array = NDArray[np.float64]

# The paper states its rolling friction as a length [m]; section 'Simulation'.
_PAPER_ROLLING_LENGTH = (1e-7, 1e-1)

_STANDARD_NORMAL = NormalDist()


class Prior:
    """Independent distributions of named parameters; one TOML form for Rust and Python.

    Arrays of parameters have one column for each free (not fixed) parameter, in the order of the
    list, in the parameters' own units. The *unconstrained coordinates* are those of the inference:
    a uniform range becomes [0, 1], a log-uniform one becomes [0, 1] in its logarithm, a normal
    becomes z-scores. Nothing keeps a coordinate inside the prior but `log_prob`.

    Args:
        parameters: the parameters, each path once, at least one of them free.

    Raises:
        TypeError: one is no `Parameter`.
        PriorError: a path is repeated, or no parameter is free.

    Examples:
        >>> prior = Prior.default()
        >>> prior.names
        ['material.sliding_friction', 'material.rolling_friction', 'material.restitution']
        >>> prior.sample(5, seed=1).shape
        (5, 3)
    """

    def __init__(self, parameters: Iterable[Parameter]) -> None:
        """Checks the list as a whole; each parameter has checked itself."""
        if not isinstance(parameters, Iterable):
            raise TypeError(f"parameters must be a list of Parameter objects, got {parameters!r}")
        self.parameters: tuple[Parameter, ...] = tuple(parameters)
        for each in self.parameters:
            if not isinstance(each, Parameter):
                raise TypeError(f"parameters must be Parameter objects, got {each!r} among them")
        paths = [parameter.path for parameter in self.parameters]
        repeated = sorted({path for path in paths if paths.count(path) > 1})
        if repeated:
            raise PriorError(f"each path may appear once, repeated: {', '.join(repeated)}")
        self.free: tuple[Parameter, ...] = tuple(p for p in self.parameters if p.is_free)
        if not self.free:
            raise PriorError("a prior needs at least one parameter that is not fixed, got none")

    @classmethod
    def default(cls) -> Prior:
        """Returns the prior of this library: three dimensionless material coefficients."""
        return cls.material(rolling_friction=(1e-3, 1.0))

    @classmethod
    def paper(cls, *, grain_diameter: float = 0.004) -> Prior:
        """Returns the paper's prior, its rolling friction made dimensionless.

        The paper samples rolling friction log-uniformly from 1e-7 to 1e-1, read here as a length
        [m]; rolling_friction is that length over the effective radius of two equal grains,
        R_eff = diameter / 4 (1 mm for the 4 mm grain).

        Args:
            grain_diameter: diameter of the grains [m].

        Raises:
            TypeError: the diameter is no number.
            PriorError: it is not positive.
        """
        check_real("grain_diameter", grain_diameter)
        if not (np.isfinite(grain_diameter) and grain_diameter > 0):
            raise PriorError(f"grain_diameter must be positive [m], got {grain_diameter}")
        effective_radius = grain_diameter / 4
        low, high = _PAPER_ROLLING_LENGTH
        return cls.material(rolling_friction=(low / effective_radius, high / effective_radius))

    @classmethod
    def material(cls, *, rolling_friction: tuple[float, float]) -> Prior:
        """Returns sliding friction and restitution in [0, 1] and a log-uniform rolling friction."""
        low, high = rolling_friction
        return cls(
            [
                Parameter(
                    path="material.sliding_friction", distribution="uniform", low=0.0, high=1.0
                ),
                Parameter(
                    path="material.rolling_friction", distribution="log_uniform", low=low, high=high
                ),
                Parameter(path="material.restitution", distribution="uniform", low=0.0, high=1.0),
            ]
        )

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Prior:
        """Returns the prior in a TOML file.

        Raises:
            FileNotFoundError: there is no such file.
            PriorError: the file is not a prior; the message begins with the file's name.
        """
        try:
            return cls.from_toml(read_bytes(path, most=LARGEST_DOCUMENT).decode(ENCODING))
        except (PriorError, UnicodeDecodeError) as error:
            raise PriorError(f"{path}: {error}") from None

    @classmethod
    def named(cls, name: str | PathLike[str]) -> Prior:
        """Returns the prior that a command line names: the word `default`, or a TOML file.

        Raises:
            FileNotFoundError: neither the word nor a file.
            PriorError: the file is not a prior.
        """
        if str(name) == "default":
            return cls.default()
        if not Path(name).exists():
            raise FileNotFoundError(not_there(str(name), "prior", ["default"]))
        return cls.load(name)

    @classmethod
    def from_toml(cls, text: str) -> Prior:
        """Returns the prior written as `[[parameter]]` tables.

        Raises:
            TypeError: not text.
            PriorError: not TOML, an unknown key, or numbers that do not fit.
        """
        if not isinstance(text, str):
            raise TypeError(f"text must be the TOML of a prior, a str, got {text!r}")
        try:
            document = tomllib.loads(text)
        except (tomllib.TOMLDecodeError, RecursionError) as error:
            raise PriorError(f"not valid TOML: {error}") from None
        unknown = sorted(set(document) - {"parameter"})
        if unknown:
            raise PriorError(f"unknown key {', '.join(unknown)}: a prior holds [[parameter]] only")
        return cls.from_tables(document.get("parameter", []))

    @classmethod
    def from_tables(cls, tables: Any) -> Prior:
        """Returns the prior of TOML tables, one for each parameter.

        Raises:
            PriorError: no list of tables, an unknown key, or numbers that do not fit.
        """
        if not isinstance(tables, list) or not all(isinstance(t, dict) for t in tables):
            raise PriorError("parameter must be a list of tables, written [[parameter]]")
        return cls(_parameter_from_table(table, i) for i, table in enumerate(tables, start=1))

    def to_toml(self) -> str:
        """Returns the TOML form; `from_toml` reads back an equal prior."""
        blocks = []
        for parameter in self.parameters:
            lines = ["[[parameter]]"]
            for key, value in parameter.as_dict().items():
                shown = f'"{value}"' if isinstance(value, str) else _toml_float(float(value))
                lines.append(f"{key} = {shown}")
            blocks.append("\n".join(lines) + "\n")
        return "\n".join(blocks)

    @property
    def names(self) -> list[str]:
        """Paths of the free parameters, in the order of the columns."""
        return [parameter.path for parameter in self.free]

    @property
    def fixed(self) -> dict[str, float]:
        """Values of the fixed parameters by path."""
        return {p.path: p.bounds[0] for p in self.parameters if not p.is_free}

    @property
    def bounds(self) -> Array:
        """Lowest and highest values of the free parameters, own units, shape (p, 2)."""
        return np.array([parameter.bounds for parameter in self.free])

    @property
    def unconstrained_bounds(self) -> Array:
        """The bounds as coordinates, shape (p, 2)."""
        return np.array([parameter.coordinate_bounds for parameter in self.free])

    def sample(self, n: int, seed: int = 0) -> Array:
        """Returns `n` draws, own units, shape (n, p); the same seed gives the same draws."""
        check_whole("n", n, at_least=0)
        check_seed(seed)
        uniform = np.random.default_rng(seed).random((n, len(self.free)))
        columns = [p.quantile(uniform[:, i]) for i, p in enumerate(self.free)]
        return np.column_stack(columns)

    def log_prob(self, theta: ArrayLike) -> Array:
        """Returns the log density at `theta` (n, p) or (p,), shape (n,); -inf outside the bounds.

        The density is with respect to the parameters' own units.

        Raises:
            ValueError: another shape, or a parameter that is NaN.
        """
        values = known(as_matrix("theta", theta, columns=len(self.free)), self.names)
        low, high = self.bounds.T
        inside = np.all((values >= low) & (values <= high), axis=1)
        density = np.full(len(values), -np.inf)
        coordinates = self.to_unconstrained(values[inside])
        density[inside] = self.coordinate_log_prob(coordinates) + self.log_slope(values[inside])
        return density

    def cdf(self, theta: ArrayLike) -> Array:
        """Returns the share of each parameter's prior below `theta` (n, p) or (p,), shape (n, p).

        Of draws from the prior each column is uniform on [0, 1].
        """
        values = as_matrix("theta", theta, columns=len(self.free))
        return np.column_stack([_share_below(p, values[:, i]) for i, p in enumerate(self.free)])

    def mean(self) -> Array:
        """Returns the prior means, own units, shape (p,)."""
        return np.array([parameter.prior_mean for parameter in self.free])

    def to_unconstrained(self, theta: ArrayLike) -> Array:
        """Returns coordinates of `theta` (n, p), shape (n, p)."""
        values = as_matrix("theta", theta, columns=len(self.free))
        return np.column_stack([p.to_coordinate(values[:, i]) for i, p in enumerate(self.free)])

    def from_unconstrained(self, coordinates: ArrayLike) -> Array:
        """Returns parameters in own units of `coordinates` (n, p), shape (n, p)."""
        values = as_matrix("coordinates", coordinates, columns=len(self.free))
        return np.column_stack([p.from_coordinate(values[:, i]) for i, p in enumerate(self.free)])

    def log_slope(self, theta: ArrayLike) -> Array:
        """Returns log |d coordinates / d theta| at `theta` (n, p), shape (n,)."""
        values = as_matrix("theta", theta, columns=len(self.free))
        return np.sum([p.log_slope(values[:, i]) for i, p in enumerate(self.free)], axis=0)

    def coordinate_log_prob(self, coordinates: Array) -> Array:
        """Returns the log prior density of `coordinates` (n, p), shape (n,)."""
        columns = [p.coordinate_log_density(coordinates[:, i]) for i, p in enumerate(self.free)]
        return np.sum(columns, axis=0)

    def __eq__(self, other: object) -> bool:
        """Whether two priors list the same parameters in the same order."""
        return isinstance(other, Prior) and self.parameters == other.parameters

    def __hash__(self) -> int:
        """Hash of the parameters."""
        return hash(self.parameters)

    def __repr__(self) -> str:
        """The parameters and their distributions, one line."""
        shown = ", ".join(f"{p.path} {p.in_words}" for p in self.parameters)
        return f"Prior({shown})"


def _share_below(parameter: Parameter, values: Array) -> Array:
    low, high = parameter.coordinate_bounds
    # Below the bounds a logarithmic coordinate need not exist.
    coordinates = parameter.to_coordinate(np.clip(values, *parameter.bounds))
    if parameter.distribution != "normal":
        return coordinates
    first, last = _STANDARD_NORMAL.cdf(low), _STANDARD_NORMAL.cdf(high)
    shares = np.array([_STANDARD_NORMAL.cdf(each) for each in coordinates.tolist()])
    return (shares - first) / (last - first)


def _parameter_from_table(table: Mapping[str, Any], number: int) -> Parameter:
    allowed = ("path", "distribution", "low", "high", "mean", "sd", "value")
    label = table.get("path", f"parameter {number}")
    unknown = sorted(set(table) - set(allowed))
    if unknown:
        raise PriorError(
            f"{label}: unknown key {', '.join(unknown)}; allowed are {', '.join(allowed)}"
        )
    for key in ("path", "distribution"):
        if not isinstance(table.get(key), str):
            raise PriorError(f"{label}: {key} must be a string, got {table.get(key)!r}")
    return Parameter(**table)


def _toml_float(value: float) -> str:
    text = repr(value)
    # TOML floats need a digit on both sides of the point, and 1e-07 is allowed as it is.
    return text if any(mark in text for mark in ".e") else f"{text}.0"


def require_prior(prior: object) -> None:
    """Refuses what is no prior, a file's name above all.

    Raises:
        TypeError: not a prior.
    """
    if not isinstance(prior, Prior):
        raise TypeError(f"prior must be a Prior, as Prior.load reads it, got {prior!r}")
