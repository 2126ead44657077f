"""The arrays of a model as named tensors, and back with every shape checked."""

from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from granulcal.bayessim.check.misfit import MisfitReference
from granulcal.bayessim.emulator.basis import Basis
from granulcal.bayessim.emulator.emulator import Emulator
from granulcal.bayessim.emulator.likelihood import Likelihood
from granulcal.bayessim.emulator.noise import Noise
from granulcal.bayessim.emulator.signal import SignalAxes
from granulcal.bayessim.network.amortised import Amortised
from granulcal.bayessim.network.network import HeadLayout, Network
from granulcal.bayessim.network.standardise import Standardiser
from granulcal.bayessim.storage.parts import Trained
from granulcal.bayessim.training.config import Config
from granulcal.errors import ModelFormatError
from granulcal.prior import Prior

__all__ = ["Tensors", "model_tensors"]

Array = NDArray[np.float64]

_X_NAMES = ("shift", "scale", "low", "high")


def model_tensors(model: Trained, *, compact: bool = False) -> dict[str, NDArray[Any]]:
    """Returns every array of a model by name.

    Args:
        model: what is saved.
        compact: without what the emulator expects at the pool of draws, which can be worked out.
    """
    standardiser, likelihood = model.standardiser, model.likelihood
    tensors: dict[str, NDArray[Any]] = {
        "x_is_log": standardiser.is_log.astype(np.uint8),
        **{f"x_{name}": getattr(standardiser, name) for name in _X_NAMES},
        **likelihood.arrays(),
        **model.misfit_reference.arrays(),
    }
    if model.average.emulator > 0 and not compact:
        # What the command line would have to work out before its first posterior; single precision
        # is enough for the weights of draws.
        names = ("pool_means", "pool_scales", "pool_unknown")
        expected = likelihood.native.expected_at_pool()
        tensors |= {
            name: array.astype(np.float32) for name, array in zip(names, expected, strict=True)
        }
    if model.amortised is not None:
        network = model.amortised.network
        tensors |= {
            "frequencies": network.frequencies.numpy(),
            "linear": network.linear.detach().numpy(),
            "fourier": network.fourier.detach().numpy(),
            "bias": network.bias.detach().numpy(),
            "axes_matrix": model.amortised.axes.matrix,
            "axes_relevance": model.amortised.axes.relevance,
            "target_shift": model.amortised.shift,
            "target_scale": model.amortised.scale,
        }
    return {name: np.ascontiguousarray(array) for name, array in tensors.items()}


class Tensors:
    """Arrays read from a file, of a model with `p` parameters and `s` statistics."""

    def __init__(self, arrays: dict[str, NDArray[Any]], where: Path, p: int, s: int) -> None:
        """Joins arrays by name with the file that they come from."""
        self.arrays, self.where, self.p, self.s = arrays, where, p, s

    def take(self, name: str, *shape: int | None) -> NDArray[Any]:
        """Returns one array; None in `shape` allows any length.

        Raises:
            ModelFormatError: there is none, of another shape, or not finite.
        """
        if name not in self.arrays:
            raise ModelFormatError(f"{self.where} has no tensor {name}")
        array = self.arrays[name]
        fits = array.ndim == len(shape) and all(
            want is None or want == have for want, have in zip(shape, array.shape, strict=True)
        )
        if not fits:
            wanted = "(" + ", ".join("any" if n is None else str(n) for n in shape) + ")"
            raise ModelFormatError(
                f"{self.where}: {name} must have shape {wanted}, got {array.shape}"
            )
        if not np.all(np.isfinite(array)):
            raise ModelFormatError(f"{self.where}: {name} must be finite")
        return array

    def standardiser(self) -> Standardiser:
        """Returns the standardiser of the statistics."""
        is_log = self.take("x_is_log", self.s).astype(bool)
        return Standardiser(is_log, *(self.take(f"x_{name}", self.s) for name in _X_NAMES))

    def likelihood(self, prior: Prior, config: Config, scalars: dict[str, Any]) -> Likelihood:
        """Returns the emulated likelihood."""
        p, s, m, count = self.p, self.s, config.emulator_features, scalars["axis_count"]
        centre, scale = self.take("emulator_centre", p), self.take("emulator_scale", p)
        frequencies = self.take("emulator_frequencies", m, p)
        scale_frequencies = self.take("emulator_scale_frequencies", None, p)
        scale_basis = Basis(centre, scale, scale_frequencies, degree=2)
        columns = scale_basis(np.zeros((1, p))).shape[1]
        emulator = Emulator(
            basis=Basis(centre, scale, frequencies),
            coefficients=self.take("emulator_coefficients", s, 1 + p + 2 * m),
            scale_basis=scale_basis,
            scale_coefficients=self.take("emulator_scale_coefficients", s, columns),
            unknown_coefficients=self.take("emulator_unknown_coefficients", s, columns),
            noise=Noise(self.take("emulator_root", s, s), scalars["degrees"]),
            shift=self.take("emulator_y_shift", s),
            spread=self.take("emulator_y_spread", s),
        )
        root = self.take("emulator_leading_root", count, count)
        leading = emulator.first(count, Noise(root, scalars["leading_degrees"]))
        axes = SignalAxes(self.take("emulator_axes", s, s), self.take("emulator_relevance", s))
        return Likelihood(prior, axes, emulator, leading, scalars["widening"])

    def misfit(self) -> MisfitReference:
        """Returns the residuals of held-out pairs."""
        is_unit = "misfit_unit_noise" in self.arrays
        return MisfitReference(
            self.take("misfit_squares", None),
            self.take("misfit_residuals", None, self.s),
            self.take("misfit_unit_noise" if is_unit else "misfit_noise", None, self.s),
            is_unit,
        )

    def amortised(self, config: Config) -> Amortised:
        """Returns the network."""
        layout, members = HeadLayout(config.component_counts[0], self.p), config.ensemble
        matrix = self.take("axes_matrix", self.s, None)
        inputs = matrix.shape[1]
        network = (
            self.take("frequencies", members, config.features, inputs),
            self.take("linear", members, inputs, layout.size),
            self.take("fourier", members, 2 * config.features, layout.size),
            self.take("bias", members, 1, layout.size),
        )
        return Amortised(
            SignalAxes(matrix, self.take("axes_relevance", inputs)),
            Network(layout, *(torch.from_numpy(tensor) for tensor in network)),
            self.take("target_shift", self.p),
            self.take("target_scale", self.p),
        )
