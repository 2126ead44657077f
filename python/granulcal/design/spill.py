"""Probability that a pour spills grains, against the height of the funnel."""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from granulcal.design.count_model import CountModel, beta_binomial_tail
from granulcal.design.forecast import SpillForecast
from granulcal.design.posterior_file import PosteriorDraws
from granulcal.design.ring_model import HEIGHT, height_prior
from granulcal.errors import TrainingDataError
from granulcal.pours.kept_pours import KeptPours
from granulcal.pours.left_out import LeftOut
from granulcal.pours.scene import Scene
from granulcal.prior import Parameter, Prior
from granulcal.progress import ProgressLine

if TYPE_CHECKING:
    from granulcal.bayessim.posterior.posterior import Posterior

__all__ = ["design_spill", "forecast_of"]

Array = NDArray[np.float64]

SPILLED = "spilled"
_FEWEST_POURS = 20
_GRID = 61
_GOLDEN = (np.sqrt(5) - 1) / 2
_DRAWS = 1000
# Positive parameters that span more than this are standardised by their logarithm.
_WIDE = 10.0


def design_spill(
    scene: Scene,
    *,
    heights: tuple[float, float] = (0.06, 0.3),
    grains: Sequence[int] = (1, 10, 50),
    pours: int = 200,
    posterior: "Posterior | PosteriorDraws | None" = None,
    out: str | PathLike[str],
    seed: int = 0,
    threads: int | None = None,
    progress: bool = True,
) -> SpillForecast:
    """Returns P(spilled >= k | height) with its uncertainty, from pours at heights between two.

    Stop it anywhere: the same call goes on after the last pour that is kept in `out`.

    Args:
        scene: a funnel, a vessel, and an `observe.spill` table.
        heights: lowest and highest height of the funnel's tip [m].
        grains: numbers k.
        pours: how many; their heights are evenly spread, and more can be added later.
        posterior: of the material, a draw for each pour, and what its prior fixed for all; None:
            the scene's is known.
        out: folder of pours.json.
        seed: seed of every random choice.
        threads: pours at once; the default is one for each core.
        progress: show pours on stderr.

    Raises:
        ValueError: a scene that counts no spilled grains, heights that are no range, a k below 1.
        TrainingDataError: fewer than twenty usable pours.
    """
    draws = None if posterior is None else PosteriorDraws.of(posterior).without(HEIGHT)
    scene = scene if draws is None else draws.on(scene)
    _check(scene, heights, grains, pours)
    # Evenly spread however many there are, so that more pours can be added to those on disk.
    where = heights[0] + (heights[1] - heights[0]) * (_GOLDEN * np.arange(1, pours + 1) % 1)
    chosen = np.empty((pours, 0))
    if draws is not None:
        rows = np.random.default_rng(seed).permutation(len(draws.samples))
        chosen = draws.samples[np.resize(rows, pours)]
    kept = KeptPours(
        scene,
        _named(draws, heights),
        Path(out) / "pours.json",
        seed=seed,
        threads=threads,
        observed=True,
    )
    line = ProgressLine() if progress else None
    resumed = len(kept.rows)
    if line is not None:
        kept.progress = lambda done: line(
            pours, resumed, done - resumed, *kept.left_out(pours, (SPILLED,)).counts
        )
    Path(out).mkdir(parents=True, exist_ok=True)
    try:
        observed = kept(np.column_stack([where, chosen]), 0)
    finally:
        if line is not None:
            line.close()
    counts = observed[:, kept.x_names.index(SPILLED)]
    total = int(scene.get("grains.count"))
    names = () if draws is None else draws.names
    return forecast_of(
        where,
        chosen,
        counts,
        total,
        grains=grains,
        names=names,
        seed=seed,
        unusable=kept.left_out(pours, (SPILLED,)),
    )


def forecast_of(
    heights: Array,
    material: Array,
    counts: Array,
    total: int,
    *,
    grains: Sequence[int],
    names: Sequence[str] = (),
    seed: int = 0,
    unusable: LeftOut | None = None,
) -> SpillForecast:
    """Returns the forecast of counted pours.

    Args:
        heights: of the pours [m], shape (m,).
        material: the material of each pour, drawn from what is believed of it, shape (m, q).
        counts: spilled grains, NaN where the pour cannot be used, shape (m,).
        total: grains of a pour.
        grains: numbers k.
        names: paths of the material's parameters.
        seed: seed of the draws.
        unusable: why some pours cannot be used, where that is known.
    """
    usable = np.isfinite(counts)
    if usable.sum() < _FEWEST_POURS:
        raise TrainingDataError(
            f"a forecast needs at least {_FEWEST_POURS} usable pours, got {int(usable.sum())} "
            f"of {len(counts)}"
        )
    heights, counts, z = heights[usable], counts[usable], _standardised(material[usable])
    model = CountModel.fit(heights, z, counts, total)
    generator = np.random.default_rng((seed, 1))
    coefficients, rho = model.draw(_DRAWS, generator)
    believed = z[generator.integers(len(z), size=_DRAWS)]
    grid = np.linspace(heights.min(), heights.max(), _GRID)
    shares = model.shares(grid, believed, coefficients)
    tails = [beta_binomial_tail(k, total, shares, rho) for k in grains]
    return SpillForecast(
        heights=grid,
        grains=tuple(int(k) for k in grains),
        probability=np.array([tail.mean(axis=1) for tail in tails]),
        low=np.array([np.quantile(tail, 0.05, axis=1) for tail in tails]),
        high=np.array([np.quantile(tail, 0.95, axis=1) for tail in tails]),
        expected=total * shares.mean(axis=1),
        poured_heights=heights,
        spilled=counts,
        total=total,
        rho=model.rho,
        names=tuple(names),
        unusable=LeftOut(unseen=int((~usable).sum())) if unusable is None else unusable,
    )


def _check(scene: Scene, heights: tuple[float, float], grains: Sequence[int], pours: int) -> None:
    if SPILLED not in scene.observed_names:
        raise ValueError(
            f"scene {scene.name!r} has no [observe.spill] table, so no grain counts as spilled"
        )
    scene.get(HEIGHT)
    low, high = heights
    if not 0 < low < high:
        raise ValueError(f"heights must be positive and rising [m], got {low} and {high}")
    total = int(scene.get("grains.count"))
    wrong = [k for k in grains if not 1 <= k <= total]
    if wrong or not grains:
        raise ValueError(f"grains must be from 1 to {total}, got {list(grains)}")
    if pours < _FEWEST_POURS:
        raise ValueError(f"pours must be at least {_FEWEST_POURS}, got {pours}")


def _named(draws: PosteriorDraws | None, heights: tuple[float, float]) -> Prior:
    """Names and ranges of what differs between the pours; nothing is drawn from it."""
    parameters = list(height_prior(heights).parameters)
    for name, values in () if draws is None else zip(draws.names, draws.samples.T, strict=True):
        low, high = float(values.min()), float(np.nextafter(values.max(), np.inf))
        parameters.append(Parameter(path=name, distribution="uniform", low=low, high=high))
    return Prior(parameters)


def _standardised(material: Array) -> Array:
    columns = []
    for values in material.T:
        is_wide = values.min() > 0 and values.max() > _WIDE * values.min()
        warped = np.log(values) if is_wide else values
        spread = warped.std()
        columns.append((warped - warped.mean()) / (spread if spread > 0 else 1.0))
    return np.column_stack(columns) if columns else np.empty((len(material), 0))
