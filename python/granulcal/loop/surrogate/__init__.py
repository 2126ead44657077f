"""One emulator of all pours, linearised at an experiment, and fits on it."""
