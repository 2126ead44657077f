//! The material of a grain or a wall: the numbers that granulcal infers.

use serde::{Deserialize, Serialize};

use crate::error::SceneError;

/// Coefficients of a contact between two surfaces of the same kind.
///
/// | field | symbol | unit | allowed |
/// |---|---|---|---|
/// | `sliding_friction` | mu_s | - | `[0, 10]` |
/// | `rolling_friction` | mu_r | - | `[0, 10^3]` |
/// | `restitution` | e | - | `[0, 1]` |
/// | `tangential_restitution` | e_t | - | `[0, 1]` |
/// | `torsional_friction` | mu_t | - | `[0, 10^3]` |
/// | `softness` | delta / R | - | `[0, 0.2]` |
/// | `touching_exponent` | q | - | `[0, 10]` |
/// | `impact_friction` | - | - | `[0, 10]` |
/// | `rolling_dashpot` | x_r | - | `[0, 10]` |
///
/// `rolling_friction` limits the rolling moment by `mu_r R_eff F_n`, `torsional_friction` the moment about the
/// normal by `mu_t R_eff F_n`, `R_eff = r_i r_j / (r_i + r_j)` for a pair and `r` at a wall (Ai et al. 2011);
/// their upper bound only keeps out typing errors: above about 1 rolling is locked.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// Coulomb's coefficient of sliding friction mu_s `[-]`.
    pub sliding_friction: f64,
    /// Rolling friction mu_r `[-]`.
    pub rolling_friction: f64,
    /// Newton's coefficient of restitution e `[-]`.
    pub restitution: f64,
    /// Tangential restitution e_t `[-]`: a sticking impact leaves with `-e_t` times its tangential speed.
    #[serde(default)]
    pub tangential_restitution: f64,
    /// Torsional friction mu_t `[-]`: resists spinning about the normal, as `rolling_friction` resists rolling.
    #[serde(default = "default_torsional_friction")]
    pub torsional_friction: f64,
    /// Gap below which two grains count as touching when one of them is struck, over the mean of their radii `[-]`:
    /// about the overlap of a typical impact. 0.01 stands for a Young's modulus of some 3e8 Pa at 1 m/s, 0.05 for 3e6
    /// to 3e7.
    #[serde(default = "default_softness")]
    pub softness: f64,
    /// q `[-]`: contacts that touched before a blow have the restitution e^q, the pair that strikes has e. 1 is a
    /// viscous dashpot, 0 an elastic contact; numbers in between are nuisances of other engines' contacts.
    #[serde(default = "one")]
    pub touching_exponent: f64,
    /// Friction cones in impacts over those in lasting contacts `[-]`; above 1 for dashpots that pull, whose tension
    /// other engines count into |F_n|.
    #[serde(default = "one")]
    pub impact_friction: f64,
    /// Dashpot on rolling during an impact, beside a spring that reaches the moment limit, as a share of the critical
    /// one `[-]`: LIGGGHTS' `epsd` (`coefficientRollingViscousDamping`). With one, slower impacts count as impacts.
    #[serde(default)]
    pub rolling_dashpot: f64,
    /// 0: the name of `rolling_dashpot` while it was another law. Scenes of then state it.
    #[doc(hidden)]
    #[serde(default, skip_serializing)]
    pub rolling_damping: f64,
}

/// What a scene may state of the dashpot by its former name.
const FORMER_DASHPOT: &str = "0: it is rolling_dashpot now, and between grains twice as strong";

/// Softness where none is stated: that of the engines that pile grains in rows (docs/theory/contact.md).
const SOFTNESS: f64 = 0.05;

fn default_softness() -> f64 {
    SOFTNESS
}

fn one() -> f64 {
    1.0
}

/// Torsional friction where none is stated: 2/3 mu_s a / R_eff for mu_s 0.5 and a contact of radius a = 0.06 R_eff.
/// With none at all, a grain may spin for ever on the top of another.
const TORSIONAL_FRICTION: f64 = 0.02;

