//! Beverloo's hopper: a flat-bottomed silo that runs out through a round hole.
//!
//!     W = C rho_b sqrt(g) (D - k d)^(5/2),    C = 0.58, k = 1.4
//!
//! (Beverloo, Leniger, van de Velde 1961, doi:10.1016/0009-2509(61)85030-6; Mankoc et al. 2007,
//! doi:10.1007/s10035-007-0062-2). The grains fall into the same tube below.

use std::f64::consts::{FRAC_PI_6, PI};

use granulcal::dem::{GRAVITY, Material, Shape, Simulation, Wall, WallMaterial};
use nalgebra::Vector3;

use super::fit;
use super::packed::{DIAMETER, rain, ring, scene, settle, start, top_of, tube};

/// Beverloo's constants.
pub const C: f64 = 0.58;
/// See [`C`].
pub const K: f64 = 1.4;

/// Share of the grains that has left when the rate is taken from, and up to.
const WINDOW: (f64, f64) = (0.05, 0.25);
/// Time between two counts `[s]`.
const SAMPLE: f64 = 2e-3;
/// Time without a grain after which the hole is jammed `[s]`.
const PATIENCE: f64 = 0.5;

/// A filled silo with its hole closed.
#[derive(Clone, Debug)]
pub struct Filled {
    positions: Vec<Vector3<f64>>,
    material: Material,
    /// Radius of the tube and height of its floor `[m]`.
    pub radius: f64,
    /// See `radius`.
    pub bottom: f64,
    /// Solid fraction, without three diameters at the floor and at the top `[-]`.
    pub solid_fraction: f64,
    /// Height of the filling in diameters.
    pub height: f64,
}

/// Fills a silo of `width` diameters with `count` grains.
pub fn fill(width: f64, count: usize, material: Material, seed: u64) -> Filled {
    let radius = 0.5 * width * DIAMETER;
    let grain = FRAC_PI_6 * DIAMETER.powi(3);
    // Room below for all grains, loosely heaped, and to fall.
    let bottom = 2.0 * count as f64 * grain / (PI * radius * radius) + 4.0 * radius;
    let rained = rain(count, radius, bottom, seed);
    let floor = Shape::Plane { point: [0.0, 0.0, bottom], normal: [0.0, 0.0, 1.0] };
    let walls = vec![
        tube(radius, 0.0, top_of(&rained), WallMaterial::default()),
        Wall::fixed(floor, WallMaterial::default()),
    ];
    let positions = settle(&scene(&rained, material, walls));

    let top = top_of(&positions) - DIAMETER - bottom;
    let (from, to) = (bottom + 3.0 * DIAMETER, bottom + top - 3.0 * DIAMETER);
    let inside = positions.iter().filter(|p| (from..to).contains(&p.z)).count() as f64;
    let solid_fraction = inside * grain / (PI * radius * radius * (to - from));
    Filled { positions, material, radius, bottom, solid_fraction, height: top / DIAMETER }
}

impl Filled {
    /// Beverloo's rate through a hole of `outlet` diameters `[grains/s]`.
    pub fn beverloo(&self, outlet: f64) -> f64 {
        let per_volume = self.solid_fraction / FRAC_PI_6; // grains per d^3
        C * per_volume * (GRAVITY / DIAMETER).sqrt() * (outlet - K).powf(2.5)
    }

    /// The silo with a hole of `outlet` diameters in its floor, behind `walls`.
    pub fn open(&self, outlet: f64, mut walls: Vec<Wall>) -> Simulation {
        walls.push(ring(0.5 * outlet * DIAMETER, self.radius, self.bottom));
        walls.push(tube(self.radius, 0.0, self.bottom, WallMaterial::default()));
        start(&scene(&self.positions, self.material, walls))
    }

    /// Opens a hole of `outlet` diameters and returns the rate `[grains/s]`, or nothing if it jams.
    pub fn discharge(&self, outlet: f64) -> Option<f64> {
        let top = self.bottom + (self.height + 1.0) * DIAMETER;
        let wall = tube(self.radius, self.bottom, top, WallMaterial::default());
        let mut simulation = self.open(outlet, vec![wall]);
        let count = self.positions.len() as f64;
        let (mut samples, mut last, mut since) = (Vec::new(), 0.0, 0.0);
        loop {
            simulation.advance(SAMPLE);
            let time = simulation.time();
            let left = simulation.positions().iter().filter(|p| p.z < self.bottom).count() as f64;
            if left > last {
                (last, since) = (left, time);
            }
            if left > WINDOW.1 * count {
                return Some(fit::line(&samples).0);
            }
            if left > WINDOW.0 * count {
                samples.push((time, left));
            }
            if time - since > PATIENCE {
                return None;
            }
        }
    }
}
