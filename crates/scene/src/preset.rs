//! Solver presets: named choices of step, sweeps and margins. They change cost and error, never the law.

mod method;

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::SceneError;
pub use method::{Complementarity, Method, NewtonSettings, ReferenceSettings};

/// The name of a set of solver settings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Preset {
    /// For a first try: large steps, penetration below 0.25 radii.
    Fast,
    /// For data sets: penetration below 0.1 radii.
    #[default]
    Default,
    /// For checking the others: a third of the step of `default` and three times the sweeps.
    Accurate,
    /// For comparison with Matl et al. 2020: their solver and iterations, guarded.
    Paper,
}

impl Preset {
    /// Every preset: those of this program from cheap to expensive, then the paper's.
    pub const ALL: [Self; 4] = [Self::Fast, Self::Default, Self::Accurate, Self::Paper];

    /// The word used in TOML, on the command line and in Python.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Default => "default",
            Self::Accurate => "accurate",
            Self::Paper => "paper",
        }
    }
}

impl fmt::Display for Preset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Preset {
    type Err = SceneError;

    fn from_str(word: &str) -> Result<Self, SceneError> {
        Self::ALL
            .into_iter()
            .find(|preset| preset.name() == word)
            .ok_or_else(|| SceneError::UnknownPreset { got: word.to_owned() })
    }
}

/// How finely the springs of an impact are followed (docs/theory/contact.md, box 1).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImpactSettings {
    /// Time that a contact moves by itself, in 1/omega of its spring `[-]`: what is handed on through a chain of grains
    /// needs it small, the rebound of a pair does not depend on it.
    pub micro_step: f64,
    /// Normal impulse in a time of 1/omega below which an impact is over `[m/s]`.
    pub stopping_speed: f64,
}

/// What a preset stands for.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SolverSettings {
    /// How the contact problem of a substep is solved.
    pub method: Method,
    /// Substep `[s]`.
    pub dt: f64,
    /// Gauss-Seidel sweeps in a substep, at least, unless the impulses settle before.
    pub sweeps: usize,
    /// Over-relaxation of all sweeps but the last of these `[-]`, in [1, 2).
    pub relaxation: f64,
    /// Change of a contact's impulses in a sweep below which they have settled, in radii of the least grain
    /// a substep `[-]`.
    pub settled: f64,
    /// Sweeps in a substep, at least, while the grains hardly move, unless the impulses settle before: a heap whose
    /// weight has not reached its foot creeps.
    pub quiet_sweeps: usize,
    /// Sweeps in a substep, at most: hard impacts on dense packings need more than quiet flow.
    pub max_sweeps: usize,
    /// Way by which a contact may still close against its constraint in a substep, in radii of the least grain `[-]`;
    /// as long as one closes further the sweeps go on.
    pub closing: f64,
    /// Substeps between two searches for pairs.
    pub list_period: usize,
    /// Gap below which a pair is listed although it does not approach, in radii `[-]`.
    pub margin: f64,
    /// Penetration beyond which a pour is unhealthy, in radii `[-]`.
    pub max_penetration: f64,
    /// How finely an impact is followed.
    pub impact: ImpactSettings,
    /// What only [`Method::NewtonPcr`] reads.
    pub newton: NewtonSettings,
    /// What only [`Method::Reference`] reads.
    pub reference: ReferenceSettings,
}

impl SolverSettings {
    /// Refuses settings that no solver can have.
    ///
    /// # Errors
    /// [`SceneError::OutOfRange`] names the number.
    pub fn check(&self) -> Result<(), SceneError> {
        let positive = |name, got: f64| {
            let allowed = "positive and finite";
            let fits = got > 0.0 && got.is_finite();
            if fits { Ok(()) } else { Err(SceneError::range(name, got, allowed)) }
        };
        positive("settings.dt", self.dt)?;
        positive("settings.sweeps", self.sweeps as f64)?;
        if !(1.0..2.0).contains(&self.relaxation) {
            return Err(SceneError::range("settings.relaxation", self.relaxation, "in [1, 2)"));
        }
        positive("settings.settled", self.settled)?;
        positive("settings.quiet_sweeps", self.quiet_sweeps as f64)?;
        positive("settings.max_sweeps", self.max_sweeps as f64)?;
        positive("settings.closing", self.closing)?;
        positive("settings.list_period", self.list_period as f64)?;
        positive("settings.margin", self.margin)?;
        positive("settings.max_penetration", self.max_penetration)?;
        positive("settings.impact.micro_step", self.impact.micro_step)?;
        positive("settings.impact.stopping_speed", self.impact.stopping_speed)?;
        positive("settings.newton.outer", self.newton.outer as f64)?;
        positive("settings.newton.inner", self.newton.inner as f64)?;
        positive("settings.newton.relaxation", self.newton.relaxation)?;
        positive("settings.reference.residual", self.reference.residual)?;
        positive("settings.reference.max_sweeps", self.reference.max_sweeps as f64)
    }
}

impl Preset {
    /// The settings behind the name.
    pub fn settings(self) -> SolverSettings {
        match self {
            Self::Fast => SolverSettings {
                method: Method::Nsgs,
                dt: 1.0 / 900.0,
                sweeps: 4,
                relaxation: 1.4,
                settled: 1e-11,
                quiet_sweeps: 24,
                max_sweeps: 30,
                closing: 0.04,
                list_period: 2,
                margin: 0.3,
                max_penetration: 0.25,
                impact: ImpactSettings { micro_step: 0.5, stopping_speed: 0.02 },
                newton: NewtonSettings::default(),
                reference: ReferenceSettings::default(),
            },
            Self::Default => SolverSettings {
                method: Method::Nsgs,
                dt: 1.0 / 2000.0,
                sweeps: 4,
                relaxation: 1.4,
                settled: 1e-11,
                quiet_sweeps: 24,
                max_sweeps: 40,
                closing: 0.02,
                list_period: 5,
                margin: 0.25,
                max_penetration: 0.1,
                impact: ImpactSettings { micro_step: 0.3, stopping_speed: 0.01 },
                newton: NewtonSettings::default(),
                reference: ReferenceSettings::default(),
            },
            Self::Accurate => SolverSettings {
                method: Method::Nsgs,
                dt: 1.0 / 6000.0,
                sweeps: 12,
                relaxation: 1.4,
                settled: 1e-11,
                quiet_sweeps: 24,
                max_sweeps: 120,
                closing: 0.002,
                list_period: 8,
                margin: 0.3,
                max_penetration: 0.1,
                impact: ImpactSettings { micro_step: 0.1, stopping_speed: 0.001 },
                newton: NewtonSettings::default(),
                reference: ReferenceSettings::default(),
            },
            // 1/60 s in 10 substeps, 4 Newton steps of 20 iterations, relaxation 0.75. Overlaps of 0.29 radii were
            // seen.
            Self::Paper => SolverSettings {
                method: Method::NewtonPcr,
                dt: 1.0 / 600.0,
                sweeps: 6,
                relaxation: 1.4,
                settled: 1e-11,
                quiet_sweeps: 24,
                max_sweeps: 60,
                closing: 0.06,
                list_period: 1,
                margin: 0.5,
                max_penetration: 0.4,
                impact: ImpactSettings { micro_step: 0.3, stopping_speed: 0.01 },
                newton: NewtonSettings::default(),
                reference: ReferenceSettings::default(),
            },
        }
    }
}
