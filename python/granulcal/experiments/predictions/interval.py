"""How wide the rows' intervals are."""

__all__ = ["HALF_90"]

HALF_90 = 1.645
"""Half of the interval that holds 90 % of a normal distribution, in its standard deviations."""
