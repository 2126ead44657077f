"""`granulcal inspect` of models and posteriors, which granulcal-cli does not read."""

import json
import shutil
from pathlib import Path

import pytest

import granulcal as gc
from granulcal.cli import main

SHIPPED = Path(gc.__path__[0]) / "models" / "funnel"
POSTERIOR = {
    "recordings": ["a\x1b[31m.png"],
    "parameters": {
        "material.sliding_friction": {
            "mode": 0.5, "mean": 0.52, "interval90": [0.25, 0.75], "median": 0.5
        }
    },
    "fixed": {"material.restitution": 0.4},
    "inside_model": {"is_inside": True, "p_value": 0.25, "impossible": [], "statistics": {}},
    "calibrated": True,
    "samples": [[0.5], [0.6]],
}  # fmt: skip


def _told(capfd: pytest.CaptureFixture[str], *words: object, code: int = 0) -> str:
    found = main(["inspect", *map(str, words)])
    out, err = capfd.readouterr()
    assert found == code, err
    return out if code == 0 else err


@pytest.mark.parametrize("path", ["funnel", SHIPPED, SHIPPED / "model.json"])
def test_a_model_says_what_it_is_of(path, tmp_path, monkeypatch, capfd):
    monkeypatch.setenv("GRANULCAL_CACHE", str(tmp_path))
    told = _told(capfd, path)
    found = json.loads(_told(capfd, path, "--json"))
    assert found["kind"] == "model" and found["pours"] > 100 and len(found["statistics"]) == 16
    assert found["scene"]["name"] == "funnel" and found["scene"]["grains"] == 2000
    prior = {each.path: each.in_words for each in gc.Prior.default().parameters}
    assert found["prior"] == prior and "90% region" in found["coverage"]
    for line in ("kind: model", f"estimator: {found['estimator']}", "  name: funnel"):
        assert f"{line}\n" in told
    assert "  material.restitution: uniform from 0 to 1\n" in told
    assert "\nstatistics: max_z, mean_z, " in told and " truths, chance allows " in told


def test_a_posterior_says_what_it_is_of(tmp_path, capfd):
    path = tmp_path / "posterior.json"
    path.write_text(json.dumps(POSTERIOR))
    told = _told(capfd, path)
    assert told == _told(capfd, tmp_path, "-q")
    assert told.startswith("kind: posterior\n") and "\x1b" not in told
    assert "    interval90: 0.25 to 0.75\n" in told and "  material.restitution: 0.4\n" in told
    assert "  is_inside: yes\n" in told and told.endswith("samples: 2\n")
    found = json.loads(_told(capfd, path, "--json"))
    assert found["parameters"]["material.sliding_friction"]["interval90"] == [0.25, 0.75]
    assert "scene" not in found
    scene = gc.Scene.drop(0.02, count=5).to_toml()
    path.write_text(json.dumps({**POSTERIOR, "scene_toml": scene}))
    assert json.loads(_told(capfd, path, "--json"))["scene"]["grains"] == 5
    path.write_text(json.dumps({**POSTERIOR, "parameters": None, "samples": []}))
    assert "\nparameters: none\n" in _told(capfd, path)


def test_a_data_set_is_one_whatever_else_lies_in_its_folder(tmp_path, capfd):
    prior = gc.Prior.default()
    gc.generate(gc.Scene.drop(0.02, count=5), prior, 1, seed=1, out=tmp_path)
    (tmp_path / "posterior.json").write_text(json.dumps(POSTERIOR))
    assert json.loads(_told(capfd, tmp_path, "--json"))["kind"] != "posterior"


def test_other_documents_are_refused_by_name(tmp_path, capfd):
    for text, why in (("{", "truncated or not JSON"), ('{"key": "x"}', "recordings must be there")):
        path = tmp_path / "pours.json"
        path.write_text(text)
        told = _told(capfd, path, code=2)
        assert "pours.json" in told and why in told and "`infer -o`" in told
    shutil.copy(SHIPPED / "model.json", tmp_path)
    (tmp_path / "model.json").write_text('{"format": "other"}')
    assert "model.json is not a granulcal-bayessim file" in _told(capfd, tmp_path, code=2)


def test_a_built_in_scene_without_a_model_and_a_file_of_its_name(tmp_path, monkeypatch, capfd):
    monkeypatch.setenv("GRANULCAL_CACHE", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    assert "`granulcal model drop` makes it" in _told(capfd, "drop", code=2)
    (tmp_path / "drop").mkdir()
    (tmp_path / "drop" / "posterior.json").write_text(json.dumps(POSTERIOR))
    assert _told(capfd, "drop").startswith("kind: posterior\n")


def test_what_the_simulator_reads_is_still_its_own(tmp_path, capfd):
    path = tmp_path / "prior.toml"
    path.write_text(gc.Prior.default().to_toml())
    assert "kind: prior" in _told(capfd, path)
    assert _told(capfd, tmp_path / "none.json", code=2)
    told = _told(capfd, SHIPPED, "--contact-problem", tmp_path / "x.npz", "--time", "1", code=2)
    assert told
