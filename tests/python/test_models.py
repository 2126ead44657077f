import json
from pathlib import Path

import pytest

import granulcal as gc
from granulcal.cli import main
from granulcal.starter import make_model, models


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("GRANULCAL_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(models, "_SHIPPED", tmp_path / "shipped")
    return tmp_path / "cache"


def _put(folder: Path, fingerprint: str) -> Path:
    folder.mkdir(parents=True)
    (folder / "made.json").write_text(json.dumps({"fingerprint": fingerprint}))
    return folder


def test_a_model_is_found_by_its_scene_if_it_fits_the_simulator(cache: Path) -> None:
    fitting = models.fingerprint(gc.Scene.funnel(), gc.Prior.default())
    assert models.find_model("funnel") is None
    with pytest.raises(FileNotFoundError, match="granulcal model funnel"):
        models.model_named("funnel")
    shipped = _put(cache.parent / "shipped" / "funnel", fitting)
    assert models.model_named("funnel") == shipped
    # One that was made here goes first, unless another simulator made it.
    own = _put(cache / "models" / "funnel", "0123")
    assert models.find_model("funnel") == shipped
    (own / "made.json").write_text(json.dumps({"fingerprint": fitting}))
    assert models.find_model("funnel") == own
    folder = cache / "own"
    folder.mkdir()
    with pytest.raises(FileNotFoundError, match=r"own holds no model.json; asked for .* or drop$"):
        models.model_named(folder)
    (folder / "manifest.toml").touch()
    with pytest.raises(FileNotFoundError, match=r"`granulcal train .*own -o model` makes one"):
        models.model_named(folder)
    (folder / "model.json").touch()
    assert models.model_named(folder) == folder
    with pytest.raises(FileNotFoundError, match="did you mean funnel"):
        models.model_named("funel")
    with pytest.raises(NotADirectoryError, match="is a file"):
        models.model_named(own / "made.json")


def test_a_model_is_loaded_by_the_name_of_its_scene(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As `infer funnel` takes it; Python had been told that funnel/model.json does not exist."""
    monkeypatch.setenv("GRANULCAL_CACHE", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    assert gc.BayesSim.load("funnel").prior == gc.Prior.default()
    with pytest.raises(FileNotFoundError, match="`granulcal model drop` makes it once"):
        gc.BayesSim.load("drop")
    # What is here goes first.
    (tmp_path / "funnel").mkdir()
    with pytest.raises(FileNotFoundError, match=r"model.json does not exist"):
        gc.BayesSim.load("funnel")


def test_infer_without_a_model_says_how_to_make_one(
    cache: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["infer", "funnel", "couscous.bag"]) == 2
    assert "`granulcal model funnel` makes it once" in capsys.readouterr().err


@pytest.mark.slow
def test_a_model_is_made_once_and_goes_on_after_a_stop(
    cache: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("torch")
    small = gc.Scene.drop(0.02, count=60, preset="fast")
    monkeypatch.setattr(gc.Scene, "built_in", lambda name: small)
    folder = make_model.make_model("drop", pours=60, say=lambda text: None)
    assert folder == cache / "models" / "drop" and models.find_model("drop") == folder
    assert (folder / "training.parquet").exists()
    capsys.readouterr()
    assert main(["model", "drop", "-n", "60", "--json"]) == 0
    told = capsys.readouterr()
    assert "is there already" in told.err and str(folder) in json.loads(told.out)["model"]


def _pours(folder: Path, seed: int = 0) -> gc.Dataset:
    scene = gc.Scene.built_in("drop")
    return gc.generate(scene, gc.Prior.default(), 60, seed=seed, out=folder, progress=False)


@pytest.mark.slow
def test_a_model_is_made_from_pours_that_are_there(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("torch")
    small = gc.Scene.drop(0.02, count=60, preset="fast")
    monkeypatch.setattr(gc.Scene, "built_in", lambda name: small)
    pours = _pours(tmp_path / "pours", seed=3)
    words = ["model", "drop", "--data", str(tmp_path / "pours"), "--compact"]
    assert main([*words, "-o", str(tmp_path / "model")]) == 0
    made = json.loads((tmp_path / "model" / "made.json").read_text())
    assert made["pours"] == 60 and made["seed"] == 3
    # Nothing was poured into the cache, and what ships is small.
    assert not (cache / "pours").exists()
    sizes = {path.name: path.stat().st_size for path in (tmp_path / "model").iterdir()}
    assert set(sizes) == {"made.json", "model.json", "weights.safetensors"}
    assert sum(sizes.values()) < 1_000_000
    # The small form says what the whole one says.
    assert main(["model", "drop", "--data", str(tmp_path / "pours")]) == 0
    whole, compact = (
        gc.BayesSim.load(folder).posterior(pours.x[0]).mean()
        for folder in (cache / "models" / "drop", tmp_path / "model")
    )
    assert whole == pytest.approx(compact, abs=1e-6)
    capsys.readouterr()


def test_pours_of_another_scene_prior_or_simulator_make_no_model(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    small = gc.Scene.drop(0.02, count=40, preset="fast")
    monkeypatch.setattr(gc.Scene, "built_in", lambda name: small)
    scene, prior = small, gc.Prior.default()
    good = gc.generate(scene, prior, 2, out=tmp_path / "good", progress=False)
    make_model.require_pours_of("drop", good)
    other = gc.generate(
        gc.Scene.drop(0.02, count=41, preset="fast"), prior, 2, out=tmp_path / "o", progress=False
    )
    with pytest.raises(ValueError, match="another scene than drop"):
        make_model.require_pours_of("drop", other)
    narrow = gc.Prior.from_toml(prior.to_toml().replace("high = 1.0", "high = 0.9", 1))
    wrong = gc.generate(scene, narrow, 2, out=tmp_path / "prior", progress=False)
    with pytest.raises(ValueError, match="another prior"):
        make_model.require_pours_of("drop", wrong)
    good.paper16[0, 0] *= 1 + 1e-12
    with pytest.raises(ValueError, match="another simulator"):
        make_model.require_pours_of("drop", good)
