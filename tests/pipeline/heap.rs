//! The pour whose statistics are kept: `tests/golden/README.md`.

use std::path::PathBuf;

use granulcal::dem::{Material, Pour, Scene, Simulation};

/// 400 grains that make a heap within a second of simulated time.
pub fn scene() -> Scene {
    let mut scene = Scene::drop(0.02);
    scene.grains.count = 400;
    scene.material =
        Material { sliding_friction: 0.6, rolling_friction: 0.4, ..Material::default() };
    scene.camera.downsample = 4;
    scene
}

/// It, poured.
pub fn pour() -> Pour {
    Simulation::new(&scene(), 11).expect("a valid scene").run()
}

/// Where its statistics are kept.
pub fn golden_path() -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "tests", "golden", "drop_400.json"].iter().collect()
}
