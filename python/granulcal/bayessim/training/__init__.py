"""Training: pairs, settings, one fit, and rounds of pours for one observation."""
