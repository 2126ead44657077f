"""What is made to be viewed: films, notebooks' HTML, ArviZ."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

import granulcal as gc
from granulcal.bayessim.check.toys import LinearGaussian
from granulcal.cli import main
from granulcal.pours.film import _outlines, film

EXAMPLES = Path(__file__).parents[2] / "examples"


def test_a_film_shows_the_pour_until_it_rests(
    small_scene: gc.Scene, small_pour: gc.Pour, tmp_path: Path
) -> None:
    image = pytest.importorskip("PIL.Image")
    times: list[float] = []
    path = tmp_path / "pour.gif"
    count = film(small_scene, path, seed=3, fps=20, slow=1, width=120, progress=times.append)
    with image.open(path) as gif:
        assert gif.n_frames <= count == len(times) and gif.size[0] == 120
        first = np.asarray(gif.convert("RGB"), int)
        lasts = []
        for i in range(gif.n_frames):
            gif.seek(i)
            lasts.append(gif.info["duration"])
        # Pillow joins frames that are the same, and their times.
        assert lasts[0] == 50 and sum(lasts) == 50 * (count - 1) + 1500
        last = np.asarray(gif.convert("RGB"), int)
    assert times[-1] == pytest.approx(small_pour.simulated_s, abs=1e-9)
    # Grains are brown on grey: they fall, so that their rows move down the picture.
    rows = [np.nonzero((p[..., 0] - p[..., 2]) > 60)[0].mean() for p in (first, last)]
    assert rows[1] > rows[0] + 3


def test_a_long_film_keeps_its_last_frame(small_scene: gc.Scene, tmp_path: Path) -> None:
    assert film(small_scene, tmp_path / "x.gif", fps=60, slow=1, width=64, most_frames=3) == 4
    with pytest.raises(ValueError, match="must end in .gif or .mp4"):
        film(small_scene, tmp_path / "x.avi")


def test_a_gate_that_moves_leaves_the_other_walls_in_the_picture() -> None:
    """One wall that moved had taken all lines away."""
    hopper = gc.Scene.load(EXAMPLES / "hopper_round.toml")
    # Of a cylinder and of a cone two rings and two sides each; the disc is the gate.
    assert len(_outlines(hopper)) == 8
    assert len(_outlines(gc.Scene.load(EXAMPLES / "drum.toml"))) == 0
    assert len(_outlines(gc.Scene.funnel())) == 8


def test_a_film_as_mp4_lasts_as_long_as_its_frames(small_scene: gc.Scene, tmp_path: Path) -> None:
    av = pytest.importorskip("av")
    path = tmp_path / "pour.mp4"
    count = film(small_scene, path, seed=3, fps=20, slow=1, width=121)
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        assert stream.codec_context.name == "h264" and stream.average_rate == 20
        # The last frame is held for a second and a half; sides are even.
        assert sum(1 for _ in container.decode(stream)) == count + 30
        assert stream.width == 120 and stream.height % 2 == 0
    assert [file.name for file in tmp_path.iterdir()] == ["pour.mp4"]


def test_the_layout_shows_what_a_film_for_foxglove_has(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    layout = json.loads((EXAMPLES / "foxglove.json").read_text(encoding="utf-8"))
    panels = layout["configById"]
    assert {layout["layout"]["first"], layout["layout"]["second"]} == set(panels)
    shown = set(panels["3D!pour"]["topics"])
    shown |= {panels["Image!depth"]["imageMode"][key] for key in ("imageTopic", "calibrationTopic")}
    words = ["simulate", "drop", "--set", "grains.count=20", "--mcap", str(tmp_path / "x.mcap")]
    assert main([*words, "--quiet"]) == 0
    capfd.readouterr()
    assert main(["inspect", str(tmp_path / "x.mcap")]) == 0
    told = capfd.readouterr().out
    assert [topic for topic in shown if topic not in told] == []


def test_the_word_film(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "drop.gif"
    words = ["film", "drop", "--set", "grains.count=20", "--width", "64", "--fps", "10"]
    assert main([*words, "-o", str(out), "--json"]) == 0
    assert out.stat().st_size > 0 and '"frames"' in capsys.readouterr().out


def test_notebooks_show_a_table_and_a_picture(small_pour: gc.Pour, small_data: gc.Dataset) -> None:
    pour = small_pour._repr_html_()
    assert "at_rest" in pour and "data:image/png;base64," in pour
    assert "material.sliding_friction" in small_data._repr_html_()
    toy = LinearGaussian.random(bounded=True)
    _, x = toy.simulate(1)
    assert "90 % interval" in toy.posterior(x[0])._repr_html_()


def test_what_a_session_types_out_is_a_line(small_pour: gc.Pour) -> None:
    """Arrays and addresses had been."""
    camera = gc.Camera.overhead(height=0.3, field_width=0.3, pixels=150)
    assert repr(camera) == "Camera.overhead(height=0.3, field_width=0.3, pixels=150)"
    assert repr(camera.tilted(x_deg=3)) == f"{camera!r}.tilted(x_deg=3, y_deg=0)"
    depth = camera.render(small_pour.positions, small_pour.radii)
    recording = gc.Recording.from_depth(depth, fx=150.0, fy=150.0, cx=74.5, cy=74.5)
    formation, levelled = recording.formation(), recording.level()
    count = len(formation.points)
    assert repr(formation).startswith(f"Formation(pile, {count} of 22500 pixels with data, ")
    assert repr(levelled).startswith(f"Levelled(150 x 150 pixels, {count} of 22500 with data are ")
    assert "material.restitution uniform from 0 to 1" in repr(gc.Prior.default())


def test_arviz_gets_the_draws() -> None:
    pytest.importorskip("arviz")
    toy = LinearGaussian.random(bounded=True)
    _, x = toy.simulate(1)
    posterior = toy.posterior(x[0])
    data = posterior.to_arviz(400, chains=4, seed=2)
    name = posterior.names[0]
    values = np.asarray(data["posterior"][name])
    assert values.shape == (4, 100)
    assert np.array_equal(values.ravel(), posterior.sample(400, 2)[:, 0])
    with pytest.raises(ValueError, match="at least chains"):
        posterior.to_arviz(2, chains=4)


def test_who_has_no_arviz_is_told_where_it_comes_from(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "arviz", None)
    toy = LinearGaussian.random(bounded=True)
    with pytest.raises(ModuleNotFoundError, match=r"pip install 'granulcal\[arviz\]'"):
        toy.posterior(toy.simulate(1)[1][0]).to_arviz()
