"""An outlet that is a slot: two thick rollers along x, `strength` mm apart, in the stem."""

from dataclasses import replace

import numpy as np
from engine import Setup, Stiffness, contact

from effects import Effect


def narrow(setup: Setup, strength: float, random: np.random.Generator) -> Setup:
    """Returns the setup with rollers `strength` mm apart.

    Their axes lie in the stem's wall and their tops at its upper end: no pocket holds a grain.
    """
    wall, funnel = contact(setup.walls, "wall", Stiffness.of(setup)), setup.funnel
    roller = funnel.stem_radius - 0.5e-3 * strength
    z, half = funnel.neck - roller, funnel.rim_radius
    lines = []
    for name, y in (("left", -funnel.stem_radius), ("right", funnel.stem_radius)):
        lines.append(f"region {name} cylinder x {y} {z} {roller} -{half} {half} side out")
        lines.append(f"fix {name} all wall/gran/region granular {wall} region {name}")
    return replace(setup, commands="\n".join(lines))


EFFECT = Effect(name="slot", unit="mm", strengths=(29.0, 26.0, 24.0), apply=narrow)
