import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import granulcal as gc
from granulcal.bayessim.check.identifiability import NO_TRACE, Identifiability
from granulcal.bayessim.check.misfit import Misfit, OddPour, StatisticMisfit
from granulcal.bayessim.check.toys import LinearGaussian
from granulcal.bayessim.network.mixture import Mixture
from granulcal.commands.misfit import print_misfit
from granulcal.parameter import Parameter
from granulcal.pours.formation_image import common_field, height_grid
from granulcal.pours.profile_picture import profile_band, radial_profile
from granulcal.report import HealthRow, write_report

pytest.importorskip("matplotlib")
pytest.importorskip("jinja2")


@pytest.fixture(scope="module")
def posterior() -> gc.Posterior:
    """A posterior of the default prior's parameters, without training."""
    toy = LinearGaussian.random(bounded=True)
    mixture = toy.normal(toy.simulate(1)[1][0])
    return gc.Posterior.from_mixture(gc.Prior.default(), mixture)


@pytest.fixture(scope="module")
def page(
    small_data: gc.Dataset,
    small_pour: gc.Pour,
    posterior: gc.Posterior,
    tmp_path_factory: pytest.TempPathFactory,
) -> Path:
    other = gc.simulate(small_pour.scene, seed=4)
    observed = small_pour.statistics().paper16 + 3 * small_data.x.std(axis=0)
    return write_report(
        tmp_path_factory.mktemp("report") / "report.html",
        observed=observed,
        observed_points=small_pour.points(),
        posterior=posterior,
        pours=[small_pour, other],
        prior_pours=[other],
        drawn=[other, small_pour],
        misfit=Misfit(
            pours=2,
            p_value=0.004,
            joint_p_value=0.2,
            statistics=(
                StatisticMisfit("max_z", 4.56, 0.004),
                StatisticMisfit("mean_r", -0.5, 0.9),
            ),
        ),
        data=small_data,
        truth=gc.Prior.default().mean(),
        title="A <test> & more",
        summary="What was done.",
        notes=["Read this."],
        command="granulcal report a b -o c",
    )


