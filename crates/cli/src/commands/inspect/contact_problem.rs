//! `inspect --contact-problem`: one substep of a scene as arrays.

use std::path::Path;

use anyhow::Context as _;
use granulcal_dataset::{Room, write_contact_problem};
use granulcal_dem::Simulation;
use serde_json::{Value, json};

use super::args::SubstepArgs;
use crate::outcome::BadArgument;
use crate::scene;

impl SubstepArgs {
    /// Refuses options that choose a substep when none is asked for.
    pub fn refuse_any(&self) -> anyhow::Result<()> {
        let given = [
            ("--time", self.time.is_some()),
            ("--seed", self.seed.is_some()),
            ("--set", !self.with.changes.is_empty()),
            ("--preset", self.with.preset.is_some()),
        ];
        match given.into_iter().find(|(_, is_given)| *is_given) {
            None => Ok(()),
            Some((name, _)) => {
                Err(BadArgument(format!("{name} needs --contact-problem, got none")).into())
            }
        }
    }
}

/// Simulates the scene until the time asked for and writes the next substep's problem; returns its facts.
pub fn write(name: &Path, out: &Path, args: &SubstepArgs) -> anyhow::Result<Value> {
    let refuse = |text: String| anyhow::Error::from(BadArgument(text));
    if out.extension().is_none_or(|ending| ending != "npz") {
        let found = out.display();
        return Err(refuse(format!("--contact-problem must end in .npz, got {found}")));
    }
    let time = args.time.unwrap_or(0.0);
    if !(time.is_finite() && time >= 0.0) {
        return Err(refuse(format!("--time must be zero or positive, and finite, got {time}")));
    }
    let scene = scene::changed(name, &args.with)?;
    Room::of_pour(&scene, None).require(None)?;
    let mut simulation = Simulation::new(&scene, args.seed.unwrap_or(0))?;
    simulation.advance(time);
    if let Some(status) = simulation.ended() {
        let (status, end) = (status.name(), simulation.time());
        return Err(refuse(format!(
            "--time must be before the pour's end, {end} s ({status}), got {time}"
        )));
    }
    let problem = simulation.contact_problem()?;
    write_contact_problem(out, &problem).context("writing --contact-problem")?;
    Ok(json!({
        "kind": "contact problem",
        "time_s": problem.time,
        "dt_s": problem.dt,
        "grains": problem.inverse_mass.len(),
        "contacts": problem.contacts.len(),
        "carrying": problem.contacts.iter().filter(|contact| contact.impulse[0] > 0.0).count(),
        "sweeps": problem.sweeps,
        "residual_m_per_s": problem.residual(),
        "scale_m_per_s": problem.scale(),
    }))
}
