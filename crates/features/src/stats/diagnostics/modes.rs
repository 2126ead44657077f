//! Azimuthal modes of the mass and of the rim about the pour axis.
//!
//! With φ the azimuth of a point about the pour axis and m = 1, 2, 3,
//!
//! \\[ \mathrm{mass\_cos}_m + i\,\mathrm{mass\_sin}_m = \frac{\sum_i z_i e^{i m \varphi_i}}{\sum_i z_i} \\]
//!
//! is the Fourier coefficient of the volume under the points (those below the ground left out). The rim is
//! R_s, the 90 % quantile of r in each of S = 24 equal sectors, 0 in an empty one, at the azimuth φ_s of
//! the sector's middle:
//!
//! \\[ \mathrm{rim\_cos}_m + i\,\mathrm{rim\_sin}_m = \frac{2 \sum_s R_s e^{i m \varphi_s}}{\sum_s R_s} \\]
//!
//! so that a rim R (1 + a cos mφ) reads a. A mode of order 1 is a tilt or an offset, order 2 an ellipse. Each pair
//! turns with the axes: by a rotation α it becomes e^{imα} times itself (the rim's for multiples of a
//! sector, 15°). 0 where there is nothing to weigh. A sector averages over 15°: the rim's amplitudes read
//! sin(mπ/24)/(mπ/24) of themselves, 2.6 % low at m = 3.
//!
//! Source: Fourier coefficients on the circle, Mardia & Jupp 2000, Directional Statistics, section 2.4,
//! weighted; the loop's design for mass and rim as the two functions of azimuth.

use std::f64::consts::{PI, TAU};

use super::{Diagnostic, Survey};
use crate::stats::iqr::quantile;
use crate::stats::{Behaviour, Rotation};

/// Sectors of the rim.
const SECTORS: usize = 24;
/// Share of a sector's points within its rim.
const RIM_QUANTILE: f64 = 0.9;
/// Values of three modes: cos and sin in turn.
const VALUES: usize = 6;

/// Modes 1 to 3 of the volume.
pub(super) const MASS: [Diagnostic; VALUES] = [
    mass::<0>("mass_cos_1", "cosine mode 1 of the volume about the pour axis"),
    mass::<1>("mass_sin_1", "sine mode 1 of the volume about the pour axis"),
    mass::<2>("mass_cos_2", "cosine mode 2 of the volume about the pour axis"),
    mass::<3>("mass_sin_2", "sine mode 2 of the volume about the pour axis"),
    mass::<4>("mass_cos_3", "cosine mode 3 of the volume about the pour axis"),
    mass::<5>("mass_sin_3", "sine mode 3 of the volume about the pour axis"),
];

/// Modes 1 to 3 of the rim's radius.
pub(super) const RIM: [Diagnostic; VALUES] = [
    rim::<0>("rim_cos_1", "cosine mode 1 of the rim's radius about the pour axis, over the mean"),
    rim::<1>("rim_sin_1", "sine mode 1 of the rim's radius about the pour axis, over the mean"),
    rim::<2>("rim_cos_2", "cosine mode 2 of the rim's radius about the pour axis, over the mean"),
    rim::<3>("rim_sin_2", "sine mode 2 of the rim's radius about the pour axis, over the mean"),
    rim::<4>("rim_cos_3", "cosine mode 3 of the rim's radius about the pour axis, over the mean"),
    rim::<5>("rim_sin_3", "sine mode 3 of the rim's radius about the pour axis, over the mean"),
];

const fn mass<const VALUE: usize>(name: &'static str, doc: &'static str) -> Diagnostic {
    let rotation = Rotation::Mode { order: VALUE as u8 / 2 + 1 };
    let behaviour = Behaviour { rotation, ..Behaviour::WEIGHED_NUMBER };
    Diagnostic { name, unit: "-", doc, behaviour, value: |survey| survey.modes().mass[VALUE] }
}

const fn rim<const VALUE: usize>(name: &'static str, doc: &'static str) -> Diagnostic {
    let rotation = Rotation::Mode { order: VALUE as u8 / 2 + 1 };
    let behaviour = Behaviour { rotation, ..Behaviour::NUMBER };
    Diagnostic { name, unit: "-", doc, behaviour, value: |survey| survey.modes().rim[VALUE] }
}

/// Modes 1 to 3 of mass and rim, cos and sin in turn.
#[derive(Debug, Clone)]
pub(super) struct Modes {
    pub(super) mass: [f64; VALUES],
    pub(super) rim: [f64; VALUES],
}

impl Modes {
    pub(super) fn new(survey: &Survey) -> Self {
        Self { mass: mass_modes(survey), rim: rim_modes(survey) }
    }
}

/// cos and sin of φ, 2φ, 3φ from those of φ.
fn waves(cos: f64, sin: f64) -> [f64; VALUES] {
    let (cos_2, sin_2) = (cos * cos - sin * sin, 2.0 * cos * sin);
    [cos, sin, cos_2, sin_2, cos * cos_2 - sin * sin_2, sin * cos_2 + cos * sin_2]
}

fn mass_modes(survey: &Survey) -> [f64; VALUES] {
    let (mut modes, mut total) = ([0.0; VALUES], 0.0);
    for (((x, y), r), z) in survey.x.iter().zip(&survey.y).zip(&survey.r).zip(&survey.z) {
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

fn rim_modes(survey: &Survey) -> [f64; VALUES] {
    let mut sectors = [const { Vec::new() }; SECTORS];
    for ((&x, &y), &r) in survey.x.iter().zip(&survey.y).zip(&survey.r) {
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
