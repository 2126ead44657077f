//! The share of the grains' mass that has run out, against time.

use granulcal_dem::Pour;
use granulcal_scene::ObserveDischarge;
use nalgebra::Vector3;

use super::observation::{Frame, Observation, ObservedStatistic, Series, holds};

/// Between these shares the rate of a discharge is taken `[%]`: after the start, before the end.
pub const RATE_RANGE: (f64, f64) = (5.0, 85.0);

/// `discharged[t]` at the stated times, and `discharge_rate`.
#[derive(Clone, Debug)]
pub(super) struct Discharge {
    spec: ObserveDischarge,
    series: Series,
}

impl Discharge {
    pub(super) fn new(spec: &ObserveDischarge) -> Self {
        Self { spec: spec.clone(), series: Series::new("discharged", "%") }
    }

    /// Share of the mass below the height or out of the scene `[%]`; masses go with the cube of the radius.
    fn percent(&self, positions: &[Vector3<f64>], radii: &[f64], radii_out: &[f64]) -> f64 {
        // Those that have left the scene have run out.
        let mut out = radii_out.iter().map(|radius| radius.powi(3)).sum::<f64>();
        let mut all = out;
        for (position, radius) in positions.iter().zip(radii) {
            let mass = radius.powi(3);
            all += mass;
            out += if position.z < self.spec.below { mass } else { 0.0 };
        }
        100.0 * out / all
    }
}

impl Observation for Discharge {
    fn statistics(&self) -> Vec<ObservedStatistic> {
        let below = self.spec.below;
        let at = |t: &f64| ObservedStatistic {
            name: format!("discharged[{t}]"),
            unit: "%",
            doc: format!("share of the mass below z = {below} m, {t} s after the begin"),
        };
        let mut all: Vec<_> = self.spec.times.iter().map(at).collect();
        let (low, high) = RATE_RANGE;
        all.push(ObservedStatistic {
            name: "discharge_rate".to_owned(),
            unit: "%/s",
            doc: format!("least-squares slope of the share between {low} and {high} %"),
        });
        all
    }

    fn see(&mut self, frame: &Frame) {
        let percent = self.percent(&frame.positions, &frame.radii, &frame.radii_out);
        self.series.push(frame.time, percent);
    }

    fn values(&self, pour: &Pour) -> Vec<f64> {
        let at = |&time: &f64| self.series.at(time, holds(pour));
        let Series { times, values, .. } = &self.series;
        self.spec.times.iter().map(at).chain([rate(times, values)]).collect()
    }

    fn series(&self) -> &[Series] {
        std::slice::from_ref(&self.series)
    }

    fn is_jammed(&self, pour: &Pour) -> bool {
        self.percent(&pour.positions, &pour.radii, &pour.radii_out) < self.spec.jammed_below
    }
}

/// Least-squares slope of a share against time within [`RATE_RANGE`] `[%/s]`; NaN with fewer than two samples there.
pub fn rate(times: &[f64], percent: &[f64]) -> f64 {
    let (low, high) = RATE_RANGE;
    let within: Vec<_> =
        times.iter().zip(percent).filter(|(_, p)| (low..=high).contains(*p)).collect();
    let count = within.len() as f64;
    let mean = |of: &dyn Fn(&(&f64, &f64)) -> f64| within.iter().map(of).sum::<f64>() / count;
    let (t0, p0) = (mean(&|s| *s.0), mean(&|s| *s.1));
    mean(&|s| (s.0 - t0) * (s.1 - p0)) / mean(&|s| (s.0 - t0).powi(2))
}
