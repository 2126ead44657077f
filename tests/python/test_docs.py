"""The documents: links lead somewhere, and the reference of scenes has every key."""

import re
import subprocess
import tomllib
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import pytest

import granulcal as gc

ROOT = Path(__file__).parents[2]
FENCE = re.compile(r"\s*(```|~~~)")
LINK = re.compile(
    r"\[(?:[^\[\]]|\[[^\[\]]*\])*\]\(<?([^()\s>]*(?:\([^()\s]*\)[^()\s>]*)*)>?[^()]*\)"
)
HEADING = re.compile(r" {0,3}#{1,6}\s+(.*?)\s*#*\s*$")


def tracked() -> list[Path]:
    """Returns the Markdown files that git knows; none where this is no checkout."""
    told = subprocess.run(
        ["git", "ls-files", "-z", "*.md"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    return [ROOT / name for name in told.stdout.split("\0") if name and (ROOT / name).exists()]


def prose(path: Path) -> Iterator[str]:
    """Yields the lines of a file that are not code between fences."""
    is_code = False
    for line in path.read_text(encoding="utf-8").split("\n"):
        if FENCE.match(line):
            is_code = not is_code
        elif not is_code:
            yield line


@cache
def anchors(path: Path) -> frozenset[str]:
    """Returns the anchors that GitHub gives the headings of a file.

    It takes letters to lower case, leaves out what is no letter, digit, hyphen or underscore, and
    makes a hyphen of each space; of equal headings the second has -1.
    """
    found, seen = set(), Counter[str]()
    for line in prose(path):
        if (heading := HEADING.match(line)) is None:
            continue
        text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", heading[1])
        anchor = re.sub(r"[^\w\- ]", "", text.lower()).replace(" ", "-")
        found.add(f"{anchor}-{seen[anchor]}" if seen[anchor] else anchor)
        seen[anchor] += 1
    return frozenset(found)


def links(path: Path) -> Iterator[str]:
    """Yields the targets of a file's links and pictures, which may go over the end of a line."""
    for block in re.split(r"\n\s*\n", "\n".join(prose(path))):
        lines = [line for line in block.split("\n") if not line.startswith("    ")]
        text = re.sub(r"`[^`]*`", "code", "\n".join(lines))
        yield from LINK.findall(text)


def dead(path: Path) -> list[str]:
    """Returns the links of a file that lead to no file, or to no heading of it."""
    found = []
    for target in links(path):
        if re.match(r"[a-z]+:", target):
            continue
        place, _, anchor = unquote(target).partition("#")
        there = (path.parent / place).resolve() if place else path
        if not there.exists() or (anchor and anchor not in anchors(there)):
            found.append(f"{path.relative_to(ROOT)}: {target}")
    return found


def test_links_of_the_documents_lead_somewhere() -> None:
    documents = tracked()
    if not documents:
        pytest.skip("no checkout of git")
    assert sum(len(list(links(path))) for path in documents) > 100
    assert [link for path in documents for link in dead(path)] == []


def test_anchors_are_those_of_github(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "# A ball's end: 1 g (`of_it`)\n\n## Twice\n## Twice\n"
        "```\n# no heading\n```\n[here](#twice-1), [`code`](page.md#a-balls-end-1-g-of_it)\n"
    )
    assert anchors(page) == {"a-balls-end-1-g-of_it", "twice", "twice-1"}
    assert list(links(page)) == ["#twice-1", "page.md#a-balls-end-1-g-of_it"]


@pytest.mark.parametrize("scene", [gc.Scene.funnel(), gc.Scene.drop(0.05)], ids=lambda s: s.name)
def test_the_reference_of_scenes_has_every_key_of_the_built_in_ones(scene: gc.Scene) -> None:
    text = (ROOT / "docs/scenes.md").read_text(encoding="utf-8")
    document = tomllib.loads(scene.to_toml())
    for table, value in document.items():
        assert f"`{table}`" in text or f"[{table}]" in text, table
        # Where the table has a section of its own its keys are rows there.
        start = text.find(f"\n## {table.capitalize()}\n")
        section = text[start : text.find("\n## ", start + 1)] if start >= 0 else text
        for key in value if isinstance(value, dict) else ():
            assert f"`{key}`" in section or f"`{table}.{key}`" in section, f"{table}.{key}"


def test_what_the_page_on_pours_shows_runs_as_it_stands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "docs" / "pours.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```", text, flags=re.S | re.M)
    assert len(blocks) == 5
    shown: dict[str, Any] = {}
    for block in blocks:
        exec(compile(block, "docs/pours.md", "exec"), shown)
    weight = 9.81 * 200 * 1300.0 * np.pi / 6 * 4e-3**3
    carried = shown["contacts"].forces[shown["on_ground"]].sum(axis=0)
    assert carried == pytest.approx([0.0, 0.0, weight], abs=0.01 * weight)
    assert shown["seen"].positions.shape[1:] == (200, 3)
    assert "degrees" in capsys.readouterr().out
    assert (tmp_path / "frames" / "frames.vtk.series").exists() and len(shown["data"]) == 4
