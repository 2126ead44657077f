//! What `infer` says, as JSON and as a table.

use granulcal_bayessim::{Identifiability, Marginal, Misfit, Model, ModelError, Posterior};
use granulcal_numbers::short;
use granulcal_scene::{Distribution, Parameter};
use serde_json::{Map, Value, json};

use crate::context::{note, print_line};

/// Draws behind means and intervals.
const SUMMARY_DRAWS: usize = 10_000;

/// A posterior, or why there is none.
pub struct Report<'a> {
    model: &'a Model,
    recordings: &'a [String],
    observed: &'a [Vec<f64>],
    /// Why the recordings cannot be of the model's scene.
    impossible: Vec<String>,
    /// What makes them doubtful.
    doubts: Vec<String>,
    found: Option<Found>,
}

/// What a model says of recordings that can be of its scene.
struct Found {
    misfit: Misfit,
    posterior: Posterior,
    marginals: Vec<Marginal>,
    mode: Vec<f64>,
    known: Identifiability,
}

impl<'a> Report<'a> {
    /// The posterior given the statistics of each recording.
    pub fn of(
        model: &'a Model,
        recordings: &'a [String],
        observed: &'a [Vec<f64>],
        seed: u64,
    ) -> Result<Self, ModelError> {
        let misfit = model.misfit(observed)?;
        let posterior = model.posterior(observed)?;
        let found = Found {
            misfit,
            marginals: posterior.marginals(SUMMARY_DRAWS, seed)?,
            mode: posterior.mode(),
            known: posterior.identifiability(),
            posterior,
        };
        let (impossible, doubts) = (Vec::new(), Vec::new());
        Ok(Self { model, recordings, observed, impossible, doubts, found: Some(found) })
    }

    /// Recordings that cannot be of the model's scene: a posterior would say nothing.
    pub fn impossible(
        model: &'a Model,
        recordings: &'a [String],
        observed: &'a [Vec<f64>],
        impossible: Vec<String>,
    ) -> Self {
        Self { model, recordings, observed, impossible, doubts: Vec::new(), found: None }
    }

    /// The report that says these doubts of the recordings, too.
    pub fn with_doubts(self, doubts: Vec<String>) -> Self {
        Self { doubts, ..self }
    }

    /// Whether the model explains the recordings.
    pub fn is_inside(&self) -> bool {
        self.found.as_ref().is_some_and(|found| found.misfit.is_inside())
    }

    /// Draws of the posterior.
    pub fn samples(&self, count: usize, seed: u64) -> Vec<Vec<f64>> {
        self.found.as_ref().map_or_else(Vec::new, |found| found.posterior.sample(count, seed))
    }

    /// The JSON: the same fields always, null where there is no posterior.
    pub fn document(&self) -> Value {
        let found = self.found.as_ref();
        let statistics = |row: &Vec<f64>| -> Map<String, Value> {
            let names = self.model.x_names.iter().cloned();
            names.zip(row.iter().map(|&value| Value::from(value))).collect()
        };
        let mut warnings = self.doubts.clone();
        warnings.extend(
            found.iter().flat_map(|found| &found.posterior.warnings).map(ToString::to_string),
        );
        json!({
            "recordings": self.recordings,
            "parameters": found.map(Found::parameters),
            "fixed": self.fixed(),
            "inside_model": self.inside_model(),
            "identifiability": found.map(|found| &found.known),
            "calibrated": self.model.is_calibrated == Some(true),
            "warnings": warnings,
            "statistics": self.observed.iter().map(statistics).collect::<Vec<_>>(),
        })
    }

    /// What the prior fixed: part of the material as much as what was inferred.
    fn fixed(&self) -> Map<String, Value> {
        let value = |p: &Parameter| match p.distribution {
            Distribution::Fixed { value } => Some((p.path.clone(), Value::from(value))),
            _ => None,
        };
        self.model.prior.parameters().iter().filter_map(value).collect()
    }

    fn inside_model(&self) -> Value {
        let misfit = self.found.as_ref().map(|found| &found.misfit);
        let statistics = misfit.map(|misfit| {
            let value = |s: &granulcal_bayessim::StatisticMisfit| {
                (s.name.clone(), json!({ "residual": s.residual, "p_value": s.p_value }))
            };
            misfit.statistics.iter().map(value).collect::<Map<_, _>>()
        });
        json!({
            "is_inside": self.is_inside(),
            "impossible": self.impossible,
            "p_value": misfit.map(|misfit| misfit.p_value),
            "joint_p_value": misfit.map(|misfit| misfit.joint_p_value),
            "scatter_p_value": misfit.and_then(|misfit| misfit.scatter_p_value),
            "statistics": statistics,
            "odd_pour": misfit.and_then(|misfit| misfit.odd_pour).map(|odd| {
                json!({ "number": odd.number, "times": odd.times, "p_value": odd.p_value })
            }),
        })
    }

    /// The table.
    pub fn print(&self) -> anyhow::Result<()> {
        let Some(found) = &self.found else {
            print_line(
                "OUTSIDE THE MODEL: this cannot be a formation of the model's scene, whatever its material.",
            )?;
            for reason in &self.impossible {
                print_line(&format!("  {reason}"))?;
            }
            return print_line("No posterior is given.");
        };
        print_line(&found.misfit.to_string())?;
        if let Some(odd) = &found.misfit.odd_pour {
            print_line(&format!("  pour {} is {}", odd.number, self.recordings[odd.number - 1]))?;
        }
        print_line(&format!("{:<30}{:>10}{:>10}   90 % interval", "parameter", "mode", "mean"))?;
        for (m, &mode) in found.marginals.iter().zip(&found.mode) {
            let [mode, mean, low, high] = [mode, m.mean, m.interval90.0, m.interval90.1]
                .map(|value| short(value).to_string());
            print_line(&format!("{:<30}{mode:>10}{mean:>10}   {low} to {high}", m.name))?;
        }
        print_line(&found.known.to_string())?;
        for warning in &found.posterior.warnings {
            note(&format!("note: {warning}"));
        }
        Ok(())
    }
}

impl Found {
    fn parameters(&self) -> Map<String, Value> {
        let value = |(m, mode): (&Marginal, &f64)| {
            let interval = [m.interval90.0, m.interval90.1];
            let value =
                json!({ "mode": mode, "mean": m.mean, "median": m.median, "interval90": interval });
            (m.name.clone(), value)
        };
        self.marginals.iter().zip(&self.mode).map(value).collect()
    }
}
