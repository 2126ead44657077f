//! Grains of different size: lognormal diameters, or diameters drawn from a measured list.
//!
//! `d_i = d exp(s z_i - 3/2 s^2)` with `s^2 = ln(1 + cv^2)` and z normal, cut off at |z| = 2.5. The mean volume is that
//! of grains of diameter d for the uncut distribution, so the pour's mass stays what it is but for what the cut takes:
//! 2 % at a cv of 0.2, 6 % at 0.35, 13 % at 0.5, the largest that is taken. A list is scaled by nothing: its diameters
//! are what they are. Masses go with the cube.

use granulcal_numbers::{box_muller, half_open};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};

use super::effect::Effect;
use crate::check::positive;
use crate::error::SceneError;

/// Farthest z of a grain `[-]`.
const CUT: f64 = 2.5;
/// Largest spread: beyond it the cut takes too much of the volume `[-]`.
const WIDEST: f64 = 0.5;
/// Keeps the sizes of a seed apart from its places.
const STREAM: u64 = 0x9e37_79b9_7f4a_7c15;

/// Sizes of grains.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Polydispersity {
    /// Standard deviation over mean of the diameters `[-]`.
    pub cv: f64,
    /// Measured diameters `[m]`, each as likely as the others; instead of `cv`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub diameters: Vec<f64>,
}

impl Effect for Polydispersity {
    fn path(&self) -> &'static str {
        "effects.polydispersity"
    }

    fn check(&self) -> Result<(), SceneError> {
        if !(0.0..=WIDEST).contains(&self.cv) {
            return Err(SceneError::range("effects.polydispersity.cv", self.cv, "in [0, 0.5]"));
        }
        for (number, &diameter) in self.diameters.iter().enumerate() {
            positive(&format!("effects.polydispersity.diameters.{number}"), diameter)?;
        }
        if self.cv > 0.0 && !self.diameters.is_empty() {
            let allowed = "0 where diameters are listed";
            return Err(SceneError::range("effects.polydispersity.cv", self.cv, allowed));
        }
        Ok(())
    }

    fn is_on(&self) -> bool {
        self.cv > 0.0 || !self.diameters.is_empty()
    }
}

impl Polydispersity {
    /// Diameter of the widest grain that may be drawn, of typical diameter `diameter` `[m]`.
    pub(crate) fn widest(&self, diameter: f64) -> f64 {
        if !self.diameters.is_empty() {
            return self.diameters.iter().copied().fold(0.0, f64::max);
        }
        let variance = (1.0 + self.cv * self.cv).ln();
        // Their size grows with z up to the cut.
        diameter * (CUT * variance.sqrt() - 1.5 * variance).exp()
    }

    /// Radii of `count` grains of typical radius `radius` `[m]`; `None` when they are all alike.
    pub fn radii(&self, count: usize, radius: f64, seed: u64) -> Option<Vec<f64>> {
        let mut random = Pcg64::seed_from_u64(seed ^ STREAM);
        let mut uniform = move || half_open(random.next_u64());
        if !self.diameters.is_empty() {
            let pick = |u: f64| (u * self.diameters.len() as f64) as usize;
            return Some((0..count).map(|_| 0.5 * self.diameters[pick(uniform())]).collect());
        }
        if self.cv == 0.0 {
            return None;
        }
        let variance = (1.0 + self.cv * self.cv).ln();
        let mut size = move || loop {
            let (u, v) = (uniform(), uniform());
            // 1 - u is never 0.
            let [z, _] = box_muller(1.0 - u, v);
            if z.abs() <= CUT {
                return radius * (variance.sqrt() * z - 1.5 * variance).exp();
            }
        };
        Some((0..count).map(|_| size()).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_the_stated_spread_and_volume() {
        let (cv, count) = (0.2, 40_000);
        let radii = Polydispersity { cv, diameters: Vec::new() }.radii(count, 2e-3, 3).unwrap();
        let mean = radii.iter().sum::<f64>() / count as f64;
        let variance = radii.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / count as f64;
        let volume = radii.iter().map(|r| (r / 2e-3).powi(3)).sum::<f64>() / count as f64;
        // The cut takes 1.2 % of the grains, 5 % of the variance and 2 % of the volume.
        assert!((variance.sqrt() / mean / cv - 1.0).abs() < 0.06);
        assert!((volume - 1.0).abs() < 0.03, "{volume}");
    }

    #[test]
    fn the_cut_takes_what_is_stated() {
        for (cv, left) in [(0.2, 0.984), (0.35, 0.942), (0.5, 0.871)] {
            let sizes = Polydispersity { cv, diameters: Vec::new() };
            let radii = sizes.radii(40_000, 1.0, 3).unwrap();
            let volume = radii.iter().map(|r| r.powi(3)).sum::<f64>() / 40_000.0;
            assert!((volume - left).abs() < 0.01, "{cv}: {volume}");
        }
        let wide = Polydispersity { cv: 0.6, diameters: Vec::new() };
        assert!(wide.check().unwrap_err().to_string().contains("[0, 0.5]"));
    }

    #[test]
    fn equal_grains_have_no_list_and_a_seed_repeats() {
        assert!(Polydispersity::default().radii(5, 2e-3, 1).is_none());
        let listed = Polydispersity { cv: 0.0, diameters: vec![1e-3, 3e-3] };
        let radii = listed.radii(200, 2e-3, 1).unwrap();
        assert_eq!(radii, listed.radii(200, 2e-3, 1).unwrap());
        assert_ne!(radii, listed.radii(200, 2e-3, 2).unwrap());
        let small = radii.iter().filter(|&&r| r == 5e-4).count();
        assert!((70..130).contains(&small) && radii.iter().all(|&r| r == 5e-4 || r == 1.5e-3));
    }
}
