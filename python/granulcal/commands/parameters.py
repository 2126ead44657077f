"""The parameters of a posterior, as words of the command line tell them."""

from typing import TYPE_CHECKING, Any

from granulcal.digits import told_apart

if TYPE_CHECKING:
    from granulcal.bayessim.posterior.posterior import Posterior

__all__ = ["parameters_of", "print_parameters"]


def parameters_of(posterior: "Posterior") -> dict[str, dict[str, Any]]:
    """Returns mode, mean and 90 % interval of each parameter, by its name."""
    mode, mean, region = posterior.mode(), posterior.mean(), posterior.credible_region(0.9)
    return {
        name: {"mode": float(mode[i]), "mean": float(mean[i]), "interval90": list(region[name])}
        for i, name in enumerate(posterior.names)
    }


def print_parameters(parameters: dict[str, Any]) -> None:
    """Prints what `parameters_of` returns as a table."""
    print(f"{'parameter':<30}{'mode':>10}{'mean':>10}   90 % interval")
    for name, values in parameters.items():
        numbers = [values["mode"], values["mean"], *values["interval90"]]
        mode, mean, low, high = told_apart(numbers, least=4)
        print(f"{name:<30} {mode:>9} {mean:>9}   {low} to {high}")
