"""The surrogate of all pours of an archive."""

from collections.abc import Callable

from granulcal.loop.pours.archive import Archive
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.one_thread import one_thread

__all__ = ["fit_surrogate"]


@one_thread()
def fit_surrogate(store: Archive, *, seed: int, say: Callable[[str], None] = print) -> Surrogate:
    """Returns the surrogate of all pours of an archive."""
    rows = store.pours()
    say(f"surrogate of {len(rows)} pours (left out: {rows.left_out})")
    return Surrogate.fit(
        store.plan.design,
        rows.theta,
        rows.condition,
        rows.psi,
        rows.x,
        names=rows.names,
        pour=rows.pour,
        seed=seed,
    )
