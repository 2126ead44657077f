"""How pours end, and which of them say something.

`docs/theory/dataset.md` has what each word means.
"""

__all__ = ["NO_GRAINS", "UNUSABLE", "USABLE"]

USABLE = ("at_rest", "out_of_view", "ran_out", "horizon")
"""Statuses of pours that are learnt from."""

UNUSABLE = ("unhealthy", "jammed")
"""Statuses of pours that nothing is learnt from."""

NO_GRAINS = "no_grains_in_view"
"""What a row says whose pour is usable and shows too few grains for statistics."""
