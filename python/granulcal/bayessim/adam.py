r"""Adam with decoupled decay of the weights, for arrays of numpy and tensors of torch alike.

$$ m \leftarrow \beta_1 m + (1 - \beta_1) g, \qquad v \leftarrow \beta_2 v + (1 - \beta_2) g^2,
   \qquad x \leftarrow (1 - \eta \lambda) x
   - \eta \, \frac{m / (1 - \beta_1^t)}{\sqrt{v / (1 - \beta_2^t)} + \epsilon} $$

Written out because torch's own optimisers import its compiler, which takes longer than a fit.

Reference:
    Adam: a method for stochastic optimization, ICLR 2015, arXiv:1412.6980.
    Loshchilov and Hutter, Decoupled weight decay regularization, ICLR 2019.
"""

from collections.abc import Sequence
from typing import Any

__all__ = ["Adam"]

_FIRST, _SECOND, _SMALL = 0.9, 0.999, 1e-8


class Adam:
    """Moments of the gradients of some arrays.

    Args:
        arrays: changed in place by `step`.
        decays: lambda of each array; None: no decay.
    """

    def __init__(self, arrays: Sequence[Any], decays: Sequence[float] | None = None) -> None:
        """Starts at zero moments."""
        self.arrays = list(arrays)
        self.decays = list(decays or [0.0] * len(self.arrays))
        self.first = [0 * array for array in self.arrays]
        self.second = [0 * array for array in self.arrays]
        self.steps = 0

    def step(self, gradients: Sequence[Any], rate: float) -> None:
        """Moves each array against its gradient; `rate` is eta."""
        self.steps += 1
        size = rate / (1 - _FIRST**self.steps)
        root = (1 - _SECOND**self.steps) ** -0.5
        together = zip(self.arrays, gradients, self.first, self.second, self.decays, strict=True)
        for array, gradient, first, second, decay in together:
            first *= _FIRST
            first += (1 - _FIRST) * gradient
            second *= _SECOND
            second += (1 - _SECOND) * gradient * gradient
            if decay:
                array *= 1 - rate * decay
            array -= size * first / (root * second**0.5 + _SMALL)
