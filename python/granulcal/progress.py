"""How far a batch is, on stderr: a line that renews itself in a terminal, a few lines in a log."""

import sys
import time
from typing import TextIO

__all__ = ["ProgressLine", "duration"]

_WIDTH = 30
_LOG_EVERY_S = 30.0
_LEFT_OUT = ("unhealthy", "jammed", "without grains in view")


class ProgressLine:
    """Shows pours done, their rate and the time left; call it with the counts of a batch.

    Args:
        stream: where to write; the default is stderr.
    """

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._is_terminal = self._stream.isatty()
        self._started = time.monotonic()
        self._logged = self._started
        self._shown = ""

    def __call__(self, total: int, resumed: int, made: int, *left_out: int) -> None:
        """Shows the counts.

        Args:
            total: pours wanted.
            resumed: pours found on disk.
            made: pours simulated since.
            *left_out: pours that are unhealthy, jammed and out of view, as far as they are known.
        """
        now = time.monotonic()
        done = resumed + made
        text = f"{done}/{total} pours"
        if resumed:
            text += f" ({resumed} from disk)"
        for count, word in zip(left_out, _LEFT_OUT, strict=False):
            if count:
                text += f", {count} {word}"
        if made and done < total:
            left = (total - done) * (now - self._started) / made
            text += f", {duration(left)} left"
        if self._is_terminal:
            filled = _WIDTH * done // max(total, 1)
            bar = "#" * filled + "-" * (_WIDTH - filled)
            self._write("\r", f"[{bar}] {text}")
        elif now - self._logged >= _LOG_EVERY_S:
            self._logged = now
            self._stream.write(text + "\n")
            self._stream.flush()

    def close(self) -> None:
        """Leaves the last state on its own line."""
        if self._is_terminal and self._shown:
            self._stream.write("\n")
            self._stream.flush()

    def _write(self, start: str, text: str) -> None:
        if text != self._shown:
            self._stream.write(start + text.ljust(len(self._shown)))
            self._stream.flush()
            self._shown = text


def duration(seconds: float) -> str:
    """Returns a time in words: seconds, minutes or hours."""
    if seconds >= 5400:
        return f"{seconds / 3600:.1f} h"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02} s" if minutes else f"{rest} s"
