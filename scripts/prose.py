"""Holds prose to 120 characters a line in every Markdown file and Rust comment that git tracks.

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
COMMENT = re.compile(r"(\s*//[/!]?)(?: |$)")
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
        ["git", "ls-files", "-z", "*.md", "*.rs"],
        cwd=ROOT, check=True, capture_output=True, text=True,
    )  # fmt: skip
    found = 0
    for name in filter(None, told.stdout.split("\0")):
        path = ROOT / name
        if not path.exists():
            continue
        lines = path.read_text(encoding="utf-8").split("\n")
        is_rust = path.suffix == ".rs"
        if options.wrap:
            filled = wrapped_comments(lines) if is_rust else wrapped(lines)
            if filled != lines:
                path.write_text("\n".join(filled), encoding="utf-8")
            lines = filled
        for number in long_comments(lines) if is_rust else too_long(lines):
            found += 1
            got = len(lines[number])
            print(f"{name}:{number + 1}: {got} characters of {LONGEST}", file=sys.stderr)
    return 1 if found else 0


def comments(lines: list[str]) -> list[tuple[int, str, list[str]]]:
    """Returns runs of comments of Rust: the first line, what every line begins with, the rest."""
    found: list[tuple[int, str, list[str]]] = []
    for number, line in enumerate(lines):
        if not (begin := COMMENT.match(line)):
            continue
        text = line[begin.end() :]
        if found and found[-1][0] + len(found[-1][2]) == number and found[-1][1] == begin[1]:
            found[-1][2].append(text)
        else:
            found.append((number, begin[1], [text]))
    return found


def long_comments(lines: list[str]) -> list[int]:
    """Returns the numbers of the lines of Rust whose comment is too long, from 0."""
    return [
        first + i
        for first, begin, text in comments(lines)
        for i in too_long(text, LONGEST - len(begin) - 1)
    ]


def wrapped_comments(lines: list[str]) -> list[str]:
    """Returns the lines of Rust with the paragraphs of comments filled anew that are too long."""
    for first, begin, text in reversed(comments(lines)):
        filled = wrapped(text, LONGEST - len(begin) - 1)
        lines = [
            *lines[:first],
            *(f"{begin} {line}".rstrip() for line in filled),
            *lines[first + len(text) :],
        ]
    return lines


def prose(lines: list[str]) -> list[bool]:
    """Returns which lines are prose."""
    is_prose, fenced = [], False
    for line in lines:
        fence = FENCE.match(line) is not None
        fenced ^= fence
        is_prose.append(not (fence or fenced or not line.strip() or NO_PROSE.match(line)))
    return is_prose


def too_long(lines: list[str], longest: int = LONGEST) -> list[int]:
    """Returns the numbers of lines of prose that are too long, from 0."""
    is_prose = prose(lines)
    return [i for i, line in enumerate(lines) if is_prose[i] and len(line) > longest]


def wrapped(lines: list[str], longest: int = LONGEST) -> list[str]:
    """Returns the lines with every paragraph filled anew that has one that is too long."""
    while long := too_long(lines, longest):
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
            text, longest, initial_indent=begin, subsequent_indent=rest,
            break_long_words=False, break_on_hyphens=False,
        )  # fmt: skip
        if filled == lines[first:last]:
            break
        lines = lines[:first] + filled + lines[last:]
    return lines


if __name__ == "__main__":
    raise SystemExit(main())
