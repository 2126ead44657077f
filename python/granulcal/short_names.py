"""Names of parameters as short as tables and figures want them."""

from collections.abc import Sequence

__all__ = ["short_names"]


def short_names(paths: Sequence[str]) -> list[str]:
    """Returns the last word of each path; as many as it takes where several end alike.

    `material.friction` and `ground.height` become friction and height, `material.friction` and
    `effects.ground.friction` become material.friction and ground.friction.
    """
    parts = [path.split(".") for path in paths]
    found = []
    for i, mine in enumerate(parts):
        others = [other for j, other in enumerate(parts) if j != i and other != mine]
        count = next(
            (n for n in range(1, len(mine)) if all(other[-n:] != mine[-n:] for other in others)),
            len(mine),
        )
        found.append(".".join(mine[-count:]))
    return found
