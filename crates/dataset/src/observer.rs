//! What a scene observes of a pour: series over time and statistics, by name. One kind of observation is one file.
//!
//! The observer looks at a simulation at stated times and changes nothing of it: the pour has the same bits with and
//! without. The names, units and meanings of its statistics follow from the scene's `observe` alone, so that every pour
//! of a data set has the same columns.

mod clock;
mod discharge;
mod front;
mod images;
mod liquid;
mod observation;
mod radius;
mod spill;
mod surface;

use granulcal_dem::{Pour, Simulation, Status};
use granulcal_scene::Scene;

use crate::DatasetError;
use crate::row::RowStatus;
pub use discharge::{RATE_RANGE as DISCHARGE_RANGE, rate as discharge_rate};
use observation::{Frame, Observation};
pub use observation::{ObservedStatistic, Series};

/// Simulated time between two questions whether to go on `[s]`: some substeps, seconds for a million grains.
pub const POLL_INTERVAL: f64 = 0.002;

/// What a pour has shown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Observed {
    /// Values of [`observed_statistics`], one each; NaN for what could not be seen.
    pub statistics: Vec<f64>,
    /// What was sampled over time.
    pub series: Vec<Series>,
}

/// Looks at a simulation whenever the scene says. A copy has seen what it has, and looks on by itself.
#[derive(Clone, Debug)]
pub struct Observer {
    observations: Vec<Box<dyn Observation>>,
    begin: f64,
    rate: f64,
    /// Number of the next sample.
    next: u64,
}

/// The statistics that a scene observes; none if it observes nothing.
pub fn observed_statistics(scene: &Scene) -> Vec<ObservedStatistic> {
    observations(scene).iter().flat_map(|observation| observation.statistics()).collect()
}

fn observations(scene: &Scene) -> Vec<Box<dyn Observation>> {
    let mut all: Vec<Box<dyn Observation>> = Vec::new();
    let Some(observe) = &scene.observe else { return all };
    if let Some(spec) = &observe.surface {
        all.push(Box::new(surface::Surface::new(spec, scene)));
    }
    if let Some(spec) = &observe.front {
        all.push(Box::new(front::Front::new(spec, observe.clock.as_ref())));
    }
    if let Some(spec) = &observe.liquid {
        all.push(Box::new(liquid::Liquid::new(spec, observe.clock.as_ref())));
    }
    if let Some(spec) = &observe.discharge {
        all.push(Box::new(discharge::Discharge::new(spec)));
    }
    if let Some(spec) = &observe.radius {
        all.push(Box::new(radius::Radius::new(spec)));
    }
    if let Some(spec) = &observe.spill {
        all.push(Box::new(spill::Spill::new(spec, scene)));
    }
    if let Some(spec) = &observe.images {
        all.push(Box::new(images::Images::new(spec, &scene.camera)));
    }
    all
}

impl Observer {
    /// An observer of `scene` that has seen nothing.
    pub fn new(scene: &Scene) -> Self {
        let (begin, rate) = scene.observe.as_ref().map_or((0.0, 1.0), |o| (o.begin, o.rate));
        Self { observations: observations(scene), begin, rate, next: 0 }
    }

    /// Whether there is nothing to look at.
    pub fn is_idle(&self) -> bool {
        self.observations.is_empty()
    }

    /// When the next sample is due, at the nearest substep `[s]`.
    fn due(&self) -> f64 {
        self.begin + self.next as f64 / self.rate
    }

    /// Simulates `seconds`, or less if the pour ends before, and takes the samples that fall due; to the end for
    /// infinity, nothing for a negative number. Samples before the time at which the first call begins are missed, as
    /// after a restart from a checkpoint.
    ///
    /// # Errors
    /// [`DatasetError::Argument`] for NaN; nothing is simulated then.
    pub fn advance(
        &mut self,
        simulation: &mut Simulation,
        seconds: f64,
    ) -> Result<(), DatasetError> {
        if seconds.is_nan() {
            let (what, got) = ("the time to simulate [s]", seconds.to_string());
            return Err(DatasetError::Argument { what, got, allowed: "a number" });
        }
        self.go_on(simulation, seconds);
        Ok(())
    }

