"""The pours that the engines are compared on: sets P and B and ten points spread over the prior."""

import math

from lammps_contact import Law

BOUNDS = {
    "sliding_friction": (0.1, 1.0),
    "log10_rolling_friction": (math.log10(0.03), 0.0),
    "restitution": (0.0, 0.8),
}
"""Bounds of the ten points [-]."""
RANKS = ((7, 5), (4, 0), (0, 6), (2, 3), (9, 7), (5, 9), (8, 4), (3, 2), (1, 8), (6, 1))
"""Ranks of mu_r and e at the ten ranks of mu_s: a Latin hypercube, correlations below 0.05."""


def rows() -> dict[str, Law]:
    """Returns the coefficients of every row by its name.

    Set P is sliding friction 0.5, restitution 0.3 and a rolling moment of at most 0.3 R F_n; set B
    is 0.8, 0.1 and 0.1 R F_n, with R the grain's radius, at pairs and at walls. R_eff is R / 2 at
    pairs: hence twice the number between grains. The ten points have one number for both, as
    scenes have by default. B14 is B with about the least restitution at which LAMMPS' contacts can
    do without tension. P44 and B23 are what P and B become with LAMMPS' `tsuji` and the grain's
    radius mistaken for the effective one.
    """
    laws = {
        "P": _with_grain_radius(0.5, 0.3, 0.3),
        "B": _with_grain_radius(0.8, 0.1, 0.1),
        "B14": _with_grain_radius(0.8, 0.1, 0.14),
        "P44": Law(
            sliding_friction=0.5,
            rolling_friction=0.3,
            restitution=0.44,
            wall_rolling_friction=0.3,
        ),
        "B23": Law(
            sliding_friction=0.8,
            rolling_friction=0.1,
            restitution=0.23,
            wall_rolling_friction=0.1,
        ),
    }
    for index, (rolling_rank, restitution_rank) in enumerate(RANKS):
        mu_s, mu_r, e = (
            low + (high - low) * rank / 9.0
            for rank, (low, high) in zip(
                (index, rolling_rank, restitution_rank), BOUNDS.values(), strict=True
            )
        )
        rolling = round(10.0**mu_r, 3)
        laws[f"{index + 1:02d}"] = Law(
            sliding_friction=round(mu_s, 2),
            rolling_friction=rolling,
            restitution=round(e, 2),
            wall_rolling_friction=rolling,
        )
    return laws


def _with_grain_radius(sliding: float, rolling: float, restitution: float) -> Law:
    return Law(
        sliding_friction=sliding,
        rolling_friction=2.0 * rolling,
        restitution=restitution,
        wall_rolling_friction=rolling,
    )
