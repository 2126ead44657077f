import subprocess
import sys

import pytest

import granulcal as gc

_HEAVY = "torch matplotlib jinja2 scipy pandas safetensors"


def _loaded_by(statement: str) -> set[str]:
    code = f"import sys; {statement}; print(*(m for m in {_HEAVY.split()} if m in sys.modules))"
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    return set(result.stdout.split())


@pytest.mark.parametrize(
    "statement",
    [
        "import granulcal",
        "import granulcal.cli",
        "import granulcal.demo",
        "import granulcal as gc; gc.Posterior",
        "import granulcal as gc; gc.simulate(gc.Scene.drop(0.02, count=20)).statistics()",
    ],
)
def test_heavy_packages_stay_unloaded(statement):
    assert _loaded_by(statement) == set()


def test_bayessim_loads_torch_when_asked_for():
    assert "torch" in _loaded_by("import granulcal as gc; gc.BayesSim")


def test_every_public_name_is_there():
    for name in gc.__all__:
        assert getattr(gc, name) is not None
    assert set(gc.__all__) <= set(dir(gc))


def test_functions_are_not_hidden_by_their_modules():
    import granulcal.pours.simulate
    import granulcal.pours.statistics  # noqa: F401

    assert callable(gc.simulate)
    assert callable(gc.statistics)


def test_unknown_names_are_refused():
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        gc.nothing  # noqa: B018
