"""The files that an engine leaves: read by their columns, or refused by name."""

from pathlib import Path

import numpy as np
import pytest

from granulcal.arrays import read_array
from granulcal.cli import main
from granulcal.engines.files import read_grains


def test_grains_are_read_from_a_dump(tmp_path: Path) -> None:
    dump = "ITEM: TIMESTEP\n0\nITEM: ATOMS id x y z radius\n9 9 9 9 9\n"
    dump += "ITEM: TIMESTEP\n5\nITEM: ATOMS id x y z radius\n2 0.1 0 0 0.002\n1 0 0 0.002 0.001\n"
    (tmp_path / "grains.dump").write_text(dump)
    found = read_grains(tmp_path)
    assert found is not None
    assert found[0].tolist() == [[0, 0, 0.002], [0.1, 0, 0]] and found[1].tolist() == [0.001, 0.002]


def test_columns_are_read_by_name(tmp_path: Path) -> None:
    file = tmp_path / "grains.csv"
    file.write_text("id, Z,x,y ,radius\n7,0.3,0.1,0.2,0.004\n")
    found = read_grains(tmp_path, 0.002)
    assert found is not None
    assert found[0].tolist() == [[0.1, 0.2, 0.3]] and found[1].tolist() == [0.004]
    file.write_text("z,x,y\n\n0.3,0.1,0.2,\n")
    found = read_grains(tmp_path, 0.002)
    assert found is not None and found[0].tolist() == [[0.1, 0.2, 0.3]]
    file.write_text("z,x,y\n")
    found = read_grains(tmp_path, 0.002)
    assert found is not None and found[0].shape == (0, 3)
    file.write_text("0.1,0.2,0.002\n0.1,0.3,0.002\n")
    with pytest.raises(ValueError, match=r"first line must name the columns.*'0\.1,0\.2,0\.002'"):
        read_grains(tmp_path, 0.002)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("grains.csv", "x,y,z\n1,2,three\n"),
        ("grains.csv", "x,y\n1,2\n"),
        ("grains.csv", "0.1,0.2,0.002\n0.1,0.3,0.002\n"),
        ("grains.csv", "x,y,z,z\n1,2,3,4\n"),
        # Of decimal commas the second number had been 12 m, and the third 0.
        ("grains.csv", "x,y,z\n0,012,0,034,0,056\n"),
        ("grains.dump", "no dump"),
        ("grains.dump", "ITEM: ATOMS id x y z radius\n1 2 3\n"),
        ("grains.npy", "no array"),
    ],
)
def test_files_of_an_engine_are_refused_by_name(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(ValueError, match=name):
        read_grains(tmp_path, 0.002)


@pytest.mark.parametrize(
    "name", ["archive.npz", "objects.npy", "cut.npy", "text.npy", "folder.npy"]
)
def test_what_is_no_array_of_numbers_is_refused_by_name(
    tmp_path: Path, name: str, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    if name == "archive.npz":
        np.savez(path, grains=np.zeros((3, 3)))
    elif name == "objects.npy":
        np.save(path, np.array([{"a": 1}], dtype=object), allow_pickle=True)
    elif name == "cut.npy":
        np.save(path, np.zeros((30, 3)))
        path.write_bytes(path.read_bytes()[:200])
    elif name == "text.npy":
        path.write_text("0.1, 0.2")
    else:
        path.mkdir()
    with pytest.raises(ValueError, match=name):
        read_array(path)
    words = ["export", "bed", "drop", "--to", "csv", "--positions", str(path)]
    assert main([*words, "-o", str(tmp_path / "bed.csv")]) == 2
    assert name in capfd.readouterr().err
