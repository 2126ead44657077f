"""Archives of arrays are read through one door: bounded, without pickles, refused by name."""

import os
from pathlib import Path

import numpy as np
import pytest
from mutations import mutations

from granulcal.arrays import read_array, read_arrays
from granulcal.experiments.paper import heights
from granulcal.experiments.paper.common.sizes import FULL
from granulcal.experiments.paper.heights import Recordings


def load(folder: Path) -> Recordings:
    return Recordings.load("couscous", FULL, folder)


def place(folder: Path) -> Path:
    (folder / "recordings").mkdir()
    return folder / "recordings" / "couscous.npz"


ARRAYS = {
    "heights": np.full(3, 0.12),
    "positions": np.arange(45.0).reshape(3, 5, 3),
    "radii": np.ones(5),
    "held": np.zeros(3),
}


def test_damaged_recordings_of_the_paper_are_refused_by_name(tmp_path):
    path = place(tmp_path)
    np.savez_compressed(path, **ARRAYS)
    whole = path.read_bytes()
    assert len(load(tmp_path).heights) == 3
    refused = 0
    for data in mutations(whole, 40, seed=4, is_text=False):
        path.write_bytes(data)
        try:
            load(tmp_path)
        except ValueError as error:
            assert "couscous.npz" in str(error)
            refused += 1
    assert refused > 20


def test_recordings_of_other_shapes_are_refused(tmp_path):
    path = place(tmp_path)
    np.savez(path, **ARRAYS)
    assert load(tmp_path).positions.shape == (3, 5, 3)
    for name, array in [
        ("heights", np.full(2, 0.12)),
        ("positions", np.ones(3)),
        ("positions", np.ones((3, 5, 2))),
        ("radii", np.ones(4)),
        ("held", np.zeros((3, 1))),
        ("held", np.array([None] * 3)),
        ("radii", np.array(["a"] * 5)),
    ]:
        np.savez(path, **{**ARRAYS, name: array})
        with pytest.raises(ValueError, match="couscous.npz"):
            load(tmp_path)
    np.savez(path, **{name: array for name, array in ARRAYS.items() if name != "held"})
    with pytest.raises(ValueError, match=r"couscous.npz must have .* lacks \['held'\]"):
        load(tmp_path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows has no pipes with names")
def test_what_is_no_plain_file_is_refused(tmp_path):
    path = place(tmp_path)
    os.mkfifo(path)
    with pytest.raises(ValueError, match="plain file"):
        load(tmp_path)
    for read in (read_array, read_arrays):
        with pytest.raises(ValueError, match="plain file"):
            read(Path("/dev/zero"))


def test_no_module_of_the_package_reads_archives_by_itself():
    """One bare reader is enough for a pickle, a pipe without end, or an error without a name."""
    package = Path(heights.__file__).parents[2]
    for file in package.rglob("*.py"):
        if file.name != "arrays.py":
            text = file.read_text()
            assert "np.load(" not in text and "numpy.load(" not in text, file
