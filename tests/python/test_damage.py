"""Bits that turned on a disk are found in models and data sets."""

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

import granulcal as gc
from granulcal.bayessim import BayesSim
from granulcal.errors import ModelFormatError, UnverifiedModelWarning
from granulcal.loop.effects.library import by_name
from granulcal.loop.pours.forward import Forward
from granulcal.loop.pours.image_rows import ImageRows
from granulcal.pours.kept_pours import KeptPours

MODEL = Path(__file__).parents[2] / "crates" / "bayessim" / "tests" / "data" / "pile"
SMALL = {"emulator_features": 8, "method": "emulated"}


@pytest.fixture(scope="module")
def folder(small_data, tmp_path_factory):
    folder = tmp_path_factory.mktemp("damage") / "model"
    BayesSim.fit(small_data, quiet=True, **SMALL).save(folder)
    return folder


def test_no_flipped_bit_of_a_model_shifts_the_posterior(folder, tmp_path):
    place = tmp_path / "model"
    shutil.copytree(folder, place)
    for name in ("model.json", "weights.safetensors"):
        whole = (folder / name).read_bytes()
        found = 0
        for i in range(100):
            at = i * len(whole) // 100
            data = bytearray(whole)
            data[at] ^= 1 << (i % 8)
            (place / name).write_bytes(data)
            with pytest.raises(ModelFormatError, match="model.json|weights.safetensors"):
                BayesSim.load(place)
            found += 1
        assert found == 100
        (place / name).write_bytes(whole)
    BayesSim.load(place)


def test_a_model_without_hashes_is_read_with_a_warning():
    with pytest.warns(UnverifiedModelWarning, match="pile"):
        BayesSim.load(MODEL)


def test_training_again_keeps_what_else_lies_in_the_folder(folder, small_data):
    (folder / "notes.txt").write_text("mine")
    BayesSim.fit(small_data, quiet=True, seed=3, **SMALL).save(folder)
    assert (folder / "notes.txt").read_text() == "mine"
    assert BayesSim.load(folder).summary.method == "emulated"


def test_a_flipped_part_is_named(small_data, tmp_path):
    path = tmp_path / "data.parquet"
    small_data.save(path)
    whole = path.read_bytes()
    refused = 0
    for i in range(100):
        data = bytearray(whole)
        data[i * len(whole) // 100] ^= 1 << (i % 8)
        path.write_bytes(data)
        try:
            read = gc.Dataset.load(path)
        except ValueError as error:
            assert "data.parquet" in str(error)
            refused += 1
        else:
            assert np.array_equal(read.theta, small_data.theta)
            assert np.array_equal(read.x, small_data.x, equal_nan=True)
    assert refused > 30


@pytest.mark.skipif(sys.platform == "win32", reason="links need a right that Windows keeps")
def test_the_folder_of_a_model_may_be_a_link_and_stays_one(folder, small_data, tmp_path):
    real = tmp_path / "real"
    shutil.copytree(folder, real)
    (tmp_path / "link").symlink_to(real)
    before = (real / "model.json").read_bytes()
    BayesSim.fit(small_data, quiet=True, seed=9, **SMALL).save(tmp_path / "link")
    assert (tmp_path / "link").is_symlink() and real.is_dir()
    assert (real / "model.json").read_bytes() != before
    BayesSim.load(real)


def test_no_flipped_bit_of_kept_pours_changes_a_digit(tmp_path):
    scene, prior = gc.Scene.drop(0.02, count=12), gc.Prior.default()
    path = tmp_path / "pours.json"
    theta = prior.sample(2, seed=1)
    KeptPours(scene, prior, path, threads=1)(theta, 0)
    whole, rows = path.read_bytes(), KeptPours(scene, prior, path).rows
    refused = 0
    for i in range(200):
        data = bytearray(whole)
        data[i * len(whole) // 200] ^= 1 << (i % 8)
        path.write_bytes(data)
        try:
            read = KeptPours(scene, prior, path)
        except ValueError as error:
            assert "pours.json" in str(error), error
            refused += 1
        else:
            assert read.rows == rows, i
    assert refused > 150


def test_damaged_pours_of_the_loop_are_made_again(tmp_path):
    scene = gc.Scene.drop(0.02, count=30, preset="fast")
    forward = Forward(tmp_path, 1)
    made = forward.pours(scene, [1, 2])
    (file,) = tmp_path.iterdir()
    whole = file.read_bytes()
    assert forward.ran == 2
    assert np.array_equal(forward.pours(scene, [1, 2]), made) and forward.ran == 2
    for i in range(40):
        data = bytearray(whole)
        data[i * len(whole) // 40] ^= 1 << (i % 8)
        file.write_bytes(data)
        assert np.array_equal(forward.pours(scene, [1, 2]), made), i
    for data in (b"", b"PK", whole[:-9], b"no archive"):
        file.write_bytes(data)
        ran = forward.ran
        assert np.array_equal(forward.pours(scene, [1, 2]), made)
        assert forward.ran == ran + 2


def test_damaged_image_rows_of_the_loop_are_made_again(tmp_path):
    scene = gc.Scene.drop(0.02, count=60, preset="fast")
    prior = gc.Prior(
        [gc.Parameter(path="material.restitution", distribution="uniform", low=0.2, high=0.6)]
    )
    effects = by_name(["camera.blur"])
    rows = ImageRows(
        folder=tmp_path, scene=scene, prior=prior, conditions=(), places=(), effects=effects,
        count=3, seed=5,
    )  # fmt: skip
    rows.fill(threads=1, say=lambda _: None)
    found = rows.rows()
    assert found is not None
    made = dict(found)
    (file,) = tmp_path.iterdir()
    whole = file.read_bytes()
    for i in range(0, len(whole), max(1, len(whole) // 30)):
        file.write_bytes(whole[:i] + bytes([whole[i] ^ 16]) + whole[i + 1 :])
        found = rows.rows()
        if found is not None:
            for reading, ours in found:
                theirs = made[reading]
                assert all(
                    np.array_equal(getattr(ours, column), getattr(theirs, column))
                    for column in ("theta", "condition", "psi", "x")
                ), i
    # As archives have it from before there were readings of two effects.
    file.write_bytes(whole)
    with np.load(file) as arrays:
        older = {k: v[..., :1].sum(axis=1) if k[:4] == "psi/" else v for k, v in arrays.items()}
    with file.open("wb") as out:
        np.savez_compressed(out, **older)
    found = rows.rows()
    assert found is not None
    for reading, ours in found:
        assert np.array_equal(ours.psi, made[reading].psi)
    file.write_bytes(whole[: len(whole) // 2])
    assert rows.rows() is None
    rows.fill(threads=1, say=lambda _: None)
    again = rows.rows()
    assert again is not None and np.array_equal(dict(again)[()].x, made[()].x)
