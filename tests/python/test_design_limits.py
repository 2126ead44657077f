"""What `design` refuses before any pour, and what it warns of."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import granulcal as gc
from granulcal.cli import main
from granulcal.design.forecast import SpillForecast
from granulcal.design.pattern import Pattern
from granulcal.design.posterior_file import PosteriorDraws, UncheckedModelWarning
from granulcal.design.reach import Reach
from granulcal.design.ring_model import RingModel, height_prior, observing_radii
from granulcal.pours.left_out import LeftOut

BOWL = Path(__file__).parents[2] / "examples" / "bowl.toml"
NAME = "material.sliding_friction"


def posterior(folder: Path, **more: object) -> Path:
    document = {"parameters": {NAME: {"mode": 0.4}}, "samples": [[0.4], [0.5]], **more}
    path = folder / "posterior.json"
    path.write_text(json.dumps(document))
    return path


def forecast(probability: list[float], high: list[float]) -> SpillForecast:
    heights = np.linspace(0.1, 0.4, len(high))
    return SpillForecast(
        heights=heights,
        grains=(1,),
        probability=np.array([probability]),
        low=np.zeros((1, len(high))),
        high=np.array([high]),
        expected=heights,
        poured_heights=heights,
        spilled=heights,
        total=10,
        rho=0.0,
        names=(),
        unusable=LeftOut(),
    )


def test_no_height_is_advised_whose_probability_is_above(tmp_path: Path) -> None:
    """A few draws of many spilled grains lift the mean above the upper end of the band."""
    skewed = forecast([0.01, 0.03, 0.08, 0.5], [0.02, 0.04, 0.04, 0.9])
    assert skewed.highest(1, 0.05) == pytest.approx(0.2)
    assert skewed.advice(1, 0.05).endswith("up to 20.0 cm")
    assert forecast([0.1, 0.2], [0.0, 0.0]).highest(1, 0.05) is None
    lowest = forecast([0.01, 0.1, 0.2, 0.5], [0.02, 0.2, 0.3, 0.9]).advice(1, 0.05)
    assert lowest.endswith("near the lowest height poured: pours from lower would tell")


def failing(is_calibrated: bool | None) -> RingModel:
    """A model of a straight line whose check ended so."""
    calibration = None if is_calibrated is None else SimpleNamespace(is_calibrated=is_calibrated)
    heights = np.linspace(0.05, 0.13, 60)
    radii = np.column_stack([0.01 + 0.3 * heights, 0.03 + 0.5 * heights])
    noise = np.random.default_rng(3).normal(scale=5e-4, size=radii.shape)

    class Posterior:
        def __init__(self, outer: float) -> None:
            self.height = (outer - 0.03) / 0.5

        def mean(self) -> list[float]:
            return [self.height]

        def credible_region(self, _: float) -> dict[str, tuple[float, float]]:
            return {"funnel.height": (self.height - 0.001, self.height + 0.001)}

    model = RingModel.__new__(RingModel)
    prior = height_prior((0.05, 0.13))
    bayes = SimpleNamespace(
        calibration=calibration, prior=prior, posterior=lambda row: Posterior(row[1])
    )
    model.bayes = bayes  # pyright: ignore[reportAttributeAccessIssue]
    model.reach = Reach(heights, radii + noise)
    model.scene = observing_radii(gc.Scene.funnel(count=12, preset="fast"))
    model.pour_count, model.unusable = 60, LeftOut()
    return model


@pytest.mark.parametrize("is_calibrated", [True, False, None])
def test_a_model_that_fails_its_check_is_told(
    is_calibrated: bool | None,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(RingModel, "load", lambda _: failing(is_calibrated))
    (tmp_path / "model").mkdir()
    out = tmp_path / "plan"
    words = ["design", "rings", str(tmp_path / "model"), "--pile", "0.08", "-o", str(out)]
    code, (said, told) = main(words), capsys.readouterr()
    # The table above it is in centimetres.
    assert "plan.csv and plan.json (metres)" in said
    notes = json.loads((out / "plan.json").read_text())["notes"]
    if is_calibrated is False:
        assert code == 3 and "fails its own check" in told and "fails its own check" in notes[0]
    else:
        assert code == 0 and told == "" and notes == []


def test_a_folder_is_asked_how_long_it_would_take(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The folder had been read as a scene."""
    monkeypatch.setattr(RingModel, "load", lambda _: failing(True))
    (tmp_path / "model").mkdir()
    words = ["design", "rings", str(tmp_path / "model"), "--dry-run", "--json"]
    words += ["-o", str(tmp_path / "plan")]
    assert main([*words, "--pile", "0.08", "--held-out", "5"]) == 0
    assert json.loads(capsys.readouterr().out)["missing"] == 6
    assert main(words) == 2
    assert "nothing is wanted" in capsys.readouterr().err
    assert not (tmp_path / "plan").exists()


