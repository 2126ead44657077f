//! Fourier coefficients of mass and rim: the equations are in the head of `modes.rs`.

use std::f64::consts::{PI, TAU};

use crate::stats::iqr::quantile;

/// Sectors of the rim.
const SECTORS: usize = 24;
/// Share of a sector's points within its rim.
const RIM_QUANTILE: f64 = 0.9;
/// Values of three modes: cos and sin in turn.
pub(crate) const VALUES: usize = 6;

/// Modes 1 to 3 of mass and rim, cos and sin in turn.
#[derive(Debug, Clone)]
pub(crate) struct Modes {
    pub(crate) mass: [f64; VALUES],
    pub(crate) rim: [f64; VALUES],
}

impl Modes {
    pub(crate) fn new([x, y, z, r]: [&[f64]; 4]) -> Self {
        Self { mass: mass_modes(x, y, z, r), rim: rim_modes(x, y, r) }
    }
}

/// cos and sin of φ, 2φ, 3φ from those of φ.
fn waves(cos: f64, sin: f64) -> [f64; VALUES] {
    let (cos_2, sin_2) = (cos * cos - sin * sin, 2.0 * cos * sin);
    [cos, sin, cos_2, sin_2, cos * cos_2 - sin * sin_2, sin * cos_2 + cos * sin_2]
}

fn mass_modes(x: &[f64], y: &[f64], z: &[f64], r: &[f64]) -> [f64; VALUES] {
    let (mut modes, mut total) = ([0.0; VALUES], 0.0);
    for (((x, y), r), z) in x.iter().zip(y).zip(r).zip(z) {
        let weight = z.max(0.0);
        total += weight;
        // A point on the axis has weight and no azimuth.
        if *r > 0.0 {
            for (mode, wave) in modes.iter_mut().zip(waves(x / r, y / r)) {
                *mode += weight * wave;
            }
        }
    }
    modes.map(|mode| if total > 0.0 { mode / total } else { 0.0 })
}

fn rim_modes(x: &[f64], y: &[f64], r: &[f64]) -> [f64; VALUES] {
    let mut sectors = [const { Vec::new() }; SECTORS];
    for ((&x, &y), &r) in x.iter().zip(y).zip(r) {
        if r > 0.0 {
            let sector = ((y.atan2(x) + PI) / TAU * SECTORS as f64) as usize;
            sectors[sector.min(SECTORS - 1)].push(r);
        }
    }
    let (mut modes, mut total) = ([0.0; VALUES], 0.0);
    for (sector, radii) in sectors.iter_mut().enumerate() {
        let rim = quantile(radii, RIM_QUANTILE);
        let (sin, cos) = ((sector as f64 + 0.5) / SECTORS as f64 * TAU - PI).sin_cos();
        for (mode, wave) in modes.iter_mut().zip(waves(cos, sin)) {
            *mode += 2.0 * rim * wave;
        }
        total += rim;
    }
    modes.map(|mode| if total > 0.0 { mode / total } else { 0.0 })
}
