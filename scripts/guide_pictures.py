"""The pictures of docs/guide.md.

    python scripts/guide_pictures.py [setup] [steps]

setup: camera, funnel and the lengths to measure. steps: what `features --debug-images` shows of the
sample recording.
"""

import argparse
import tempfile
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.image
import matplotlib.pyplot as plt
from PIL import Image

from granulcal.cli import main as granulcal

OUT = Path(__file__).parents[1] / "docs" / "results"


def setup() -> None:
    """Draws the set-up, lengths in centimetres."""
    figure, axes = plt.subplots(figsize=(7.5, 5.2), dpi=110)
    ink, soft = "#333333", "#8a93a8"
    axes.plot([-32, 32], [0, 0], color=ink, lw=2)
    axes.text(-31, -2.6, "flat, matt table, not of the grains' colour", fontsize=9, color=ink)
    for side in (-1, 1):
        x = [1.6 * side, 1.6 * side, 6 * side]
        axes.plot(x, [12, 13, 20], color=ink, lw=2)
        axes.plot([1.6 * side, 24 * side], [40, 0], color=soft, lw=0.8, ls="--")
    pile = [(-5.2, 0), (-3.6, 0.9), (-1.6, 2.0), (0, 2.5), (1.6, 2.0), (3.6, 0.9), (5.2, 0)]
    axes.fill(*zip(*pile, strict=True), color="#d6a860")
    axes.add_patch(plt.Rectangle((-4.5, 40), 9, 2.5, color=ink))
    axes.text(5.6, 40.6, "depth camera, looking down", fontsize=9, color=ink)
    paper = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}
    arrow = {"arrowstyle": "<->", "color": "#b0413e", "shrinkA": 0, "shrinkB": 0}

    def length(
        a: tuple[float, float], b: tuple[float, float], text: str, at: tuple[float, float]
    ) -> None:
        axes.annotate("", xy=a, xytext=b, arrowprops=arrow)
        axes.text(*at, text, fontsize=9, color="#b0413e", va="center", bbox=paper)

    length((9, 0), (9, 12), "funnel.height, to ½ mm", (9.6, 6))
    length((9, 13), (9, 20), "cone_length", (9.6, 16.5))
    length((-9, 12), (-9, 13), "stem_length", (-20.5, 12.5))
    length((0, 21.3), (6, 21.3), "rim_radius", (0.3, 22.8))
    length((0, 10.6), (1.6, 10.6), "stem_radius", (-11.4, 9.6))
    length((-27, 0), (-27, 40), "camera.height,\n30 to 50 cm", (-26, 25))
    axes.text(-4.6, 3.6, "2000 grains,\nweighed", fontsize=8, color=ink)
    axes.set_aspect("equal")
    axes.set_xlim(-33, 33)
    axes.set_ylim(-4, 45)
    axes.axis("off")
    figure.savefig(OUT / "guide-setup.png", bbox_inches="tight")
    plt.close(figure)


def steps() -> None:
    """Puts the three pictures of a sample recording side by side."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "couscous"
        _run("init", str(folder))
        _run("sample", str(folder))
        shown = folder / "steps"
        camera = ["--camera", str(folder / "camera.toml")]
        _run("features", str(folder / "couscous.png"), *camera, "--debug-images", str(shown))
        figure, panels = plt.subplots(1, 3, figsize=(10, 2.9), dpi=110, layout="constrained")
        for axes, name in zip(panels, ("residual", "height", "mask"), strict=True):
            axes.imshow(matplotlib.image.imread(shown / f"{name}.png"), cmap="gray")
            axes.set_title(f"{name}.png", fontsize=10)
            axes.axis("off")
        figure.savefig(OUT / "guide-steps.png")
        plt.close(figure)
        # Noise of the camera does not compress: 128 colours do.
        with Image.open(OUT / "guide-steps.png") as picture:
            few = picture.convert("RGB").quantize(128, dither=Image.Dither.NONE)
        few.save(OUT / "guide-steps.png", optimize=True)


def _run(*words: str) -> None:
    if granulcal(words) != 0:
        raise SystemExit(f"granulcal {' '.join(words)} failed")


PICTURES = {"setup": setup, "steps": steps}


def main() -> None:
    """Makes what is asked for, or all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("pictures", nargs="*", metavar="PICTURE", help=", ".join(PICTURES))
    options = parser.parse_args()
    unknown = [name for name in options.pictures if name not in PICTURES]
    if unknown:
        raise SystemExit(f"pictures are {', '.join(PICTURES)}; got {', '.join(unknown)}")
    for name in options.pictures or PICTURES:
        PICTURES[name]()


if __name__ == "__main__":
    main()
