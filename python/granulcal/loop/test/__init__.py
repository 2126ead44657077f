"""Tests of an experiment: fit, residual, scores of effects, refits and the verdict."""
