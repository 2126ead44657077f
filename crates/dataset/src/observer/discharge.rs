//! The share of the grains' mass that has run out, against time.

use granulcal_dem::Pour;
use granulcal_scene::ObserveDischarge;
use nalgebra::Vector3;

use super::observation::{Frame, Observation, ObservedStatistic, Series, holds};

/// Between these shares the rate of a discharge is taken `[%]`: after the start, before the end.
pub const RATE_RANGE: (f64, f64) = (5.0, 85.0);
/// The last of what runs out is left out in any case: below this share of it `[-]`.
const BEFORE_THE_END: f64 = 0.95;

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
            doc: format!(
                "least-squares slope of the share between {low} and {high} %, before the last twentieth of what runs out"
            ),
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

/// Least-squares slope of a share against time within [`RATE_RANGE`] `[%/s]`, below 95 % of the largest share; NaN with
/// fewer than two samples there.
///
/// What stays behind, on a flat bottom or above an arch, is in no sample of the flow: however long it is looked at
/// after the flow has stopped, the slope is the same.
pub fn rate(times: &[f64], percent: &[f64]) -> f64 {
    let out = percent.iter().copied().fold(0.0, f64::max);
    let (low, high) = (RATE_RANGE.0, RATE_RANGE.1.min(BEFORE_THE_END * out));
    let within: Vec<_> =
        times.iter().zip(percent).filter(|(_, p)| (low..=high).contains(*p)).collect();
    let count = within.len() as f64;
    let mean = |of: &dyn Fn(&(&f64, &f64)) -> f64| within.iter().map(of).sum::<f64>() / count;
    let (t0, p0) = (mean(&|s| *s.0), mean(&|s| *s.1));
    mean(&|s| (s.0 - t0) * (s.1 - p0)) / mean(&|s| (s.0 - t0).powi(2))
}

#[cfg(test)]
mod tests {
    use super::rate;

    #[test]
    fn what_stays_behind_is_no_part_of_the_flow() {
        // 40 %/s for a second and a half, and 60 % at most.
        let curve = |until: usize| -> (Vec<f64>, Vec<f64>) {
            (0..=until).map(|i| 0.01 * i as f64).map(|t| (t, (40.0 * t).min(60.0))).unzip()
        };
        for until in [160, 400, 4000] {
            let (times, percent) = curve(until);
            assert!((rate(&times, &percent) - 40.0).abs() < 1e-9, "{until}");
        }
        assert!(rate(&[0.0, 1.0, 2.0], &[0.0; 3]).is_nan());
    }

    #[test]
    fn of_what_runs_out_altogether_the_range_is_of_all() {
        // Slow below 5 % and above 85 %.
        let times: Vec<f64> = (0..=300).map(|i| 0.01 * f64::from(i)).collect();
        let share = |t: f64| match t {
            t if t < 1.0 => 4.99 * t,
            t if t < 2.0 => 5.0 + 80.0 * (t - 1.0),
            t => 85.1 + 14.9 * (t - 2.0),
        };
        let percent: Vec<f64> = times.iter().map(|&t| share(t)).collect();
        assert!((rate(&times, &percent) - 80.0).abs() < 1e-9);
    }
}
