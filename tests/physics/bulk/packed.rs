//! Grains packed in a cylinder: rained in, settled, and handed on to a scene with other walls.

use granulcal::dem::{
    CameraSpec, Effects, EndRule, Ends, GRAVITY, Grains, Ground, Material, Preset, Scene, Shape,
    Simulation, SolverSettings, Start, Wall, WallMaterial,
};
use nalgebra::Vector3;

/// Diameter of every grain `[m]`.
pub const DIAMETER: f64 = 4e-3;

/// Kinetic energy of a grain per mass, in the mean, at which a packing counts as settled `[m^2/s^2]`.
const SETTLED: f64 = 1e-6;
/// Sweeps in a substep while a packing is prepared.
const PREPARING: usize = 40;
/// Longest time that a packing may take to settle `[s]`.
const PATIENCE: f64 = 20.0;

/// Listed grains above the ground among `walls`, never ended by a rule.
pub fn scene(positions: &[Vector3<f64>], material: Material, walls: Vec<Wall>) -> Scene {
    Scene {
        name: "bulk".to_owned(),
        preset: Preset::Default,
        substep: None,
        gravity: [0.0, 0.0, -GRAVITY],
        material,
        grains: Grains::balls(positions.len(), DIAMETER, 2500.0),
        start: Start::Positions { positions: positions.iter().map(|&p| p.into()).collect() },
        bed: None,
        intruder: None,
        ground: Ground::default(),
        funnel: None,
        walls,
        effects: Effects::default(),
        end: EndRule { horizon: 1e3, kinetic_energy: f64::MIN_POSITIVE, ..EndRule::default() },
        camera: CameraSpec { field_width: 1e3, ..CameraSpec::default() },
        periodic: None,
        outflow: None,
        views: Vec::new(),
        observe: None,
    }
}

/// The simulation of a scene whose grains are listed: no seed is left in it.
pub fn start(scene: &Scene) -> Simulation {
    Simulation::new(scene, 0).expect("a valid scene")
}

/// A cylinder about the z axis, `radius`, `from` and `to` in metres.
pub fn tube(radius: f64, from: f64, to: f64, material: WallMaterial) -> Wall {
    let (from, to) = ([0.0, 0.0, from], [0.0, 0.0, to]);
    Wall::fixed(Shape::Cylinder { from, to, radius, closed: Ends::None }, material)
}

/// A flat ring about the z axis at `height` `[m]`: a cone that has next to no height.
pub fn ring(inner_radius: f64, outer_radius: f64, height: f64) -> Wall {
    const RISE: f64 = 1e-9;
    let shape = Shape::Cone {
        from: [0.0, 0.0, height],
        to: [0.0, 0.0, height + RISE],
        radius_from: inner_radius,
        radius_to: outer_radius,
        closed: Ends::None,
    };
    Wall::fixed(shape, WallMaterial::default())
}

/// `count` grains on a loose lattice in a cylinder of `radius` `[m]` above `floor` `[m]`, each moved a little
/// by `seed`: what falls into the cylinder and packs at random.
pub fn rain(count: usize, radius: f64, floor: f64, seed: u64) -> Vec<Vector3<f64>> {
    let spacing = 1.3 * DIAMETER;
    let jitter = 0.5 * (spacing - DIAMETER) / 3f64.sqrt();
    let reach = radius - 0.5 * DIAMETER - 2.0 * jitter;
    let half = (reach / spacing).floor() as i64;
    let layer: Vec<(f64, f64)> = (-half..=half)
        .flat_map(|x| (-half..=half).map(move |y| (spacing * x as f64, spacing * y as f64)))
        .filter(|(x, y)| x.hypot(*y) <= reach)
        .collect();
    let mut random = SplitMix(seed);
    (0..count)
        .map(|index| {
            let (x, y) = layer[index % layer.len()];
            let z = floor + 0.5 * DIAMETER + jitter + spacing * (index / layer.len()) as f64;
            Vector3::new(x, y, z) + jitter * random.in_cube()
        })
        .collect()
}

/// Height that no grain reaches `[m]`.
pub fn top_of(positions: &[Vector3<f64>]) -> f64 {
    positions.iter().map(|p| p.z).fold(0.0, f64::max) + DIAMETER
}

/// Lets the grains come to rest and returns where they are. A packing is prepared with many sweeps, whatever
/// the preset that is examined on it.
pub fn settle(scene: &Scene) -> Vec<Vector3<f64>> {
    let preset = scene.settings();
    let settings = SolverSettings { sweeps: PREPARING, max_sweeps: 2 * PREPARING, ..preset };
    let mut simulation = start(scene).with_settings(settings).expect("valid settings");
    wait_for_rest(&mut simulation);
    simulation.positions()
}

/// Advances until the grains are at rest in the mean.
pub fn wait_for_rest(simulation: &mut Simulation) {
    let speed = wait_for_rest_above(simulation, f64::NEG_INFINITY);
    assert!(speed.is_none(), "the grains do not come to rest: {speed:?} m/s");
}

/// Advances until the grains above `level` `[m]` are at rest in the mean; the others may go on. If they do not come to
/// rest, their root mean square speed `[m/s]`.
pub fn wait_for_rest_above(simulation: &mut Simulation, level: f64) -> Option<f64> {
    let until = simulation.time() + PATIENCE;
    loop {
        simulation.advance(0.02);
        let velocities = simulation.velocities();
        let (mut count, mut energy) = (0, 0.0);
        for (position, velocity) in simulation.positions().iter().zip(&velocities) {
            if position.z > level {
                count += 1;
                energy += 0.5 * velocity.norm_squared();
            }
        }
        if energy <= SETTLED * f64::from(count) {
            return None;
        }
        if simulation.time() >= until {
            return Some((2.0 * energy / f64::from(count)).sqrt());
        }
    }
}

/// Steele, Lea and Flood's SplitMix64: small, and the same everywhere.
struct SplitMix(u64);

impl SplitMix {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A point of the cube from -1 to 1.
    fn in_cube(&mut self) -> Vector3<f64> {
        let mut axis = || (self.next() >> 11) as f64 / (1u64 << 52) as f64 - 1.0;
        Vector3::new(axis(), axis(), axis())
    }
}
