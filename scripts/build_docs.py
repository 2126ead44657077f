"""Collects the pages of the site in build/docs: docs/, README, the command line's own help.

    make docs

The pages of theory and results are found by their folders. Links out of docs/ lead to the
repository.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
OUT = ROOT / "build" / "docs"
PICTURES = "https://raw.githubusercontent.com/granulcal/granulcal/main/docs"
REPOSITORY = "https://github.com/granulcal/granulcal/blob/main"


def main() -> int:
    """Writes build/docs and build/mkdocs.yml; returns the exit code."""
    shutil.rmtree(OUT, ignore_errors=True)
    shutil.copytree(ROOT / "docs", OUT)
    (OUT / "index.md").write_text(start(), encoding="utf-8")
    for page in OUT.rglob("*.md"):
        text = linked(named(page.read_text(encoding="utf-8"), page.parent), page.parent)
        page.write_text(text, encoding="utf-8")
    add_film(OUT / "gallery.md")
    (OUT / "commands.md").write_text(commands(), encoding="utf-8")
    (OUT / "api.md").write_text(api(), encoding="utf-8")
    (OUT / "rust.md").write_text(rust(), encoding="utf-8")
    write_navigation()
    return 0


def start() -> str:
    """Returns the README as the first page: pictures from here, no table of contents beside it."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8").replace("](docs/", "](")
    return f"---\nhide:\n  - toc\n---\n\n{readme.replace(f'({PICTURES}/', '(')}"


def add_film(gallery: Path) -> None:
    """Films a pour of today's simulator and puts it on top of the gallery."""
    name = "results/pour.gif"
    told("film", "funnel", "--width", "420", "--fps", "12", "-o", str(OUT / name))
    text = gallery.read_text(encoding="utf-8")
    title, rest = text.split("\n", 1)
    picture = f"![A pour through the paper's funnel, seen from the side]({name})"
    gallery.write_text(f"{title}\n\n{picture}\n{rest}", encoding="utf-8")


def named(text: str, folder: Path) -> str:
    """Returns a page on which the name of another page, as docs/guide.md, is a link to it."""

    def lead(match: re.Match[str]) -> str:
        place = OUT / match.group(1)
        if not place.exists():
            return match.group(0)
        return f"[{match.group(0)}]({os.path.relpath(place, folder)})"

    # Not inside of links and listings.
    pattern = r"(?<![\w/(\[`])`?docs/([\w/-]+\.md)`?(?![\w\])])"
    parts = re.split(r"(^```.*?^```|^ {4}.*?$|\[[^\]]*\]\([^)]*\))", text, flags=re.S | re.M)
    return "".join(part if i % 2 else re.sub(pattern, lead, part) for i, part in enumerate(parts))


def linked(text: str, folder: Path) -> str:
    """Returns a page whose links to files outside of docs/ lead to the repository."""

    def lead(match: re.Match[str]) -> str:
        target = match.group(2)
        if re.match(r"[a-z]+:|#", target) or (folder / target.split("#")[0]).exists():
            return match.group(0)
        inside = os.path.normpath(Path("docs") / folder.relative_to(OUT) / target)
        return f"{match.group(1)}({REPOSITORY}/{inside})"

    return re.sub(r"(\[[^\]]*\])\(([^)\s]+)\)", lead, text)


def commands() -> str:
    """Returns the help of every command, as the commands print it."""
    parts = ["# Command line", "", "As `granulcal COMMAND --help` prints it.", ""]
    parts += ["```text", told("--help"), "```", ""]
    names = re.findall(r"^  ([a-z][a-z-]+)  ", told("--help").partition("Commands:")[2], flags=re.M)
    for name in names:
        if name == "help":
            continue
        parts += [f"## granulcal {name}", "", "```text", told(name, "--help"), "```", ""]
        inner = {"design": ("rings", "spill"), "export": ("material", "posterior", "scene", "bed")}
        for word in inner.get(name, ()):
            text = told(name, word, "--help")
            parts += [f"### granulcal {name} {word}", "", "```text", text, "```", ""]
    return "\n".join(parts)


def told(*words: str) -> str:
    """Returns what a command prints, at a width that a page has room for."""
    environment = {**os.environ, "COLUMNS": "100", "NO_COLOR": "1", "TERM": "dumb"}
    command = [sys.executable, "-m", "granulcal.cli", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    return done.stdout.rstrip()


def api() -> str:
    """Returns a page that mkdocstrings fills from the docstrings of all public names."""
    import granulcal

    homes = {name: getattr(granulcal, name) for name in granulcal.__all__ if name != "__version__"}
    lines = ["# Python", "", "Everything that `import granulcal as gc` offers. SI units.", ""]
    for name, thing in sorted(homes.items(), key=lambda pair: pair[0].lower()):
        lines += [f"::: {thing.__module__}.{name}", ""]
    return "\n".join(lines)


def rust() -> str:
    """Returns a page that leads to the documentation of each crate, which `make docs` adds."""
    lines = ["# Rust", "", "The simulator, its images and its files, without Python.", ""]
    lines += ["| crate | what |", "|---|---|"]
    for manifest in sorted((ROOT / "crates").glob("*/Cargo.toml")):
        table = tomllib.loads(manifest.read_text(encoding="utf-8"))
        package, name = table["package"], table["package"]["name"]
        if table.get("lib", {}).get("crate-type") == ["cdylib"]:
            # Python's module: its page is that of Python.
            continue
        # HTML: the pages are not there yet when the links of Markdown are examined.
        place = f"rust/{name.replace('-', '_')}/index.html"
        lines.append(f'| <a href="{place}">{name}</a> | {package["description"]} |')
    return "\n".join([*lines, ""])


def write_navigation() -> None:
    """Writes mkdocs.yml into build/ with the pages of theory and results in its navigation."""
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    for folder, title in (("theory", "Theory"), ("results", "Results")):
        pages = sorted((OUT / folder).glob("*.md"))
        text += f"  - {title}:\n" + "".join(f"      - {folder}/{page.name}\n" for page in pages)
    text = text.replace("docs_dir: build/docs", "docs_dir: docs").replace(
        "site_dir: build/site", "site_dir: site"
    )
    text = text.replace("paths: [python]", "paths: [../python]")
    (ROOT / "build" / "mkdocs.yml").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__).parse_args()
    raise SystemExit(main())