def test_a_pour_that_still_moves_is_told() -> None:
    grains = np.zeros((2, 3)), np.full(2, 1e-3), np.array([0, 1])
    pattern = Pattern(*grains, ("horizon", "at_rest"), np.zeros((2, 2)), gc.Scene.funnel())
    (note,) = pattern.notes
    assert note.startswith("pour 1 has not come to rest") and not pattern.is_whole
    assert replace(pattern, statuses=("ran_out", "out_of_view")).is_whole


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["rings", "funnel", "--held-out", "1"], "--held-out: must be at least 2, got 1"),
        (["rings", "funnel", "--held-out", "0"], "--held-out: must be at least 2, got 0"),
        (["rings", "funnel", "--pile", "0.05", "--tolerance", "nan"], "must be positive, got nan"),
        (["rings", "funnel", "--pile", "0.05", "--tolerance", "0"], "must be positive, got 0"),
        (["rings", "funnel", "--pile", "0.05", "--pours", "49"], "must be at least 50, got 49"),
        (["rings", "funnel", "--pile", "0.05", "--set", "a=b"], "a must be a number"),
        (["spill", str(BOWL), "--pours", "19"], "--pours: must be at least 20, got 19"),
        (["spill", str(BOWL), "--at-most", "0"], "--at-most: must lie between 0 and 1, got 0"),
        (["spill", str(BOWL), "--at-most", "1"], "--at-most: must lie between 0 and 1, got 1"),
        (["spill", str(BOWL), "--at-most", "nan"], "--at-most: must lie between 0 and 1, got nan"),
    ],
)
def test_limits_are_checked_before_any_pour(
    words: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["design", *words, "-o", str(tmp_path / "out")]) == 2
    assert told in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_limits_hold_without_the_command_line() -> None:
    with pytest.raises(ValueError, match="pours must be at least 50, got 20"):
        RingModel.train(gc.Scene.funnel(), pours=20)
    with pytest.raises(ValueError, match="count must be at least 2, got 1"):
        failing(True).held_out(1, seed=1)


@pytest.mark.parametrize("word", ["rings", "spill"])
def test_a_number_is_set_or_of_the_posterior(
    word: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = ["rings", "funnel", "--pile", "0.05"] if word == "rings" else ["spill", str(BOWL)]
    words = ["design", *scene, "--posterior", str(posterior(tmp_path))]
    for more in (["--dry-run"], []):
        out = ["-o", str(tmp_path / "out"), *more]
        assert main([*words, "--set", f"{NAME}=0.9", *out]) == 2
        assert f"--set {NAME}: the posterior" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_draws_of_an_unchecked_model_are_warned_of(tmp_path: Path) -> None:
    path = posterior(tmp_path, calibrated=False, warnings=["one", "two"])
    with pytest.warns(UncheckedModelWarning, match=r"may be too narrow; one; two"):
        assert PosteriorDraws.load(path).is_inside
    PosteriorDraws.load(posterior(tmp_path, calibrated=True, warnings=["one"]))
    with pytest.raises(ValueError, match="calibrated must be true or false"):
        PosteriorDraws.load(posterior(tmp_path, calibrated="no"))
