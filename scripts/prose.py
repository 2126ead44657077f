"""Holds lines of prose to 120 characters in every Markdown file that git tracks.

`make lint` runs it. With `--wrap` it fills the paragraphs anew that have a longer line. Code,
tables, formulas, headings and pictures may be longer. It needs only the standard library and git.
"""

import argparse
import re
import subprocess
import sys
import textwrap
from pathlib import Path

ROOT = Path(__file__).parents[1]
LONGEST = 120
NO_PROSE = re.compile(r"\s*(\||\$\$|#|!\[[^\]]*\]\([^)]*\)$)| {4}")
FENCE = re.compile(r"\s*(```|~~~)")
# What begins a block of its own: a bullet, a number, a quotation.
BEGINS = re.compile(r"\s*([-*+] |\d+\. |> ?)")


def main() -> int:
    """Prints lines that are too long, or fills their paragraphs anew; 1 if any remain."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--wrap", action="store_true", help="fill the paragraphs anew")
    options = parser.parse_args()
    told = subprocess.run(
        ["git", "ls-files", "-z", "*.md"], cwd=ROOT, check=True, capture_output=True, text=True
    )
    found = 0
    for name in filter(None, told.stdout.split("\0")):
        path = ROOT / name
        lines = path.read_text(encoding="utf-8").split("\n")
        if options.wrap:
            filled = wrapped(lines)
            if filled != lines:
                path.write_text("\n".join(filled), encoding="utf-8")
            lines = filled
        for number in too_long(lines):
            found += 1
            got = len(lines[number])
            print(f"{name}:{number + 1}: {got} characters of {LONGEST}", file=sys.stderr)
    return 1 if found else 0


def prose(lines: list[str]) -> list[bool]:
    """Returns which lines are prose."""
    is_prose, fenced = [], False
    for line in lines:
        fence = FENCE.match(line) is not None
        fenced ^= fence
        is_prose.append(not (fence or fenced or not line.strip() or NO_PROSE.match(line)))
    return is_prose


def too_long(lines: list[str]) -> list[int]:
    """Returns the numbers of lines of prose that are too long, from 0."""
    is_prose = prose(lines)
    return [i for i, line in enumerate(lines) if is_prose[i] and len(line) > LONGEST]


def wrapped(lines: list[str]) -> list[str]:
    """Returns the lines with every paragraph filled anew that has one that is too long."""
    while long := too_long(lines):
        is_prose, first = prose(lines), long[0]
        while not BEGINS.match(lines[first]) and first > 0 and is_prose[first - 1]:
            first -= 1
        last = long[0] + 1
        while last < len(lines) and is_prose[last] and not BEGINS.match(lines[last]):
            last += 1
        head = BEGINS.match(lines[first])
        begin = head.group() if head else lines[first][: -len(lines[first].lstrip())]
        rest = begin if begin.strip() == ">" else " " * len(begin)
        text = " ".join(line.strip() for line in lines[first:last])[len(begin.lstrip()) :]
        filled = textwrap.wrap(
            text, LONGEST, initial_indent=begin, subsequent_indent=rest,
            break_long_words=False, break_on_hyphens=False,
        )  # fmt: skip
        if filled == lines[first:last]:
            break
        lines = lines[:first] + filled + lines[last:]
    return lines


if __name__ == "__main__":
    raise SystemExit(main())