    fn go_on(&mut self, simulation: &mut Simulation, seconds: f64) {
        if self.is_idle() {
            simulation.advance(seconds);
            return;
        }
        let (end, half) = (simulation.time() + seconds, 0.5 * simulation.settings().dt);
        if self.next == 0 {
            let missed = (simulation.time() - half - self.begin) * self.rate;
            self.next = missed.max(0.0).ceil() as u64;
        }
        loop {
            self.sample(simulation);
            if simulation.ended().is_some() || simulation.time() + half >= end {
                break;
            }
            let until = self.due().min(end);
            simulation.advance((until - simulation.time()).max(2.0 * half));
        }
    }

    /// Simulates to the end, or gives up when `keep_going` says so.
    pub fn run_while(
        &mut self,
        mut simulation: Simulation,
        keep_going: &dyn Fn() -> bool,
    ) -> Option<Pour> {
        if self.is_idle() {
            return simulation.run_while(keep_going);
        }
        let has_ended = self.advance_while(&mut simulation, f64::INFINITY, keep_going);
        has_ended.then(|| simulation.into_pour())
    }

    /// Simulates to the substep that ends nearest to `time` `[s]`, or less if the pour ends before, and takes the
    /// samples that fall due. Gives up between two substeps when `keep_going` says so: false then.
    pub fn advance_while(
        &mut self,
        simulation: &mut Simulation,
        time: f64,
        keep_going: &dyn Fn() -> bool,
    ) -> bool {
        let dt = simulation.settings().dt;
        while simulation.ended().is_none() && simulation.time() + 0.5 * dt < time {
            if !keep_going() {
                return false;
            }
            // A substep at least, whatever the rounding.
            self.go_on(simulation, (time - simulation.time()).min(POLL_INTERVAL).max(dt));
        }
        true
    }

    /// Takes a sample if one is due, and one of the end.
    fn sample(&mut self, simulation: &Simulation) {
        let (time, half) = (simulation.time(), 0.5 * simulation.settings().dt);
        let is_due = time + half >= self.due();
        let is_last = simulation.ended().is_some() && time >= self.begin;
        if !(is_due || is_last) {
            return;
        }
        let number = ((time + half - self.begin) * self.rate).floor().max(0.0) as u64;
        self.next = number + 1;
        let (since, stated) = (time - self.begin, number as f64 / self.rate);
        // The first stands for the begin, half a substep late or not: nothing was seen before it.
        let since = if number == 0 && is_due { since.min(0.0) } else { since };
        let frame = Frame {
            time: since,
            stands_for: if is_due { since.max(stated) } else { since },
            positions: simulation.positions(),
            radii: simulation.radii(),
            radii_out: simulation.radii_out(),
            liquid: simulation.liquid_profile(),
        };
        for observation in &mut self.observations {
            observation.see(&frame);
        }
    }

    /// What was seen of a pour that has ended.
    pub fn observed(&self, pour: &Pour) -> Observed {
        // The grains of an unhealthy pour can be anywhere, NaN included.
        let is_sound = pour.status != Status::Unhealthy;
        let values = |observation: &dyn Observation| match observation.values(pour) {
            values if is_sound => values,
            values => vec![f64::NAN; values.len()],
        };
        Observed {
            statistics: self.observations.iter().flat_map(|o| values(o.as_ref())).collect(),
            series: self.observations.iter().flat_map(|o| o.series().to_vec()).collect(),
        }
    }

    /// The status of a pour's row: `jammed` where an observation says so of a pour at rest.
    pub fn status(&self, pour: &Pour) -> RowStatus {
        let is_jammed = pour.status == Status::AtRest
            && self.observations.iter().any(|observation| observation.is_jammed(pour));
        RowStatus::Pour(if is_jammed { Status::Jammed } else { pour.status })
    }
}

#[cfg(test)]
mod tests;
