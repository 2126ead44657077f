import json
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import granulcal as gc
from granulcal.cli import main
from granulcal.experiments.paper.common.command import (
    experiments,
    find,
    missing_sets,
    reproduce_paper,
    run_one,
)
from granulcal.experiments.paper.common.eye import BARE, Disturbance, Eye
from granulcal.experiments.paper.common.measure import (
    Published,
    bootstrap,
    bootstrap_grid,
    bootstrap_pairs,
    error_row,
    level_row,
    share_interval,
)
from granulcal.experiments.paper.common.outcome import Outcome, Row
from granulcal.experiments.paper.common.page import write_page, write_tables
from granulcal.experiments.paper.common.sizes import FULL, MEDIUM, QUICK, TINY
from granulcal.experiments.paper.common.workshop import Pairs, Workshop
from granulcal.experiments.paper.heights import SHIPPED as RECORDINGS
from granulcal.experiments.paper.heights import Recordings
from granulcal.experiments.paper.observation_error import _peaks
from granulcal.experiments.paper.propagation import _least
from granulcal.pours.kept_pours import KeptPours

pytest.importorskip("torch")
pytest.importorskip("matplotlib")


_QUICKEST = ("noise", "propagation")
"""Experiments without a fit, which the default tests run."""


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The quickest experiments at the smallest size, once, and the page of them."""
    out = tmp_path_factory.mktemp("paper")
    for name in _QUICKEST:
        reproduce_paper(out, name, size=TINY, quiet=True)
    folder = out / "paper-tiny"
    return folder, write_page(folder, experiments(), TINY)


def test_pours_at_other_parameters_are_poured_again_and_counted(tmp_path: Path) -> None:
    scene, prior = gc.Scene.drop(0.02, count=12), gc.Prior.default()
    theta, told = prior.sample(3, seed=1), []
    path = tmp_path / "pours.json"
    kept = KeptPours(scene, prior, path, threads=1)
    before = kept(theta, 0)
    other = theta.copy()
    other[1, 0] *= 0.5
    kept = KeptPours(scene, prior, path, threads=1, progress=told.append)
    assert (kept.kept_of(theta), kept.kept_of(other)) == (3, 2)
    after = kept(other, 0)
    # Two of three were there.
    assert told == [3] and kept.kept_of(other) == 3
    np.testing.assert_array_equal(after[[0, 2]], before[[0, 2]])


def test_every_experiment_is_there_once():
    known = experiments()
    assert [each.number for each in known] == sorted({each.number for each in known})
    assert len({each.name for each in known}) == len(known)
    for each in known:
        assert find(each.name) is find(str(each.number)) is find(each.name.replace("-", "_"))
        assert each.asks.endswith(("?", ".")) and each.section
    with pytest.raises(ValueError, match="no experiment 'rngs' here; there are 1 noise"):
        find("rngs")


def _check(folder: Path, name: str) -> None:
    """What every experiment must have told."""
    loaded = Outcome.load(folder / name)
    assert loaded is not None, name
    outcome, made = loaded
    assert outcome.rows and outcome.answer and outcome.figures, name
    assert all(row.verdict in ("", "not judged: tiny version") for row in outcome.rows)
    assert all(row.count > 0 for row in outcome.rows)
    for figure in outcome.figures:
        data = (folder / name / figure.file).read_bytes()
        assert data.startswith(b"\x89PNG"), figure.file
    assert made["size"] == "tiny" and name in made["command"]
    sets = find(name).sets(TINY)
    assert {each.name for each in sets} == set(made["seeds"]), name
    assert made["pours"] >= sum(each.count for each in sets) > 0


def test_experiments_run_and_say_what_they_did(ran):
    for name in _QUICKEST:
        _check(ran[0], name)


def test_sets_that_are_there_are_not_missing(ran):
    out = ran[0].parent
    assert missing_sets(out, "noise", size=TINY) == []
    everything = {each.name for each in missing_sets(out, size=TINY)}
    shared = {"default-training", "default-tests"}
    assert shared < everything and "noise" not in everything
    assert shared <= {each.name for each in missing_sets(out, "ablation", size=TINY)}


def test_what_a_part_has_found_is_kept_before_the_next_is_run(tmp_path):
    row = Row(quantity="error", ours="0.1", interval="", count=4)

    def run(workshop: Workshop) -> Outcome:
        workshop.so_far(Outcome(rows=[row], answer="half of it", missing=["the paper's solver"]))
        raise KeyboardInterrupt

    stopped = replace(find("sim-to-sim"), run=run)
    folder = tmp_path / "paper-tiny"
    with pytest.raises(KeyboardInterrupt):
        run_one(stopped, folder, size=TINY, quiet=True)
    loaded = Outcome.load(folder / "sim-to-sim")
    assert loaded is not None and loaded[0].rows == [row]
    assert not Outcome.is_complete(folder / "sim-to-sim")
    names = {each.name for each in missing_sets(tmp_path, "sim-to-sim", size=TINY)}
    assert names == {each.name for each in find("sim-to-sim").sets(TINY)}
    page = write_page(folder, experiments(), TINY).read_text(encoding="utf-8")
    assert "Not run yet: the paper&#39;s solver." in page and "(in part)" in page


def test_a_formation_for_a_picture_is_poured_once(tmp_path, monkeypatch):
    scene = gc.Scene.drop(0.01, count=25)
    shop = Workshop(tmp_path, "x", TINY, threads=1, quiet=True)
    first, other = shop.formation(scene, 1), shop.formation(scene, 2)
    assert first.shape[1] == 3 and len(first) > 0
    np.testing.assert_array_equal(first, gc.simulate(scene, seed=1).points())
    assert first.shape != other.shape or not np.array_equal(first, other)

    def poured_again(*_, **__):
        raise AssertionError("it is there")

    monkeypatch.setattr("granulcal.experiments.paper.common.workshop.simulate", poured_again)
    np.testing.assert_array_equal(shop.formation(scene, 1), first)
    with pytest.raises(AssertionError, match="it is there"):
        shop.formation(scene.with_({"material.restitution": 0.1}), 1)


def test_tables_hold_every_row_of_what_has_run(ran):
    text = write_tables(ran[0], experiments()).read_text(encoding="utf-8")
    lines = text.splitlines()
    for name in _QUICKEST:
        loaded = Outcome.load(ran[0] / name)
        assert loaded is not None
        outcome, made = loaded
        assert f"## {find(name).number} {find(name).title}" in lines and outcome.answer in lines
        assert f"    {made['command']}    # {made['pours']} pours, {made['at']}" in lines
        tables = [[row.quantity for row in outcome.rows]]
        tables += [[cells[0] for cells in table.rows] for table in outcome.tables]
        for quantity in (quantity for table in tables for quantity in table):
            assert any(line.startswith(f"| {quantity.replace('|', '/')} | ") for line in lines)
    assert "sim-to-sim" not in text
    widths = [line.count(" | ") for line in lines if line.startswith("| quantity")]
    assert widths == [5] * len(_QUICKEST)


@pytest.mark.slow
@pytest.mark.parametrize("name", [each.name for each in experiments()])
def test_every_experiment_runs(name, tmp_path):
    if name == "heights" and not (RECORDINGS / "barley.npz").exists():
        pytest.skip("the recordings of benches/paper/recordings.py are not here")
    reproduce_paper(tmp_path, name, size=TINY, quiet=True)
    _check(tmp_path / "paper-tiny", name)


def test_a_second_run_makes_nothing_again(ran):
    folder, _ = ran
    kept = {
        path: path.stat().st_mtime_ns for path in (folder / "pours").rglob("*") if path.is_file()
    }
    before = json.loads((folder / "noise" / "result.json").read_text())
    reproduce_paper(folder.parent, "noise", size=TINY, quiet=True)
    after = json.loads((folder / "noise" / "result.json").read_text())
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    assert after["rows"] == before["rows"]


class _Sources(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []
        self.sections = 0

    def handle_starttag(self, tag, attrs):
        self.sections += tag == "section"
        self.found += [value for name, value in attrs if name in ("src", "href") and value]


def test_recordings_of_another_number_of_grains_are_not_taken(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"recordings.py .*recordings --grains 400`"):
        Recordings.load("barley", MEDIUM, tmp_path)
    assert len(Recordings.load("barley", QUICK, tmp_path).heights)


def test_the_page_needs_nothing_else_and_says_that_it_is_small(ran):
    _, page = ran
    text = page.read_text(encoding="utf-8")
    parser = _Sources()
    parser.feed(text)
    assert parser.sections == len(experiments())
    assert all(source.startswith(("data:image/png", "#")) for source in parser.found)
    assert "This is the small version" in text
    assert text.count("Not run at this size") == len(experiments()) - len(_QUICKEST)


@pytest.mark.skipif(shutil.which("chromium") is None, reason="no chromium")
def test_the_page_opens_in_a_browser(ran, tmp_path):
    _, page = ran
    shot = tmp_path / "page.png"
    words = ["chromium", "--headless", "--no-sandbox", "--disable-gpu", f"--screenshot={shot}"]
    words += ["--window-size=1100,1600", f"--user-data-dir={tmp_path}", page.as_uri()]
    subprocess.run(words, check=True, capture_output=True, timeout=120)
    assert shot.stat().st_size > 20_000


def test_command_line_refuses_by_name(capsys):
    assert main(["reproduce", "paper", "nothing"]) == 2
    assert "the paper has no experiment 'nothing'" in capsys.readouterr().err
    assert main(["reproduce", "sensor", "--quick"]) == 2
    assert "quick belongs to the study 'paper'" in capsys.readouterr().err
    assert main(["reproduce"]) == 0
    *studies, of_data = capsys.readouterr().out.splitlines()
    # Each with what it is of.
    assert any(line.startswith("paper ") and "Matl" in line for line in studies)
    assert all(len(line.split()) > 5 for line in studies) and "--data" in of_data


def test_full_size_is_the_papers_or_larger():
    assert FULL.grains == 2000 and FULL.training >= 1000 and FULL.tests >= 50
    assert 2 * FULL.repeats >= 1000 and FULL.recordings == (10, 5)
    assert QUICK.training < FULL.training and not QUICK.is_full


def test_an_eye_without_errors_sees_what_the_scene_sees(small_scene, small_pour):
    eye = Eye.of(small_scene)
    view = eye.at(small_pour.positions, small_pour.radii, small_pour.seed)
    threshold = small_scene.get("camera.height_threshold")
    seen = gc.statistics(view.points(view.clean, threshold))
    np.testing.assert_allclose(seen.paper16, small_pour.statistics().paper16, rtol=1e-5, atol=1e-7)


def test_errors_of_an_image_are_those_asked_for(small_scene, small_pour):
    view = Eye.of(small_scene).at(small_pour.positions, small_pour.radii, 3)
    noisy = view.heights(Disturbance(depth_noise=2e-3)) - view.clean
    assert noisy.std() == pytest.approx(2e-3, rel=0.05)
    blurred = view.heights(Disturbance(blur=3.0))
    # A blur moves grains' height to their neighbours and keeps its sum, far from the border.
    assert np.nansum(blurred) == pytest.approx(np.nansum(view.clean), rel=1e-3)
    assert np.nanmax(blurred) < 0.5 * np.nanmax(view.clean)
    fine = view.heights(Disturbance(fine_blur=8.0))
    assert np.nanmax(fine) < np.nanmax(view.clean)
    sensor = view.heights(Disturbance(is_d435=True))
    ground = np.isfinite(sensor) & (view.clean < BARE)
    assert 1e-5 < np.nanstd(sensor[ground]) < 2e-3


def test_rows_have_the_means_intervals_and_verdicts_of_known_numbers():
    paper = Published(mean=0.3, sd=0.4, count=50)
    assert paper.rms == pytest.approx(0.5) and str(paper) == "0.3000 ± 0.4000 (n = 50)"
    errors = np.tile([0.1, -0.1], 25)
    row = error_row("x", errors, FULL, paper)
    assert row.ours == "0.0000 ± 0.1010" and row.verdict == "better"
    assert row.interval.startswith("rms 0.1000 (0.1000 to 0.1000)")
    assert error_row("x", 10 * errors, FULL, paper).verdict == "worse"
    assert error_row("x", errors[:20], FULL, paper).verdict == "not decided: too few tests"
    assert error_row("x", errors, QUICK, paper).verdict == "not judged: quick version"
    spread = np.concatenate([np.full(25, 0.2), np.full(25, 0.4)])
    assert level_row("x", spread, FULL, paper).verdict == "not decided"
    assert level_row("x", spread - 0.15, FULL, paper).verdict == "better"


def test_a_bootstrap_interval_is_that_of_the_mean():
    values = np.random.default_rng(1).normal(2.0, 1.0, 400)
    low, high = bootstrap(values)
    assert low == pytest.approx(values.mean() - 1.96 * values.std() / 20, abs=0.01)
    assert high == pytest.approx(values.mean() + 1.96 * values.std() / 20, abs=0.01)
    assert np.isnan(bootstrap([1.0])).all()
    # Wilson's interval of 8 of 10.
    assert share_interval(8, 10) == pytest.approx((0.4901, 0.9433), abs=1e-3)


def test_intervals_of_what_shares_pours_hold_the_mean():
    """Of ten with each of five and of pairs of ten: values in a row or a pair are not alone."""
    random, sets = np.random.default_rng(3), 120
    held: dict[str, int] = dict.fromkeys(("grid", "rows", "pairs", "alone"), 0)
    apart = [np.subtract.outer(x, x) for x in random.normal(size=(2000, 10))]
    true = np.abs(apart).sum() / (2000 * 90)
    for x in random.normal(size=(sets, 10)):
        own, others = random.normal(size=(10, 1)), random.normal(size=(1, 5))
        values = 0.36 * own + 0.4 * others + 0.3 * random.normal(size=(10, 5))
        distances = np.abs(np.subtract.outer(x, x))
        found = {
            "grid": (bootstrap_grid(values), 0.0),
            "rows": (bootstrap(values.mean(axis=1)), 0.0),
            "pairs": (bootstrap_pairs(distances), true),
            "alone": (bootstrap(distances[np.triu_indices(10, 1)]), true),
        }
        for name, ((low, high), mean) in found.items():
            held[name] += low <= mean <= high
    assert held["grid"] >= 0.85 * sets > 0.78 * sets >= held["rows"]
    assert held["pairs"] >= 0.85 * sets > 0.78 * sets >= held["alone"]
    assert np.isnan([*bootstrap_grid(np.ones((1, 5))), *bootstrap_pairs(np.zeros((2, 2)))]).all()


def test_peaks_of_a_posterior_are_counted():
    grid = np.linspace(0, 1, 200)
    bump = lambda at: np.exp(-0.5 * ((grid - at) / 0.05) ** 2)  # noqa: E731
    assert _peaks(bump(0.5)) == 1
    assert _peaks(bump(0.0)) == 1
    assert _peaks(bump(0.2) + 0.5 * bump(0.8)) == 2
    assert _peaks(bump(0.2) + 0.1 * bump(0.8)) == 1


def test_the_least_change_that_shows_is_found():
    values = np.linspace(0, 1, 9)
    x = np.repeat((3 * values)[:, None, None], 2, axis=1)
    found = _least(values, x, 0.5, [lambda y: np.full_like(y, 0.6)])
    assert found == pytest.approx(0.2, abs=2e-3)
    assert _least(values, x, 0.5, [lambda y: np.full_like(y, 2.0)]) == np.inf


def test_tests_are_made_until_enough_are_usable(small_scene, small_prior, tmp_path):
    shop = Workshop(tmp_path, "x", TINY, threads=1, quiet=True)
    found = shop.tests("tests", small_scene, small_prior, 5, 3)
    assert len(found) == 5 and shop.pours >= 5 and shop.seeds == {"tests": 3}
    part = found.of(found.names[2:4])
    np.testing.assert_array_equal(part.x, found.x[:, 2:4])


def test_tests_of_sequences_are_counted_once(small_scene, small_prior, tmp_path, monkeypatch):
    from granulcal.experiments.paper import sequence

    def all_but_the_first(data):
        kept = Pairs(data.theta[1:], data.x[1:], data.prior, data.x_names, data.left_out)
        return {"last image": kept, "sequence": kept}

    monkeypatch.setattr(sequence, "_both", all_but_the_first)
    shop = Workshop(tmp_path, "sequence", TINY, threads=1, quiet=True)
    found = sequence._tests(shop, small_scene, small_prior)
    assert [len(each) for each in found.values()] == [TINY.tests] * 2
    assert shop.pours == TINY.tests + 1


def test_a_change_that_no_curve_shows_is_told_as_far_as_both_sides_were_poured(monkeypatch):
    from granulcal.experiments.paper import propagation
    from granulcal.pours.statistics import NAMES

    values, x = np.linspace(0.0, 1.0, 5), np.ones((5, 3, len(NAMES)))
    monkeypatch.setattr(propagation, "_RESAMPLES", 20)
    x[0, 0] = np.nan
    row = propagation._row("q", "p", values, x, 0.75, [("max_z", lambda middle: np.array(0.1))])
    # The pour that cannot be used is none of them.
    assert (row.ours, row.count) == ("more than ± 0.25", 14)


def test_a_change_that_no_curve_shows_is_beyond_the_range_without_a_warning(monkeypatch):
    from granulcal.experiments.paper import propagation
    from granulcal.pours.statistics import NAMES

    values, x = np.linspace(0.0, 1.0, 5), np.ones((5, 3, len(NAMES)))
    # NumPy warns of the difference of two infinite numbers, and warnings are errors here.
    monkeypatch.setattr(propagation, "_RESAMPLES", 20)
    row = propagation._row("q", "p", values, x, 0.5, [("max_z", lambda middle: np.array(0.1))])
    assert (row.ours, row.interval) == ("more than ± 0.5", "beyond the range")
