"""Which file of a Python package imports which, followed to where a name is defined.

An import inside a function counts, and one for types alone: they hide a circle, they do not open
it. A module that is loaded by its name counts, too: in a file that calls `import_module` every text
that names a module is an arrow, and one that is put together behind a package's name is an arrow to
all modules of that package.
"""

import ast
from pathlib import Path

from graph import Arrows


def arrows_of(package: Path) -> Arrows:
    """Returns which file imports which, as paths relative to the package's folder."""
    files = {module_of(package, path): path for path in sorted(package.rglob("*.py"))}
    trees = {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in files.items()}
    handed_on = {name: aliases(tree) for name, tree in trees.items()}
    arrows: Arrows = {}
    for name, tree in trees.items():
        own = files[name].relative_to(package).as_posix()
        uses = arrows.setdefault(own, set())
        is_package = files[name].name == "__init__.py"
        for wanted in imports(tree) + loaded_by_name(tree, handed_on[name], set(files)):
            target = resolve(handed_on, files, wanted)
            if target is None or target == name or (is_package and target.startswith(f"{name}.")):
                continue
            uses.add(files[target].relative_to(package).as_posix())
    return arrows


def module_of(package: Path, path: Path) -> str:
    """Returns the dotted name of a file."""
    parts = path.relative_to(package.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports(tree: ast.Module) -> list[str]:
    """Returns the dotted names that a file imports."""
    found = []
    waiting: list[ast.AST] = list(tree.body)
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found += [f"{node.module}.{alias.name}" for alias in node.names]
        waiting += ast.iter_child_nodes(node)
    return found


def loaded_by_name(tree: ast.Module, known: dict[str, str], modules: set[str]) -> list[str]:
    """Returns the modules whose names stand as text in a file that loads modules by name."""
    nodes = list(ast.walk(tree))
    called = {node.func for node in nodes if isinstance(node, ast.Call)}
    names = {node.attr for node in called if isinstance(node, ast.Attribute)}
    names |= {node.id for node in called if isinstance(node, ast.Name)}
    if "import_module" not in names:
        return []
    local = known | {name.rpartition(".")[2]: name for name in imports(tree)}
    found = []
    for node in nodes:
        if isinstance(node, ast.Constant) and node.value in modules:
            found.append(node.value)
        elif isinstance(node, ast.JoinedStr):
            package = beginning(node, local).rstrip(".")
            found += [each for each in modules if package and each.rpartition(".")[0] == package]
    return found


def beginning(text: ast.JoinedStr, local: dict[str, str]) -> str:
    """Returns what a text that is put together begins with; a module's `__name__` is its name."""
    first = text.values[0] if text.values else None
    if isinstance(first, ast.Constant):
        return str(first.value)
    value = first.value if isinstance(first, ast.FormattedValue) else None
    if isinstance(value, ast.Attribute) and value.attr == "__name__":
        return local.get(value.value.id, "") if isinstance(value.value, ast.Name) else ""
    return ""


def aliases(tree: ast.Module) -> dict[str, str]:
    """Returns what a file's own imports are called in it."""
    found = {}
    for node in tree.body:
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            for alias in node.names:
                found[alias.asname or alias.name] = f"{node.module}.{alias.name}"
    return found


def resolve(
    handed_on: dict[str, dict[str, str]], files: dict[str, Path], wanted: str, depth: int = 0
) -> str | None:
    """Returns the module that defines what a dotted name means; None outside of the package."""
    if wanted in files:
        return wanted
    module, _, name = wanted.rpartition(".")
    if not module or depth > 20:
        return None
    if module in files:
        further = handed_on[module].get(name)
        if further is not None:
            return resolve(handed_on, files, further, depth + 1) or module
        return module
    return resolve(handed_on, files, module, depth + 1)
