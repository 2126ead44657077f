"""Bits that turned on a disk are found in models and data sets."""

import shutil
from pathlib import Path

import numpy as np
import pytest

import granulcal as gc
from granulcal.bayessim import BayesSim
from granulcal.errors import ModelFormatError, UnverifiedModelWarning

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
