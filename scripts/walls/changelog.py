"""What a changelog says of names: those between backticks, and where modules are now."""

import re

# A name, or names in braces behind what they share.
_BRACES = re.compile(r"(?P<head>[\w.:]*)\{(?P<inside>[^{}]*)\}")
_MOVED = re.compile(r"`([\w.]+)`(?: \(now `(\w+)`\))?")


class Changelog:
    """The names of a changelog.

    Attributes:
        said: every text between backticks, braces multiplied out.
        homes: where a module of Python is now, by where it was, both without `granulcal.`.
    """

    def __init__(self, text: str) -> None:
        """Reads it."""
        self.said: set[str] = set()
        for quoted in re.findall(r"`([^`]+)`", text):
            for found in _BRACES.finditer(quoted):
                inside = found["inside"].split(",")
                self.said |= {found["head"] + name.strip() for name in inside}
            self.said |= {quoted, quoted.partition("(")[0]}
        # `pairs.Calibrated` says Calibrated.
        self.said |= {re.split(r"\.|::", name)[-1] for name in self.said}
        self.homes: dict[str, str] = {}
        table = text.partition("| shelf |")[2].partition("\n\n")[0]
        for line in table.splitlines():
            cells = [cell.strip() for cell in line.split("|")[1:-1]]
            if len(cells) != 2 or not cells[0].startswith("`"):
                continue
            for module, renamed in _MOVED.findall(cells[1]):
                last = renamed or module.rpartition(".")[2]
                self.homes[module] = f"{cells[0].strip('`')}.{last}"

    def names(self, *names: str) -> bool:
        """Returns whether any of `names` stands between backticks or ends a path there."""
        return any(name in self.said for name in names)
