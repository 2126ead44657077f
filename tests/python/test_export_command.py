"""The word `export`: what it takes from where, and how it ends."""

import json
from pathlib import Path

import numpy as np
import pytest

import granulcal as gc
from granulcal.cli import main

NAME, FIXED = "material.sliding_friction", "material.restitution"


def posterior(folder: Path, **more: object) -> Path:
    """Writes a posterior of one number, another one fixed."""
    document = {
        "parameters": {NAME: {"mode": 0.3}},
        "fixed": {FIXED: 0.45},
        "samples": [[0.2], [0.25]],
        **more,
    }
    path = folder / "posterior.json"
    path.write_text(json.dumps(document))
    return path


@pytest.mark.parametrize("path", [NAME, FIXED])
def test_a_number_is_set_or_of_the_posterior(
    path: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What was set had been lost without a word."""
    file, out = posterior(tmp_path), tmp_path / "out"
    common = ["--to", "lammps", "-o", str(out), "--set", f"{path}=0.7"]
    for words in (["posterior", str(file), "drop"], ["scene", "drop", "--posterior", str(file)]):
        assert main(["export", *words, *common]) == 2
        told = capsys.readouterr().err
        assert f"--set {path}: the posterior" in told and "leave out one of both" in told
    assert not out.exists()
    common[-1] = "material.rolling_friction=0.07"
    assert main(["export", "scene", "drop", "--posterior", str(file), *common]) == 0
    readme = (out / "README.txt").read_text()
    assert f"the most probable of a posterior: {NAME}\n" in readme
    assert f"posterior: posterior.json; fixed by its prior: {FIXED}" in readme
    assert f"{NAME} = 0.3" in readme and "material.rolling_friction = 0.07" in readme


def test_a_posterior_is_named_by_its_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run, out = tmp_path / "run", tmp_path / "out"
    run.mkdir()
    words = ["export", "posterior", str(run), "drop", "--to", "lammps", "-o", str(out)]
    assert main(words) == 2
    told = capsys.readouterr().err
    assert "run holds no posterior.json; asked for is JSON of `infer -o`" in told
    assert "`granulcal infer" not in told
    (run / "model.json").touch()
    assert main(words) == 2
    told = capsys.readouterr().err
    assert f"`granulcal infer {run} RECORDING -o posterior.json` makes one of this model" in told
    posterior(run)
    assert main(words) == 0
    assert f"{NAME} = 0.3" in (out / "mode.in").read_text()


@pytest.mark.parametrize("words", [["scene=", "material.restitution"], ["a=b"], ["a=nan"]])
def test_set_takes_numbers(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = ["export", "material", "drop", "--to", "lammps", "-o", str(tmp_path / "a.in")]
    assert main([*line, *(f"--set={word}" for word in words)]) == 2
    told = capsys.readouterr().err
    assert "--set takes numbers alone" in told or "PATH=NUMBER" in told


def test_a_posterior_of_an_unchecked_model_is_warned_of(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = posterior(tmp_path, calibrated=False, warnings=["friction is at its bound"])
    words = ["export", "posterior", str(file), "drop", "--to", "lammps", "-o"]
    with pytest.MonkeyPatch.context() as patch:
        # Tests make errors of warnings; a command line shows them.
        patch.setattr("warnings.warn", lambda text, *_, **__: print(text))
        assert main([*words, str(tmp_path / "out")]) == 0
    told = capsys.readouterr().out
    assert "has not passed a check of its own" in told and "friction is at its bound" in told
    posterior(tmp_path, calibrated=True, warnings=["friction is at its bound"])
    assert main([*words, str(tmp_path / "out")]) == 0
    assert "bound" not in capsys.readouterr().err


@pytest.mark.parametrize("horizon", [0.005, 2.0])
def test_a_bed_that_has_not_come_to_rest_ends_with_3(
    horizon: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "bed.csv"
    scene = gc.Scene.drop(0.02, count=6, preset="fast").with_({"end.horizon": horizon})
    (tmp_path / "scene.toml").write_text(scene.to_toml())
    words = ["export", "bed", str(tmp_path / "scene.toml"), "--to", "csv", "-o", str(out)]
    code, told = main(words), capsys.readouterr().err
    assert out.exists()
    if horizon < 1.0:
        assert code == 3 and "the pour ended as horizon: its grains still move" in told
    else:
        assert code == 0 and told == ""


def test_a_bed_in_place_of_a_users_file_is_refused_before_the_pour(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("granulcal.pours.simulate.simulate", lambda *_, **__: pytest.fail("poured"))
    out = tmp_path / "bed.vtk"
    out.write_text("mine\n")
    assert main(["export", "bed", "drop", "--to", "vtk", "-o", str(out)]) == 2
    assert "granulcal did not export it" in capsys.readouterr().err
    np.save(tmp_path / "grains.npy", np.full((4, 3), np.nan))
    words = ["export", "bed", "drop", "--to", "csv", "-o", str(tmp_path / "bed.csv")]
    assert main([*words, "--positions", str(tmp_path / "grains.npy")]) == 2
    assert "those of 4 grains are not" in capsys.readouterr().err


def test_a_name_that_ends_as_another_kind_of_file_is_refused_before_the_pour(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("granulcal.pours.simulate.simulate", lambda *_, **__: pytest.fail("poured"))
    bed, material = tmp_path / "bed.ply", tmp_path / "material.in"
    assert main(["export", "bed", "drop", "--to", "vtk", "-o", str(bed)]) == 2
    assert "bed.ply ends in .ply, as files of ply do, and would hold vtk: let it end in .vtk" in (
        capsys.readouterr().err
    )
    assert main(["export", "material", "drop", "--to", "mujoco", "-o", str(material)]) == 2
    assert "as files of lammps and liggghts do, and would hold mujoco: let it end in .xml" in (
        capsys.readouterr().err
    )
    assert not bed.exists() and not material.exists()
    # Of an ending that no kind has nothing is said, and .in is of two engines.
    for to, name in (("mujoco", "grains.txt"), ("liggghts", "material.in")):
        assert main(["export", "material", "drop", "--to", to, "-o", str(tmp_path / name)]) == 0


def test_young_is_refused_where_grains_are_rigid(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["export", "material", "drop", "--to", "mujoco", "-o", str(tmp_path / "a.xml")]
    assert main([*words, "--young", "1e7"]) == 2
    assert "young must be left out for mujoco" in capsys.readouterr().err


@pytest.mark.parametrize("word", ["material", "posterior", "scene", "bed", "frames"])
def test_help_names_no_option_that_its_word_lacks(
    word: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    assert main(["export", word, "--help"]) == 0
    usage, _, told = capsys.readouterr().out.partition("positional arguments:")
    for option in ("--posterior", "--positions", "--seed"):
        assert (option in told) == (option in usage), option
