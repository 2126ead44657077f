"""Colours and dashes of pours and of numbers of grains, as many as there may be."""

__all__ = ["colour_of", "line_of"]

_COLOURS = ("#1f5f8b", "#c8742b", "#4a8c4a", "#8b4a8b", "#8b1f3d", "#5b5b5b")
_STYLES = ("-", "--", "-.", ":")


def colour_of(i: int) -> str:
    """Returns the colour of line or circle i; from the seventh on they come again."""
    return _COLOURS[i % len(_COLOURS)]


def line_of(i: int) -> tuple[str, str]:
    """Returns colour and dashes of line i: no two of the first 24 are alike."""
    return colour_of(i), _STYLES[i // len(_COLOURS) % len(_STYLES)]
