"""Model files: the same to the bit, and damage named."""

import json
import os
import pickle
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from signed import sign  # noqa: E402
from toy_models import SCENE, edit_json  # noqa: E402

from granulcal.bayessim import BayesSim  # noqa: E402
from granulcal.errors import (  # noqa: E402
    ModelFormatError,
)


def test_save_and_load_are_identical_to_the_bit(quick, toy, tmp_path):
    quick.save(tmp_path / "model")
    quick.save(tmp_path / "model")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["model"]
    loaded = BayesSim.load(tmp_path / "model")
    sent = pickle.loads(pickle.dumps(quick))
    assert repr(sent) == repr(quick) and repr(sent).endswith(f"{quick.summary.pair_count} pours)")
    x = toy.simulate(3, seed=8)[1]
    for observed in (x[0], x):
        ours, theirs = quick.posterior(observed), loaded.posterior(observed)
        np.testing.assert_array_equal(ours.sample(50), theirs.sample(50))
        np.testing.assert_array_equal(ours.sample(50), sent.posterior(observed).sample(50))
        np.testing.assert_array_equal(
            ours.log_prob(ours.sample(5)), theirs.log_prob(ours.sample(5))
        )
    assert str(loaded.calibration) == str(quick.calibration)
    assert loaded.calibration is not None and quick.calibration is not None
    assert loaded.calibration.as_dict() == quick.calibration.as_dict()
    assert (loaded.x_names, loaded.scene_toml) == (quick.x_names, SCENE)
    assert loaded.scene_hash == quick.scene_hash
    loaded.save(tmp_path / "again")
    for name in ("model.json", "weights.safetensors"):
        first, second = (tmp_path / folder / name for folder in ("model", "again"))
        assert first.read_bytes() == second.read_bytes()


@pytest.mark.parametrize("done", [1, 2, 3])
def test_a_save_that_is_stopped_leaves_a_model_and_all_other_files(
    quick: BayesSim, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, done: int
) -> None:
    """Ctrl-C between two renames had removed the old model and the new one, or the pours beside."""
    folder, renamed = tmp_path / "model", []
    quick.save(folder)
    for name in ("training.parquet", "coverage.png"):
        (folder / name).write_bytes(name.encode())

    def rename(old: Path, new: Path, real: Callable[..., None] = os.rename) -> None:
        real(old, new)
        renamed.append(new)
        if len(renamed) == done:
            raise KeyboardInterrupt

    monkeypatch.setattr("granulcal.bayessim.storage.model_folder.os.rename", rename)
    with pytest.raises(KeyboardInterrupt):
        quick.save(folder)
    monkeypatch.undo()
    there = sorted(path for path in tmp_path.rglob("*.*") if path.is_file())
    assert BayesSim.load(folder).prior == quick.prior
    assert {"training.parquet", "coverage.png"} <= {path.name for path in there}


def _cut(folder, name):
    path = folder / name
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def _drop_entry(folder):
    document = json.loads((folder / "model.json").read_text())
    del document["prior_toml"]
    (folder / "model.json").write_text(json.dumps(document))
    sign(folder)


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (
            lambda f: edit_json(f, version=99, made_by="granulcal 9.9"),
            r"version must be 3 or 4 \(granulcal .*got 99 \(made by granulcal 9.9\): update",
        ),
        (lambda f: edit_json(f, version=2), "got 2 .*train the model again"),
        (lambda f: edit_json(f, format="other"), "is not a granulcal-bayessim file"),
        (
            lambda f: edit_json(f, x_names=["one"]),
            "axis_count must be at most 1",
        ),
        (lambda f: edit_json(f, config={"colour": 3}), "config.colour must be absent"),
        (lambda f: edit_json(f, config={}), "config.method must be there"),
        (lambda f: edit_json(f, prior_toml="[["), "not valid TOML"),
        (_drop_entry, "prior_toml must be there"),
        (lambda f: _cut(f, "model.json"), "truncated or not JSON"),
        (lambda f: _cut(f, "weights.safetensors"), "truncated"),
    ],
)
def test_damaged_files_are_named(quick, tmp_path, damage, message):
    quick.save(tmp_path / "model")
    damage(tmp_path / "model")
    with pytest.raises(ModelFormatError, match=message):
        BayesSim.load(tmp_path / "model")


def test_missing_files_and_foreign_folders(quick, tmp_path):
    with pytest.raises(FileNotFoundError, match=r"model\.json"):
        BayesSim.load(tmp_path / "nothing")
    quick.save(tmp_path / "model")
    (tmp_path / "model" / "weights.safetensors").unlink()
    with pytest.raises(FileNotFoundError, match=r"weights\.safetensors"):
        BayesSim.load(tmp_path / "model")
    shutil.rmtree(tmp_path / "model")
    (tmp_path / "model").mkdir()
    (tmp_path / "model" / "diary.txt").write_text("dear diary")
    with pytest.raises(FileExistsError, match="not a saved model"):
        quick.save(tmp_path / "model")
    assert (tmp_path / "model" / "diary.txt").exists()
