"""`granulcal infer` by a model of what its scene observes."""

import json
from pathlib import Path

import pytest

import granulcal as gc
from granulcal import cli
from granulcal.bayessim import BayesSim

_OBSERVE = """
[observe]
rate = 100.0

[observe.front]
times = [0.05, 0.1]

[observe.radius]
percentiles = [50.0, 90.0]
"""


@pytest.fixture(scope="module")
def scene(small_scene: gc.Scene) -> gc.Scene:
    return gc.Scene.from_toml(small_scene.to_toml() + _OBSERVE)


@pytest.fixture(scope="module")
def model(scene, small_prior, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("observed")
    data = gc.generate(scene, small_prior, 80, seed=5, out=folder / "pours", progress=False)
    made = BayesSim.fit(data, quiet=True, seed=1, method="emulated", emulator_features=8)
    made.save(folder / "model")
    return folder / "model"


def _measured(scene: gc.Scene, path: Path, seed: int) -> str:
    pour = gc.simulate(scene, seed=seed)
    path.write_text(json.dumps({"observed": pour.observed().to_dict()}))
    return str(path)


def test_measured_numbers_become_a_posterior(model, scene, tmp_path, capfd):
    files = [_measured(scene, tmp_path / f"{seed}.json", seed) for seed in (11, 12)]
    out = tmp_path / "posterior.json"
    words = ["infer", str(model), *files, "--json", "-o", str(out)]
    code = cli.main(words)
    found = json.loads(capfd.readouterr().out)
    made = BayesSim.load(model)
    x = [gc.Recording.observed(file, scene) for file in files]
    assert code == (0 if made.misfit(x).is_inside else 3)
    assert found["inside_model"]["p_value"] == pytest.approx(made.misfit(x).p_value)
    region = made.posterior(x).credible_region(0.9)
    for name, values in found["parameters"].items():
        assert values["interval90"] == pytest.approx(list(region[name]))
    kept = json.loads(out.read_text())
    assert len(kept.pop("samples")) == 1000 and kept == found
    assert cli.main(["inspect", str(out)]) == 0
    assert cli.main(["infer", str(model), files[0]]) in (0, 3)
    told = capfd.readouterr().out
    assert "90 % interval" in told and "assumed: " in told and "information gained" in told
    # What was inferred can be carried over, whatever the scene was.
    command = ["export", "posterior", str(out), "drop", "--to", "lammps", "-o", str(tmp_path / "l")]
    assert cli.main(command) in (0, 3)


def test_a_report_is_of_the_statistics_that_the_scene_observes(model, scene, tmp_path, capfd):
    pytest.importorskip("jinja2")
    files = [_measured(scene, tmp_path / f"{seed}.json", seed) for seed in (11, 12)]
    page, pours = tmp_path / "report.html", model.parent / "pours"
    words = ["report", str(model), *files, "--data", str(pours), "-o", str(page), "--seeds", "2"]
    assert cli.main([*words, "--json"]) in (0, 3)
    told = json.loads(capfd.readouterr().out)
    assert told["report"] == str(page) and told["warnings"] == []
    text = page.read_text(encoding="utf-8")
    for name in scene.observed_names:
        assert f"<code>{name}</code>" in text
    assert f"over the {len(scene.observed_names)} statistics" in text and "max_z" not in text
    assert "Depth images" not in text and "mean of 2 pours" in text
    assert f"granulcal report {model}" in text and "--draws" not in text
    # What is of depth images is refused, as `infer` refuses it.
    assert cli.main([*words, "--camera", str(pours)]) == 2
    assert "--camera is of depth images" in capfd.readouterr().err


def test_what_does_not_go_with_the_model_is_named(model, scene, tmp_path, capfd):
    file = _measured(scene, tmp_path / "pour.json", 11)
    part = tmp_path / "part.csv"
    part.write_text("statistic,value\nradius[50],0.01\n")
    image = tmp_path / "depth.bag"
    image.write_bytes(b"#ROSBAG V2.0\n")
    cases = {
        (str(part),): "part.csv has no value of front_radius[0.05]",
        (file, file): "given once",
        (file, "--border", "2"): "--border is of depth images",
        (file, "--samples", "5"): "--samples goes with --json",
        (file, "--samples", "-5", "--json"): "--samples must be at least 0, got -5",
        (file, "--scene", "drop"): "the model was trained on another scene",
        (str(image),): "must be one of .bmp, .png, .txt, .csv, .json",
    }
    for words, match in cases.items():
        assert cli.main(["infer", str(model), *words]) == 2
        assert match in capfd.readouterr().err, words
