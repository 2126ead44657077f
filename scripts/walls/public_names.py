"""Tells which public names are gone since a commit without a word in the changelog's migrations.

    python scripts/walls/public_names.py COMMIT

A name is what stands in the `__all__` of a module of Python, with the public members of its
classes, and what the root of a crate hands on. One that is gone is told unless CHANGELOG.md has it
between backticks, alone or behind its module or class; a module that moved is looked for on the
shelf that the changelog's table names. Needs git and the standard library.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import crate_names
import package_names
from changelog import Changelog

ROOT = Path(__file__).parents[2]


def main() -> int:
    """Prints what is gone and named nowhere, one a line; 1 if anything is."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("commit", help="what the names of today are compared with")
    parser.add_argument("--root", type=Path, default=ROOT, help="folder of the workspace")
    options = parser.parse_args()
    root, commit = options.root, options.commit
    changelog = Changelog((root / "CHANGELOG.md").read_text(encoding="utf-8"))
    with tempfile.TemporaryDirectory() as folder:
        before = Path(folder)
        tree = ["git", "-C", str(root), "archive", commit, "crates", "python"]
        with subprocess.Popen(tree, stdout=subprocess.PIPE) as archive:
            subprocess.run(["tar", "-x", "-C", folder], stdin=archive.stdout, check=True)
        if archive.returncode:
            return 2
        gone, count = package_names.gone(before, root, changelog)
        gone_of_rust, count_of_rust = crate_names.gone(before, root, changelog)
    for name in gone + gone_of_rust:
        print(f"{name} is gone, and CHANGELOG.md has no migration of it", file=sys.stderr)
    print(f"{count} names of Python and {count_of_rust} of Rust at {commit}")
    return 1 if gone or gone_of_rust else 0


if __name__ == "__main__":
    raise SystemExit(main())
