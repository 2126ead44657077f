"""Pours of two laws of the solver are never mixed; whoever uses those of another law is told."""

import json
import shutil
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import granulcal as gc
from granulcal import _native, cli
from granulcal.bayessim import BayesSim
from granulcal.errors import OtherLawWarning
from granulcal.pours.kept_pours import KeptPours

BEFORE = Path(__file__).parents[2] / "crates" / "dataset" / "tests" / "data" / "before_laws"
QUICK: dict[str, Any] = {
    "features": 8,
    "ensemble": 2,
    "components": 2,
    "emulator_features": 8,
    "max_epochs": 10,
}


def test_pours_of_before_laws_had_numbers_load_with_a_warning():
    with pytest.warns(OtherLawWarning, match="before laws had numbers"):
        data = gc.Dataset.load(BEFORE)
    assert data.law is None and len(data) == 3


def test_pours_of_another_law_are_not_gone_on_with(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", OtherLawWarning)
        data = gc.Dataset.load(BEFORE)
    shutil.copytree(BEFORE, tmp_path / "old")
    with pytest.raises(ValueError, match="law of the solver is one of before laws had numbers"):
        gc.generate(data.scene, data.prior, 5, seed=4, out=tmp_path / "old", progress=False)


def test_new_pours_and_their_models_state_the_law(small_data, tmp_path, capfd):
    assert small_data.law == _native.LAW
    model = BayesSim.fit(small_data, quiet=True, **QUICK)
    assert model.law == _native.LAW
    model.save(tmp_path / "model")
    assert BayesSim.load(tmp_path / "model").law == _native.LAW
    # The model of another law: loaded with a warning, by Python and by the command line.
    model.law = 1
    model.save(tmp_path / "model")
    with pytest.warns(OtherLawWarning, match="law 1, which is not today's"):
        BayesSim.load(tmp_path / "model")
    assert infer(tmp_path) in (0, 3)
    assert "another law of the solver, 1; today's is" in capfd.readouterr().err


def test_a_model_of_pairs_that_were_handed_in_has_no_law(small_data, tmp_path, capfd):
    usable = small_data.is_usable
    theta, x = small_data.theta[usable], small_data.x[usable]
    for scene in (None, small_data.scene_toml):
        model = BayesSim.fit(
            theta, x, small_data.prior, x_names=small_data.x_names, scene=scene, quiet=True, **QUICK
        )
        model.save(tmp_path / "model")
        # Neither side warns of a law, be there a scene or not.
        with warnings.catch_warnings():
            warnings.simplefilter("error", OtherLawWarning)
            assert BayesSim.load(tmp_path / "model").law is None
        assert infer(tmp_path) in (0, 3)
        assert "law" not in capfd.readouterr().err


def infer(folder: Path) -> int:
    """Runs `infer` with the model in a folder on a pile of sixty grains."""
    camera = gc.Camera.overhead(height=0.4, field_width=0.2, pixels=80)
    generator = np.random.default_rng(0)
    grains = np.c_[generator.normal(0, 0.02, (60, 2)), np.full(60, 0.004)]
    image, toml = camera.record(grains, np.full(60, 0.004), folder)
    return cli.main(["infer", str(folder / "model"), str(image), "--camera", str(toml)])


@pytest.mark.parametrize(("law", "said"), [(1, "law 1"), (None, "before laws had numbers")])
def test_kept_pours_of_another_law_are_refused(tmp_path, law, said):
    scene, prior = gc.Scene.drop(0.02, count=12), gc.Prior.default()
    path = tmp_path / "pours.json"
    KeptPours(scene, prior, path, threads=1)(prior.sample(1, seed=1), 0)
    document = json.loads(path.read_text())
    assert document["law"] == _native.LAW
    document["law"] = law
    if law is None:
        del document["law"]
    path.write_text(json.dumps(document))
    with pytest.raises(ValueError, match=f"pours.json has pours by .*{said}.*another folder"):
        KeptPours(scene, prior, path)
