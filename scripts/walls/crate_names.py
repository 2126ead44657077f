"""Public names at the roots of a workspace's crates, read from their sources."""

import re
import tomllib
from pathlib import Path

from changelog import Changelog
from rust import CHILD, NOISE, USE, branches, without_tests

_ITEM = re.compile(
    r"^pub (?:const |unsafe |async )*(?:fn|struct|enum|trait|type|const|static|union) (\w+)",
    re.MULTILINE,
)
_MODULE = re.compile(r"^pub mod (\w+);", re.MULTILINE)


def gone(before: Path, now: Path, changelog: Changelog) -> tuple[list[str], int]:
    """Returns the names that are neither there nor in the changelog, and how many there were."""
    old, new = of_workspace(before), of_workspace(now)
    lost = [
        name for name in sorted(old - new) if not changelog.names(name, name.rpartition("::")[2])
    ]
    return lost, len(old)


def of_workspace(root: Path) -> set[str]:
    """Returns what the roots of all crates hand on, with the crate's name in front."""
    found: set[str] = set()
    for manifest in sorted((root / "crates").glob("*/Cargo.toml")):
        lib = manifest.parent / "src" / "lib.rs"
        if lib.exists():
            package = tomllib.loads(manifest.read_text(encoding="utf-8"))["package"]["name"]
            found |= of_file(lib, package.replace("-", "_"))
    return found


def of_file(path: Path, prefix: str) -> set[str]:
    """Returns the public names of a module: its items, what it hands on, its public modules."""
    text = without_tests(NOISE.sub(" ", path.read_text(encoding="utf-8")))
    found = {f"{prefix}::{name}" for name in _ITEM.findall(text)}
    folder = path.parent if path.name in ("lib.rs", "mod.rs") else path.with_suffix("")
    for use in USE.finditer(text):
        if (use["public"] or "").strip() != "pub":
            continue
        for names, alias in branches(use["tree"]):
            if alias != "*":
                found.add(f"{prefix}::{alias}")
            elif names[0] in CHILD.findall(text):
                child = folder.joinpath(*names[:-1]).with_suffix(".rs")
                found |= of_file(child, prefix)
    for name in _MODULE.findall(text):
        for child in (folder / f"{name}.rs", folder / name / "mod.rs"):
            if child.exists():
                found |= of_file(child, f"{prefix}::{name}")
    return found
