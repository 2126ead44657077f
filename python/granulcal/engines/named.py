"""The engine that a command line names."""

import importlib
import shutil

from granulcal.engines.command import CommandEngine
from granulcal.engines.exported import RUNNERS, ExportedEngine
from granulcal.engines.protocol import CallableEngine, Engine
from granulcal.words import did_you_mean

__all__ = ["engine_named"]


def engine_named(text: str) -> Engine:
    """Returns the engine that a command line names.

    Args:
        text: one of the engines that ship (`lammps`, `liggghts`, `yade`, `mujoco`, `newton`,
            `chrono`); `module:function` of a Python function; else a command.

    Raises:
        ValueError: an engine that is not installed, or a function or command that is not there.
    """
    if text in RUNNERS:
        return ExportedEngine(text)
    module, mark, function = text.partition(":")
    if mark and module.replace(".", "").replace("_", "").isalnum() and " " not in text:
        try:
            found = getattr(importlib.import_module(module), function)
        except (ImportError, AttributeError) as error:
            raise ValueError(f"engine {text!r}: {error}") from None
        return CallableEngine(found, name=text)
    engine = CommandEngine(text)
    if shutil.which(engine.words[0]) is None:
        told = f"{text!r} is no command of this machine; engine must be one, module:function"
        raise ValueError(f"{told} or one of {', '.join(RUNNERS)}{did_you_mean(text, RUNNERS)}")
    return engine
