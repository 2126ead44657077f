"""The network: a mixture density on random Fourier features, trained by PyTorch alone here.

Training evaluates it as well; of a saved model the crate granulcal-bayessim does (`network.rs`,
`mixture.rs`).
"""
