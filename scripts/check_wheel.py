"""Tries an installed wheel without PyTorch: a pour, a data set, a sample recording, an export.

    python scripts/check_wheel.py

It tries the installed package and not the source tree. It ends with 0 and the version, or says
what is wrong.
"""

import sys
import tempfile
from importlib.metadata import metadata
from pathlib import Path


def main() -> int:
    """Returns the exit code."""
    # The folder of this script would not hide the package, the root of the sources would.
    sys.path = [path for path in sys.path if Path(path or ".").resolve() != Path.cwd()]
    import granulcal as gc
    from granulcal.cli import main as granulcal

    classifiers = metadata("granulcal").get_all("Classifier") or []
    assert "Typing :: Typed" in classifiers
    assert (Path(gc.__file__).parent / "py.typed").exists()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "couscous"
        words = ["--scene", "drop", "--preset", "fast", "--set", "grains.count=60"]
        assert granulcal(["init", str(folder), *words]) == 0
        assert granulcal(["sample", str(folder)]) == 0
        scene = gc.Scene.load(folder / "scene.toml")
        pour = gc.simulate(scene, seed=1)
        # Single grains may roll out of view: then it is not waited for them.
        assert pour.status in ("at_rest", "out_of_view"), pour
        assert pour.positions.shape == (60, 3), pour
        data = gc.generate(scene, gc.Prior.default(), 4, out=folder / "pours", progress=False)
        assert data.x.shape == (4, 16)
        image = gc.Recording.open(folder / "couscous.png", camera=folder / "camera.toml")
        assert 0 < image.statistics()["max_z"] < 0.02
        words = ["export", "scene", str(folder / "scene.toml"), "--to", "lammps"]
        assert granulcal([*words, "-o", str(folder / "pour")]) == 0
        assert granulcal(["features", "--list"]) == 0
    print(f"granulcal {gc.__version__} on Python {sys.version.split()[0]}, {sys.platform}: fine")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
