import ast
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDERS = ("benches", "examples", "scripts")


def names_of_granulcal(file):
    """Module and name of every `from granulcal... import ...` in a file."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        module = node.module if isinstance(node, ast.ImportFrom) else None
        if isinstance(node, ast.ImportFrom) and module and module.startswith("granulcal"):
            yield from ((module, alias.name) for alias in node.names)


def test_what_benches_import_is_there():
    pytest.importorskip("torch")
    files = [file for folder in FOLDERS for file in sorted((ROOT / folder).rglob("*.py"))]
    assert len(files) > 30
    missing = []
    for file in files:
        for module, name in names_of_granulcal(file):
            if hasattr(import_module(module), name):
                continue
            try:
                import_module(f"{module}.{name}")
            except ModuleNotFoundError:
                missing.append(f"{file.relative_to(ROOT)}: {module} has no {name}")
    assert not missing
