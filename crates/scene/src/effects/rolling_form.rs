//! Rolling resistance of another form: a moment that grows with the speed of rolling, up to Coulomb's.
//!
//! ```text
//! M = -mu_r R_eff F_n min(1, |rho| / v_0) rho / |rho|,    rho: rolling velocity at the contact
//! ```
//!
//! With v_0 = 0 it is the base model's moment, which holds a grain that does not roll; with any other nothing holds it,
//! and a heap creeps. Source: the viscous and the constant-torque model (B and A) of Ai et al., Powder Technology 206
//! (2011) 269, doi:10.1016/j.powtec.2010.09.030; one in the other's limit.

use serde::{Deserialize, Serialize};

use super::effect::Effect;
use crate::check::non_negative;
use crate::error::SceneError;

/// The speed that tells the forms apart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RollingForm {
    /// v_0 `[m/s]`; 0 is off.
    pub speed: f64,
}

impl Effect for RollingForm {
    fn path(&self) -> &'static str {
        "effects.rolling_form"
    }

    fn check(&self) -> Result<(), SceneError> {
        non_negative("effects.rolling_form.speed", self.speed)
    }

    fn is_on(&self) -> bool {
        self.speed > 0.0
    }

    fn changes_contacts(&self) -> bool {
        true
    }
}
