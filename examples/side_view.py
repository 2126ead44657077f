"""Draws the grains of a pour from the side, or from above.

Run: granulcal simulate examples/drum.toml --positions drum.npy
     python examples/side_view.py drum.npy --diameter 2.4e-3 -o drum.png
"""

import argparse

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.collections import EllipseCollection


def draw(
    positions: NDArray[np.float64],
    diameter: float | NDArray[np.float64],
    out: str,
    *,
    from_above: bool,
    inches: float,
    metadata: dict[str, str] | None = None,
) -> None:
    """Draws centres, shape (n, 3) [m], as discs in the plane y = 0 or z = 0, the nearest last.

    `diameter` is that of all, or of each, shape (n,) [m].

    What `metadata` says is kept in the picture's file.
    """
    if from_above:
        positions = positions[:, [0, 2, 1]] * [1, -1, 1]
    nearest_last = np.argsort(positions[:, 1])[::-1]
    x, y, z = 1e3 * positions[nearest_last].T
    figure, axes = plt.subplots(figsize=(inches, inches), layout="constrained")
    sizes = 1e3 * np.broadcast_to(diameter, len(x))[nearest_last]
    shade = plt.get_cmap("copper")(np.interp(-y, (-y.max(), -y.min() + 1e-9), (0.4, 1.0)))
    axes.add_collection(
        EllipseCollection(
            sizes,
            sizes,
            0 * sizes,
            units="x",
            offsets=np.stack([x, z], 1),
            offset_transform=axes.transData,
            facecolors=shade,
            edgecolors="black",
            linewidths=0.3,
        )
    )
    axes.set(xlabel="x [mm]", ylabel="y [mm]" if from_above else "z [mm]", aspect="equal")
    margin = sizes.max()
    axes.set_xlim(x.min() - margin, x.max() + margin)
    axes.set_ylim(z.min() - margin if from_above else min(0.0, z.min() - margin), z.max() + margin)
    figure.savefig(out, dpi=80, metadata=metadata)
    plt.close(figure)


def main() -> None:
    """Draws the file that is named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("positions", help="centres of the grains, .npy of shape (n, 3) [m]")
    parser.add_argument("--diameter", type=float, default=4e-3, help="of a grain [m]")
    parser.add_argument("--within", type=float, default=np.inf, help="|x| and |y| drawn [m]")
    parser.add_argument("--from-above", action="store_true", help="along -z instead of +y")
    parser.add_argument("--inches", type=float, default=5.0, help="side of the picture")
    parser.add_argument("-o", "--out", default="side.png", help="the picture")
    arguments = parser.parse_args()
    positions = np.load(arguments.positions)
    draw(
        positions[(np.abs(positions[:, :2]) <= arguments.within).all(axis=1)],
        arguments.diameter,
        arguments.out,
        from_above=arguments.from_above,
        inches=arguments.inches,
    )


if __name__ == "__main__":
    main()
