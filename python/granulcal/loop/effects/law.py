"""Free numbers of the contact law: unknown, never a finding.

Engines that agree on sliding and rolling friction and restitution pour other heaps where these
numbers differ, and nobody has measured them for real grains. A task that says

    law = ["touching_exponent", "softness", "torsional_friction"]      # or law = true for all

has them free in every fit, with the priors below, sampled in every pour of its archive.

| number | prior | stands for |
|---|---|---|
| `touching_exponent` | uniform 0.2 to 1 | restitution e^q of contacts that touched before a blow |
| `softness` | log-uniform 0.005 to 0.1 | gap that counts as touching, over the radius |
| `torsional_friction` | log-uniform 0.01 to 0.4 | resistance to spinning about the normal |
| `impact_friction` | uniform 1 to 1.2 | friction cones in impacts: dashpots that pull |
| `rolling_dashpot` | uniform 0 to 1 | rolling in impacts by a spring and a dashpot |
"""

from collections.abc import Sequence

from granulcal.errors import ObservationError
from granulcal.pours.scene import Scene
from granulcal.prior import Parameter

__all__ = ["LAW", "law_numbers"]

LAW: tuple[Parameter, ...] = (
    Parameter(path="material.touching_exponent", distribution="uniform", low=0.2, high=1.0),
    Parameter(path="material.softness", distribution="log_uniform", low=0.005, high=0.1),
    Parameter(path="material.torsional_friction", distribution="log_uniform", low=0.01, high=0.4),
    Parameter(path="material.impact_friction", distribution="uniform", low=1.0, high=1.2),
    Parameter(path="material.rolling_dashpot", distribution="uniform", low=0.0, high=1.0),
)
"""All of them, with their priors."""


def law_numbers(asked: bool | Sequence[str], scene: Scene) -> tuple[Parameter, ...]:
    """Returns the free numbers of the contact law that a task asks for.

    Args:
        asked: names, the last words of the paths; True for all that the scene takes, False for
            none.
        scene: the scene.

    Raises:
        ObservationError: a name that is none of them, or a number that the scene does not take.
    """
    if isinstance(asked, bool):
        return tuple(one for one in LAW if asked and _refusal(one, scene) is None)
    known = {one.path.rpartition(".")[2]: one for one in LAW}
    unknown = [name for name in asked if name not in known]
    if unknown:
        raise ObservationError(f"law has no {', '.join(unknown)}; there are {', '.join(known)}")
    for name in asked:
        refusal = _refusal(known[name], scene)
        if refusal is not None:
            raise ObservationError(f"leave {name} out of law: {refusal}") from refusal
    return tuple(one for name, one in known.items() if name in asked)


def _refusal(number: Parameter, scene: Scene) -> ValueError | None:
    """Returns why a scene does not take the number: grains that are not round do not know all."""
    refusals = (scene.refusal({number.path: value}) for value in number.bounds)
    return next((one for one in refusals if one is not None), None)
