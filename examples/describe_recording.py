"""Describe a depth image: photograph a pour with a tilted camera, store it, open it, measure it."""

import argparse
import tempfile

import granulcal as gc


def main() -> None:
    """Prints what the segmentation found and how far the camera's tilt was undone."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=500, help="grains (default: %(default)s)")
    options = parser.parse_args()

    pour = gc.simulate(gc.Scene.drop(0.05, count=options.count, preset="fast"), seed=1)
    camera = gc.Camera.overhead(height=0.4, field_width=0.5, pixels=400).tilted(x_deg=3.0)
    with tempfile.TemporaryDirectory() as folder:
        image, toml = camera.record(pour.positions, pour.radii, folder, depth_noise=3e-4)
        formation = gc.Recording.open(image, camera=toml).formation(downsample=2)
    print(f"ground tilted by {formation.plane.tilt_deg:.2f} deg, {len(formation.points)} points")
    print(f"height {1e3 * formation.statistics()['max_z']:.1f} mm")


if __name__ == "__main__":
    main()
