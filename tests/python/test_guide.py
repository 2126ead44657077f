"""The commands of docs/guide.md that come before the training, as a newcomer types them."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import granulcal as gc
from granulcal.cli import main

ROOT = Path(__file__).parents[2]
# What makes them small; nothing else is changed.
SMALL = {
    "granulcal init couscous": "granulcal init couscous --set grains.count=120 --preset fast",
    "--baseline 0.05": "--baseline 0.05 --frames 3 --sessions 2",
    "-n 1000": "-n 4",
}


def commands(step: int) -> list[str]:
    """Returns the commands of a step, those in sentences too, in the order of the page."""
    text = (ROOT / "docs" / "guide.md").read_text(encoding="utf-8")
    part = re.split(r"^## ", text, flags=re.M)[step].partition("No camera?")[0]
    found = re.findall(r"^ {4}((?:granulcal|mv|cd) .*)$|`(granulcal [^`\n]+)`", part, flags=re.M)
    lines = [re.sub(r"\s+(#|->).*", "", a or b) for a, b in found]
    return [line for line in lines if not line.startswith("granulcal record")]


def small(line: str) -> str:
    for words, fewer in SMALL.items():
        line = line.replace(words, fewer)
    return line


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="lines of a POSIX shell")
def test_the_recordings_are_where_the_next_command_looks(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    tool = f'granulcal() {{ "{sys.executable}" -m granulcal.cli "$@"; }}'
    recorded = [small("granulcal init couscous"), "granulcal sample couscous"]
    at_hand = [*recorded, "mv couscous/couscous.bag couscous/wall.bag .", "rm -r couscous"]
    lines = [small(line) for line in [*commands(3), *commands(4)]]
    assert len(lines) == 9 and lines[-1].startswith("granulcal generate"), lines
    script = "\n".join(["set -e", tool, *at_hand, *lines])
    done = subprocess.run(
        ["bash", "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    # So few pours may all be of no use, which generate says by 3.
    assert done.returncode in (0, 3), done.stdout + done.stderr
    assert (tmp_path / "couscous" / "pours" / "manifest.toml").exists()


def test_who_has_no_camera_types_what_makes_the_recordings() -> None:
    text = (ROOT / "docs" / "guide.md").read_text(encoding="utf-8")
    assert "`granulcal init couscous && cd couscous && granulcal sample`" in text


def test_a_table_of_heights_becomes_a_recording_as_the_guide_makes_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = (ROOT / "docs" / "guide.md").read_text(encoding="utf-8")
    lines = re.findall(r'^ {4}((?:heights = |np\.savez\("couscous\.npz").*)$', text, flags=re.M)
    assert len(lines) == 2
    # A cone of 30 mm, 12 mm high, 0.5 mm from point to point, with a hole in its data.
    side = np.arange(-50.0, 50.0, 0.5)
    x, y = np.meshgrid(side, side)
    table = np.maximum(12.0 * (1.0 - np.hypot(x, y) / 30.0), 0.0).astype(str)
    table[5, 7] = ""
    (tmp_path / "heights.csv").write_text("\n".join(",".join(row) for row in table))
    monkeypatch.chdir(tmp_path)
    exec("\n".join(lines), {"np": np})
    scene = gc.Scene.drop(0.05, count=500).with_({"camera.field_width": 0.1})
    pile = gc.Recording.open("couscous.npz").formation(**scene.reading)
    assert pile.statistics()["max_z"] == pytest.approx(0.012, abs=0.001)
    assert pile.statistics()["mean_r"] == pytest.approx(0.0185, abs=0.002)


def test_a_recording_without_a_lens_is_begun_as_the_guide_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    image = pytest.importorskip("PIL.Image")
    text = (ROOT / "docs" / "guide.md").read_text(encoding="utf-8")
    (words,) = re.findall(r"`(--recording couscous\.png [^`]+)`", text)
    monkeypatch.chdir(tmp_path)
    assert main(["init", "couscous", "--scene", "drop"]) == 0
    own = Path("couscous", "camera.toml")
    lines = own.read_text(encoding="utf-8")
    for key, value in {"fx": "600.0", "fy": "600.0", "depth_unit": "0.001"}.items():
        lines = re.sub(rf"(?m)^{key} = [\d.]+", f"{key} = {value}", lines)
    own.write_text(lines, encoding="utf-8")
    # A heap under that lens, half a metre away, in millimetres.
    pour = gc.simulate(gc.Scene.drop(0.02, count=60, preset="fast"), seed=1)
    camera = gc.Camera.load(own, height=0.5)
    counts = np.round(1e3 * camera.render(pour.positions, pour.radii)).astype(np.uint16)
    image.fromarray(counts).save("couscous.png")
    assert main(["init", "couscous", "--scene", "drop", *words.split()]) == 0
    scene = gc.Scene.load("couscous/scene.toml")
    assert scene.get("camera.height") == pytest.approx(0.5, abs=0.001)
    assert scene.get("camera.field_width") == pytest.approx(480 * 0.5 / 600, rel=0.01)
