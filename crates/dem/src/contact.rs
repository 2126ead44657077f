//! Contacts in batches of [`LANES`], with their coefficients.
//!
//! Between two searches the list of contacts is fixed; every substep refreshes gap, normal and bias of
//! each. Impulses live in the batches.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::lanes::{LANES, Lanes, Lanes3};
use crate::law::INVERSE_INERTIA;

/// [`LANES`] contacts: geometry, law and impulses. Empty lanes refer to the resting body and have no compliance.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Batch {
    /// First grain of each contact.
    pub i: [u32; LANES],
    /// Second grain, or the resting body at a wall.
    pub j: [u32; LANES],
    /// Unit normal from `j` to `i`.
    pub normal: Lanes3,
    /// Bias b of `0 <= w_n + b _|_ lambda_n >= 0` `[m/s]`.
    pub bias: Lanes,
    /// Normal impulse.
    pub lambda_n: Lanes,
    /// Tangential impulse, at right angles to the normal.
    pub lambda_t: Lanes3,
    /// Rolling and torsional impulse over the effective radius.
    pub lambda_r: Lanes3,
    /// Coefficients, as an index into `ContactSet::laws`.
    pub law: u32,
    /// How many lanes are in use.
    pub used: u32,
}

/// Masses, levers, compliances and friction of the contacts of a batch; shared by all batches that agree.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct LawLanes {
    /// Inverse masses.
    pub inverse_mass_i: Lanes,
    pub inverse_mass_j: Lanes,
    /// R_eff / r of either grain.
    pub lever_i: Lanes,
    pub lever_j: Lanes,
    /// 1 / A_n and 1 / A_r of the contact's own Delassus block; 1 / A_t is 2/7 of 1 / A_n.
    pub compliance_n: Lanes,
    pub compliance_r: Lanes,
    pub sliding_friction: Lanes,
    pub rolling_friction: Lanes,
    pub torsional_friction: Lanes,
    /// What a soft contact gives way per impulse; 0 is rigid.
    pub compliance: Lanes,
    /// Rolling velocity up to which the rolling impulse grows with it `[m/s]`; 0 is Coulomb's law.
    pub rolling_speed: f64,
    /// Whether the sliding impulse of any lane changes its rolling velocity: not between equal spheres.
    pub couples: bool,
}

/// What only grains at walls need.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(crate) struct WallLanes {
    /// Wall of each contact.
    pub wall: [u32; LANES],
    /// Side of the wall's shell at the last search (see `wall::Nearest::side`).
    pub side: [i8; LANES],
    /// Whether the grain's centre has changed sides.
    pub went_through: [bool; LANES],
}

/// A contact before it is put into a batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct ContactKey {
    pub i: u32,
    /// Second grain, or the wall's number.
    pub partner: u32,
}

/// Two grains, or a grain and a wall, that may be an impact within the substep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Candidate {
    pub i: u32,
    /// Second grain, or the number of grains plus the wall's number.
    pub partner: u32,
}

/// Coefficients of one contact, put into a lane when the list is made.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct ContactLaw {
    pub inverse_mass: [f64; 2],
    pub lever: [f64; 2],
    pub sliding_friction: f64,
    pub rolling_friction: f64,
    pub torsional_friction: f64,
    /// See [`LawLanes::compliance`].
    pub compliance: f64,
    /// See [`LawLanes::rolling_speed`].
    pub rolling_speed: f64,
}

impl Batch {
    pub fn empty(resting: u32) -> Self {
        Self {
            i: [resting; LANES],
            j: [resting; LANES],
            normal: Lanes3 { x: Lanes::ZERO, y: Lanes::ZERO, z: Lanes::splat(1.0) },
            bias: Lanes::ZERO,
            lambda_n: Lanes::ZERO,
            lambda_t: Lanes3::ZERO,
            lambda_r: Lanes3::ZERO,
            law: 0,
            used: 0,
        }
    }

    /// Lanes in use.
    pub fn lanes(&self) -> Range<usize> {
        0..self.used as usize
    }
}

impl LawLanes {
    /// All lanes alike.
    pub fn uniform(law: &ContactLaw) -> Self {
        let mut lanes = Self {
            inverse_mass_i: Lanes::ZERO,
            inverse_mass_j: Lanes::ZERO,
            lever_i: Lanes::ZERO,
            lever_j: Lanes::ZERO,
            compliance_n: Lanes::ZERO,
            compliance_r: Lanes::ZERO,
            sliding_friction: Lanes::ZERO,
            rolling_friction: Lanes::ZERO,
            torsional_friction: Lanes::ZERO,
            compliance: Lanes::ZERO,
            rolling_speed: law.rolling_speed,
            couples: false,
        };
        (0..LANES).for_each(|lane| lanes.set(lane, law));
        lanes
    }

    /// Gives a lane the coefficients of a contact.
    pub fn set(&mut self, lane: usize, law: &ContactLaw) {
        let [mass_i, mass_j] = law.inverse_mass;
        let [lever_i, lever_j] = law.lever;
        self.inverse_mass_i.0[lane] = mass_i;
        self.inverse_mass_j.0[lane] = mass_j;
        self.lever_i.0[lane] = lever_i;
        self.lever_j.0[lane] = lever_j;
        self.couples |= lever_i * mass_i != lever_j * mass_j;
        self.compliance_n.0[lane] = 1.0 / (mass_i + mass_j + law.compliance);
        self.compliance.0[lane] = law.compliance;
        let roll = lever_i * lever_i * mass_i + lever_j * lever_j * mass_j;
        self.compliance_r.0[lane] = 1.0 / (INVERSE_INERTIA * roll);
        self.sliding_friction.0[lane] = law.sliding_friction;
        self.rolling_friction.0[lane] = law.rolling_friction;
        self.torsional_friction.0[lane] = law.torsional_friction;
    }
}
