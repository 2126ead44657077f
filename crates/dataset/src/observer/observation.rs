//! What one kind of observation is, and what it gives.

use std::fmt::Debug;

use granulcal_dem::{Pour, Status};
use granulcal_features::series::sheet_radius;
use nalgebra::Vector3;

/// A statistic of a scene, as the registry tells the others.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ObservedStatistic {
    /// Its name in every file, table and plot, with where or when it is taken in brackets: `front_radius[0.1]`.
    pub name: String,
    /// Its unit, "-" if dimensionless.
    pub unit: &'static str,
    /// What it is, in one line.
    pub doc: String,
}

/// A number over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// The name of its statistics, without the time in brackets.
    pub name: String,
    /// Its unit.
    pub unit: &'static str,
    /// When each sample was taken, after the observation's begin `[s]`.
    pub times: Vec<f64>,
    /// The samples; NaN where there is no such thing.
    pub values: Vec<f64>,
}

impl Series {
    pub(super) fn new(name: impl Into<String>, unit: &'static str) -> Self {
        Self { name: name.into(), unit, times: Vec::new(), values: Vec::new() }
    }

    pub(super) fn push(&mut self, time: f64, value: f64) {
        self.times.push(time);
        self.values.push(value);
    }

    /// Linear between samples. Before the first it is NaN, as after the last unless grains at rest hold it.
    pub(super) fn at(&self, time: f64, holds: bool) -> f64 {
        let after = self.times.partition_point(|&t| t < time - 1e-9);
        match (after.checked_sub(1), self.times.get(after)) {
            (_, Some(&t)) if t <= time + 1e-9 => self.values[after],
            (Some(before), Some(&t1)) => {
                let (t0, y0, y1) = (self.times[before], self.values[before], self.values[after]);
                y0 + (y1 - y0) * (time - t0) / (t1 - t0)
            }
            (Some(last), None) if holds => self.values[last],
            _ => f64::NAN,
        }
    }
}

/// Grains at one time.
pub(super) struct Frame {
    /// After the observation's begin `[s]`.
    pub(super) time: f64,
    /// The latest stated time that it is a sample of `[s]`: up to half a substep after `time`, which is the nearest.
    pub(super) stands_for: f64,
    pub(super) positions: Vec<Vector3<f64>>,
    pub(super) radii: Vec<f64>,
    /// Of the grains that have left the scene.
    pub(super) radii_out: Vec<f64>,
    /// Width of a ring, and height of the liquid's surface in each; none where there is no liquid.
    pub(super) liquid: Option<(f64, Vec<f64>)>,
}

impl Frame {
    /// Radius up to which the liquid's surface is `depth` high `[m]`; none where there is no such liquid.
    pub(super) fn liquid_front(&self, depth: f64) -> Option<f64> {
        let (ring, heights) = self.liquid.as_ref()?;
        sheet_radius(*ring, heights, depth)
    }
}

/// A copy behind a pointer, which every kind of observation that can be cloned has.
pub(super) trait Copied {
    /// The copy.
    fn copied(&self) -> Box<dyn Observation>;
}

impl<T: Observation + Clone + 'static> Copied for T {
    fn copied(&self) -> Box<dyn Observation> {
        Box::new(self.clone())
    }
}

impl Clone for Box<dyn Observation> {
    fn clone(&self) -> Self {
        // Of what is pointed to: the pointer would copy itself for ever.
        (**self).copied()
    }
}

/// One kind of observation.
pub(super) trait Observation: Copied + Debug + Send + Sync {
    /// The statistics that it gives.
    fn statistics(&self) -> Vec<ObservedStatistic>;
    /// Takes a sample.
    fn see(&mut self, _frame: &Frame) {}
    /// Values of the statistics once the pour has ended.
    fn values(&self, pour: &Pour) -> Vec<f64>;
    /// What it has seen over time.
    fn series(&self) -> &[Series] {
        &[]
    }
    /// Whether a pour that has come to rest is jammed.
    fn is_jammed(&self, _pour: &Pour) -> bool {
        false
    }
}

/// Whether a pour's last sample stands for all times after it.
pub(super) fn holds(pour: &Pour) -> bool {
    matches!(pour.status, Status::AtRest | Status::OutOfView | Status::Jammed)
}
