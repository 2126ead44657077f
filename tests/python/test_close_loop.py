"""The loop as a user calls it: a task file, an archive, a verdict; small pours, but real ones."""

import hashlib
import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import granulcal as gc
from granulcal import loop
from granulcal.cli import main
from granulcal.errors import ObservationError, TrainingDataError
from granulcal.loop.analysis import Analysis
from granulcal.loop.check.prior_pours import prior_pours
from granulcal.loop.close import planned
from granulcal.loop.effects.library import FUNNEL, by_name, fingerprint
from granulcal.loop.pours.archive import Archive, ArchivePlan
from granulcal.loop.pours.forward import Forward
from granulcal.loop.pours.measures import Measures
from granulcal.loop.pours.parts import parts_of
from granulcal.loop.pours.refine import further
from granulcal.loop.pours.time_needed import time_needed
from granulcal.loop.preregistration import register
from granulcal.loop.report import folder
from granulcal.loop.task import Task
from granulcal.loop.test.thresholds import Thresholds
from granulcal.pours.camera import Camera

SCENE = """
name = "small"
[grains]
count = 90
diameter = 4e-3
density = 1300.0
[start]
kind = "grid"
counts = [5, 5, 4]
spacing = 6e-3
jitter = 5e-4
base = 0.02
[end]
horizon = 2.0
[camera]
projection = "pinhole"
height = 0.3
field_width = 0.3
pixels = 220
downsample = 1
height_threshold = 1e-3
"""
PRIOR = """
[[parameter]]
path = "material.sliding_friction"
distribution = "uniform"
low = 0.3
high = 0.8
[[parameter]]
path = "material.restitution"
distribution = "uniform"
low = 0.2
high = 0.6
"""
HEIGHTS = {"low": 0.02, "high": 0.06, "between": 0.04}
TRUTH = {
    "material.sliding_friction": 0.5,
    "material.rolling_friction": 0.1,
    "material.restitution": 0.4,
}


def make(
    folder: Path,
    extra: dict[str, float],
    effects: str = '["tilt.y", "ground.restitution"]',
    scene_text: str = SCENE,
    pours: int = 3,
    lens: float = 0.0,
) -> Path:
    """Writes scene, prior, recordings and the task of pours with `extra` numbers in the scene.

    Each height has `pours` of them, of a camera whose focal length is longer than told by `lens`.
    """
    folder.mkdir()
    (folder / "scene.toml").write_text(scene_text)
    (folder / "prior.toml").write_text(PRIOR)
    camera = Camera.overhead(height=0.3, field_width=0.3 / (1 + lens), pixels=220)
    lines = ['scene = "scene.toml"', 'prior = "prior.toml"', f"effects = {effects}"]
    for name, base in HEIGHTS.items():
        names = []
        for seed in range(pours):
            scene = gc.Scene.load(folder / "scene.toml").with_(
                {**TRUTH, **extra, "start.base": base}
            )
            pour = gc.simulate(scene, seed=100 + seed)
            image, toml = camera.record(pour.positions, pour.radii, folder / f"{name}-{seed}")
            if lens:
                told = re.sub(
                    r"(?m)^f[xy] = .*$", lambda f: f"{f[0][:2]} = 220.0", toml.read_text()
                )
                toml.write_text(told)
            names.append(str(Path(image).relative_to(folder)))
        use = "sealed" if name == "between" else "fit"
        lines += ["[[conditions]]", f'name = "{name}"', f'at = {{ "start.base" = {base} }}']
        lines += [f'use = "{use}"', f"recordings = {json.dumps(names)}"]
    (folder / "loop.toml").write_text("\n".join(lines) + "\n")
    return folder / "loop.toml"


