"""The commands of docs/guide.md that come before the training, as a newcomer types them."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

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
    return [line for line in lines if line != "granulcal record"]


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
    assert len(lines) == 8 and lines[-1].startswith("granulcal generate"), lines
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