fn default_torsional_friction() -> f64 {
    TORSIONAL_FRICTION
}

impl Default for Material {
    /// A middling dry grain: mu_s 0.5, mu_r 0.1, e 0.5, no tangential restitution, mu_t 0.02.
    fn default() -> Self {
        Self {
            sliding_friction: 0.5,
            rolling_friction: 0.1,
            restitution: 0.5,
            tangential_restitution: 0.0,
            torsional_friction: TORSIONAL_FRICTION,
            softness: SOFTNESS,
            touching_exponent: 1.0,
            impact_friction: 1.0,
            rolling_dashpot: 0.0,
            rolling_damping: 0.0,
        }
    }
}

impl Material {
    /// A checked material without tangential restitution, with the torsional friction of most grains, 0.02.
    ///
    /// # Errors
    /// [`SceneError::OutOfRange`] names the coefficient that is out of range or not finite.
    pub fn new(
        sliding_friction: f64,
        rolling_friction: f64,
        restitution: f64,
    ) -> Result<Self, SceneError> {
        let material = Self { sliding_friction, rolling_friction, restitution, ..Self::default() };
        material.check("material")?;
        Ok(material)
    }

    /// Checks every coefficient; `name` prefixes the path in the error.
    ///
    /// # Errors
    /// [`SceneError::OutOfRange`].
    pub fn check(&self, name: &str) -> Result<(), SceneError> {
        in_range(name, "sliding_friction", self.sliding_friction, 10.0, "in [0, 10]")?;
        in_range(name, "rolling_friction", self.rolling_friction, 1e3, "in [0, 1000]")?;
        in_range(name, "torsional_friction", self.torsional_friction, 1e3, "in [0, 1000]")?;
        in_range(name, "softness", self.softness, 0.2, "in [0, 0.2]")?;
        in_range(name, "touching_exponent", self.touching_exponent, 10.0, "in [0, 10]")?;
        in_range(name, "impact_friction", self.impact_friction, 10.0, "in [0, 10]")?;
        in_range(name, "rolling_dashpot", self.rolling_dashpot, 10.0, "in [0, 10]")?;
        in_range(name, "rolling_damping", self.rolling_damping, 0.0, FORMER_DASHPOT)?;
        in_range(name, "restitution", self.restitution, 1.0, "in [0, 1]")?;
        in_range(name, "tangential_restitution", self.tangential_restitution, 1.0, "in [0, 1]")
    }

    /// Refuses what grains that are not round do not read: numbers of impacts that come one after another in a time of
    /// their own, as only balls' do.
    ///
    /// # Errors
    /// [`SceneError::OfRoundGrains`] names the first that is not at its default, and `body`, which is there.
    pub(crate) fn check_bodies(&self, name: &str, body: &'static str) -> Result<(), SceneError> {
        let plain = Self::default();
        let numbers = [
            ("tangential_restitution", self.tangential_restitution, plain.tangential_restitution),
            ("softness", self.softness, plain.softness),
            ("touching_exponent", self.touching_exponent, plain.touching_exponent),
            ("impact_friction", self.impact_friction, plain.impact_friction),
            ("rolling_dashpot", self.rolling_dashpot, plain.rolling_dashpot),
        ];
        match numbers.iter().find(|(_, got, allowed)| got != allowed) {
            Some(&(field, got, allowed)) => {
                let name = format!("{name}.{field}");
                Err(SceneError::OfRoundGrains { name, got, allowed, body })
            }
            None => Ok(()),
        }
    }
}

