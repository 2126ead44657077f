"""Point sets and their statistics by numpy, scipy and dcor, for tests/statistics.rs.

Run `python generate_statistics.py` in this folder (numpy, scipy, dcor); the seed is fixed.
"""

import json
import warnings

import dcor
import numpy as np
import scipy
from scipy import optimize, stats

warnings.simplefilter("ignore")
rng = np.random.default_rng(20240607)


def disc(n, radius):
    r, angle = radius * np.sqrt(rng.random(n)), 2 * np.pi * rng.random(n)
    return r * np.cos(angle), r * np.sin(angle)


def pile(n):
    x, y = disc(n, 0.05)
    return x, y, 0.02 * (1 - np.hypot(x, y) / 0.05) + 0.001 * rng.random(n)


def ring(n):
    r, angle = rng.normal(0.05, 0.008, n), 2 * np.pi * rng.random(n)
    return r * np.cos(angle), r * np.sin(angle), 0.004 + 0.004 * rng.random(n)


def crater(n):
    x, y = disc(n, 0.06)
    return x, y, 0.003 + 0.01 * np.exp(-(((np.hypot(x, y) - 0.04) / 0.01) ** 2))


def lattice(n):
    side = int(np.ceil(np.sqrt(n)))
    i = np.arange(n)
    return 0.004 * (i % side), 0.004 * (i // side), 0.004 * (1 + i % 3)


def heavy(n):
    x, y = 0.01 * rng.standard_t(2, n), 0.01 * rng.standard_t(2, n)
    return x, y, 0.002 * (1 + rng.pareto(3, n))


def blob(n):
    return rng.normal(0.1, 0.02, n), rng.normal(-0.2, 0.01, n), rng.exponential(0.005, n)


def streak(n):
    x = rng.random(n) * 0.2
    return x, 0.3 * x + 0.001 * rng.normal(size=n), 0.01 * rng.random(n)


def chi_fits(r):
    """scipy's fit from its own start, and its global search within the bounds of the crate.

    From its own start scipy mostly ends where the likelihood diverges (df < 1, loc at min(r)), or
    on the way to a normal distribution (df in the hundreds).
    """
    fits = [stats.chi.fit(r)]
    span = np.ptp(r)
    if span > 1e-9:
        bounds = {
            "df": (1, 100),
            "loc": (r.min() - 20 * span, r.min()),
            "scale": (0.01 * span, 10 * span),
        }
        fits.append(tuple(stats.fit(stats.chi, r, bounds, optimizer=search).params))
    results = []
    for fit in fits:
        values = dict(zip(("df", "shift", "scale"), fit))
        values["log_likelihood"] = stats.chi.logpdf(r, *fit).sum()
        results.append(finite(values))
    return results


def search(fun, bounds, *, integrality=None):
    return optimize.differential_evolution(fun, bounds, rng=np.random.default_rng(1))


def finite(values):
    return {k: float(v) if np.isfinite(v) else None for k, v in values.items()}


def expected(points):
    x, y, z = points.T
    x, y = x - x.mean(), y - y.mean()
    r = np.hypot(x, y)
    values = {
        "max_z": z.max(),
        "mean_z": z.mean(),
        "sd_z": z.std(),
        "max_r": r.max(),
        "mean_r": r.mean(),
        "sd_x": x.std(),
        "sd_y": y.std(),
        "sd_r": r.std(),
        "iqr_x": stats.iqr(x),
        "iqr_y": stats.iqr(y),
        "iqr_r": stats.iqr(r),
        "kurtosis_r": stats.kurtosis(r),
        "dcor_r_z": dcor.distance_correlation(r, z, method="naive"),
    }
    return {"values": finite(values), "chi": chi_fits(r)}


def main():
    sets = []
    for make in (pile, ring, crater, lattice, heavy, blob, streak):
        for n in (3, 4, 5, 8, 13, 30, 60, 120, 200):
            points = np.round(np.stack(make(n), axis=1), 7)
            sets.append({"name": f"{make.__name__}_{n}", "points": points.tolist(), **expected(points)})
    versions = {"numpy": np.__version__, "scipy": scipy.__version__, "dcor": dcor.__version__}
    with open("statistics.json", "w") as file:
        json.dump({"versions": versions, "sets": sets}, file, separators=(",", ":"))
        file.write("\n")


if __name__ == "__main__":
    main()
