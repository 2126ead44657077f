"""How far long work is, on stderr: a line that renews itself in a terminal, a few lines in a log.

A batch of pours has a `ProgressLine`. Work of many kinds of steps, such as a training, names each
kind where it loops, `for part in steps("emulator", parts)`; a command that wants to show them runs
it `with shown():`, and nobody else sees them.
"""

import sys
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple, TextIO, TypeVar

__all__ = ["FirstSteps", "ProgressLine", "duration", "first_steps", "quieted", "shown", "steps"]

_T = TypeVar("_T")

_WIDTH = 30
_LOG_EVERY_S = 30.0
_LEFT_OUT = ("unhealthy", "jammed", "without grains in view")


_is_quiet: ContextVar[bool] = ContextVar("is_quiet", default=False)


@contextmanager
def quieted(is_quiet: bool = True) -> Generator[None, None, None]:
    """Shows no progress of what runs in it."""
    token = _is_quiet.set(is_quiet)
    try:
        yield
    finally:
        _is_quiet.reset(token)


class ProgressLine:
    """Shows pours done, their rate and the time left; call it with the counts of a batch.

    Args:
        stream: where to write; the default is stderr.
    """

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._is_quiet = _is_quiet.get()
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
            *left_out: pours that are unhealthy, jammed and without grains in view, as far as they
                are known.
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
        self._show(text, done / max(total, 1), now)

    def step(self, what: str, done: int, total: int, since: float) -> None:
        """Shows one kind of steps.

        Args:
            what: the kind.
            done: steps done.
            total: steps of this kind at most.
            since: when the first began, of `time.monotonic` [s].
        """
        now = time.monotonic()
        if done >= total:
            self._erase()
            return
        text = f"{what} {done}/{total}"
        if done:
            text += f", at most {duration((total - done) * (now - since) / done)} left"
        self._show(text, done / total, now)

    def _erase(self) -> None:
        """Leaves an empty line for what is printed next."""
        if self._is_terminal and self._shown:
            self._stream.write("\r" + " " * len(self._shown) + "\r")
            self._stream.flush()
            self._shown = ""

    def _show(self, text: str, share: float, now: float) -> None:
        if self._is_quiet:
            return
        if self._is_terminal:
            filled = int(_WIDTH * share)
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


class FirstSteps(NamedTuple):
    """What the first steps of a kind took.

    Attributes:
        before: from the start to the first of them [s].
        each: one of them, the mean [s].
        total: how many there are at most.
    """

    before: float
    each: float
    total: int


class _EnoughError(Exception):
    """The steps that were asked for are done."""


class _Trial(ProgressLine):
    """In place of a line: ends the work after its first steps of a kind."""

    def __init__(self, what: str, count: int) -> None:
        super().__init__()
        self.what, self.count = what, count
        self.found: FirstSteps | None = None

    def step(self, what: str, done: int, total: int, since: float) -> None:
        if what != self.what or done == 0 or self.found is not None:
            return
        if done == min(self.count, total):
            each = (time.monotonic() - since) / done
            self.found = FirstSteps(since - self._started, each, total)
            raise _EnoughError


_LINE: ContextVar[ProgressLine | None] = ContextVar("_LINE", default=None)


def steps(what: str, items: Sequence[_T]) -> Iterator[_T]:
    """Yields the items; the line that is shown says how many of them are done.

    Args:
        what: kind of the steps, for example "emulator".
        items: one for each step.
    """
    line = _LINE.get()
    if line is None:
        yield from items
        return
    since = time.monotonic()
    try:
        for done, item in enumerate(items):
            line.step(what, done, len(items), since)
            yield item
    finally:
        # Also where the loop is left early.
        line.step(what, len(items), len(items), since)


@contextmanager
def shown(stream: TextIO | None = None) -> Generator[ProgressLine, None, None]:
    """Shows the steps of what runs inside; `stream` is stderr by default."""
    line = ProgressLine(stream)
    token = _LINE.set(line)
    try:
        yield line
    finally:
        _LINE.reset(token)
        line.close()


def first_steps(what: str, count: int, work: Callable[[], object]) -> FirstSteps:
    """Runs `work` until its first steps of a kind are done, and returns what they took.

    Args:
        what: kind of the steps, as `steps` has it.
        count: how many of them are run.
        work: loops over `steps` of this kind; nothing of it is kept.

    Raises:
        ValueError: the work has no such steps.
    """
    trial = _Trial(what, count)
    token = _LINE.set(trial)
    try:
        work()
    except _EnoughError:
        pass
    finally:
        _LINE.reset(token)
    if trial.found is None:
        raise ValueError(f"the work has no steps {what!r}")
    return trial.found


def duration(seconds: float) -> str:
    """Returns a time in words: seconds, minutes or hours."""
    if seconds >= 5400:
        return f"{seconds / 3600:.1f} h"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02} s" if minutes else f"{rest} s"
