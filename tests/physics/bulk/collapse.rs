//! A column of grains that loses its wall at once and spreads.
//!
//!     (r_inf - r_0) / r_0 = 1.24 a        for a < 1.7
//!                         = 1.6 sqrt(a)   above,    a = h_0 / r_0
//!
//! (Lube, Huppert, Sparks, Hallworth 2004, doi:10.1017/S0022112004009036). The deposit ends where rings a diameter
//! wide, seen from above, are less than half covered: grains that bounce or roll on alone are not part of it.

use std::f64::consts::PI;

use granulcal::dem::{Material, WallMaterial};
use nalgebra::Vector3;

use super::packed::{DIAMETER, rain, scene, settle, start, top_of, tube, wait_for_rest};

/// Aspect ratio at which the law changes.
pub const KNEE: f64 = 1.7;

/// Cover of a ring below which the deposit has ended: grain cross sections over the ring's area `[-]`.
const COVER: f64 = 0.5;
/// Solid fraction that a column's number of grains is chosen for.
const EXPECTED_FRACTION: f64 = 0.58;

/// A collapse, lengths in diameters.
#[derive(Clone, Copy, Debug)]
pub struct Collapse {
    /// h_0 / r_0 of the column as it stood `[-]`.
    pub aspect: f64,
    /// (r_inf - r_0) / r_0 `[-]`.
    pub run_out: f64,
    /// Height of the deposit at its middle over r_0 `[-]`.
    pub height: f64,
    /// Number of grains.
    pub count: usize,
}

/// Lube's run-out at the aspect ratio `a`.
pub fn lube(a: f64) -> f64 {
    if a < KNEE { 1.24 * a } else { 1.6 * a.sqrt() }
}

/// A column of radius `radius` diameters and about `aspect` times as high collapses on the ground.
pub fn measure(radius: f64, aspect: f64, material: Material, seed: u64) -> Collapse {
    let count = (6.0 * EXPECTED_FRACTION * radius.powi(3) * aspect).round() as usize;
    let r_0 = radius * DIAMETER;
    let rained = rain(count, r_0, 0.0, seed);
    let wall = tube(r_0, 0.0, top_of(&rained), WallMaterial::default());
    let column = settle(&scene(&rained, material, vec![wall]));
    // Of a uniform column the mean height is half the height; single grains on top do not count.
    let h_0 = 2.0 * column.iter().map(|p| p.z).sum::<f64>() / count as f64;

    let mut simulation = start(&scene(&column, material, Vec::new()));
    wait_for_rest(&mut simulation);
    let deposit = &simulation.positions();
    Collapse {
        aspect: h_0 / r_0,
        run_out: edge(deposit) / r_0 - 1.0,
        height: middle(deposit) / r_0,
        count,
    }
}

/// Radius at which the cover of the ground falls below [`COVER`] for good `[m]`.
fn edge(deposit: &[Vector3<f64>]) -> f64 {
    let mut rings = Vec::new();
    for grain in deposit {
        let ring = (grain.x.hypot(grain.y) / DIAMETER) as usize;
        if ring >= rings.len() {
            rings.resize(ring + 1, 0.0);
        }
        rings[ring] += 0.25 * PI;
    }
    let cover: Vec<f64> =
        rings.iter().enumerate().map(|(k, grains)| grains / (PI * (2 * k + 1) as f64)).collect();
    let last = cover.iter().rposition(|&c| c >= COVER).unwrap_or(0);
    // Between the middles of the last ring above and the first below, linearly.
    let next = cover.get(last + 1).copied().unwrap_or(0.0);
    (last as f64 + 0.5 + (cover[last] - COVER) / (cover[last] - next)) * DIAMETER
}

/// Top of the deposit within two diameters of the axis `[m]`.
fn middle(deposit: &[Vector3<f64>]) -> f64 {
    let near = |p: &&Vector3<f64>| p.x.hypot(p.y) < 2.0 * DIAMETER;
    deposit.iter().filter(near).map(|p| p.z + 0.5 * DIAMETER).fold(0.0, f64::max)
}
