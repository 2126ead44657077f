//! How the contact problem of a substep is solved, as numbers: the methods themselves are in `solver/`.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::SceneError;

/// How the contact problem of a substep is solved. All methods solve the same problem.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Non-smooth Gauss-Seidel: fast, and what every preset but `paper` uses.
    #[default]
    Nsgs,
    /// Non-smooth Newton on a matrix-free conjugate residual solver (Macklin et al. 2019), guarded.
    NewtonPcr,
    /// Non-smooth Gauss-Seidel with conjugate directions, iterated to a stated residual.
    Reference,
}

impl Method {
    /// Every method.
    pub const ALL: [Self; 3] = [Self::Nsgs, Self::NewtonPcr, Self::Reference];

    /// The word for it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Nsgs => "nsgs",
            Self::NewtonPcr => "newton_pcr",
            Self::Reference => "reference",
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Method {
    type Err = SceneError;

    fn from_str(word: &str) -> Result<Self, SceneError> {
        Self::ALL
            .into_iter()
            .find(|method| method.name() == word)
            .ok_or_else(|| SceneError::UnknownMethod { got: word.to_owned() })
    }
}

/// How Newton's method is run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct NewtonSettings {
    /// Newton steps in a substep.
    pub outer: usize,
    /// Iterations of the linear solver in a Newton step.
    pub inner: usize,
    /// Share of a Newton step that is taken `[-]`.
    pub relaxation: f64,
    /// The equation for complementarity.
    pub complementarity: Complementarity,
}

impl Default for NewtonSettings {
    /// 4 steps of 20 iterations, relaxation 0.75 (Matl et al. 2020).
    fn default() -> Self {
        Self {
            outer: 4,
            inner: 20,
            relaxation: 0.75,
            complementarity: Complementarity::FischerBurmeister,
        }
    }
}

/// The function whose root is complementarity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Complementarity {
    /// `psi = x + y - sqrt(x^2 + y^2)` (Fischer 1992): smooth but at the origin.
    #[default]
    FischerBurmeister,
    /// `psi = min(x, y)`: an active set.
    MinMap,
}

/// How far the reference is iterated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReferenceSettings {
    /// Natural-map residual over the rms normal impulse at which to stop `[-]`.
    pub residual: f64,
    /// Sweeps in a solve, at most.
    pub max_sweeps: usize,
}

impl Default for ReferenceSettings {
    fn default() -> Self {
        Self { residual: 1e-6, max_sweeps: 20_000 }
    }
}
