"""The network: a mixture density on random Fourier features, trained by PyTorch alone here."""
