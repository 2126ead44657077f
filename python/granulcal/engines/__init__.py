"""Other simulators in place of ours: a protocol, and the engines that ship; docs/engines.md."""

from granulcal.engines.command import CommandEngine
from granulcal.engines.exported import ExportedEngine, installed
from granulcal.engines.in_use import engine_in_use, pouring_with
from granulcal.engines.named import engine_named
from granulcal.engines.protocol import CallableEngine, Engine

__all__ = [
    "CallableEngine",
    "CommandEngine",
    "Engine",
    "ExportedEngine",
    "engine_in_use",
    "engine_named",
    "installed",
    "pouring_with",
]
