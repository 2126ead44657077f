//! The scenes that the tests share, and how a single grain is followed.

use granulcal::dem::{
    CameraSpec, Effects, EndRule, GRAVITY, Grains, Ground, Material, Preset, Scene, Simulation,
    Start,
};
use nalgebra::Vector3;

/// Radius of every grain in these tests `[m]`.
pub const RADIUS: f64 = 2e-3;

/// A block of grains above the ground: the lowest centres at `base` `[m]`, no funnel, an end rule
/// and a camera that never stop a grain that moves.
pub fn block(counts: [usize; 3], spacing: f64, base: f64, material: Material) -> Scene {
    Scene {
        name: "block".to_owned(),
        preset: Preset::Default,
        substep: None,
        gravity: [0.0, 0.0, -GRAVITY],
        material,
        grains: Grains::balls(counts.iter().product(), 2.0 * RADIUS, 1300.0),
        start: Start::Grid { counts, spacing, jitter: 0.0, base },
        bed: None,
        intruder: None,
        ground: Ground::default(),
        funnel: None,
        walls: Vec::new(),
        effects: Effects::default(),
        end: EndRule { horizon: 100.0, kinetic_energy: f64::MIN_POSITIVE, ..EndRule::default() },
        camera: CameraSpec { field_width: 1e3, ..CameraSpec::default() },
        periodic: None,
        outflow: None,
        views: Vec::new(),
        observe: None,
    }
}

/// One grain with its centre at `height` `[m]`.
pub fn one_grain(height: f64, material: Material) -> Scene {
    block([1, 1, 1], 4.0 * RADIUS, height, material)
}

/// A ball of `count` grains let go at `height` `[m]` that ends as scenes do.
pub fn drop_of(count: usize, height: f64, material: Material) -> Scene {
    let mut scene = Scene::drop(height);
    scene.grains.count = count;
    scene.material = material;
    scene
}

/// Sliding friction, rolling friction and restitution as a material.
pub fn material(sliding_friction: f64, rolling_friction: f64, restitution: f64) -> Material {
    Material::new(sliding_friction, rolling_friction, restitution).expect("a valid material")
}

/// The simulation of `scene` with seed 1.
pub fn start(scene: &Scene) -> Simulation {
    Simulation::new(scene, 1).expect("a valid scene")
}

/// Position, velocity and r omega of one grain.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    /// Centre `[m]`.
    pub x: Vector3<f64>,
    /// Velocity `[m/s]`.
    pub v: Vector3<f64>,
    /// Radius times angular velocity `[m/s]`.
    pub w: Vector3<f64>,
}

/// How grain `grain` moves now.
pub fn motion(simulation: &Simulation, grain: usize) -> Motion {
    let pour = simulation.clone().into_pour();
    Motion {
        x: pour.positions[grain],
        v: pour.velocities[grain],
        w: pour.radii[grain] * pour.angular_velocities[grain],
    }
}

/// Every number of the state to the bit: positions, velocities, angular velocities.
pub fn bits(simulation: &Simulation) -> Vec<u64> {
    let pour = simulation.clone().into_pour();
    [&pour.positions, &pour.velocities, &pour.angular_velocities]
        .into_iter()
        .flatten()
        .flat_map(|vector| vector.iter().map(|c| c.to_bits()))
        .collect()
}
