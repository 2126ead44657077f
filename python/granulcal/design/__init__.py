"""Pours that are planned: which height gives a wanted ring, how much a height spills."""
