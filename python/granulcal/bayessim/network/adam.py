r"""Adam with decoupled decay of the weights.

$$ m \leftarrow \beta_1 m + (1 - \beta_1) g, \qquad v \leftarrow \beta_2 v + (1 - \beta_2) g^2,
   \qquad x \leftarrow (1 - \eta \lambda) x
   - \eta \, \frac{m / (1 - \beta_1^t)}{\sqrt{v / (1 - \beta_2^t)} + \epsilon} $$

Written out because torch's own optimisers import its compiler, which takes longer than a fit.

Reference:
    Adam: a method for stochastic optimization, ICLR 2015, arXiv:1412.6980.
    Loshchilov and Hutter, Decoupled weight decay regularization, ICLR 2019.
"""

from collections.abc import Sequence

import torch

__all__ = ["Adam"]

_FIRST, _SECOND, _SMALL = 0.9, 0.999, 1e-8


class Adam:
    """Moments of the gradients of some tensors.

    Args:
        tensors: changed in place by `step`.
        decays: lambda of each tensor; None: no decay.
    """

    def __init__(
        self, tensors: Sequence[torch.Tensor], decays: Sequence[float] | None = None
    ) -> None:
        """Starts at zero moments."""
        self.tensors = list(tensors)
        self.decays = list(decays or [0.0] * len(self.tensors))
        self.first = [torch.zeros_like(tensor) for tensor in self.tensors]
        self.second = [torch.zeros_like(tensor) for tensor in self.tensors]
        self.steps = 0

    def step(self, gradients: Sequence[torch.Tensor], rate: float) -> None:
        """Moves each tensor against its gradient; `rate` is eta."""
        self.steps += 1
        root = (1 - _SECOND**self.steps) ** 0.5
        # Numerator and denominator times the root of the second correction.
        size = rate * root / (1 - _FIRST**self.steps)
        together = zip(self.tensors, gradients, self.first, self.second, self.decays, strict=True)
        for tensor, gradient, first, second, decay in together:
            first.lerp_(gradient, 1 - _FIRST)
            second.mul_(_SECOND).addcmul_(gradient, gradient, value=1 - _SECOND)
            if decay:
                tensor.mul_(1 - rate * decay)
            tensor.addcdiv_(first, second.sqrt().add_(root * _SMALL), value=-size)
