//! Janssen's silo: the wall carries all but a share of the grains that grows no more with the filling.
//!
//! Be M the weight above a level and S what the level carries, both in grains, K the ratio of the stress on the wall to
//! that on the level and mu the friction that the wall mobilises. A slice's balance is dS/dM = 1 - S / M_sat, so that
//!
//!     S = M_sat (1 - exp(-M / M_sat)),    M_sat = D (dM/dz) / (4 mu K)
//!
//! (Janssen 1895; Sperl 2006, doi:10.1007/s10035-005-0224-z). The grains run out slowly through a hole, which
//! mobilises the wall's friction everywhere; K and mu are measured at the wall, so that nothing is fitted to S.

use granulcal::dem::{GRAVITY, Material, Simulation, WallMaterial};

use super::hopper;
use super::packed::{DIAMETER, tube};

/// Shares of the grains that have left when the loads are examined first and last: before, the filling still rests
/// as it was poured, with little friction at the wall.
const LOOKED_AT: (f64, f64) = (0.2, 0.3);
/// Time between two checks `[s]`.
const LOOK: f64 = 1e-3;
/// Longest discharge that is waited for `[s]`.
const PATIENCE: f64 = 30.0;

/// A silo to measure, lengths in diameters.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    /// Inner diameter D of the tube.
    pub width: f64,
    /// Number of grains.
    pub count: usize,
    /// Diameter of the hole.
    pub outlet: f64,
}

/// A level of the silo and the ring of wall above it, half a width high.
#[derive(Clone, Copy, Debug)]
pub struct Level {
    /// Grains above.
    pub above: f64,
    /// What the level carries, in grains.
    pub carried: f64,
    /// Stress on the ring over the mean stress of the levels at its ends `[-]`.
    pub stress_ratio: f64,
    /// Friction over normal force at the ring `[-]`.
    pub mobilised: f64,
}

/// What a silo carries.
#[derive(Clone, Debug)]
pub struct Silo {
    /// Levels that the hole does not disturb, a width above the floor and higher, from below.
    pub levels: Vec<Level>,
    /// M_sat from K and mu at the wall, in grains.
    pub saturation: f64,
    /// K and mu, in the mean over the rings that are full.
    pub stress_ratio: f64,
    /// See `stress_ratio`.
    pub mobilised: f64,
}

impl Silo {
    /// Janssen's S below `above` grains.
    pub fn janssen(&self, above: f64) -> f64 {
        self.saturation * (1.0 - (-above / self.saturation).exp())
    }

    /// Root mean square over the levels of S - Janssen's S, over the saturation `[-]`.
    pub fn deviation(&self) -> f64 {
        let square = |level: &Level| (level.carried - self.janssen(level.above)).powi(2);
        let mean = self.levels.iter().map(square).sum::<f64>() / self.levels.len() as f64;
        mean.sqrt() / self.saturation
    }
}

/// Fills a silo, lets it run out and measures it meanwhile.
pub fn measure(shape: Shape, material: Material, seed: u64) -> Silo {
    let filled = hopper::fill(shape.width, shape.count, material, seed);
    let height = 0.5 * shape.width * DIAMETER;
    let rings = (filled.height * DIAMETER / height).ceil() as usize;
    let bottom = |k: usize| filled.bottom + k as f64 * height;
    let wall: Vec<_> = (0..rings)
        .map(|k| tube(filled.radius, bottom(k), bottom(k + 1), WallMaterial::default()))
        .collect();
    let mut simulation = filled.open(shape.outlet, wall);

    let count = shape.count as f64;
    let left = |simulation: &Simulation| {
        assert!(simulation.time() < PATIENCE, "{shape:?} is jammed");
        simulation.positions().iter().filter(|p| p.z < filled.bottom).count() as f64 / count
    };
    while left(&simulation) < LOOKED_AT.0 {
        simulation.advance(LOOK);
    }
    let (mut above, mut forces) = (vec![0.0; rings + 1], vec![(0.0, 0.0); rings]);
    let mut looks = 0.0;
    while left(&simulation) < LOOKED_AT.1 {
        simulation.advance(LOOK);
        looks += 1.0;
        for (k, above) in above.iter_mut().enumerate() {
            let higher = simulation.positions().iter().filter(|p| p.z > bottom(k)).count();
            *above += higher as f64;
        }
        // After the ground, the walls in the order of the scene: the rings first.
        for (force, load) in forces.iter_mut().zip(&simulation.wall_loads().unwrap()[1..]) {
            force.0 -= load.force.z / GRAVITY;
            force.1 += load.normal_force / GRAVITY;
        }
    }
    for grains in &mut above {
        *grains /= looks;
    }
    for (friction, normal) in &mut forces {
        *friction /= looks;
        *normal /= looks;
    }
    balance(&above, &forces, height, filled.radius)
}

/// Balances the rings, each with its friction and normal force in grains, from the top downwards.
fn balance(above: &[f64], forces: &[(f64, f64)], height: f64, radius: f64) -> Silo {
    let carried = |k: usize| above[k] - forces[k..].iter().map(|f| f.0).sum::<f64>();
    let level = |k: usize| {
        let (friction, normal) = forces[k];
        let mean = 0.5 * (carried(k) + carried(k + 1));
        // Force over area: the ring's 2 pi r h against the level's pi r^2.
        let stress_ratio = 0.5 * normal * radius / (height * mean);
        Level { above: above[k], carried: carried(k), stress_ratio, mobilised: friction / normal }
    };
    // Rings half a width high: two of them are the width next to the floor.
    let filled = above.iter().take_while(|&&grains| grains >= 1.0).count();
    let levels: Vec<Level> = (2..filled).map(level).collect();
    let full = &levels[..levels.len() - 2];
    let mean = |of: fn(&Level) -> f64| full.iter().map(of).sum::<f64>() / full.len() as f64;
    let (stress_ratio, mobilised) = (mean(|l| l.stress_ratio), mean(|l| l.mobilised));
    let per_length = (above[2] - above[filled - 2]) / (height * (filled - 4) as f64);
    let saturation = 2.0 * radius * per_length / (4.0 * mobilised * stress_ratio);
    Silo { levels, saturation, stress_ratio, mobilised }
}
