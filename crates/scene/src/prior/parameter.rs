//! One parameter of a prior, and what it may be.

use crate::distribution::Distribution;
use crate::error::SceneError;
use crate::scene::Scene;

/// A normal that is cut to less mass than this is a mistake, and its inverse would lose all its digits.
const SMALLEST_NORMAL_MASS: f64 = 1e-6;

/// A share of a distribution, of no round number.
const INSIDE: f64 = 0.381_966_011_250_105;

/// One parameter of a prior.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Path of the number in the scene, for example `material.sliding_friction`.
    pub path: String,
    /// Its distribution.
    pub distribution: Distribution,
}

/// The numbers of a distribution as a file has them: those that it needs, and no others.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Keys {
    /// Lower bound.
    pub low: Option<f64>,
    /// Upper bound.
    pub high: Option<f64>,
    /// Mean of a normal before it is cut.
    pub mean: Option<f64>,
    /// Standard deviation of a normal before it is cut.
    pub sd: Option<f64>,
    /// The value of what is fixed.
    pub value: Option<f64>,
}

impl Parameter {
    /// Checks the path's form and the numbers of the distribution.
    ///
    /// # Errors
    /// [`SceneError::Prior`] names the parameter and what cannot be.
    pub fn check(&self) -> Result<(), SceneError> {
        let is_word = |word: &str| {
            !word.is_empty() && word.chars().all(|c| c.is_ascii_alphanumeric() || "_-".contains(c))
        };
        let begins = |c: char| c.is_ascii_alphabetic() || c == '_';
        if !(self.path.starts_with(begins) && self.path.split('.').all(is_word)) {
            let got = format!("{:?}", self.path);
            return Err(refuse(&self.path, "path", got, "words joined by dots"));
        }
        check_distribution(&self.path, &self.distribution)
    }
}

impl Parameter {
    /// Refuses draws of what is a whole number in the scene: hardly any of them is one.
    ///
    /// # Errors
    /// [`SceneError::PriorOfWhole`].
    pub(super) fn check_whole(&self, scene: &Scene) -> Result<(), SceneError> {
        if matches!(self.distribution, Distribution::Fixed { .. }) {
            return Ok(());
        }
        match scene.with(&self.path, self.distribution.quantile(INSIDE)) {
            Err(SceneError::NotWhole { path, .. }) => {
                let is_count = path.ends_with("grains.count");
                let hint = if is_count {
                    "; of round grains the scene may state grains.volume in place of grains.count, and a prior may \
                     draw that"
                } else {
                    ""
                };
                Err(SceneError::PriorOfWhole { parameter: path, hint })
            }
            _ => Ok(()),
        }
    }
}

/// What is wrong with a parameter, for messages.
pub(super) fn refuse(
    parameter: &str,
    what: &'static str,
    got: String,
    allowed: &'static str,
) -> SceneError {
    SceneError::Prior { parameter: parameter.to_owned(), what, got, allowed }
}

fn check_distribution(path: &str, distribution: &Distribution) -> Result<(), SceneError> {
    let finite = |what, value: f64| {
        let refusal = || refuse(path, what, value.to_string(), "finite");
        if value.is_finite() { Ok(()) } else { Err(refusal()) }
    };
    let ordered = |low: f64, high: f64| {
        let refusal = || refuse(path, "high", format!("low {low} and high {high}"), "above low");
        if low < high { Ok(()) } else { Err(refusal()) }
    };
    match *distribution {
        Distribution::Uniform { low, high } => {
            finite("low", low).and(finite("high", high)).and(ordered(low, high))?;
            let refusal =
                || refuse(path, "high less low", format!("{low:e} and {high:e}"), "finite");
            if (high - low).is_finite() { Ok(()) } else { Err(refusal()) }
        }
        Distribution::LogUniform { low, high } => {
            if low <= 0.0 {
                return Err(refuse(path, "low", low.to_string(), "positive for log_uniform"));
            }
            finite("low", low).and(finite("high", high)).and(ordered(low, high))
        }
        Distribution::Normal { mean, sd, low, high } => {
            finite("mean", mean).and(finite("sd", sd))?;
            if sd <= 0.0 {
                return Err(refuse(path, "sd", sd.to_string(), "positive"));
            }
            low.map_or(Ok(()), |low| finite("low", low))?;
            high.map_or(Ok(()), |high| finite("high", high))?;
            low.zip(high).map_or(Ok(()), |(low, high)| ordered(low, high))?;
            let mass = distribution.mass();
            if mass < SMALLEST_NORMAL_MASS {
                let got = format!("bounds that hold {mass:.3e}");
                return Err(refuse(
                    path,
                    "low and high",
                    got,
                    "bounds of at least 1e-6 of the normal's mass",
                ));
            }
            Ok(())
        }
        Distribution::Fixed { value } => finite("value", value),
    }
}
