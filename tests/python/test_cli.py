import importlib
import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import granulcal
from safetensors.numpy import load_file, save_file
from signed import sign

import granulcal as gc
from granulcal import cli
from granulcal.bayessim import BayesSim
from granulcal.cli import main
from granulcal.commands import check

pytest.importorskip("torch")


@pytest.fixture(scope="module")
def model(small_data: gc.Dataset, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("trained") / "model"
    assert main(["train", str(small_data.path), "-o", str(out)]) == 0
    return out


@pytest.fixture(scope="module")
def recording(small_pour: gc.Pour, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    camera = gc.Camera.overhead(height=0.29, field_width=0.58, pixels=580)
    folder = tmp_path_factory.mktemp("recording")
    image, toml = camera.record(small_pour.positions, small_pour.radii, folder)
    return str(image), str(toml)


def test_help_teaches(capfd):
    assert main(["--help"]) == 0
    text = capfd.readouterr().out
    for word in ("generate", "train", "infer", "report", "reproduce", "demo", "Exit codes"):
        assert word in text
    assert main([]) == 2
    assert main(["--version"]) == 0


def test_words_of_the_simulator_are_passed_on():
    done = granulcal("features", "--list")
    assert done.returncode == 0
    assert "max_z" in done.stdout
    refused = granulcal("nonsense")
    assert refused.returncode == 2
    assert "nonsense" in refused.stderr
    assert refused.stdout == ""


def test_train_writes_a_model_with_its_data(model, small_data):
    assert gc.BayesSim.load(model).prior == small_data.prior
    assert np.array_equal(gc.Dataset.load(model / "training.parquet").x, small_data.x)


def test_training_on_a_part_of_a_batch_is_told(small_data, tmp_path, capfd):
    part = tmp_path / "part"
    shutil.copytree(small_data.path, part)
    for file in sorted(part.glob("part-*.parquet"))[-1:]:
        file.unlink()
    missing = gc.Dataset.load(part).missing
    assert missing > 0 and gc.Dataset.load(small_data.path).missing == 0
    assert main(["train", str(part), "-o", str(tmp_path / "model"), "--dry-run"]) == 0
    assert f"{missing} more were asked for" in capfd.readouterr().err


def test_infer_prints_json_and_writes_files(model, recording, tmp_path, capfd):
    out, plot = tmp_path / "posterior.json", tmp_path / "pair.png"
    capfd.readouterr()
    words = ["infer", str(model), recording[0], "--camera", recording[1], "--json"]
    assert main([*words, "-o", str(out), "--plot", str(plot)]) == 0
    printed = json.loads(capfd.readouterr().out)
    assert list(printed["parameters"]) == gc.Prior.default().names
    for values in printed["parameters"].values():
        low, high = values["interval90"]
        assert low < values["mean"] < high
    assert len(printed["statistics"]) == 1
    written = json.loads(out.read_text())
    assert written["parameters"] == printed["parameters"]
    assert np.shape(written["samples"]) == (1000, 3)
    assert plot.read_bytes().startswith(b"\x89PNG")


def _without_python(model: Path, recording: tuple[str, str]) -> dict:
    words = ["granulcal-cli", "infer", str(model), recording[0], "--camera", recording[1], "--json"]
    code = f"from granulcal import _native; raise SystemExit(_native.run_cli({words}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode in (0, 3), done.stderr
    return json.loads(done.stdout)


def test_the_table_of_a_model_says_what_its_emulator_does(model, recording, tmp_path):
    said = _without_python(model, recording)
    tensors = load_file(model / "weights.safetensors")
    table = [name for name in tensors if name.startswith("pool_")]
    assert len(table) == 3
    kept = {name: array for name, array in tensors.items() if name not in table}
    shifted = {**tensors, "pool_means": tensors["pool_means"] + 1}
    for changed, is_same in ((kept, True), (shifted, False)):
        other = shutil.copytree(model, tmp_path / str(is_same))
        save_file(changed, other / "weights.safetensors")
        again = _without_python(other, recording)
        means = [[p["mean"] for p in each["parameters"].values()] for each in (said, again)]
        assert np.allclose(*means, rtol=1e-3) == is_same, means


def test_infer_prints_a_table(model, recording, capfd):
    assert main(["infer", str(model), recording[0], "--camera", recording[1]]) == 0
    lines = capfd.readouterr().out.splitlines()
    assert "inside the model" in lines[0]
    header = [line.split()[:3] for line in lines].index(["parameter", "mode", "mean"])
    table = lines[header + 1 : header + 4]
    names = ["sliding_friction", "rolling_friction", "restitution"]
    assert [line.split()[0].rsplit(".")[-1] for line in table] == names


def test_infer_reads_a_recording_that_is_cut_off_and_says_so(model, tmp_path, capfd):
    data = Path(__file__).parents[2] / "crates" / "dataset" / "tests" / "data" / "recordings"
    whole = (data / "ros2_16uc1_none.mcap").read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: len(whole) * 3 // 4])
    assert main(["infer", str(model), str(cut), "--frames", "all", "--json"]) == 3
    printed = capfd.readouterr()
    assert json.loads(printed.out)["statistics"]
    assert "cut.mcap: an unknown number of frames lost" in printed.err
    assert main(["infer", str(model), str(cut), "--topic", "/nowhere"]) == 2
    assert "/camera/depth/image_rect_raw" in capfd.readouterr().err


def test_a_model_of_another_scene_is_refused(model, recording, small_scene, tmp_path, capfd):
    same, other = tmp_path / "same.toml", tmp_path / "other.toml"
    same.write_text(small_scene.to_toml())
    other.write_text(small_scene.with_({"grains.count": 61}).to_toml())
    words = ["infer", str(model), recording[0], "--camera", recording[1], "--json", "--scene"]
    assert main([*words, str(same)]) == 0
    capfd.readouterr()
    assert main([*words, str(other)]) == 2
    said = capfd.readouterr()
    assert "another scene: scene.grains.count is 60 there, 61 is asked for" in said.err
    assert said.out == ""


def test_a_model_of_statistics_that_an_image_has_not_is_refused(model, recording, tmp_path, capfd):
    other = tmp_path / "other"
    shutil.copytree(model, other)
    document = json.loads((other / "model.json").read_text())
    document["x_names"][0] = "max_z[0.3]"
    (other / "model.json").write_text(json.dumps(document))
    sign(other)
    assert main(["infer", str(other), recording[0], "--camera", recording[1], "--json"]) == 2
    said = capfd.readouterr()
    assert "max_z[0.3]" in said.err
    assert said.out == ""


def test_report_writes_one_page(model, recording, tmp_path, capsys):
    pytest.importorskip("jinja2")
    page = tmp_path / "deep" / "report.html"
    words = ["report", str(model), recording[0], "--camera", recording[1], "-o", str(page)]
    assert main([*words, "--seeds", "2"]) == 0
    assert str(page) in capsys.readouterr().out
    assert "mean of 2 pours" in page.read_text()


def test_calibrate_needs_no_model_and_goes_on_where_it_stopped(
    recording, small_scene, tmp_path, capsys
):
    scene, prior, out = tmp_path / "scene.toml", tmp_path / "prior.toml", tmp_path / "run"
    scene.write_text(small_scene.to_toml())
    prior.write_text(gc.Prior.default().to_toml())
    words = ["calibrate", str(scene), str(prior), recording[0], "--camera", recording[1]]
    words += ["-o", str(out)]
    assert main([*words, "--budget", "10"]) == 2
    assert "at least 60" in capsys.readouterr().err and not out.exists()
    assert main([*words, "--budget", "60", "--json"]) == 0
    told = capsys.readouterr()
    found = json.loads(told.out)
    assert found["pours"] == 60 and "round 4 of 4: 60 of 60 pours" in told.err
    low, high = found["parameters"]["material.sliding_friction"]["interval90"]
    assert 0 <= low < high <= 1
    kept = (out / "pours.json").read_bytes()
    assert main([*words, "--budget", "60", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == found
    assert (out / "pours.json").read_bytes() == kept
    assert main([*words, "--budget", "60"]) == 0
    told = capsys.readouterr().out
    assert f"\nassumed: grains.count {small_scene.get('grains.count'):g}, grains.diameter" in told
    # Another recording, of whatever name, would replace these pours and their posterior.
    pour = gc.simulate(small_scene, seed=12)
    camera = gc.Camera.overhead(height=0.29, field_width=0.58, pixels=580)
    image, _ = camera.record(pour.positions, pour.radii, tmp_path / "other")
    before = (out / "posterior.json").read_bytes()
    other = [*words[:3], str(image), *words[4:], "--budget", "60"]
    assert main(other) == 2
    told = capsys.readouterr().err
    assert f"another recording, {recording[0]}" in told and "give another folder" in told
    assert (out / "posterior.json").read_bytes() == before
    assert (out / "pours.json").read_bytes() == kept


def test_bad_input_is_exit_code_2(model, recording, tmp_path, tmp_path_factory, capfd):
    alone = shutil.copy(recording[0], tmp_path_factory.mktemp("alone"))
    for words, message in (
        (["train", str(tmp_path / "none"), "-o", str(tmp_path / "m")], "none"),
        (["infer", str(tmp_path / "none"), recording[0]], "none"),
        (["infer", str(model), str(tmp_path / "none.png"), "--camera", recording[1]], "none.png"),
        (["infer", str(model), str(alone)], "camera"),
        (["report", str(model), recording[0], "-o", "x.html", "--seeds", "0"], "--seeds"),
        (["infer", str(model)], "recording"),
        (["demo", "--pours"], "--pours"),
    ):
        assert main(words) == 2, words
        said = capfd.readouterr()
        assert message in said.err
        assert "Traceback" not in said.err


def test_a_folder_that_is_no_model_is_left_alone(small_data, tmp_path, capsys):
    (tmp_path / "precious.txt").write_text("keep")
    assert main(["train", str(small_data.path), "-o", str(tmp_path)]) == 2
    assert "not a saved model" in capsys.readouterr().err
    assert (tmp_path / "precious.txt").read_text() == "keep"


def test_check_tells_its_coverage_as_json(model, small_data, capfd):
    code = main(["check", str(model), "--json"])
    told = json.loads(capfd.readouterr().out)
    assert code == (0 if told["calibrated"] else 3) and told["calibrated"] is (not told["failures"])
    assert len(told["coverage"]) >= 2
    for count in told["coverage"]:
        assert 0 <= count["inside"] <= count["total"] and count["low"] <= count["high"]
    assert len(told["rank_p_values"]) == len(small_data.prior.names)
    assert 0 < told["tarp_p_value"] <= 1 and told["gain_nat"] > 0
    assert set(told["identifiability"]["names"]) == set(small_data.prior.names)


def test_what_a_check_says_of_other_pours_is_of_them(
    model, small_data, small_scene, tmp_path, capfd
):
    other = tmp_path / "other"
    gc.generate(small_scene, small_data.prior, 30, seed=77, out=other, progress=False)
    told = []
    for words in ([], ["--data", str(other)]):
        assert main(["check", str(model), *words, "--json"]) in (0, 3)
        told.append(json.loads(capfd.readouterr().out))
    assert told[0]["gain_nat"] != told[1]["gain_nat"]
    assert told[0]["identifiability"]["gains"] != told[1]["identifiability"]["gains"]
    pairs = gc.Dataset.load(other)
    loaded = BayesSim.load(model)
    found, known = loaded.examine(pairs.theta, pairs.x)
    assert told[1]["identifiability"] == known.as_dict() and told[1]["gain_nat"] == found.gain


def test_a_model_of_some_statistics_of_an_image_is_checked_and_drawn(
    model, small_data, small_scene, recording, tmp_path, capfd
):
    """The check had been refused, and the plot after the posterior."""
    places, folder, plot = [3, 1, 0], tmp_path / "some", tmp_path / "pair.png"
    names = [small_data.x_names[place] for place in places]
    made = BayesSim.fit(
        small_data.theta, small_data.x[:, places], small_data.prior, x_names=names,
        scene=small_scene, quiet=True, method="emulated",
    )  # fmt: skip
    made.save(folder)
    words = ["infer", str(folder), recording[0], "--camera", recording[1]]
    assert main([*words, "--plot", str(plot)]) in (0, 3)
    assert plot.read_bytes().startswith(b"\x89PNG")
    other = tmp_path / "other"
    data = gc.generate(small_scene, small_data.prior, 30, seed=77, out=other, progress=False)
    capfd.readouterr()
    assert main(["check", str(folder), "--data", str(other), "--json"]) in (0, 3)
    told = json.loads(capfd.readouterr().out)
    assert told["gain_nat"] == made.examine(data.theta, data.x[:, places])[0].gain
    observed = tmp_path / "observed"
    observe = "\n[observe]\nrate = 100.0\n\n[observe.radius]\npercentiles = [50.0]\n"
    radii = gc.Scene.from_toml(small_scene.to_toml() + observe)
    gc.generate(radii, small_data.prior, 2, seed=7, out=observed, progress=False)
    made.scene_toml = None
    made.save(folder)
    assert main(["check", str(folder), "--data", str(observed)]) == 2
    assert "has no max_r, mean_z, max_z, which the model is of" in capfd.readouterr().err


def test_pours_of_another_prior_are_refused_with_what_differs(
    model, small_data, small_scene, tmp_path, capfd
):
    narrow = small_data.prior.to_toml().replace("low = 0.2\n", "low = 0.25\n", 1)
    prior = gc.Prior.from_toml(narrow)
    gc.generate(small_scene, prior, 4, seed=7, out=tmp_path / "few", progress=False)
    assert main(["check", str(model), "--data", str(tmp_path / "few")]) == 2
    error = capfd.readouterr().err
    assert "material.sliding_friction is uniform from 0.25 to 1 there" in error
    assert "uniform from 0.2 to 1 in the model" in error and "rolling" not in error
    assert "leave `prior` out" not in error and "with the model's prior" in error


@pytest.mark.parametrize(("words", "goes_on"), [("calibrate", True), ("check", False)])
def test_who_stops_a_command_is_told_whether_it_goes_on(words, goes_on, capfd, monkeypatch):
    def stopped(*_):
        raise KeyboardInterrupt

    module = importlib.import_module(f"granulcal.commands.{words}")
    monkeypatch.setattr(module, "_run", stopped)
    arguments = {"calibrate": ["funnel", "default", "d.png", "-o", "run"], "check": ["funnel"]}
    assert main([words, *arguments[words]]) == 130
    error = capfd.readouterr().err
    assert error == f"granulcal: stopped{'; the same command goes on where it was' * goes_on}\n"


def test_an_error_of_its_own_is_one_line(capfd, monkeypatch):
    def broken(*_):
        raise IndexError("list index out of range")

    monkeypatch.setattr(check, "_run", broken)
    assert cli.main(["check", "nothing"]) == 1
    error = capfd.readouterr().err
    assert "IndexError" in error and "GRANULCAL_TRACEBACK" in error and error.count("\n") == 1
