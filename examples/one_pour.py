"""Pour, look, describe: the 16 statistics of one simulated formation."""

import argparse

import granulcal as gc


def main() -> None:
    """Prints the statistics of a pour through the paper's funnel."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=2000, help="grains (default: %(default)s)")
    parser.add_argument("--preset", default="fast", help="fast, default, accurate or paper")
    options = parser.parse_args()

    material = gc.Material(sliding_friction=0.4, rolling_friction=0.1, restitution=0.5)
    scene = gc.Scene.funnel(height=0.12, count=options.count, preset=options.preset)
    pour = gc.simulate(scene, material, seed=1)
    print(f"{pour.status} after {pour.simulated_s:.2f} s, {pour.cpu_seconds:.1f} s of processor")
    for name, value in pour.statistics().to_dict().items():
        print(f"{name:<12}{value:>12.5g}")


if __name__ == "__main__":
    main()