@pytest.fixture(scope="module")
def tilted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A task whose table is tilted by 4 degrees."""
    return make(tmp_path_factory.mktemp("loop") / "tilted", {"effects.tilt.y": 0.07})


@pytest.mark.slow
def test_a_tilted_table_is_found_named_and_removed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # Of three pours a height the gain at the fitted ones is between -0.6 and 25.
    tilted = make(tmp_path / "tilted", {"effects.tilt.y": 0.07}, pours=6)
    out = tmp_path / "out"
    words = ["close-loop", str(tilted), "-o", str(out), "--budget", "1250", "--pairs", "19"]
    assert main(words) == 0
    told = capsys.readouterr().out
    assert told.index("registered before any data") < told.index("kappa") < told.index("verdict E")
    verdict = json.loads((out / "verdict.json").read_text())
    assert verdict["verdict"] == "EFFECT" and verdict["named"] == ["tilt.y"]
    low, middle, high = verdict["strength"]["tilt.y"]
    assert low < 0.07 < high and abs(middle - 0.07) < 0.03
    assert verdict["misfit"]["fit"]["after"] < 0.5 * verdict["misfit"]["fit"]["before"]
    assert verdict["sealed"]["is_improved"] and verdict["sealed"]["is_at_floor"]
    assert verdict["fit"]["is_improved"]
    assert verdict["calibrated"]["pairs"] == 19 and verdict["calibrated"]["stretch"] >= 1
    assert verdict["stands"] and verdict["confirmed_p"] > 0.01
    assert verdict["verdict_before_checks"] == "EFFECT" and verdict["random_draws"] >= 24
    assert verdict["fit_less_best_draw"] < 0
    rows = [row["name"] for row in verdict["sealed_rows"]]
    assert rows == ["nearest condition", "straight line", "base + its own interpolated residual"]
    assert len(verdict["correction"]) == 3
    assert "after 24 random draws of tilt.y, EFFECT" in told
    assert "of 19 simulated pairs held" in told
    page = (out / "report.html").read_text()
    assert "What needs no physics, at the sealed conditions" in page
    assert "tilt.y" in page and "data:image/png" in page
    assert "Of 19 simulated pairs" in page and "A correction without physics" in page
    # Between the measured heights, where the sealed pours are: both kinds of prediction hold them.
    sealed = np.mean(Task.load(tilted).of("sealed")[0].statistics(Task.load(tilted).scene), axis=0)
    for extra in ([], ["--corrected"]):
        asked = ["predict", str(out), "--at", "start.base=0.04", "--level", "0.95", "--json"]
        assert main([*asked, *extra]) == 0
        rows = json.loads(capsys.readouterr().out)["statistics"]
        held = [
            row["low"] <= y <= row["high"] for row, y in zip(rows.values(), sealed, strict=True)
        ]
        assert np.mean(held) > 0.8
    # Again: nothing is run twice, and the same comes out.
    before = (out / "verdict.json").read_text()
    assert main(words) == 0
    assert (out / "verdict.json").read_text() == before
    # What was registered stays: another seed is another analysis.
    assert main([*words, "--seed", "1"]) == 2
    assert "registered for another analysis" in capsys.readouterr().err


@pytest.mark.slow
def test_a_declared_tilt_is_not_found(tmp_path: Path) -> None:
    # Of .02 rad five of six triples of pours are called a tilt, this one a camera that stands
    # aside: of twice as much it is a tilt by 24 nat.
    far = make(tmp_path / "far", {"effects.tilt.y": 0.04})
    found = gc.close_loop(Task.load(far), tmp_path / "plain", budget=1100)
    assert found.trace.verdict.named == ("tilt.y",)
    near = make(tmp_path / "near", {"effects.tilt.y": 0.02})
    declared = near.with_name("declared.toml")
    asked = near.read_text().replace('"tilt.y", "ground', '"ground')
    declared.write_text('nuisances = { "tilt.y" = 0.02 }\n' + asked)
    closed = gc.close_loop(Task.load(declared), tmp_path / "declared", budget=1100)
    assert closed.trace.verdict.kind == "NONE"
    page = (tmp_path / "declared" / "report.html").read_text()
    assert f"Closing the loop on {declared}" in page and "granulcal.close_loop(task, " in page


@pytest.mark.slow
def test_a_lens_that_is_not_the_stated_one_is_named_where_it_is_asked(tmp_path: Path) -> None:
    others = ["tilt.y", "ground.restitution", "drag", "camera.offset", "camera.missing"]
    lens = 1 / 1.06 - 1
    task = make(tmp_path / "lens", {}, json.dumps([*others, "camera.lens"]), lens=lens)
    closed = gc.close_loop(Task.load(task), tmp_path / "out", budget=1600, pairs=0)
    assert (closed.verdict.kind, closed.verdict.named) == ("EFFECT", ("camera.lens",))
    low, middle, high = closed.strengths()["camera.lens"]
    assert low < lens < high and middle == pytest.approx(lens, abs=0.01)


@pytest.mark.slow
def test_rods_are_no_fault_of_the_camera(tmp_path: Path) -> None:
    # Whole sets of a funnel, with the words of before: benches/loop_rivals.py, docs/theory/loop.md.
    wide = SCENE.replace("spacing = 6e-3", "spacing = 8e-3").replace(
        "jitter = 5e-4", "jitter = 1e-4"
    )
    effects = '["camera.blur", "camera.offset", "camera.flying", "ground.restitution", "clump"]'
    rods = make(tmp_path / "rods", {"effects.clump.aspect": 1.4}, effects, wide)
    closed = gc.close_loop(Task.load(rods), tmp_path / "out", budget=1100, pairs=0)
    assert closed.verdict.kind == "EFFECT" and closed.verdict.named[0] == "clump"
    low, _, high = closed.strengths()["clump"]
    assert low < 1.5 and high > 1.3
    said = json.loads((tmp_path / "out" / "verdict.json").read_text())
    assert all({"effects", "log_probability", "p"} == set(one) for one in said["rivals_by_pours"])


def test_a_declared_tolerance_is_no_candidate(tilted: Path, tmp_path: Path) -> None:
    text = tilted.read_text().replace('"tilt.y", "ground', '"ground')

    def load(nuisances: str) -> Task:
        file = tilted.parent / f"{tmp_path.name}.toml"
        file.write_text(f"nuisances = {{ {nuisances} }}\n{text}")
        return Task.load(file)

    task = load('"tilt.y" = 0.009, "count" = 2, "ground.sliding" = 0.1')
    sds = {effect.name: effect.nuisance_sd for effect in task.library}
    # Full strength of the library: 0.09 rad, a quarter of 90 grains less, a ratio of 4.
    assert sds.pop("ground.restitution") is None
    expected = {"tilt.y": 0.1, "count": 2 / 22.5, "ground.sliding": np.log(1.1) / np.log(4)}
    assert sds == pytest.approx(expected)
    assert all(effect.is_shared for effect in task.library if effect.nuisance_sd)
    with pytest.raises(TrainingDataError, match=r"tolerance of tilt.y must be positive, got 0.0"):
        load('"tilt.y" = 0.0')
    with pytest.raises(TrainingDataError, match="no effect magnetism.*; there are cohesion"):
        load('"magnetism" = 1.0')


def test_further_pours_are_where_the_fits_are(tilted: Path, tmp_path: Path) -> None:
    task = Task.load(tilted)
    plan = planned(task, 1100, 0)
    names = [effect.name for effect in plan.design.effects]
    tilt = names.index("tilt.y")

    def fit(active: tuple[int, ...]) -> Any:
        slopes = np.random.default_rng(1).normal(size=(6, 2 + len(active)))
        return SimpleNamespace(
            v=np.array([0.5, -0.3]),
            psi=0.4 * np.eye(len(names))[tilt],
            active=active,
            root=0.2 * np.eye(6),
            slopes=slopes,
        )

    found: Any = SimpleNamespace(base_fit=fit(()), models=[SimpleNamespace(fit=fit((tilt,)))])
    forward = Forward(tmp_path, 1)
    analysis = Analysis(task, plan, forward, Thresholds(), 0, print)
    base, tilts = further(analysis, found, 0)
    assert forward.ran == 48 and len(base.x) > 20 and len(tilts.x) > 20
    assert not base.psi.any() and not np.delete(tilts.psi, tilt, axis=1).any()
    assert abs(tilts.psi[:, tilt].mean() - 0.4) < 0.1
    for rows in (base, tilts):
        assert np.isfinite(rows.x).all() and ((rows.theta > 0) & (rows.theta < 1)).all()
        assert abs(rows.theta.mean(axis=0) - [0.69, 0.38]).max() < 0.15
        assert sorted(set(rows.condition[:, 0])) == [0.0, 1.0]
    # More of the mass lies downhill.
    where = Measures.of(task.scene).names.index("mass_cos_1")
    lean = abs(tilts.x[:, where].mean() - base.x[:, where].mean())
    assert lean > 4 * base.x[:, where].std() / len(base.x) ** 0.5
    again = further(analysis, found, 0)
    assert forward.ran == 48 and np.array_equal(again[1].x, tilts.x)


def test_recordings_are_read_with_what_the_prior_fixes(tilted: Path) -> None:
    # As the pours are, which all have it.
    task, fixed = Task.load(tilted), {"grains.diameter": 3e-3}
    diameter = gc.Parameter(path="grains.diameter", distribution="fixed", value=3e-3)
    other = replace(task, prior=gc.Prior([*task.prior.parameters, diameter]))
    nothing: Any = None
    found = Analysis(other, nothing, nothing, Thresholds(), 0, print).measured()["low"]
    (low, *_) = task.conditions
    assert np.array_equal(found, low.statistics(task.scene.with_(fixed)))
    assert not np.array_equal(found, low.statistics(task.scene))


def test_a_random_draw_is_poured_anew_under_each_condition(tilted: Path) -> None:
    # Pours of one seed under two conditions scatter together (0.6), and count as two.
    task, asked = Task.load(tilted), []
    size = len(Measures.of(task.scene).names)

    def pours(_: Any, seeds: list[int], __: Any) -> np.ndarray:
        asked.extend(seeds)
        return np.zeros((1, size))

    forward: Any = SimpleNamespace(pours=pours)
    analysis = Analysis(task, planned(task, 1100, 0), forward, Thresholds(), 0, print)
    measured = {condition.name: np.ones((2, size)) for condition in analysis.fitted}
    found: Any = SimpleNamespace(best=SimpleNamespace(effects=("tilt.y",)))
    seen = prior_pours(analysis, found, measured, np.ones(16), 0)
    assert len(set(asked)) == len(asked) == 24 * len(analysis.fitted)
    assert len(seen.squares) == 24 and seen.squares == pytest.approx(16)


def test_a_budget_that_is_too_small_says_what_is_enough(
    tilted: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["close-loop", str(tilted), "-o", str(tmp_path / "out"), "--budget", "100"]
    assert main([*words, "--pairs", "0"]) == 2
    assert "562 would be enough" in capsys.readouterr().err
    # Twenty simulated pairs, as many pours each as were measured to fit.
    assert main(words) == 2
    assert f"{562 + 20 * 6} would be enough" in capsys.readouterr().err
    for more in ([], ["--dry-run"]):
        assert main([*words, "--pairs", "7", *more]) == 2
        assert "pairs must be 0, or at least 19 to read 95 % from, got 7" in capsys.readouterr().err


def test_what_a_task_file_lacks_is_named(tilted: Path, tmp_path: Path) -> None:
    text = tilted.read_text()

    def load(changed: str) -> Task:
        file = tilted.parent / f"{tmp_path.name}.toml"
        file.write_text(changed)
        return Task.load(file)

    with pytest.raises(ObservationError, match="scenes must be absent, for it is unknown"):
        load(
            text.replace("scene =", "scenes =", 1).replace(
                "prior =", 'scene = "scene.toml"\nprior =', 1
            )
        )
    with pytest.raises(ObservationError, match="must be one of fit, sealed, got 'test'"):
        load(text.replace('"sealed"', '"test"'))
    with pytest.raises(ObservationError, match="at least 3 pours in conditions to fit, got 0"):
        load(text.replace('"fit"', '"sealed"'))
    with pytest.raises(FileNotFoundError, match="nowhere"):
        load(text.replace("low-0", "nowhere"))
    tolerances = {
        "names": ["max_z"],
        "path": "funnel.slope",
        "at": [0, 1],
        "directions": [[[1e-3]] * 2],
    }
    (tilted.parent / "off.json").write_text(json.dumps(tolerances))
    with pytest.raises(ObservationError, match=r"tolerances .* got 'funnel.slope'"):
        load('tolerances = "off.json"\n' + text)
    # Between places that fall nothing can be told.
    falling = {**tolerances, "path": "start.base", "at": [0.06, 0.02]}
    (tilted.parent / "off.json").write_text(json.dumps(falling))
    with pytest.raises(ObservationError, match=r"off.json: at must rise, got \[0.06, 0.02\]"):
        load('tolerances = "off.json"\n' + text)
    misspelt = {**falling, "at": [0.02, 0.06], "names": ["max_zz"]}
    (tilted.parent / "off.json").write_text(json.dumps(misspelt))
    with pytest.raises(ObservationError, match="no statistic 'max_zz'.*max_z"):
        load('tolerances = "off.json"\n' + text)
    with pytest.raises(TrainingDataError, match="no effect magnetism.*; there are cohesion"):
        load(text.replace("tilt.y", "magnetism"))
    # Before anything is registered or poured.
    with pytest.raises(
        ObservationError, match="condition 'low': path \"start.bsae\" does not name"
    ):
        load(text.replace("start.base", "start.bsae"))
    with pytest.raises(ObservationError, match="condition 'high': start.spacing must be positive"):
        load(text.replace("start.base", "start.spacing").replace("0.06", "-6.0"))
    definitions = "".join(
        f'[[definitions]]\nname = "{value}"\nat = {{ "camera.height_threshold" = {value} }}\n'
        for value in ("1e-3", "-1.0")
    )
    with pytest.raises(ObservationError, match="condition 'low': .*height_threshold"):
        load(text + definitions)


@pytest.mark.parametrize(
    ("asked", "error", "told"),
    [
        ({"budget": 1e3}, TypeError, "budget must be a whole number, got 1000.0"),
        ({"budget": 0}, ValueError, "budget must be at least 1, got 0"),
        ({"threads": 1.5}, TypeError, "threads must be a whole number, got 1.5"),
        ({"threads": 0}, ValueError, "threads must be at least 1, got 0"),
        ({"seed": -1}, ValueError, "seed must be at least 0, got -1"),
        ({"seed": 2**64 - 1}, ValueError, "seed must be at most"),
        ({"pairs": 20.0}, TypeError, "pairs must be a whole number, got 20.0"),
        (
            {"pairs": 7},
            ObservationError,
            "pairs must be 0, or at least 19 to read 95 % from, got 7",
        ),
        ({"rounds": -1}, ValueError, "rounds must be at least 0, got -1"),
        ({"rounds": None}, TypeError, "rounds must be a whole number, got None"),
    ],
)
def test_what_no_loop_can_be_asked_for_leaves_nothing(
    asked: dict[str, Any], error: type[Exception], told: str, tilted: Path, tmp_path: Path
) -> None:
    with pytest.raises(error, match=told):
        gc.close_loop(Task.load(tilted), tmp_path / "out", **{"budget": 1250, "pairs": 0, **asked})
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("kind", [str, Path])
def test_a_file_is_no_task(kind: Any, tilted: Path, tmp_path: Path) -> None:
    with pytest.raises(TypeError, match=r"must be a Task, got .*: granulcal.Task.load reads"):
        gc.close_loop(kind(tilted), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_task_is_built_of_conditions(tilted: Path) -> None:
    loaded = Task.load(tilted)
    built = tuple(
        loop.Condition(c.name, c.at, c.use, c.recordings, camera=c.camera)
        for c in loaded.conditions
    )
    task = loop.Task(loaded.scene, loaded.prior, built, loaded.library)
    assert task.conditions == loaded.conditions
    assert gc.Condition is loop.Condition and gc.Task is loop.Task


def test_what_differs_from_a_registration_is_named(tilted: Path, tmp_path: Path) -> None:
    task, rules = Task.load(tilted), Thresholds()

    def registered(pairs: int) -> str:
        return register(tmp_path, task, planned(task, 1250, 0), rules, 0, ("max_z",), pairs)

    first = registered(20)
    # Pairs are written where they are asked for alone.
    with pytest.raises(ObservationError, match=r"for another analysis \(pairs differ\)"):
        registered(0)
    # The same in other bytes, as one that was registered with numbers that are not whole.
    file = tmp_path / "preregistration.json"
    file.write_text(re.sub(r'"pairs": 20\b', '"pairs": 20.0', file.read_text()))
    assert registered(20) == hashlib.sha256(file.read_bytes()).hexdigest() != first


def test_a_report_without_its_packages_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing(*_: Any, **__: Any) -> None:
        raise ModuleNotFoundError("No module named 'jinja2'")

    written, told = [], []
    monkeypatch.setattr(folder, "write_page", missing)
    monkeypatch.setattr(folder, "write_tables", lambda _, place: written.append(place))
    closed: Any = None
    folder.write_report(closed, tmp_path, command="", title="", say=told.append)
    assert told == ["report.html left out: No module named 'jinja2'"] and written == [tmp_path]


def test_how_long_it_takes_is_told_before_it_pours(tilted: Path, tmp_path: Path) -> None:
    task = gc.Task.load(tilted)
    store = Archive(tmp_path / "archive", planned(task, 2000, 0))
    text = time_needed(task, store, 120, 2)
    assert text.startswith(f"{store.missing} pours of the archive are missing, 120 follow, and")
    assert store.missing == store.plan.pours > 1000
    assert not any((tmp_path / "archive").glob("base*"))


def test_a_recording_in_other_units_is_refused(tilted: Path) -> None:
    task = Task.load(tilted)
    # Grains of 0.4 mm under a camera that saw grains of 4 mm: a volume 1000 times off.
    small = task.scene.with_({"grains.diameter": 4e-4, "start.spacing": 6e-4, "start.jitter": 5e-5})
    with pytest.raises(ObservationError, match="times that: is the recording of this scene"):
        task.conditions[0].statistics(small)


def test_an_archive_of_something_else_is_refused(tmp_path: Path) -> None:
    scene, prior = gc.Scene.from_toml(SCENE), gc.Prior.from_toml(PRIOR)
    plan = ArchivePlan(
        scene=scene,
        prior=prior,
        conditions=(("start.base", 0.02, 0.06),),
        library=by_name(["tilt.y"]),
        base=4,
        each=4,
    )
    folder = tmp_path / "archive"
    assert Archive(folder, plan).missing == 8
    # As a run leaves it that is killed before its first part is begun.
    (folder / parts_of(plan)[0].name).mkdir(parents=True)
    assert Archive(folder, plan).missing == 8
    Archive(folder, plan).fill(threads=1, say=lambda _: None, progress=False)
    assert Archive(folder, plan).missing == 0
    assert Archive(folder, ArchivePlan(**{**plan.__dict__, "each": 9})).missing == 5
    pours = Archive(folder, plan).pours()
    assert len(pours.x) == 8 and pours.left_out.total == 0
    assert np.all(pours.psi[:4] == 0) and np.all(np.abs(pours.psi[4:]) <= 1)
    other = ArchivePlan(**{**plan.__dict__, "scene": scene.with_({"grains.count": 80})})
    # Conditions within its range are its own; beyond it they are another archive's.
    narrow = ArchivePlan(**{**plan.__dict__, "conditions": (("start.base", 0.03, 0.06),)})
    assert Archive(folder, narrow).plan.unit({"start.base": 0.03}) == pytest.approx([0.25])
    wide = ArchivePlan(**{**plan.__dict__, "conditions": (("start.base", 0.01, 0.06),)})
    with pytest.raises(TrainingDataError, match="is of another conditions"):
        Archive(folder, wide)
    with pytest.raises(TrainingDataError, match="is of another scene"):
        Archive(folder, other)


def test_effects_turn_strengths_into_numbers_and_back() -> None:
    scene = gc.Scene.from_toml(SCENE)
    for entry in FUNNEL:
        if entry.is_free:
            continue
        effect = entry.at(scene)
        for psi in (0.25, 0.5, 1.0):
            found = effect.strength(np.array([effect.value(psi)]))[0]
            assert abs(found - psi) < (0.03 if effect.whole else 1e-9)
            # Every strength is a number that the scene takes.
            changed = scene.with_({effect.path: effect.value(psi)})
            assert changed.get(effect.path) == effect.value(psi)
    assert fingerprint(FUNNEL) != fingerprint(FUNNEL[1:])
