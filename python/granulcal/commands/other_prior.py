"""In what the prior of pours differs from a model's, for the words that take pours of `generate`."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from granulcal.prior import Prior

__all__ = ["difference"]


def difference(found: "Prior", own: "Prior") -> str:
    """Returns in what the prior `found` of pours differs from a model's `own`; empty if in nothing."""
    if found.to_toml() == own.to_toml():
        return ""
    there, here = (
        {each.path: each.in_words for each in prior.parameters} for prior in (found, own)
    )
    differ = [
        f"{path} is {there.get(path, 'not named')} there and {here.get(path, 'not named')} in the "
        "model"
        for path in {**here, **there}
        if there.get(path) != here.get(path)
    ]
    return "; ".join(differ) or "its parameters are in another order"
