"""Damaged files of every kind, through loaders and command line: refused by name, or read."""

import json
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mutations import mutations

import granulcal as gc
from granulcal import cli
from granulcal.design.posterior_file import PosteriorDraws
from granulcal.loop.check.discrepancy import Discrepancy
from granulcal.loop.effects.tolerance import Tolerances
from granulcal.loop.report.models import Maker, Models
from granulcal.loop.surrogate.transform import Transform
from granulcal.loop.task import Task
from granulcal.pours.kept_pours import KeptPours
from granulcal.pours.statistics import NAMES

REPOSITORY = Path(__file__).parents[2]
MODEL = REPOSITORY / "crates" / "bayessim" / "tests" / "data" / "pile"
CORPUS = REPOSITORY / "fuzz" / "corpus"
SCENE = gc.Scene.drop(0.01).with_(
    {"grains.count": 12, "start.solid_fraction": 0.5, "end.horizon": 0.25, "camera.downsample": 8}
)
MESH = """solid tray
facet normal 0 0 1
 outer loop
  vertex 0 0 0
  vertex 0.4 0 0
  vertex 0 0.4 0
 endloop
endfacet
endsolid tray
"""


class Shelf:
    """One whole file of every kind, and how each is read."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / "scene.toml").write_text(SCENE.to_toml())
        (folder / "prior.toml").write_text(gc.Prior.default().to_toml())
        camera = gc.Camera.overhead(height=0.4, field_width=0.2, pixels=80)
        generator = np.random.default_rng(0)
        grains = np.c_[generator.normal(0, 0.02, (60, 2)), np.full(60, 0.004)]
        camera.record(grains, np.full(60, 0.004), folder)
        np.save(folder / "grains.npy", grains)
        document = {
            "parameters": {"material.restitution": {"mode": 0.5}},
            "samples": [[0.4], [0.5], [0.6]],
        }
        (folder / "posterior.json").write_text(json.dumps(document))
        tolerances = {"names": ["max_z"], "path": "funnel.height", "at": [0.02, 0.12]}
        tolerances["directions"] = [[[0.001], [0.002]]]
        (folder / "tolerances.json").write_text(json.dumps(tolerances))
        for i in range(4):
            (folder / f"pour-{i}.png").write_bytes((folder / "depth.png").read_bytes())
        (folder / "loop.toml").write_text(
            'scene = "scene.toml"\nprior = "prior.toml"\neffects = ["drag"]\nbetween = true\n'
            'camera = "camera.toml"\nreading = { downsample = 2 }\n'
            "nuisances = { height = 0.001 }\n"
            '[[conditions]]\nname = "low"\nat = { "start.height" = 0.01 }\nuse = "fit"\n'
            'known = { "effects.fluid.density" = 1.2 }\naveraged = false\n'
            'recordings = ["pour-0.png", "pour-1.png"]\n'
            '[[conditions]]\nname = "high"\nat = { "start.height" = 0.02 }\nuse = "fit"\n'
            'recordings = ["pour-2.png", "pour-3.png"]\n'
        )
        gc.generate(SCENE, gc.Prior.default(), 3, out=folder / "pours", progress=False)
        (folder / "tray.stl").write_text(MESH)
        (folder / "way.csv").write_text("0,0,0,0,0,0,0,1\n1,0.1,0,0,0,0,0,1\n")
        walls = (
            '\n[[walls]]\nshape = { kind = "mesh", file = "tray.stl" }\n'
            'motion = { kind = "trajectory", file = "way.csv" }\n'
        )
        (folder / "meshed.toml").write_text(SCENE.to_toml() + walls)
        assert self.run("simulate", "scene.toml", "--checkpoint", "state.ckpt") in (0, 3)
        (folder / "closed").mkdir()
        closed_loop().write(folder / "closed")

    def at(self, name: str) -> Path:
        return self.folder / name

    def run(self, *words: str) -> int:
        """Runs a command line whose files are of this folder."""
        named = [
            str(self.at(w)) if self.at(w.split("/")[0]).exists() or "." in w else w for w in words
        ]
        return cli.main(named)


def closed_loop() -> Models:
    """What `predict` reads: two conditions, a base model, one that is named, a correction."""
    maker = Maker({"material.restitution": 0.4}, {"start.height": 1e-3}, {})
    means = np.linspace(0.01, 0.02, 2 * len(NAMES)).reshape(2, -1)
    return Models(
        scene=SCENE,
        verdict={"kind": "EFFECT", "named": ["drag"]},
        paths=("start.height",),
        inputs=(("start.height", 0.01, 0.02),),
        names=tuple(NAMES),
        makers={"base": (maker, maker), "named": (maker, maker)},
        columns=(0, 3),
        transforms=(
            Transform("identity", 0.0, 1.0, 0.0, 1.0),
            Transform("log", 0.1, 1.0, 0.0, 1.0),
        ),
        correction=Discrepancy(
            np.array([[0.0], [1.0]]), np.array([0.1, 0.2]), 0.1 * np.arange(4.0), np.eye(4)
        ),
        known=np.array([[0.0], [1.0]]),
        means=means,
        scatter=0.1 * means,
        pours=np.array([2.0, 3.0]),
    )


@pytest.fixture(scope="module")
def shelf(tmp_path_factory) -> Shelf:
    return Shelf(tmp_path_factory.mktemp("shelf"))


def kept(path: Path) -> None:
    pours = KeptPours(SCENE, gc.Prior.default(), path.with_name("none.json"))
    pours.path = path
    pours._read(None)


def frozen_model(folder: Path, name: str, data: bytes) -> Path:
    """A model of which one file is `data`."""
    folder.mkdir(exist_ok=True)
    for each in ("model.json", "weights.safetensors"):
        content = data if each == name else (MODEL / each).read_bytes()
        (folder / each).write_bytes(content)
    return folder


def load_model(folder: Path) -> None:
    from granulcal.bayessim import BayesSim

    model = BayesSim.load(folder)
    x = 0.5 * (model.standardiser.low + model.standardiser.high)
    model.misfit(x)
    model.posterior(x).mean()


# File, whether it is text, its loader, and the command lines that read it under the name X.
KINDS: dict[str, tuple[str, bool, Callable[[Path], object] | None, list[list[str]]]] = {
    "scene": ("scene.toml", True, gc.Scene.load, [["inspect", "X"]]),
    "prior": ("prior.toml", True, gc.Prior.load, [["inspect", "X"]]),
    "camera": (
        "camera.toml", True, None,
        [["inspect", "X"], ["features", "depth.png", "--camera", "X"]],
    ),
    "image": (
        "depth.png", False, None,
        [["inspect", "X"], ["features", "X", "--camera", "camera.toml"]],
    ),
    "array": (
        "grains.npy", False, None,
        [["inspect", "X"], ["render", "drop", "--positions", "X", "-o", "out.png"]],
    ),
    "part": ("pours/part-000000.parquet", False, gc.Dataset.load, [["inspect", "X"]]),
    "checkpoint": (
        "state.ckpt", False, None,
        [["inspect", "X"], ["simulate", "scene.toml", "--resume", "X"]],
    ),
    "posterior": (
        "posterior.json", True, PosteriorDraws.load,
        [["design", "spill", "scene.toml", "--posterior", "X", "-o", "spill.out"]],
    ),
    "tolerances": ("tolerances.json", True, Tolerances.load, []),
    "task": (
        "loop.toml", True, Task.load,
        [["close-loop", "X", "-o", "loop.out", "--budget", "1"]],
    ),
    "models": (
        "closed/models.json", True, lambda path: Models.load(path.parent),
        [
            ["predict", "closed", "--at", "start.height=0.015", "--model", "line"],
            ["predict", "closed", "--at", "start.height=0.015", "--corrected", "--pours", "2"],
        ],
    ),
    "mesh": ("tray.stl", True, None, [["inspect", "meshed.toml"]]),
    "trajectory": ("way.csv", True, None, [["inspect", "meshed.toml"]]),
}  # fmt: skip


def try_kind(shelf: Shelf, kind: str, count: int, capfd) -> None:
    name, is_text, load, lines = KINDS[kind]
    whole = shelf.at(name).read_bytes()
    in_place = kind in ("mesh", "trajectory", "task", "models")
    target = shelf.at(name) if in_place else shelf.at(f"X{Path(name).suffix}")
    try:
        for i, data in enumerate(mutations(whole, count, seed=7, is_text=is_text)):
            target.write_bytes(data)
            if load is not None:
                refused_or_read(load, target, f"{kind} {i}")
            for words in lines:
                named = [target.name if word == "X" else word for word in words]
                code = shelf.run(*named)
                error = capfd.readouterr().err
                assert code in (0, 1, 2, 3), (kind, i, code, error)
                for word in ("panicked", "Traceback", "an error of its own"):
                    assert word not in error, (kind, i, error)
                assert len(error) < 20_000, (kind, i, error[:300])
    finally:
        shelf.at(name).write_bytes(whole)


def refused_or_read(load: Callable[[Path], object], path: Path, what: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            load(path)
        except (ValueError, OSError) as error:
            assert str(error), what


@pytest.mark.parametrize("kind", KINDS)
def test_damaged_files_are_refused_or_read(shelf, kind, capfd):
    try_kind(shelf, kind, 50, capfd)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_thousand_damaged_files_are_refused_or_read(shelf, kind, capfd):
    try_kind(shelf, kind, 1000, capfd)


def try_models(tmp_path: Path, shelf: Shelf, count: int, capfd) -> None:
    for name, is_text in (("model.json", True), ("weights.safetensors", False)):
        whole = (MODEL / name).read_bytes()
        for i, data in enumerate(mutations(whole, count, seed=3, is_text=is_text)):
            folder = frozen_model(tmp_path / "model", name, data)
            refused_or_read(load_model, folder, f"{name} {i}")
            words = ["infer", str(folder), str(shelf.at("depth.png")), "--camera"]
            code = cli.main([*words, str(shelf.at("camera.toml"))])
            error = capfd.readouterr().err
            assert code in (0, 1, 2, 3), (name, i, code, error)
            for word in ("panicked", "Traceback", "an error of its own"):
                assert word not in error, (name, i, error)


def test_damaged_models_are_refused_or_read(tmp_path, shelf, capfd):
    try_models(tmp_path, shelf, 50, capfd)


@pytest.mark.slow
def test_a_thousand_damaged_models_are_refused_or_read(tmp_path, shelf, capfd):
    try_models(tmp_path, shelf, 1000, capfd)


@pytest.mark.parametrize("suffix", ["bag", "mcap", "npz"])
def test_damaged_recordings_are_refused_or_read(tmp_path, suffix, capfd):
    for file in sorted((CORPUS / suffix).iterdir()):
        for i, data in enumerate(mutations(file.read_bytes(), 10, seed=5, is_text=False)):
            target = tmp_path / f"x.{suffix}"
            target.write_bytes(data)
            refused_or_read(lambda path: gc.Recording.open(path).statistics(), target, file.name)
            for command in ("inspect", "features"):
                code = cli.main([command, str(target)])
                error = capfd.readouterr().err
                assert code in (0, 2, 3) and "panicked" not in error, (file.name, i, error)


def test_damaged_kept_pours_are_refused_or_read(tmp_path):
    pours = {"key": "k", "names": ["a"], "pours": {"0": {"theta": [0.1], "status": "at_rest"}}}
    pours["pours"]["0"]["x"] = [1.0, 2.0]
    path = tmp_path / "pours.json"
    for data in mutations(json.dumps(pours).encode(), 50, seed=1, is_text=True):
        path.write_bytes(data)
        refused_or_read(kept, path, "pours.json")
