"""What a closed loop predicts under further conditions: `models.json` and `granulcal predict`."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from granulcal.cli import main
from granulcal.errors import ObservationError
from granulcal.loop.check.discrepancy import Discrepancy
from granulcal.loop.pours.forward import Coarse, Forward
from granulcal.loop.report.interval import of_one_more, t_factor
from granulcal.loop.report.models import Maker, Models, condition_of
from granulcal.loop.report.models_of import scatter_of
from granulcal.loop.surrogate.transform import Transform
from granulcal.pours.scene import Scene

SCENE = """
name = "small"
[grains]
count = 30
diameter = 4e-3
density = 1300.0
[start]
kind = "grid"
counts = [4, 4, 2]
spacing = 6e-3
jitter = 5e-4
base = 0.02
[end]
horizon = 1.0
[observe]
rate = 100.0
[observe.radius]
percentiles = [50.0, 90.0]
"""
RESIDUAL = np.array([0.3, -0.2, 0.5, 0.1])
NUMBERS = {"material.restitution": 0.3}


def correction() -> Discrepancy:
    """A correction without noise: it goes through its residuals."""
    conditions, variances = np.array([[0.0], [1.0]]), np.array([1.0, 1.0])
    shape = 0.5 + 0.5 * np.exp(-0.5 * (conditions - conditions.T) ** 2 / 0.25)
    kernel = np.kron(shape, np.diag(variances))
    precision = np.asarray(np.linalg.inv(kernel + 1e-8 * np.eye(4)), dtype=np.float64)
    return Discrepancy(conditions, variances, precision @ RESIDUAL, precision)


@pytest.fixture
def models() -> Models:
    """Two statistics, measured at two heights; the second is on the scale of its log."""
    named = {**NUMBERS, "effects.tilt.x": 0.05}
    return Models(
        scene=Scene.from_toml(SCENE),
        verdict={"kind": "EFFECT", "named": ["tilt.x"]},
        paths=("start.base",),
        inputs=(("start.base", 0.02, 0.06),),
        names=("radius[50]", "radius[90]"),
        makers={
            "base": tuple(Maker(NUMBERS, {}, {}) for _ in range(3)),
            "named": tuple(Maker(named, {"start.base": 0.01}, {}) for _ in range(3)),
        },
        columns=(0, 1),
        transforms=(
            Transform("identity", 0.0, 1.0, 0.02, 0.005),
            Transform("log", 1e-6, 1.0, -3.0, 0.1),
        ),
        correction=correction(),
        known=np.array([[0.0], [1.0]]),
        means=np.array([[0.020, 0.03], [0.024, 0.05]]),
        scatter=np.array([[0.001, 0.002], [0.001, 0.004]]),
        pours=np.array([4.0, 4.0]),
    )


def test_the_file_holds_everything(models: Models, tmp_path: Path) -> None:
    path = models.write(tmp_path)
    again = Models.load(tmp_path)
    assert again.write(tmp_path / "twice").read_text() == path.read_text()
    forward = Forward(tmp_path / "pours", 1)
    at = {"start.base": 0.03}
    for name in ("base", "named", "corrected", "line", "nearest"):
        one, two = (m.predict(name, at, forward, pours=4) for m in (models, again))
        assert np.array_equal(one.middle, two.middle) and np.array_equal(one.low, two.low)
    with pytest.raises(FileNotFoundError, match="is .* the -o of close-loop"):
        Models.load(tmp_path / "nowhere")


def test_real_grains_smaller_than_the_scenes_are_read_again(models: Models, tmp_path: Path) -> None:
    # psi of the real size lies below that of the scene, 0.
    coarse = Coarse({"grains.diameter": 3.4e-3, "grains.count": 1283.0}, -1.2)
    replace(models, coarse=coarse).write(tmp_path)
    assert Models.load(tmp_path).coarse == coarse


def test_lines_and_neighbours_need_no_pour(models: Models, tmp_path: Path) -> None:
    forward = Forward(tmp_path, 1)
    line = models.predict("line", {"start.base": 0.03}, forward, level=0.9)
    assert line.middle == pytest.approx([0.021, 0.035])
    # Variance of the line's mean, (.75^2 + .25^2) s^2 / 4, and of one pour.
    sd = 0.001 * np.sqrt((0.75**2 + 0.25**2) / 4 + 1)
    # Student's t of as many degrees of freedom as the variance has.
    t = t_factor(0.9, int((models.pours - 1).sum()))
    assert t > 1.6449 and line.high[0] - line.low[0] == pytest.approx(2 * t * sd, rel=1e-3)
    assert models.predict("nearest", {"start.base": 0.055}, forward).middle[0] == 0.024
    assert forward.ran == 0


def test_the_correction_moves_the_base_model_by_its_residual(
    models: Models, tmp_path: Path
) -> None:
    forward = Forward(tmp_path, 1)
    at = {"start.base": 0.02}
    base = models._pours(models.makers["base"][0], at, [8_500_003 + i for i in range(6)], forward)
    found = models.predict("corrected", at, forward, pours=6)
    assert found.middle[0] == pytest.approx(base[:, 0].mean() + 0.005 * 0.3, rel=1e-3)
    assert found.middle[1] == pytest.approx(base[:, 1].mean() * np.exp(0.1 * -0.2), rel=1e-3)
    # Between the conditions the correction is not known as well.
    between = models.predict("corrected", {"start.base": 0.04}, forward, pours=6)
    assert (between.high - between.low)[1] > (found.high - found.low)[1]
    with pytest.raises(ObservationError, match="the correction holds up to 0.25"):
        models.predict("corrected", {"start.base": 0.08}, forward)


def test_groups_that_are_poured_beforehand_are_the_same_and_not_made_twice(
    models: Models, tmp_path: Path
) -> None:
    asked = [(models.scene.with_({"start.base": base}), [1, 2]) for base in (0.02, 0.03, 0.04)]
    ahead, after = Forward(tmp_path / "ahead", 2), Forward(tmp_path / "after", 1)
    ahead.pours(*asked[1])
    ahead.fill("pours", asked)
    assert ahead.ran == 6
    for one in asked:
        assert np.array_equal(ahead.pours(*one), after.pours(*one))
    assert ahead.ran == after.ran == 6


def test_a_named_effect_that_shifts_a_condition_shifts_it(models: Models, tmp_path: Path) -> None:
    forward = Forward(tmp_path, 1)
    maker = models.makers["named"][0]
    shifted = models._pours(maker, {"start.base": 0.02}, [1], forward)
    scene = models.scene.with_({**maker.numbers, "start.base": 0.03})
    assert np.array_equal(shifted, forward.pours(scene, [1], {}))


def test_what_cannot_be_predicted_is_said(models: Models, tmp_path: Path) -> None:
    forward = Forward(tmp_path, 1)
    with pytest.raises(ObservationError, match="must state start.base; it lacks start.base"):
        models.predict("base", {}, forward)
    with pytest.raises(ObservationError, match="model must be one of base, named, corrected"):
        models.predict("cubic", {"start.base": 0.03}, forward)
    with pytest.raises(ObservationError, match="level must be between 0 and 1, got 90"):
        models.predict("line", {"start.base": 0.03}, forward, level=90)
    with pytest.raises(ObservationError, match=r"path=number, .* got 'height'"):
        condition_of(["height"])
    assert condition_of(["a.b=0.5", "c=3"]) == {"a.b": 0.5, "c": 3.0}


def test_the_command_prints_and_writes_json(
    models: Models, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    models.write(tmp_path)
    words = ["predict", str(tmp_path), "--at", "start.base=0.03", "--pours", "3", "--threads", "1"]
    assert main([*words, "--corrected", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["model"] == "corrected" and found["level"] == 0.9
    row = found["statistics"]["radius[50]"]
    assert row["low"] < row["middle"] < row["high"]
    assert found["units"] == {"radius[50]": "m", "radius[90]": "m"}
    assert main([*words, "--model", "line"]) == 0
    told = capsys.readouterr().out
    assert "EFFECT tilt.x" in told and "radius[90]" in told and "0.035" in told
    assert "unit" in told and told.rstrip().endswith(" m")
    assert main([*words[:3], "start.base=0.2", "--corrected"]) == 2
    assert "the correction holds up to" in capsys.readouterr().err


def test_a_model_pours_with_the_engine_of_its_loop_alone(
    models: Models, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What had been fitted to another simulator was poured with ours."""
    from granulcal.engines import CallableEngine, pouring_with

    hanging = CallableEngine(lambda scene, seed: scene.start(seed), name="hanging")
    theirs = replace(models, engine="hanging")
    file = theirs.write(tmp_path)
    assert Models.load(tmp_path).engine == "hanging"
    for name in ("base", "named", "corrected"):
        with pytest.raises(ObservationError, match="pours by 'hanging'.*got our own simulator"):
            theirs.require_engine(name)
        with pouring_with(hanging), pytest.raises(ObservationError, match="got 'hanging'"):
            models.require_engine(name)
        with pouring_with(hanging):
            theirs.require_engine(name)
    for name in ("line", "nearest"):
        theirs.require_engine(name)
    words = ["predict", str(tmp_path), "--at", "funnel.height=0.07", "--dry-run"]
    assert main(words) == 2
    assert "--engine" in capsys.readouterr().err
    # Files of before: the law tells ours from another, which then must be given.
    document = json.loads(file.read_text())
    del document["engine"]
    file.write_text(json.dumps({**document, "law": 0}))
    unnamed = Models.load(tmp_path)
    with pytest.raises(ObservationError, match="pours by another engine"):
        unnamed.require_engine("base")
    with pouring_with(hanging):
        unnamed.require_engine("base")
    file.write_text(json.dumps(document))
    Models.load(tmp_path).require_engine("base")


