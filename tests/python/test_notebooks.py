"""The notebooks of examples/, their code run cell by cell with fewer and smaller pours."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"
SMALL = {
    "own_couscous": {
        "POURS = 1000": "POURS = 60",
        "CHANGES = {}": 'CHANGES = {"grains.count": 150, "preset": "fast"}',
    },
    "own_simulator": {"POURS = 200": "POURS = 80"},
}


def run(name: str) -> dict[str, Any]:
    """Runs the code cells of a notebook and returns their names."""
    document = json.loads((EXAMPLES / f"{name}.ipynb").read_text(encoding="utf-8"))
    cells = ["".join(c["source"]) for c in document["cells"] if c["cell_type"] == "code"]
    text = "\n".join(cells)
    assert all(words in text for words in SMALL[name])
    names: dict[str, Any] = {"__name__": name}
    for cell in cells:
        for words, fewer in SMALL[name].items():
            cell = cell.replace(words, fewer)
        exec(compile(cell, name, "exec"), names)
    return names


def test_no_notebook_is_forgotten_and_none_keeps_its_output() -> None:
    paths = sorted(EXAMPLES.glob("*.ipynb"))
    assert [path.stem for path in paths] == sorted(SMALL)
    for path in paths:
        for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
            assert not cell.get("outputs"), path


@pytest.mark.slow
def test_a_simulator_of_ones_own_is_calibrated() -> None:
    pytest.importorskip("torch")
    names = run("own_simulator")
    low, high = names["posterior"].credible_region(0.99)["material.sliding_friction"]
    assert low < 0.6 < high and high - low < 0.5


@pytest.mark.slow
def test_the_guide_runs_as_a_notebook(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("torch")
    monkeypatch.chdir(tmp_path)
    names = run("own_couscous")
    assert np.isfinite(names["posterior"].mode()).all()
    assert (tmp_path / "couscous" / "materials-nb" / "mode.xml").exists()
