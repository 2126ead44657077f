"""Refuses a site with a link of its own that leads nowhere: pages, pictures and their anchors.

    python scripts/check_site.py build/site

mkdocs looks at links in Markdown; this looks at the pages as a browser gets them, so that
generated pages and the links to Rust's documentation are examined, too. Rust's own pages are left
to rustdoc.
"""

import argparse
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class Page(HTMLParser):
    """Links and anchors of a page."""

    def __init__(self, path: Path) -> None:
        super().__init__(convert_charrefs=True)
        self.links: set[str] = set()
        self.anchors: set[str] = set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Keeps what a tag links to and what may be linked to."""
        for name, value in attrs:
            if not value:
                continue
            if name in ("href", "src"):
                self.links.add(value)
            elif name == "id" or (name == "name" and tag == "a"):
                self.anchors.add(value)


def broken(site: Path) -> list[str]:
    """Returns a line for each link that leads nowhere."""
    # The page of a wrong address is served at any address: its links begin at the site's root.
    pages = [p for p in sorted(site.rglob("*.html")) if not _is_rust(site, p) and p.stem != "404"]
    read = {page.resolve(): Page(page) for page in pages}
    found = []
    for page in pages:
        for link in sorted(read[page.resolve()].links):
            fault = _fault(page.resolve(), link, read)
            if fault is not None:
                found.append(f"{page.relative_to(site)}: {link} {fault}")
    return found


def _fault(page: Path, link: str, read: dict[Path, Page]) -> str | None:
    """Returns what is wrong with a link of a page; None if nothing, or if it leads elsewhere."""
    parts = urlsplit(link)
    if parts.scheme or parts.netloc:
        return None
    target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
    if target.is_dir():
        target = target / "index.html"
    if not target.exists():
        return "is not there"
    # Names that begin so are the theme's own: its script makes them.
    if not parts.fragment or parts.fragment.startswith("__") or target not in read:
        return None
    return None if unquote(parts.fragment) in read[target].anchors else "has no such anchor"


def _is_rust(site: Path, page: Path) -> bool:
    return page.relative_to(site).parts[0] == "rust"


def main() -> int:
    """Prints what is broken; returns 1 if anything is."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("site", type=Path, help="folder of the site")
    lines = broken(parser.parse_args().site)
    print("\n".join(lines), file=sys.stderr)
    return 1 if lines else 0


if __name__ == "__main__":
    raise SystemExit(main())
