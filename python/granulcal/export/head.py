"""What stands at the head of an exported file: our numbers, where they are from, what is lost."""

import re
from collections.abc import Sequence
from types import ModuleType

import numpy as np

from granulcal.export import liggghts
from granulcal.export.landing import Landing
from granulcal.export.mark import signed
from granulcal.export.setup import Setup

__all__ = ["commented", "head"]

_COMMENTS = {".in": "# ", ".py": "# ", ".usda": "# "}


def head(
    setup: Setup,
    module: ModuleType,
    source: Sequence[str] = (),
    landing: Landing | None = None,
) -> list[str]:
    """Returns the lines of a head.

    Args:
        setup: the pour.
        module: writer of the engine.
        source: lines that say where numbers of the material come from.
        landing: of elastic grains.
    """
    lines = [f"{signed(setup.name, module.ENGINE)}. In granulcal:"]
    lines += [f"  material.{name} = {value:.9g}" for name, value in vars(setup.grains).items()]
    lines += source
    radius = setup.smallest
    lines.append(
        f"grain radius {radius:.6g} m, R_eff = {0.5 * radius:.6g} m of two grains, {radius:.6g} m at a wall"
    )
    if setup.has_sizes:
        lines.append(
            f"grains of {1e3 * radius:.6g} to {1e3 * np.max(setup.radii):.6g} mm in radius: {module.UNEQUAL}"
        )
    if landing is not None:
        lines.append(landing.told())
    lines.append("No exact counterpart:")
    own = module.notes(setup) if hasattr(module, "notes") else []
    lines += [f"  {note}" for note in (*module.NOTES, *own)]
    lines.append(
        "  softness, touching_exponent, impact_friction: the engine's own stiffness and dashpots decide them"
    )
    if module is not liggghts:
        lines.append("  rolling_dashpot: only LIGGGHTS' epsd has it")
    if setup.left_out:
        lines.append(f"Left out: {', '.join(setup.left_out)}")
    return lines


def commented(lines: Sequence[str], text: str, ending: str) -> str:
    """Returns a text with lines before it as a comment of its format."""
    if ending in (".xml", ".sdf"):
        # Two dashes end a comment of XML.
        body = re.sub("-{2,}", lambda run: " ".join(run[0]), "\n".join(lines))
        return f"<!--\n{body}\n-->\n{text}"
    mark = _COMMENTS[ending]
    comment = "".join(f"{mark}{line}".rstrip() + "\n" for line in lines)
    if ending == ".usda":
        first, _, rest = text.partition("\n")
        return f"{first}\n{comment}{rest}"
    return comment + text
