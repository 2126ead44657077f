//! Capillary cohesion: liquid bridges that form when grains touch and hold until they are drawn too long.
//!
//! With Derjaguin's radius R = 2 r_i r_j / (r_i + r_j) (2 r at a flat wall), surface tension gamma, contact angle theta
//! and the volume V of a bridge, at separation S:
//!
//! ```text
//! F = 2 pi R gamma cos(theta) / (1 + 1.05 s + 2.5 s^2),   s = S sqrt(R / V)
//! ruptures at S_c = (1 + theta / 2) V^(1/3)
//! ```
//!
//! Source: Willett, Adams, Johnson and Seville, Langmuir 16 (2000) 9396, doi:10.1021/la000657y; rupture: Lian, Thornton
//! and Adams, J. Colloid Interface Sci. 161 (1993) 138, doi:10.1006/jcis.1993.1452. Dimensional screen: no effect below
//! a Bond number of about 0.03. Water on 4 mm couscous, wetted all around: about 2.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use super::effect::Effect;
use super::tension::either;
use crate::check::{non_negative, positive};
use crate::error::SceneError;

/// Liquid bridges.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Capillary {
    /// Pull of two touching typical grains over the weight of one `[-]`, 2 pi R gamma cos(theta) / (m g).
    pub bond: f64,
    /// Surface tension gamma `[N/m]`, in place of `bond`: the same at any gravity.
    pub tension: f64,
    /// Volume of a bridge over the cube of a typical grain's radius `[-]`.
    pub volume: f64,
    /// Contact angle theta `[rad]`.
    pub contact_angle: f64,
    /// Pull at walls over that of the same bridge at a wall like the grains `[-]`; 0: dry walls.
    pub walls: f64,
}

impl Default for Capillary {
    fn default() -> Self {
        Self { bond: 0.0, tension: 0.0, volume: 2e-3, contact_angle: 0.0, walls: 1.0 }
    }
}

impl Effect for Capillary {
    fn path(&self) -> &'static str {
        "effects.capillary"
    }

    fn check(&self) -> Result<(), SceneError> {
        non_negative("effects.capillary.bond", self.bond)?;
        either("effects.capillary.tension", self.tension, self.bond)?;
        positive("effects.capillary.volume", self.volume)?;
        if !(0.0..std::f64::consts::FRAC_PI_2).contains(&self.contact_angle) {
            let allowed = "in [0, pi/2)";
            return Err(SceneError::range(
                "effects.capillary.contact_angle",
                self.contact_angle,
                allowed,
            ));
        }
        non_negative("effects.capillary.walls", self.walls)
    }

    fn is_on(&self) -> bool {
        self.bond > 0.0 || self.tension > 0.0
    }
}

impl Capillary {
    /// Pull of two touching grains of a `radius` and a `mass` over that mass, at a gravity of `g` `[m/s^2]`.
    pub fn touch(&self, radius: f64, mass: f64, g: f64) -> f64 {
        self.bond * g + TAU * radius * self.tension * self.contact_angle.cos() / mass
    }

    /// Separation at which a bridge ruptures, in radii of a typical grain `[-]`.
    pub fn rupture(&self) -> f64 {
        (1.0 + 0.5 * self.contact_angle) * self.volume.cbrt()
    }

    /// Pull of a bridge over that of touching typical grains `[-]`: `gap` and `derjaguin` (R) in radii of a typical
    /// grain.
    pub fn pull(&self, gap: f64, derjaguin: f64) -> f64 {
        let s = gap.max(0.0) * (derjaguin / self.volume).sqrt();
        derjaguin / (1.0 + 1.05 * s + 2.5 * s * s)
    }

    /// Work to part a bridge from `gap` until it ruptures, over the pull of touching typical grains times a radius
    /// `[-]`: the integral of [`Capillary::pull`].
    pub fn work(&self, gap: f64, derjaguin: f64) -> f64 {
        // Of 1 / (1 + a s + b s^2) with 4 b > a^2: 2 / q atan((2 b s + a) / q), q^2 = 4 b - a^2.
        let (a, b): (f64, f64) = (1.05, 2.5);
        let (q, scale) = ((4.0 * b - a * a).sqrt(), (derjaguin / self.volume).sqrt());
        let until = |gap: f64| ((2.0 * b * scale * gap + a) / q).atan();
        let parted = until(self.rupture()) - until(gap.max(0.0));
        (derjaguin / scale * 2.0 / q * parted).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pull_is_willetts() {
        let wet = Capillary { bond: 1.0, volume: 1e-3, ..Capillary::default() };
        assert_eq!(wet.pull(0.0, 1.0), 1.0); // touching typical grains: R = r
        assert_eq!(wet.pull(-0.01, 2.0), 2.0); // at a flat wall twice that
        // s = S sqrt(R / V) = 1 at S = sqrt(1e-3) r.
        assert!((wet.pull(1e-3f64.sqrt(), 1.0) - 1.0 / 4.55).abs() < 1e-12);
        assert!((wet.rupture() - 0.1).abs() < 1e-12);
    }

    #[test]
    fn work_is_the_integral_of_the_pull() {
        let wet = Capillary { bond: 1.0, contact_angle: 0.3, ..Capillary::default() };
        for (from, derjaguin) in [(0.0, 1.0), (-1e-3, 2.0), (0.05, 0.8)] {
            let (start, parts) = (f64::max(from, 0.0), 1000);
            let step = (wet.rupture() - start) / f64::from(parts);
            let middle = |k: i32| wet.pull(start + (f64::from(k) + 0.5) * step, derjaguin);
            let sum = step * (0..parts).map(middle).sum::<f64>();
            assert!((wet.work(from, derjaguin) / sum - 1.0).abs() < 1e-5);
        }
        assert_eq!(wet.work(1.1 * wet.rupture(), 1.0), 0.0);
    }

    #[test]
    fn tension_is_newtons_per_metre_at_any_gravity() {
        // Water on 4 mm couscous, wetted all around: 0.9 mN, of grains of 1300 kg/m3 about two weights.
        let (radius, mass) = (2e-3, 1300.0 * 4.0 / 3.0 * std::f64::consts::PI * 8e-9);
        let wet = Capillary { tension: 0.0725, ..Capillary::default() };
        let force = TAU * radius * 0.0725;
        for g in [0.0, 9.81, 45.22] {
            assert!((wet.touch(radius, mass, g) * mass - force).abs() < 1e-15);
        }
        let bond = wet.touch(radius, mass, 9.81) / 9.81;
        let same = Capillary { bond, ..Capillary::default() };
        assert!(
            (same.touch(radius, mass, 9.81) / wet.touch(radius, mass, 9.81) - 1.0).abs() < 1e-15
        );
        let both = Capillary { bond: 1.0, ..wet };
        let error = both.check().unwrap_err().to_string();
        assert!(
            error.contains("effects.capillary.tension must be 0 where bond is stated"),
            "{error}"
        );
    }
}
