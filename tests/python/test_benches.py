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


def test_rates_of_benches_have_their_exact_and_wilson_intervals(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("scipy")
    monkeypatch.syspath_prepend(ROOT / "benches")
    rates = import_module("rates")
    # 1 - 0.025^(1/32) = 0.109, and z^2 / (10 + z^2) = 0.278 of 1.96.
    rates.rate("alarm", [False] * 32, method="exact")
    rates.rate("alarm", [False] * 10, "<= 5 %")
    rates.rate("named", [])
    rates.median("left", [None, 1.0, float("nan"), 3.0], "")
    assert capsys.readouterr().out.splitlines() == [
        "| alarm | 0 of 32 = 0 % | 0 to 11 % |",
        "| alarm | 0 of 10 = 0 % | 0 to 28 % | <= 5 % |",
        "| named | 0 of 0 |  |",
        "| left: median (quartiles), n = 2 | 2.00 (1.50, 2.50) |  |  |",
    ]


def test_the_error_of_strengths_is_told_with_its_bias(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("torch")
    monkeypatch.syspath_prepend(ROOT / "benches")
    table = import_module("loop_study_table")
    # Half of the truth each, 0.3 too weak whatever the sign: nothing scatters.
    rows = [
        {
            "index": i,
            "effects": ["drag"],
            "named": [],
            "p": 0.5,
            "kappa": None,
            "strengths": [0.6 * sign],
            "strength": [0.3 * sign, -1.0, 1.0],
            "curve": [[-1.0, 0.0, 1.0], [0.0, 0.0, 0.0]],
        }
        for i, sign in enumerate((1, -1, 1, -1))
    ]
    table._strengths(rows)
    assert "| strength: mean error towards its sign, rms | -0.300, 0.300 | | |" in (
        capsys.readouterr().out.splitlines()
    )


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
