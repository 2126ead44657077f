import sys

import numpy as np
import pytest
from own_simulators import SIMULATOR
from toy_models import QUICK, SCENE

import granulcal as gc


@pytest.fixture(scope="session")
def small_scene() -> gc.Scene:
    """Sixty grains let go just above the ground: a pour of a few milliseconds."""
    return gc.Scene.drop(0.02, count=60, preset="fast")


@pytest.fixture(scope="session")
def small_pour(small_scene: gc.Scene) -> gc.Pour:
    return gc.simulate(small_scene, seed=3)


@pytest.fixture(scope="session")
def small_prior() -> gc.Prior:
    """Materials that all come to rest in view."""
    return gc.Prior(
        [
            gc.Parameter(
                path="material.sliding_friction", distribution="uniform", low=0.2, high=1.0
            ),
            gc.Parameter(
                path="material.rolling_friction", distribution="log_uniform", low=0.05, high=1.0
            ),
            gc.Parameter(path="material.restitution", distribution="uniform", low=0.1, high=0.8),
        ]
    )


@pytest.fixture(scope="session")
def small_data(
    small_scene: gc.Scene, small_prior: gc.Prior, tmp_path_factory: pytest.TempPathFactory
) -> gc.Dataset:
    """Eighty pours of the small scene: enough to train on."""
    out = tmp_path_factory.mktemp("pours")
    return gc.generate(small_scene, small_prior, 80, seed=5, out=out, progress=False)


@pytest.fixture
def points() -> np.ndarray:
    """A cone of 400 points."""
    generator = np.random.default_rng(0)
    r, angle = 0.05 * np.sqrt(generator.random(400)), 2 * np.pi * generator.random(400)
    return np.column_stack([r * np.cos(angle), r * np.sin(angle), 0.02 - 0.3 * r])


@pytest.fixture(scope="session")
def toy():
    """A linear Gaussian, whose posteriors are known."""
    pytest.importorskip("torch")
    from granulcal.bayessim.check.toys import LinearGaussian

    return LinearGaussian.random(seed=1, noise=2.0)


@pytest.fixture(scope="session")
def quick(toy):
    """A model of it that has hardly learnt anything, in a moment."""
    theta, x = toy.simulate(120, seed=1)
    names = [f"s{i}" for i in range(16)]
    return gc.BayesSim.fit(theta, x, toy.prior, x_names=names, scene=SCENE, **QUICK)


@pytest.fixture(scope="session")
def own_simulator(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The command of a simulator of one's own."""
    path = tmp_path_factory.mktemp("own") / "simulator.py"
    path.write_text(SIMULATOR)
    return f"{sys.executable} {path}"
