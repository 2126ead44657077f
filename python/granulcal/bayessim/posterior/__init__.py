"""The posterior of an observation: densities, their averages and products, draws and pictures.

A model that is saved is evaluated by the crate granulcal-bayessim, for `infer` of both commands.
The same evaluation stands here because training needs it of models that are not saved yet: it
weighs emulator and network, picks the emulator's form and checks its calibration by posteriors of
held-out pairs, and the rounds of `calibrate` pour where the last posterior may be.
`tests/python/test_both_infer.py` and `crates/bayessim/tests` hold the two together.
"""
