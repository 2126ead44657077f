"""The emulator: statistics of a material, learnt from pairs, and the likelihood it gives.

Training fits it here, and evaluates what it has fitted; of a saved model the crate
granulcal-bayessim does (`emulator.rs`, `likelihood.rs`, `noise.rs`).
"""
