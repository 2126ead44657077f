"""One pour: from a scene to grains at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

from granulcal import _native
from granulcal.engines.in_use import engine_in_use, required
from granulcal.pours.pour import Pour
from granulcal.pours.recorded import recorded
from granulcal.pours.scene import Material, Scene, require_scene
from granulcal.pours.simulation import Simulation
from granulcal.whole import check_seed, check_whole

if TYPE_CHECKING:
    from granulcal.engines import Engine

__all__ = ["Pour", "simulate"]


def simulate(
    scene: Scene,
    material: Material | None = None,
    seed: int = 0,
    preset: str | None = None,
    threads: int = 1,
    *,
    engine: Engine | None = None,
    every: float | None = None,
) -> Pour:
    """Returns the pour of a scene; the same arguments give the same bits.

    Other Python threads run meanwhile, and Ctrl-C stops it.

    Args:
        scene: what is poured.
        material: the grains' material instead of the scene's.
        seed: seed of the start's jitter and of the camera's noise.
        preset: `fast`, `default`, `accurate` or `paper` instead of the scene's, which is `default`
            unless the scene states another.
        threads: threads that share this one pour. The bits stay the same; only scenes of some ten
            thousand grains gain from a second thread, and `generate` runs many pours at once.
        engine: another simulator in place of ours, or of the one in use; docs/engines.md says what
            it must do. It has to give grains: points alone are for `generate`.
        every: simulated time between two frames [s], which `Pour.trajectory` then has. They change
            no bit of the pour; `Simulation` stops at times of one's own.

    Raises:
        TypeError: `scene` is no scene.
        ValueError: a number is out of its range, more memory is needed than there is, or frames are
            asked of another simulator.
    """
    require_scene(scene)
    check_seed(seed)
    check_whole("threads", threads, at_least=1)
    if material is not None:
        if not isinstance(material, Material):
            raise TypeError(f"material must be a Material, got {material!r}; a seed is seed=...")
        scene = scene.with_material(material)
    if preset is not None:
        scene = scene.with_(preset=preset)
    engine = required(engine) or engine_in_use()
    if engine is not None:
        if every is not None:
            raise ValueError(
                f"every={every!r} is not for the engine {engine.name!r}, which leaves the end alone"
            )
        return Pour(_left_by(engine, scene, seed), scene, seed)
    if every is not None:
        simulation = Simulation(scene, seed, threads=threads)
        trajectory = recorded(simulation, every)
        return Pour(simulation.native.pour(), scene, seed, trajectory)
    return Pour(_native.simulate(scene.native, seed, threads), scene, seed)


def _left_by(engine: Engine, scene: Scene, seed: int) -> _native.Pour:
    left = engine(scene, seed)
    if not isinstance(left, tuple):
        raise ValueError(f"{engine.name} gave points of a surface and no grains")
    return scene.native.pour_of(*left, seed)
