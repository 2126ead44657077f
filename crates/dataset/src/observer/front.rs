//! The radius of the front of grains that spread, against time.

use granulcal_dem::Pour;
use granulcal_features::series::{front_radius, outline_radius};
use granulcal_scene::{ObserveClock, ObserveFront};
use nalgebra::Vector2;

use super::clock::Clock;
use super::observation::{Frame, Observation, ObservedStatistic, Series, holds};

/// `front_radius[t]` at the stated times, and `front_radius[end]` unless it is left out.
#[derive(Clone, Debug)]
pub(super) struct Front {
    spec: ObserveFront,
    series: Series,
    clock: Clock,
}

impl Front {
    pub(super) fn new(spec: &ObserveFront, clock: Option<&ObserveClock>) -> Self {
        Self {
            spec: spec.clone(),
            series: Series::new("front_radius", "m"),
            clock: Clock::new(clock),
        }
    }
}

impl Observation for Front {
    fn statistics(&self) -> Vec<ObservedStatistic> {
        let (percent, link) = (100.0 * self.spec.level, self.spec.link);
        let what = if link > 0.0 {
            format!("mean radius of the outline of the largest body, links of {link} sums of radii")
        } else {
            format!("radius about the axis where grains cover {percent} % of the circle")
        };
        let statistic = |at: String, when: String| ObservedStatistic {
            name: format!("front_radius[{at}]"),
            unit: "m",
            doc: format!("{what}, {when}"),
        };
        let times = self.spec.times.iter();
        let mut all: Vec<_> =
            times.map(|t| statistic(t.to_string(), format!("{t} s after the begin"))).collect();
        if self.spec.end {
            all.push(statistic("end".to_owned(), "at the end".to_owned()));
        }
        all
    }

    fn see(&mut self, frame: &Frame) {
        let (axis, level, link) = (Vector2::from(self.spec.axis), self.spec.level, self.spec.link);
        let radius = if link > 0.0 {
            outline_radius(&frame.positions, &frame.radii, axis, link)
        } else {
            front_radius(&frame.positions, &frame.radii, axis, level)
        };
        self.clock.see(frame);
        // A grain that is too far away for circles leaves no front, either.
        self.series.push(frame.time, radius.ok().flatten().unwrap_or(f64::NAN));
    }

    fn values(&self, pour: &Pour) -> Vec<f64> {
        let at = |&time: &f64| self.series.at(self.clock.time(time), holds(pour));
        let end = self.series.values.last().copied().unwrap_or(f64::NAN);
        self.spec.times.iter().map(at).chain(self.spec.end.then_some(end)).collect()
    }

    fn series(&self) -> &[Series] {
        std::slice::from_ref(&self.series)
    }
}
