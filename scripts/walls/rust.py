"""Which file of a crate uses which: what it names, followed to where that is defined.

A `mod` line alone is no arrow, nor is what is handed on and not used. What is compiled for tests
alone is not examined: a test may reach up.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path

from graph import Arrows

PATH = re.compile(r"\b(?:crate|self|super)(?:::\w+)+|(?<![\w:.])[a-z_]\w*(?:::\w+)+")
USE = re.compile(r"^[ \t]*(?P<public>pub(?:\([^)]*\))? )?use (?P<tree>[^;]+);", re.MULTILINE)
CHILD = re.compile(r"^[ \t]*(?:pub(?:\([^)]*\))? )?mod (\w+);", re.MULTILINE)
TEST = re.compile(r"#\[cfg\((?:all\()?test\b[^\]]*\]\s*(?:#\[[^\]]*\]\s*)*")
DEFINITION = r"\b(?:fn|struct|enum|trait|type|const|static|macro_rules!|union)\s+{}\b"
COMMENT, STRING = r"//[^\n]*|/\*.*?\*/", r'r(?P<hash>#*)".*?"(?P=hash)|"(?:\\.|[^"\\])*"'
NOISE = re.compile(rf"{COMMENT}|{STRING}|'(?:\\.|[^'\\])'", re.DOTALL)

Module = tuple[str, ...]


@dataclass
class File:
    """One file as a module: what it imports, what it hands on, which modules are its children."""

    path: Path
    text: str
    children: set[str] = field(default_factory=set)
    imports: dict[str, Module] = field(default_factory=dict)
    handed_on: dict[str, Module] = field(default_factory=dict)
    all_of: list[Module] = field(default_factory=list)
    all_handed_on: list[Module] = field(default_factory=list)

    @property
    def body(self) -> str:
        """The text without its imports."""
        return USE.sub(" ", self.text)

    def defines(self, name: str) -> bool:
        """Returns whether a name is defined here."""
        return re.search(DEFINITION.format(re.escape(name)), self.text) is not None


def arrows_of(crate: Path) -> Arrows:
    """Returns which file uses which, as paths relative to the crate's `src`."""
    source = crate / "src"
    files = read(source)
    arrows: Arrows = {}
    for module, file in files.items():
        uses = arrows.setdefault(file.path.relative_to(source).as_posix(), set())
        for path in named(module, file):
            target = resolve(files, path)
            if target != module:
                uses.add(files[target].path.relative_to(source).as_posix())
    return arrows


def read(source: Path) -> dict[Module, File]:
    """Returns every module of a crate that is not compiled for tests alone."""
    files: dict[Module, File] = {}
    roots = [source / name for name in ("lib.rs", "main.rs") if (source / name).exists()]
    waiting: list[tuple[Module, Path]] = [((), root) for root in roots[:1]]
    while waiting:
        module, path = waiting.pop()
        text = without_tests(NOISE.sub(" ", path.read_text(encoding="utf-8")))
        file = files[module] = File(path, text, children=set(CHILD.findall(text)))
        is_folder = path.name in ("lib.rs", "main.rs", "mod.rs")
        folder = path.parent if is_folder else path.with_suffix("")
        for child in sorted(file.children):
            inside = [folder / f"{child}.rs", folder / child / "mod.rs"]
            waiting += [((*module, child), at) for at in inside if at.exists()]
        for use in USE.finditer(text):
            for names, alias in branches(use["tree"]):
                target = absolute(module, file, names)
                if target is not None:
                    take(file, target, alias, is_public=use["public"] is not None)
    return files


def take(file: File, target: Module, alias: str, *, is_public: bool) -> None:
    """Notes one import."""
    if alias == "*":
        file.all_of.append(target[:-1])
        if is_public:
            file.all_handed_on.append(target[:-1])
        return
    file.imports[alias] = target
    if is_public:
        file.handed_on[alias] = target


def without_tests(text: str) -> str:
    """Cuts out what follows a `cfg(test)`: a block in braces, or up to the semicolon."""
    while found := TEST.search(text):
        end = re.compile(r"[{;]").search(text, found.end())
        at = len(text) if end is None else end.end()
        depth = int(end is not None and end[0] == "{")
        while depth:
            brace = re.compile(r"[{}]").search(text, at)
            if brace is None:
                at = len(text)
                break
            depth += 1 if brace[0] == "{" else -1
            at = brace.end()
        text = text[: found.start()] + text[at:]
    return text


def branches(tree: str) -> list[tuple[Module, str]]:
    """Returns the paths of a `use`, each with the name that it has here."""
    tree = tree.strip()
    if "{" not in tree:
        path, _, alias = tree.partition(" as ")
        names = tuple(part.strip() for part in path.split("::"))
        return [(names, alias.strip() or names[-1])]
    before, _, inside = tree.partition("{")
    prefix = tuple(part for part in before.strip().removesuffix("::").split("::") if part)
    found, depth, part = [], 0, ""
    for letter in inside.rstrip()[:-1] + ",":
        depth += {"{": 1, "}": -1}.get(letter, 0)
        if letter != "," or depth:
            part += letter
            continue
        if part.strip() == "self":
            found.append((prefix, prefix[-1]))
        elif part.strip():
            found += [((*prefix, *rest), alias) for rest, alias in branches(part)]
        part = ""
    return found


def absolute(module: Module, file: File, names: Module) -> Module | None:
    """Returns a path from the crate's root; None for another crate's."""
    if names[0] == "crate":
        return names[1:]
    if names[0] in ("self", "super"):
        up, rest = module, names
        while rest and rest[0] in ("self", "super"):
            up, rest = (up[:-1] if rest[0] == "super" else up), rest[1:]
        return (*up, *rest)
    return (*module, *names) if names[0] in file.children else None


def named(module: Module, file: File) -> set[Module]:
    """Returns every path from the crate's root that a file uses."""
    body = file.body
    # What is only handed on is an arrow of those who take it from here.
    found = {
        target
        for alias, target in file.imports.items()
        if alias not in file.handed_on or re.search(rf"\b{alias}\b", body)
    }
    found |= set(file.all_of) - set(file.all_handed_on)
    for path in PATH.findall(body):
        names = tuple(path.split("::"))
        whole = absolute(module, file, names)
        if whole is None and names[0] in file.imports:
            whole = (*file.imports[names[0]], *names[1:])
        if whole is not None:
            found.add(whole)
    return found


def resolve(files: dict[Module, File], path: Module, depth: int = 0) -> Module:
    """Returns the module in whose file the thing that a path names is defined."""
    module, rest = (), path
    while rest and (*module, rest[0]) in files:
        module, rest = (*module, rest[0]), rest[1:]
    # A circle of names that are handed on has no end.
    if not rest or depth > len(files):
        return module
    file = files[module]
    if rest[0] in file.handed_on:
        return resolve(files, (*file.handed_on[rest[0]], *rest[1:]), depth + 1)
    if file.defines(rest[0]):
        return module
    for other in file.all_of:
        target = resolve(files, (*other, *rest), depth + 1)
        if files[target].defines(rest[0]):
            return target
    if rest[0] in file.imports:
        return resolve(files, (*file.imports[rest[0]], *rest[1:]), depth + 1)
    return module
