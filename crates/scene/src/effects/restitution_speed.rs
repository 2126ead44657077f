//! Restitution that depends on the speed of the impact: `e(v) = e (v / v_0)^(-q)`, at most 1.
//!
//! Source: q = 1/4 for plastic contacts (Thornton, J. Appl. Mech. 64 (1997) 383, doi:10.1115/1.2787319), q about 0.06
//! for viscoelastic ones near e = 0.8 (Ramirez et al., Phys. Rev. E 60 (1999) 4465, doi:10.1103/PhysRevE.60.4465, as a
//! power law over a decade of speeds). Dimensional screen: over pours of 4 to 12 cm speeds differ by a factor 1.7, so e
//! by 0.6 q.

use serde::{Deserialize, Serialize};

use super::effect::Effect;
use crate::check::{finite, positive};
use crate::error::SceneError;

/// Restitution and speed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RestitutionSpeed {
    /// q `[-]`: restitution falls with speed where it is positive.
    pub exponent: f64,
    /// v_0, where the restitution is the material's `[m/s]`.
    pub reference: f64,
}

impl Default for RestitutionSpeed {
    fn default() -> Self {
        Self { exponent: 0.0, reference: 1.0 }
    }
}

impl Effect for RestitutionSpeed {
    fn path(&self) -> &'static str {
        "effects.restitution_speed"
    }

    fn check(&self) -> Result<(), SceneError> {
        finite("effects.restitution_speed.exponent", self.exponent)?;
        positive("effects.restitution_speed.reference", self.reference)
    }

    fn is_on(&self) -> bool {
        self.exponent != 0.0
    }
}

impl RestitutionSpeed {
    /// The restitution of an impact at `speed` `[m/s]`.
    pub fn at(&self, restitution: f64, speed: f64) -> f64 {
        // None stays none, whatever the power.
        let scaled = restitution * (speed / self.reference).powf(-self.exponent);
        if restitution > 0.0 { scaled.min(1.0) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarter_power() {
        let plastic = RestitutionSpeed { exponent: 0.25, reference: 1.0 };
        assert_eq!(plastic.at(0.6, 1.0), 0.6);
        assert!((plastic.at(0.6, 16.0) - 0.3).abs() < 1e-15);
        assert_eq!(plastic.at(0.6, 1e-4), 1.0);
        assert_eq!(RestitutionSpeed { exponent: 1e4, reference: 1.0 }.at(0.0, 0.1), 0.0);
    }
}
