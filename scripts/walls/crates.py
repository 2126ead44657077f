"""Which crate of the workspace may depend on which: `deny.toml` says it, the manifests must agree.

`cargo deny` holds the same list wherever it is installed; this needs no network and no build.
"""

import tomllib
from pathlib import Path

from graph import Arrows

TABLES = ("dependencies", "dev-dependencies", "build-dependencies")


def manifests(root: Path) -> dict[str, Path]:
    """Returns the workspace's packages with their folders."""
    folders = [root, *sorted((root / "crates").iterdir())]
    found = [folder for folder in folders if (folder / "Cargo.toml").exists()]
    return {document(folder / "Cargo.toml")["package"]["name"]: folder for folder in found}


def arrows_of(root: Path) -> Arrows:
    """Returns the packages of the workspace that each depends on."""
    packages = manifests(root)
    arrows: Arrows = {}
    for name, folder in packages.items():
        manifest = document(folder / "Cargo.toml")
        arrows[name] = {other for table in TABLES for other in manifest.get(table, {})}
        arrows[name] &= packages.keys()
    return arrows


def faults(root: Path) -> list[str]:
    """Returns every arrow that `deny.toml` does not allow, and what it says of no arrow at all."""
    bans = document(root / "deny.toml")["bans"]["deny"]
    allowed = {ban["crate"]: set(ban["wrappers"]) for ban in bans}
    arrows = arrows_of(root)
    found = []
    for name in sorted(arrows):
        users = {user for user, uses in arrows.items() if name in uses}
        if users and name not in allowed:
            found.append(f"deny.toml says nothing of {name}, which {listed(users)} use")
            continue
        if new := users - allowed.get(name, set()):
            found.append(
                f"{listed(new)} must not depend on {name}: deny.toml allows {listed(allowed[name])}"
            )
        if unused := allowed.get(name, set()) - users:
            found.append(f"deny.toml allows {listed(unused)} to use {name}, which they do not")
    return found


def document(path: Path) -> dict:
    """Returns a TOML file."""
    return tomllib.loads(path.read_text(encoding="utf-8"))


def listed(names: set[str]) -> str:
    """Returns names as words."""
    return ", ".join(sorted(names))
