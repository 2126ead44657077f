"""Pours: the scene, its simulation, what a camera sees of it, and data sets of many."""
