"""The checker of the walls finds what it says it finds, in houses that were built for it."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CHECK = ROOT / "scripts" / "walls" / "check.py"

ROOM = '[package]\nname = "{name}"\n[dependencies]\n{uses}\n'
FLOORS = """
[[floor]]
name = "ground"
modules = ["law"]
[[floor]]
name = "roof"
modules = ["pour"]
"""
DENY = '[bans]\ndeny = [{ crate = "granulcal-dem", wrappers = ["granulcal"] }]\n'


def house(root: Path, **files: str) -> Path:
    """Builds a workspace of two crates and a package; `files` replace or add their texts."""
    texts = {
        "Cargo.toml": ROOM.format(name="granulcal", uses='granulcal-dem = "1"'),
        "src/lib.rs": "",
        "deny.toml": DENY,
        "crates/dem/Cargo.toml": ROOM.format(name="granulcal-dem", uses=""),
        "crates/dem/floors.toml": FLOORS,
        "crates/dem/src/lib.rs": "mod law;\nmod pour;\npub use law::Law;\n",
        "crates/dem/src/law.rs": "pub struct Law;\n",
        "crates/dem/src/pour.rs": "use crate::Law;\npub struct Pour(Law);\n",
        "python/granulcal/__init__.py": "from granulcal.a import one\n",
        "python/granulcal/a.py": "one = 1\n",
        "python/granulcal/b.py": "from granulcal import one\ntwo = one + 1\n",
    }
    for path, text in (texts | files).items():
        (root / path).parent.mkdir(parents=True, exist_ok=True)
        (root / path).write_text(text, encoding="utf-8")
    (root / "docs").mkdir()
    return root


def said(root: Path, *options: str) -> tuple[int, str]:
    """Runs the checker; returns its exit code and what it has printed."""
    command = [sys.executable, str(CHECK), "--root", str(root), *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.returncode, done.stderr


def test_this_house_has_its_walls() -> None:
    assert said(ROOT) == (0, "")


def test_a_sound_house_passes_once_it_is_drawn(tmp_path: Path) -> None:
    house(tmp_path)
    code, text = said(tmp_path)
    assert code == 1 and "docs/floors.svg is out of date" in text and text.count("\n") == 1
    assert said(tmp_path, "--draw") == (0, "")
    assert said(tmp_path) == (0, "")
    picture = (tmp_path / "docs/floors.svg").read_text(encoding="utf-8")
    assert all(f">{name}<" in picture for name in ("law", "pour", "ground", "roof", "dem"))
    # One arrow between the crates, one between the modules.
    assert picture.count("<line ") == 2 and 'class="bow"' not in picture


@pytest.mark.parametrize(
    ("path", "text", "expected"),
    [
        # By a name that is handed on, by a path inside of the code, by a path of another's child.
        (
            "crates/dem/src/law.rs",
            "use crate::pour::Pour;\npub struct Law;\n",
            "crates/dem/src: a circle of 2 files, for example law.rs -> pour.rs -> law.rs",
        ),
        (
            "crates/dem/src/law.rs",
            "pub struct Law;\nfn f() { let _ = super::pour::Pour; }\n",
            "crates/dem/src: a circle of 2 files",
        ),
        (
            "crates/dem/floors.toml",
            FLOORS.replace("law", "rest").replace("pour", "law").replace("rest", "pour"),
            "pour (floor 'ground') uses law, which stands above it ('roof')",
        ),
        (
            "crates/dem/floors.toml",
            FLOORS.replace('["pour"]', '["cellar"]'),
            "module pour stands on no floor",
        ),
        (
            "python/granulcal/a.py",
            "one = 1\ndef f():\n    from granulcal.b import two\n",
            "python/granulcal: a circle of 2 files, for example a.py -> b.py -> a.py",
        ),
        # By a module's name, whole or put together.
        (
            "python/granulcal/a.py",
            'import importlib\none = 1\nhome = "granulcal.b"\nimportlib.import_module(home)\n',
            "python/granulcal: a circle of 2 files, for example a.py -> b.py -> a.py",
        ),
        (
            "python/granulcal/a.py",
            "from importlib import import_module\none = 1\n"
            'def f(word):\n    import_module(f"granulcal.{word}")\n',
            "python/granulcal: a circle of 2 files, for example a.py -> b.py -> a.py",
        ),
        (
            "crates/dem/Cargo.toml",
            ROOM.format(name="granulcal-dem", uses="") + '[dev-dependencies]\ngranulcal = "1"\n',
            "deny.toml says nothing of granulcal, which granulcal-dem use",
        ),
        (
            "deny.toml",
            DENY.replace('"granulcal"]', '"granulcal-py"]'),
            "granulcal must not depend on granulcal-dem: deny.toml allows granulcal-py",
        ),
    ],
)
def test_what_breaks_a_wall_is_named(tmp_path: Path, path: str, text: str, expected: str) -> None:
    code, found = said(house(tmp_path, **{path: text}))
    assert code == 1 and expected in found, found


def test_a_public_name_goes_with_a_word_in_the_changelog_alone(tmp_path: Path) -> None:
    old = '__all__ = ["Kept", "lost"]\nclass Kept:\n    def of(self): ...\n\ndef lost(): ...\n'
    house(tmp_path, **{"python/granulcal/a.py": old, "CHANGELOG.md": "# Changelog\n"})
    git = ["git", "-C", str(tmp_path), "-c", "user.name=a", "-c", "user.email=a@b"]
    for words in (["init", "-q"], ["add", "."], ["commit", "-qm", "before"]):
        subprocess.run([*git, *words], check=True)
    (tmp_path / "crates/dem/src/lib.rs").write_text("mod law;\nmod pour;\n")
    (tmp_path / "python/granulcal/a.py").unlink()
    (tmp_path / "python/granulcal/shelf").mkdir()
    (tmp_path / "python/granulcal/shelf/a.py").write_text('__all__ = ["Kept"]\nclass Kept: ...\n')
    names = CHECK.with_name("public_names.py")
    command = [sys.executable, str(names), "HEAD", "--root", str(tmp_path)]

    def gone() -> list[str]:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == bool(done.stderr), done.stderr
        return [line.split()[0] for line in done.stderr.splitlines()]

    assert gone() == ["granulcal.a.Kept", "granulcal.a.lost", "granulcal_dem::Law"]
    table = "| shelf | modules |\n|---|---|\n| `shelf` | `a` |\n\n"
    (tmp_path / "CHANGELOG.md").write_text(table)
    assert gone() == ["granulcal.a.Kept.of", "granulcal.a.lost", "granulcal_dem::Law"]
    (tmp_path / "CHANGELOG.md").write_text(f"{table}`Kept.of`, `a.{{lost, other}}`, `Law`")
    assert gone() == []


@pytest.mark.parametrize(
    "text",
    [
        # A test may reach up, so may a comment and a string; what is only handed on is no arrow.
        "pub struct Law;\n#[cfg(test)]\nmod tests {\n    use crate::pour::Pour;\n}\n",
        'pub struct Law;\n// crate::pour::Pour\nconst A: &str = "crate::pour::Pour";\n',
        "pub struct Law;\npub use crate::pour::Pour;\n",
    ],
)
def test_what_is_no_arrow_is_let_pass(tmp_path: Path, text: str) -> None:
    house(tmp_path, **{"crates/dem/src/law.rs": text})
    assert said(tmp_path, "--draw") == (0, "")