class _Links(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.links: list[str] = []
        self.open: list[str] = []
        self.balanced = True

    def handle_starttag(self, tag, attrs):
        self.links += [value for key, value in attrs if key in ("src", "href") and value]
        if tag not in ("meta", "img", "link", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        self.balanced &= bool(self.open) and self.open.pop() == tag


def test_the_page_needs_nothing_else(page):
    text = page.read_text(encoding="utf-8")
    parser = _Links()
    parser.feed(text)
    assert parser.balanced
    assert not parser.open
    assert len(parser.links) == 3
    assert all(link.startswith("data:image/png;base64,") for link in parser.links)
    assert not re.search(r"https?://|@import|url\(|<script", text)


def test_the_page_shows_every_number(page, small_data):
    text = page.read_text(encoding="utf-8")
    assert "A &lt;test&gt; &amp; more" in text
    for name in (*small_data.x_names, *small_data.theta_names):
        assert f"<code>{name}</code>" in text
    assert "What was done." in text
    assert "Read this." in text
    assert "granulcal report a b -o c" in text
    assert "80 at_rest" in text
    assert "<td>log_uniform from 0.001 to 1</td>" in text
    assert f"assumed: grains.count {small_data.scene.get('grains.count'):g}, " in text
    assert "Not checked" in text
    assert gc.__version__ in text


@pytest.mark.parametrize(("count", "kind"), [(1, "narrow"), (3, "narrow"), (7, "wide")])
def test_pictures_of_one_and_of_many_parameters_can_be_read(
    small_data: gc.Dataset, small_pour: gc.Pour, tmp_path: Path, count: int, kind: str
) -> None:
    """Pressed into the page's width, letters of seven parameters were four pixels high.

    Of one parameter there are neither contours nor a dot.
    """
    free = [
        Parameter(path=f"material.{letter}", distribution="uniform", low=0.0, high=1.0)
        for letter in "abcdefg"[:count]
    ]
    mixture = Mixture.from_covariances(np.ones(1), np.zeros((1, count)), np.eye(count)[None])
    page = write_report(
        tmp_path / "report.html",
        observed=small_pour.statistics().paper16,
        posterior=gc.Posterior.from_mixture(gc.Prior(free), mixture),
        pours=[small_pour],
        data=small_data,
        title="of many",
        summary="",
    )
    text = page.read_text(encoding="utf-8")
    figure = text.split("<figure")[-1].split("src=")[0]
    caption = text.split("<figcaption")[-1]
    assert ("Contours" in caption) == ("dot and" in caption) == (count > 1)
    assert f'class="{kind}"' in figure
    assert ("style=" in figure) == (f"width: {11 * count}rem" in figure) == (count > 4)


def test_large_differences_are_marked(page):
    text = page.read_text(encoding="utf-8")
    marked = text.count("beyond 2</td>") + text.count("too large</td>")
    assert text.count('<tr class="far">') == marked and text.count("beyond 2</td>") > 8


def test_the_page_says_whether_the_measurement_is_inside_the_model(page):
    text = page.read_text()
    assert "Outside the model:" in text and "explain these 2 pours" in text and "+4.56" in text
    assert text.count("too large") == 1


def test_the_recording_of_an_odd_pour_is_named(capsys):
    odd = OddPour(number=2, times=3.5, p_value=0.001)
    found = Misfit(3, 0.5, 0.6, (), "inside the model", 0.4, odd)
    print_misfit(found, ["a.png", "c.png", "b.png"])
    assert capsys.readouterr().out == "inside the model\n  pour 2 is c.png\n"


def test_pours_of_two_materials_are_told_as_such(posterior, small_data, small_pour, tmp_path):
    of_two = write_report(
        tmp_path / "report.html",
        observed=small_pour.statistics().paper16,
        observed_count=2,
        posterior=posterior,
        pours=[small_pour],
        misfit=Misfit(
            pours=2,
            p_value=0.005,
            joint_p_value=0.6,
            scatter_p_value=0.005,
            statistics=(StatisticMisfit("max_z", 0.5, 0.9),),
            odd_pour=OddPour(number=2, times=3.5, p_value=0.001),
        ),
        data=small_data,
    )
    text = of_two.read_text(encoding="utf-8")
    assert "these 2 pours differ more from each other than pours of one material do" in text
    assert "no parameters explain" not in text and "best compromise" not in text
    assert "Pour 2 is odd:</strong> it lies 3.5 times as far from the others" in text


def test_the_page_of_several_recordings_says_which_one_it_shows(
    page, posterior, small_data, small_pour, tmp_path
):
    of_two = write_report(
        tmp_path / "report.html",
        observed=small_pour.statistics().paper16,
        observed_points=small_pour.points(),
        observed_count=2,
        posterior=posterior,
        pours=[small_pour],
        drawn=[small_pour],
        data=small_data,
    )
    text = of_two.read_text(encoding="utf-8")
    assert text.count("the first of 2 recordings") == 2
    assert text.count("the means of 2 measurements") == 2
    assert "the first of" not in page.read_text(encoding="utf-8")


def test_the_page_says_which_parameters_left_no_trace(page, posterior):
    text = page.read_text(encoding="utf-8")
    known = Identifiability.of(posterior)
    for gain in known.gains:
        assert f"<td>{gain:.2f}" in text
    # One in the table for each, and one below where there is any.
    none = int((known.gains < NO_TRACE).sum())
    assert text.count(">no trace</span>") == none + (none > 0)
    assert f"{known.effective_dimension:.1f} of 3 directions are known" in text


def test_a_report_without_pours_is_refused(posterior, small_data, tmp_path):
    with pytest.raises(ValueError, match="at least one pour"):
        write_report(
            tmp_path / "report.html",
            observed=np.zeros(16),
            observed_points=np.zeros((1, 3)),
            posterior=posterior,
            pours=[],
            data=small_data,
        )
    assert not (tmp_path / "report.html").exists()


def test_health_counts_what_happened(small_data, small_pour):
    row = HealthRow.of_dataset("data", small_data)
    assert (row.count, row.grains_lost) == (80, 0)
    assert row.worst_penetration == small_data.health["worst_penetration"].max()
    assert HealthRow.of_pours("pours", [small_pour]).statuses == {"at_rest": 1}


def test_a_grid_keeps_heights_and_places():
    y, x = np.mgrid[-0.05:0.05:21j, -0.05:0.05:21j]
    points = np.column_stack([x.ravel(), y.ravel(), 0.01 + 0.1 * x.ravel()])
    field = common_field([points])
    assert field == pytest.approx(0.12, rel=0.05)
    grid = height_grid(points, field=field, pixels=100)
    assert np.nanmax(grid) == pytest.approx(0.015)
    # Full where the points are, empty at the rim; heights rise with x, which is the column.
    assert np.isfinite(grid[12:88, 12:88]).all()
    assert np.isnan(grid[0]).all()
    assert grid[50, 80] > grid[50, 20]


def test_a_browser_shows_the_page(page, tmp_path):
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None:
        pytest.skip("chromium is not installed (apt-get install chromium)")
    picture = tmp_path / "report.png"
    subprocess.run(
        [
            browser,
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-background-networking",
            f"--user-data-dir={tmp_path / 'profile'}",
            "--window-size=1000,2400",
            f"--screenshot={picture}",
            page.as_uri(),
        ],
        check=True,
        capture_output=True,
        timeout=120,
    )
    from matplotlib.image import imread

    pixels = imread(picture)[..., :3]
    assert pixels.shape[:2] == (2400, 1000)
    # Text and pictures, not a blank page.
    assert pixels.std() > 0.05


def _cone(height: float) -> np.ndarray:
    """A cone of radius 5 cm on a grid of 1 mm, about a place off the origin."""
    y, x = np.mgrid[-0.06:0.06:121j, -0.06:0.06:121j]
    z = height * (1 - np.hypot(x, y) / 0.05)
    points = np.column_stack([x.ravel() + 0.02, y.ravel(), z.ravel()])
    return points[points[:, 2] > 0]


def test_a_profile_of_a_cone_is_a_line_and_its_volume_the_cones():
    points = _cone(0.02) - [0.02, 0.0, 0.0]
    edges = np.linspace(0.0, 0.05, 11)
    found = radial_profile(points, edges)
    middle = (edges[1:] + edges[:-1]) / 2
    assert found == pytest.approx(0.02 * (1 - middle / 0.05), abs=6e-4)
    volume = np.sum(found * np.pi * np.diff(edges**2))
    assert volume == pytest.approx(np.pi * 0.05**2 * 0.02 / 3, rel=0.01)
    assert np.all(radial_profile(np.zeros((0, 3)), edges) == 0)


def test_pixels_of_grains_that_lie_alone_are_no_wider():
    heap = _cone(0.02) - [0.02, 0.0, 0.0]
    # Twice as many lone pixels as those of the heap, 6 mm apart, 5 to 35 cm away.
    y, x = np.mgrid[-0.35:0.35:118j, -0.35:0.35:118j]
    alone = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 0.004)])
    alone = alone[np.hypot(*alone[:, :2].T) > 0.056]
    edges = np.linspace(0.0, 0.05, 11)
    both = radial_profile(np.concatenate([heap, alone]), edges)
    assert len(alone) > 1.5 * len(heap)
    assert both == pytest.approx(radial_profile(heap, edges), rel=0.02)


def test_a_band_holds_the_draws_and_tells_what_is_outside():
    draws = [_cone(height) for height in np.linspace(0.018, 0.022, 9)]
    band = profile_band(_cone(0.02), [_cone(0.02)], draws)
    low, high = band.band
    assert np.all(low <= high) and band.inside == 1.0
    assert low[0] == pytest.approx(0.0182 * (1 - band.edges[1] / 0.1), rel=0.05)
    # Half as high: below the band wherever there is a cone.
    lower = profile_band(_cone(0.01), [_cone(0.02)], draws)
    inner = lower.edges[1:] < 0.045
    assert np.all(lower.measured[inner] < lower.band[0][inner]) and lower.inside < 0.5


def test_a_command_in_a_note_is_code_and_nothing_else_is_markup():
    from granulcal.report import template

    code = template("report.html.j2").environment.filters["code"]
    told = "<code>granulcal check</code> &lt;b&gt; a` says"
    assert str(code("`granulcal check` <b> a` says")) == told
