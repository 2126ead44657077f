"""What is made to be looked at: films, notebooks' HTML, ArviZ."""

from pathlib import Path

import numpy as np
import pytest

import granulcal as gc
from granulcal.bayessim.check.toys import LinearGaussian
from granulcal.cli import main
from granulcal.pours.film import film


def test_a_film_shows_the_pour_until_it_rests(
    small_scene: gc.Scene, small_pour: gc.Pour, tmp_path: Path
) -> None:
    image = pytest.importorskip("PIL.Image")
    times: list[float] = []
    path = tmp_path / "pour.gif"
    count = film(small_scene, path, seed=3, fps=20, slow=1, width=120, progress=times.append)
    with image.open(path) as gif:
        # Pillow joins frames that are the same.
        assert count - 2 <= gif.n_frames <= count == len(times)
        assert gif.size[0] == 120 and gif.info["duration"] == 50
        first = np.asarray(gif.convert("RGB"), int)
        gif.seek(gif.n_frames - 1)
        last = np.asarray(gif.convert("RGB"), int)
    assert times[-1] == pytest.approx(small_pour.simulated_s, abs=1e-9)
    # Grains are brown on grey: they fall, so that their rows move down the picture.
    rows = [np.nonzero((p[..., 0] - p[..., 2]) > 60)[0].mean() for p in (first, last)]
    assert rows[1] > rows[0] + 3


def test_a_long_film_keeps_its_last_frame(small_scene: gc.Scene, tmp_path: Path) -> None:
    assert film(small_scene, tmp_path / "x.gif", fps=60, slow=1, width=64, most_frames=3) == 4
    with pytest.raises(ValueError, match="must end in .gif"):
        film(small_scene, tmp_path / "x.mp4")


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
