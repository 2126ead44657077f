"""The picture of the house: the crates of the workspace, and the floors inside of `dem`.

An arrow that follows from two others is left out, so that what is drawn can be read.
"""

from dataclasses import dataclass
from html import escape

from floors import Floor
from graph import Arrows

WIDTH, ROW, HEIGHT, GAP = 980, 74, 30, 14
LABEL = 190
STYLE = """
  text { font: 14px sans-serif; fill: #222; text-anchor: middle; dominant-baseline: central }
  .title { font-weight: bold; text-anchor: start }
  .floor { font-size: 12px; fill: #666; text-anchor: start }
  rect { fill: #f4f7fb; stroke: #46627f; stroke-width: 1.2; rx: 5 }
  line, .bow { stroke: #46627f; stroke-width: 1; opacity: 0.45; marker-end: url(#tip) }
  .bow { fill: none }
  .tip { fill: #46627f }
"""


@dataclass(frozen=True)
class Box:
    """A name at its place: the middle of its upper edge, and its width."""

    name: str
    x: float
    y: float
    width: float


def draw(crates: Arrows, floors: list[Floor], modules: Arrows) -> str:
    """Returns both pictures, one above the other, as one SVG."""
    names = {name: name.removeprefix("granulcal-") for name in crates}
    named = {names[a]: {names[b] for b in uses} for a, uses in crates.items()}
    upper = [("", tuple(row)) for row in rows(named)]
    lower = [(floor.name, floor.modules) for floor in reversed(floors)]
    top, end = panel("The crates", upper, named, 20)
    bottom, end = panel("The floors of dem", lower, modules, end + 30)
    body = "\n".join([*top, *bottom])
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {end + 10:.0f}" '
        f'role="img" aria-label="Crates and floors of granulcal">\n<style>{STYLE}</style>\n'
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" '
        'markerHeight="7" orient="auto"><path class="tip" d="M0 0 L8 4 L0 8 z"/></marker></defs>\n'
        f'<rect width="100%" height="100%" style="fill: white; stroke: none; rx: 0"/>\n'
        f"{body}\n</svg>\n"
    )


def panel(
    title: str, levels: list[tuple[str, tuple[str, ...]]], arrows: Arrows, top: float
) -> tuple[list[str], float]:
    """Returns the lines of one picture and where it ends."""
    lines = [f'<text class="title" x="20" y="{top:.0f}">{escape(title)}</text>']
    boxes: dict[str, Box] = {}
    for number, (label, names) in enumerate(levels):
        y = top + 22 + number * ROW
        if label:
            lines.append(
                f'<text class="floor" x="20" y="{y + HEIGHT / 2:.0f}">{escape(label)}</text>'
            )
        boxes |= {box.name: box for box in placed(names, y)}
    for name, uses in sorted(reduced(arrows).items()):
        lines += [arrow(boxes[name], boxes[other]) for other in sorted(uses)]
    for box in boxes.values():
        lines.append(
            f'<rect x="{box.x - box.width / 2:.1f}" y="{box.y:.0f}" width="{box.width:.1f}" '
            f'height="{HEIGHT}"/><text x="{box.x:.1f}" y="{box.y + HEIGHT / 2:.0f}">'
            f"{escape(box.name)}</text>"
        )
    return lines, top + 22 + len(levels) * ROW - ROW + HEIGHT


def placed(names: tuple[str, ...], y: float) -> list[Box]:
    """Returns boxes side by side about the middle of what the labels leave free."""
    widths = [18 + 8.2 * len(name) for name in names]
    spare = WIDTH - LABEL - 20 - sum(widths)
    gap = min(60.0, max(GAP, spare / max(len(names), 1)))
    at = LABEL + (WIDTH - LABEL - 20 - sum(widths) - gap * (len(names) - 1)) / 2
    found = []
    for name, width in zip(names, widths, strict=True):
        found.append(Box(name, at + width / 2, y, width))
        at += width + gap
    return found


def arrow(from_: Box, to: Box) -> str:
    """Returns a line from a box to one that it uses, below it; a bow to one on the same floor."""
    foot = from_.y + HEIGHT
    if from_.y != to.y:
        return f'<line x1="{from_.x:.1f}" y1="{foot:.0f}" x2="{to.x:.1f}" y2="{to.y:.0f}"/>'
    middle, depth = (from_.x + to.x) / 2, foot + 12 + abs(from_.x - to.x) / 16
    return (
        f'<path class="bow" d="M{from_.x:.1f} {foot:.0f} Q{middle:.1f} {depth:.0f} '
        f'{to.x:.1f} {foot:.0f}"/>'
    )


def rows(arrows: Arrows) -> list[list[str]]:
    """Returns names in rows, each below all that use it, the uppermost first."""
    depth: dict[str, int] = {}

    def below(name: str) -> int:
        if name not in depth:
            users = [user for user, uses in arrows.items() if name in uses]
            depth[name] = max((below(user) + 1 for user in users), default=0)
        return depth[name]

    for name in arrows:
        below(name)
    found: list[list[str]] = [[] for _ in range(max(depth.values()) + 1)]
    for name in sorted(depth):
        found[depth[name]].append(name)
    return found


def reduced(arrows: Arrows) -> Arrows:
    """Returns the arrows that do not follow from others, of what has no circle."""

    def reached(name: str) -> set[str]:
        found = set(arrows[name])
        for other in arrows[name]:
            found |= reached(other)
        return found

    return {
        name: uses - {far for other in uses for far in reached(other)}
        for name, uses in arrows.items()
    }
