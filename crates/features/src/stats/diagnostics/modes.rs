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

pub(super) mod fourier;

use self::fourier::VALUES;
use super::survey::Diagnostic;
use crate::stats::{Behaviour, Rotation};

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