/// The coefficients of a wall that differ from the grains'; what is absent is the grains'.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WallMaterial {
    /// Sliding friction of grain on wall `[-]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sliding_friction: Option<f64>,
    /// Rolling friction of grain on wall `[-]`, relative to the grain's radius.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rolling_friction: Option<f64>,
    /// Restitution of grain on wall `[-]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub restitution: Option<f64>,
    /// Tangential restitution of grain on wall `[-]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tangential_restitution: Option<f64>,
    /// Torsional friction of grain on wall `[-]`, relative to the grain's radius.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub torsional_friction: Option<f64>,
    /// Softness of grain on wall `[-]`, relative to the grain's radius.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub softness: Option<f64>,
    /// Exponent of restitution of grains that touch the wall before a blow `[-]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub touching_exponent: Option<f64>,
    /// Friction cones of grain on wall in impacts over those in lasting contacts `[-]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub impact_friction: Option<f64>,
    /// Dashpot on rolling of grain on wall during an impact `[-]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rolling_dashpot: Option<f64>,
    /// 0, as a material's.
    #[doc(hidden)]
    #[serde(default, skip_serializing)]
    pub rolling_damping: Option<f64>,
}

impl WallMaterial {
    /// True when every coefficient is the grains'.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// The wall's material, with the grains' where the wall states nothing.
    pub fn over(&self, grains: &Material) -> Material {
        Material {
            sliding_friction: self.sliding_friction.unwrap_or(grains.sliding_friction),
            rolling_friction: self.rolling_friction.unwrap_or(grains.rolling_friction),
            restitution: self.restitution.unwrap_or(grains.restitution),
            tangential_restitution: self
                .tangential_restitution
                .unwrap_or(grains.tangential_restitution),
            torsional_friction: self.torsional_friction.unwrap_or(grains.torsional_friction),
            softness: self.softness.unwrap_or(grains.softness),
            touching_exponent: self.touching_exponent.unwrap_or(grains.touching_exponent),
            impact_friction: self.impact_friction.unwrap_or(grains.impact_friction),
            rolling_dashpot: self.rolling_dashpot.unwrap_or(grains.rolling_dashpot),
            rolling_damping: self.rolling_damping.unwrap_or(grains.rolling_damping),
        }
    }
}

/// Dimensionless rolling friction of a rolling resistance given as a length `[m]` (MuJoCo, Chrono,
/// Newton, Zhou 2002: moment <= length * F_n); `effective_radius` is `R_eff` of the contact `[m]`.
pub fn rolling_friction_from_length(length: f64, effective_radius: f64) -> f64 {
    length / effective_radius
}

/// Rolling resistance as a length `[m]`, the inverse of [`rolling_friction_from_length`].
pub fn rolling_friction_to_length(rolling_friction: f64, effective_radius: f64) -> f64 {
    rolling_friction * effective_radius
}

fn in_range(
    name: &str,
    field: &str,
    got: f64,
    max: f64,
    allowed: &'static str,
) -> Result<(), SceneError> {
    if (0.0..=max).contains(&got) {
        return Ok(());
    }
    Err(SceneError::range(format!("{name}.{field}"), got, allowed))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refuses_what_is_out_of_range_by_name() {
        let error = Material::new(-0.3, 0.1, 0.5).unwrap_err().to_string();
        assert_eq!(error, "material.sliding_friction must be in [0, 10], got -0.3");
        assert!(Material::new(0.5, f64::NAN, 0.5).is_err());
        assert!(Material::new(0.5, 0.1, 1.01).is_err());
        let former = Material { rolling_damping: 0.7, ..Material::default() };
        let error = former.check("material").unwrap_err().to_string();
        assert!(error.contains("rolling_damping must be 0: it is rolling_dashpot now"), "{error}");
    }

    #[test]
    fn wall_takes_the_grains_where_it_states_nothing() {
        let grains = Material::default();
        let wall = WallMaterial { restitution: Some(0.2), ..WallMaterial::default() };
        assert_eq!(wall.over(&grains), Material { restitution: 0.2, ..grains });
        assert!(WallMaterial::default().is_empty() && !wall.is_empty());
    }

    #[test]
    fn rolling_length_round_trip() {
        // 4 mm grains: R_eff of a pair is 1 mm, so 0.1 mm of rolling length is mu_r = 0.1.
        assert!((rolling_friction_from_length(1e-4, 1e-3) - 0.1).abs() < 1e-15);
        assert!((rolling_friction_to_length(0.1, 1e-3) - 1e-4).abs() < 1e-18);
    }
}
