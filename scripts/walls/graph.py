"""Arrows between named things: their circles."""

Arrows = dict[str, set[str]]


def circles(arrows: Arrows) -> list[list[str]]:
    """Returns the sets of more than one name that reach each other, each sorted (Tarjan 1972)."""
    index: dict[str, int] = {}
    lowest: dict[str, int] = {}
    stack: list[str] = []
    on_stack: set[str] = set()
    found: list[list[str]] = []

    def visit(name: str) -> None:
        index[name] = lowest[name] = len(index)
        stack.append(name)
        on_stack.add(name)
        for other in sorted(arrows.get(name, ())):
            if other not in index:
                visit(other)
                lowest[name] = min(lowest[name], lowest[other])
            elif other in on_stack:
                lowest[name] = min(lowest[name], index[other])
        if lowest[name] == index[name]:
            circle = []
            while True:
                circle.append(stack.pop())
                on_stack.discard(circle[-1])
                if circle[-1] == name:
                    break
            if len(circle) > 1:
                found.append(sorted(circle))

    for name in sorted(arrows):
        if name not in index:
            visit(name)
    return found


def shortest_circle(arrows: Arrows, names: list[str]) -> list[str]:
    """Returns a shortest way from one of `names`, which reach each other, back to itself."""
    inside = set(names)
    best: list[str] = []
    for start in names:
        ways = [[start]]
        seen = {start}
        while ways:
            way = ways.pop(0)
            for other in sorted(arrows.get(way[-1], set()) & inside):
                if other == start and (not best or len(way) + 1 < len(best)):
                    best = [*way, start]
                    ways = []
                    break
                if other not in seen:
                    seen.add(other)
                    ways.append([*way, other])
    return best
