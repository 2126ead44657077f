"""The pictures of scenes in the documentation are of the law that pours today."""

import re
from pathlib import Path

import pytest

import granulcal as gc

DOCS, EXAMPLES = (Path(__file__).parents[2] / name for name in ("docs", "examples"))
NAMES = [
    *["funnel", "drop", "drum", "column", "hopper", "hopper_round", "bowl", "trail", "scoop"],
    *["crater", "ring"],
]


@pytest.mark.parametrize("name", NAMES)
def test_a_picture_is_of_the_present_law(name: str) -> None:
    """`python scripts/scene_pictures.py` makes them anew where this fails."""
    image = pytest.importorskip("PIL.Image")
    with image.open(DOCS / "results" / f"{name}.png") as picture:
        law = gc.Scene.load(EXAMPLES / f"{name}.toml").native.law
        assert picture.text.get("Law") == str(law)


def test_every_picture_of_a_scene_is_looked_at() -> None:
    text = (DOCS / "scenes.md").read_text(encoding="utf-8")
    shown = re.findall(r"!\[[^\]]*\]\(results/(\w+)\.png\)", text)
    assert sorted(shown) == sorted(NAMES)
