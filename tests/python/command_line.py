"""The Python program in a process of its own."""

import subprocess
import sys


def granulcal(*words: str) -> subprocess.CompletedProcess[str]:
    """Runs it with these words; what it has printed is text."""
    command = [sys.executable, "-m", "granulcal.cli", *words]
    return subprocess.run(command, capture_output=True, text=True, check=False)
