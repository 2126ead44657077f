"""Short names tell parameters apart."""

import pytest

from granulcal.short_names import short_names


@pytest.mark.parametrize(
    ("paths", "short"),
    [
        (["material.friction", "start.height"], ["friction", "height"]),
        (
            ["material.friction", "effects.ground.friction", "start.height"],
            ["material.friction", "ground.friction", "height"],
        ),
        # One is the end of the other.
        (["friction", "a.friction"], ["friction", "a.friction"]),
        (["a.b.c", "x.b.c"], ["a.b.c", "x.b.c"]),
        (["a.b", "a.b"], ["b", "b"]),
        ([], []),
    ],
)
def test_names_are_as_short_as_they_can_be(paths: list[str], short: list[str]) -> None:
    assert short_names(paths) == short
