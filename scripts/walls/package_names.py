"""Public names of a Python package, read from its sources."""

import ast
from pathlib import Path

from changelog import Changelog

PACKAGE = "granulcal"


def gone(before: Path, now: Path, changelog: Changelog) -> tuple[list[str], int]:
    """Returns the names that are neither there nor in the changelog, and how many there were."""
    old, new = modules(before / "python"), modules(now / "python")
    found, count = [], 0
    for module, tree in old.items():
        home = changelog.homes.get(module, module)
        there = members(new[home]) if home in new else None
        for name, inside in sorted(public(tree).items()):
            count += 1 + len(inside)
            whole = f"{module}.{name}" if module else name
            if changelog.names(whole, f"{PACKAGE}.{whole}"):
                continue
            if there is None and changelog.names(module, f"{PACKAGE}.{module}"):
                continue
            if there is None or name not in there:
                if changelog.names(name):
                    continue
                found.append(f"{PACKAGE}.{whole}")
                continue
            kept = followed(new, home, name)
            lost = inside - kept if kept is not None else set()
            found += [
                f"{PACKAGE}.{whole}.{member}"
                for member in sorted(lost)
                if not changelog.names(f"{name}.{member}", f"{whole}.{member}", member)
            ]
    return found, count


def modules(root: Path) -> dict[str, ast.Module]:
    """Returns the public modules by their name behind the package's; the package itself is ''."""
    found = {}
    for path in sorted((root / PACKAGE).rglob("*.py")):
        parts = path.relative_to(root / PACKAGE).with_suffix("").parts
        parts = parts[:-1] if parts[-1] == "__init__" else parts
        if not any(part.startswith("_") for part in parts):
            found[".".join(parts)] = ast.parse(path.read_text(encoding="utf-8"))
    return found


def public(tree: ast.Module) -> dict[str, set[str]]:
    """Returns what a module says is public, with the public members of what is a class."""
    listed = None
    for node in tree.body:
        if isinstance(node, ast.Assign) and any(
            isinstance(target, ast.Name) and target.id == "__all__" for target in node.targets
        ):
            listed = {str(name) for name in ast.literal_eval(node.value)}
    own = defined(tree)
    names = listed if listed is not None else {name for name in own if not name.startswith("_")}
    return {name: of_class(own.get(name)) for name in names}


def defined(tree: ast.Module) -> dict[str, ast.AST]:
    """Returns what a module defines itself."""
    found: dict[str, ast.AST] = {}
    for node in tree.body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            found[node.name] = node
        elif isinstance(node, ast.Assign):
            found |= {target.id: node for target in node.targets if isinstance(target, ast.Name)}
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            found[node.target.id] = node
    return found


def of_class(node: ast.AST | None) -> set[str]:
    """Returns the public methods and stated attributes of a class."""
    if not isinstance(node, ast.ClassDef):
        return set()
    found = {each.name for each in node.body if isinstance(each, ast.FunctionDef)}
    found |= {
        each.target.id
        for each in node.body
        if isinstance(each, ast.AnnAssign) and isinstance(each.target, ast.Name)
    }
    return {name for name in found if not name.startswith("_")}


def members(tree: ast.Module) -> set[str]:
    """Returns every name that a module has: defined, imported, or loaded when it is asked for."""
    found = set(defined(tree))
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom | ast.Import):
            found |= {(alias.asname or alias.name) for alias in node.names}
    return found | set(public(tree))


def followed(new: dict[str, ast.Module], module: str, name: str) -> set[str] | None:
    """Returns the members of a class, followed to where it is defined; None where it is none."""
    for _ in range(10):
        tree = new.get(module)
        if tree is None:
            return None
        own = defined(tree).get(name)
        if own is not None:
            return inherited(new, module, own) if isinstance(own, ast.ClassDef) else None
        step = imported_from(tree, name)
        if step is None:
            return None
        module, name = step
    return None


def inherited(new: dict[str, ast.Module], module: str, node: ast.ClassDef) -> set[str]:
    """Returns the members of a class with those of its bases; what it sets itself counts, too."""
    found = of_class(node)
    for each in ast.walk(node):
        if isinstance(each, ast.Attribute) and isinstance(each.ctx, ast.Store):
            found.add(each.attr)
    for base in node.bases:
        if isinstance(base, ast.Name):
            found |= followed(new, module, base.id) or set()
    return found


def imported_from(tree: ast.Module, name: str) -> tuple[str, str] | None:
    """Returns module and name of what is imported as `name` from the package."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.ImportFrom) or not (node.module or "").startswith(PACKAGE):
            continue
        for alias in node.names:
            if (alias.asname or alias.name) == name:
                return (node.module or "").removeprefix(PACKAGE).removeprefix("."), alias.name
    return None
