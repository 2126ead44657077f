import os
import pickle
import stat
import tomllib
from pathlib import Path

import numpy as np
import pytest

import granulcal as gc
from granulcal.pours.statistics import UNITS


def test_shapes_and_names(small_data):
    assert small_data.theta.shape == (80, 3)
    assert list(small_data.theta_names) == gc.Prior.default().names
    assert small_data.x.shape == (80, 16)
    assert len(small_data.status) == len(small_data.seed) == len(small_data) == 80
    assert small_data.status_counts() == {"at_rest": 80}
    assert small_data.is_usable.all()
    assert small_data.health["worst_penetration"].shape == (80,)
    assert small_data.health["grains_lost"].sum() == 0
    assert len(small_data.columns()) == 1 + 3 + 2 + 12 + 16 + 43


def test_rows_come_from_prior_and_scene(small_data, small_scene, small_prior):
    prior = small_prior
    assert small_data.prior == prior
    assert small_data.scene == small_scene
    assert np.isfinite(prior.log_prob(small_data.theta)).all()
    row = small_data.theta[4]
    scene = small_scene.with_(dict(zip(small_data.theta_names, row.tolist(), strict=True)))
    pour = gc.simulate(scene, seed=int(small_data.seed[4]))
    assert np.array_equal(pour.statistics().paper16, small_data.x[4])


def test_load_returns_what_generate_returned(small_data, tmp_path):
    again = gc.Dataset.load(small_data.path)
    assert np.array_equal(again.theta, small_data.theta)
    assert np.array_equal(again.x, small_data.x)
    small_data.save(tmp_path / "one.parquet")
    one = gc.Dataset.load(tmp_path / "one.parquet")
    assert np.array_equal(one.x, small_data.x)
    assert one.prior == small_data.prior


def test_a_data_set_goes_to_other_processes_and_a_pour_keeps_its_numbers(
    small_data: gc.Dataset, small_pour: gc.Pour
) -> None:
    sent = pickle.loads(pickle.dumps(small_data))
    np.testing.assert_array_equal(sent.x, small_data.x)
    assert sent.theta_names == small_data.theta_names
    with pytest.raises(ValueError, match="read-only"):
        small_pour.positions[0, 0] = 1.0
    with pytest.raises(TypeError, match="stays in its process"):
        pickle.dumps(small_pour)


def test_a_batch_can_be_extended_and_cut(small_scene, tmp_path):
    prior = gc.Prior.default()

    def batch(n: int, **options) -> gc.Dataset:
        return gc.generate(small_scene, prior, n, out=tmp_path / "d", progress=False, **options)

    first = batch(5)
    counts = []
    more = gc.generate(
        small_scene, prior, 9, out=tmp_path / "d", progress=lambda *c: counts.append(c)
    )
    assert np.array_equal(more.x[:5], first.x)
    assert counts[-1] == (9, 5, 4, 0, 0, 0)
    assert len(batch(5)) == 5
    assert np.array_equal(batch(9, threads=1).x, more.x)
    with pytest.raises(ValueError, match="unless resumed"):
        batch(9, resume=False)
    with pytest.raises(ValueError, match="the seed is 0, but 1 is given"):
        batch(9, seed=1)


def test_what_goes_to_another_process_has_the_rows_of_what_was_sent(
    small_scene: gc.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    prior = gc.Prior.default()
    gc.generate(small_scene, prior, 4, out="pours", progress=False)
    first = gc.generate(small_scene, prior, 2, out="pours", progress=False)
    sent = pickle.dumps(first), pickle.dumps(gc.Dataset.load("pours"))
    # A worker need not stand where the folder was named from.
    monkeypatch.chdir("/")
    two, four = map(pickle.loads, sent)
    np.testing.assert_array_equal(two.x, first.x)
    assert len(four) == 4
    assert len(pickle.loads(pickle.dumps(two))) == 2


def test_an_exception_in_progress_stops_the_batch(small_scene, tmp_path):
    def refuse(*_: int) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        gc.generate(small_scene, gc.Prior.default(), 50, out=tmp_path, progress=refuse)


def test_grains_out_of_view_are_counted_and_not_used(small_scene):
    scene = small_scene.with_({"camera.height_threshold": 0.5})
    data = gc.generate(scene, gc.Prior.default(), 2, progress=False)
    assert data.status_counts() == {"no_grains_in_view": 2}
    assert np.isnan(data.x).all()
    assert not data.is_usable.any()


def test_errors_are_those_of_python(small_scene, tmp_path):
    prior = gc.Prior.default()
    with pytest.raises(ValueError, match="n must be at least 1, got 0"):
        gc.generate(small_scene, prior, 0)
    for name in ("n", "threads", "seed", "chunk"):
        with pytest.raises(ValueError, match=f"{name} must be at most [0-9]{{19,20}}, got 11805"):
            gc.generate(small_scene, prior, **{"n": 1, name: 2**70})
    with pytest.raises(TypeError, match="n must be a whole number"):
        gc.generate(small_scene, prior, 2.5)  # pyright: ignore[reportArgumentType]
    with pytest.raises(FileNotFoundError, match=r"nothing"):
        gc.Dataset.load(tmp_path / "nothing")
    broken = tmp_path / "broken.parquet"
    broken.write_bytes(b"PAR1 and no more")
    with pytest.raises(ValueError, match=r"broken\.parquet"):
        gc.Dataset.load(broken)
    unknown = gc.Parameter(path="material.friction", distribution="uniform", low=0.1, high=0.2)
    with pytest.raises(ValueError, match=r"material\.friction"):
        gc.generate(small_scene, gc.Prior([unknown]), 1, progress=False)


def test_the_folder_of_a_calibration_is_no_data_set(small_scene, small_prior, tmp_path):
    (tmp_path / "pours.json").write_text("{}")
    with pytest.raises(ValueError, match="without one, for it holds the pours of .calib"):
        gc.generate(small_scene, small_prior, 2, out=tmp_path, progress=False)
    assert [path.name for path in tmp_path.iterdir()] == ["pours.json"]


@pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write everywhere"
)
def test_a_folder_that_cannot_be_written_is_a_permission_error(small_scene, tmp_path):
    tmp_path.chmod(stat.S_IRUSR | stat.S_IXUSR)
    with pytest.raises(PermissionError):
        gc.generate(small_scene, gc.Prior.default(), 1, out=tmp_path / "d", progress=False)


def test_the_metadata_of_a_part_has_the_units_of_its_statistics(small_data: gc.Dataset) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    schema = parquet.read_schema(small_data.path / "part-000000.parquet")
    units = tomllib.loads(schema.metadata[b"granulcal.units"].decode())
    assert {name: units[name] for name in UNITS} == UNITS
    assert (units["simulated_s"], units["energy_created"]) == ("s", "-")
    counts = {"row", "seed", "substeps", "grains_lost", "sweeps", "unconverged", "guarded"}
    assert set(schema.names) - set(units) == {*counts, "status", *small_data.theta_names}


def test_pandas_gets_every_column(small_data):
    pandas = pytest.importorskip("pandas")
    frame = small_data.to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    assert frame.shape == (80, len(small_data.columns()))


@pytest.mark.parametrize("name", ["pours.csv", "pours.CSV", "pours.npz"])
def test_parquet_is_not_written_under_the_name_of_another_table(
    name: str, small_data: gc.Dataset, tmp_path: Path
) -> None:
    with pytest.raises(ValueError, match=f"{name}: a data set is saved as Parquet"):
        small_data.save(tmp_path / name)
    assert not list(tmp_path.iterdir())
