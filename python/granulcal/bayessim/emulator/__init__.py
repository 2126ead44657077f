"""The emulator: statistics of a material, learnt from pairs, and the likelihood it gives."""