@pytest.mark.parametrize(
    ("kind", "width"), [("identity", 1.0), ("log", 1.0), ("reciprocal", 10.0), ("asinh", 2.0)]
)
def test_transforms_have_inverses(kind: str, width: float) -> None:
    transform = Transform(kind, 0.4, width, 0.7, 1.5)
    x = np.linspace(0.5, 9.0, 20)
    assert transform.inverse(transform(x)) == pytest.approx(x)


@pytest.mark.parametrize("pours", [5, 10, 20, 40])
@pytest.mark.parametrize("level", [0.9, 0.95])
def test_the_interval_of_one_more_pour_holds_it_as_often_as_it_says(pours: int, level: float):
    random = np.random.default_rng(pours)
    low, high = of_one_more(random.standard_normal((pours, 20_000)), level, pours)
    another = random.standard_normal(20_000)
    held = np.mean((low <= another) & (another <= high))
    # Quantiles of 20 pours had held 0.82 of 0.9.
    assert abs(held - level) < 0.012


@pytest.mark.parametrize("pours", [2, 5, 10])
@pytest.mark.parametrize("own", [0.0, 0.3, 3.0])
def test_draws_of_few_pours_are_no_further_pours(pours: int, own: float) -> None:
    random = np.random.default_rng(pours)
    rows = np.repeat(random.standard_normal((pours, 20_000)), 40, axis=0)
    low, high = of_one_more(rows + own * random.standard_normal(rows.shape), 0.9, pours)
    another = random.standard_normal(20_000) + own * random.standard_normal(20_000)
    held = np.mean((low <= another) & (another <= high))
    # As if all were of pours it had been 0.87 to 1.
    assert 0.89 < held < 0.95


def test_the_scatter_of_one_pour_is_borrowed_where_nothing_tells_it() -> None:
    # Written as NaN it left a `models.json` that `predict` could not read.
    rows = [np.array([[1.0, 5.0], [3.0, 5.0]]), np.ones((1, 2)), np.empty((0, 2))]
    spread = np.array([4.0, np.inf])
    assert scatter_of(rows, spread) == pytest.approx(np.array([[np.sqrt(2.0), 0.0]] * 3))
    assert scatter_of(rows[1:], spread) == pytest.approx(np.array([[4.0, 0.0]] * 2))
