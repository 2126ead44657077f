import json
from pathlib import Path

import pytest

import granulcal as gc
from granulcal.cli import main
from granulcal.starter import models


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
    assert models.model_named("pours/model") == Path("pours/model")


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
    folder = models.make_model("drop", pours=60, say=lambda text: None)
    assert folder == cache / "models" / "drop" and models.find_model("drop") == folder
    assert (folder / "training.parquet").exists()
    assert main(["model", "drop", "-n", "60", "--json"]) == 0
    told = capsys.readouterr()
    assert "is there already" in told.err and str(folder) in json.loads(told.out)["model"]
