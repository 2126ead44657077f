//! The radius of the front of the scene's liquid, against time.

use granulcal_dem::Pour;
use granulcal_scene::{ObserveClock, ObserveLiquid};

use super::clock::Clock;
use super::observation::{Frame, Observation, ObservedStatistic, Series, holds};

/// `liquid_radius[t]` at the stated times.
#[derive(Clone, Debug)]
pub(super) struct Liquid {
    spec: ObserveLiquid,
    series: Series,
    clock: Clock,
}

impl Liquid {
    pub(super) fn new(spec: &ObserveLiquid, clock: Option<&ObserveClock>) -> Self {
        Self {
            spec: spec.clone(),
            series: Series::new("liquid_radius", "m"),
            clock: Clock::new(clock),
        }
    }
}

impl Observation for Liquid {
    fn statistics(&self) -> Vec<ObservedStatistic> {
        let thin = 1e3 * self.spec.depth;
        let statistic = |t: &f64| ObservedStatistic {
            name: format!("liquid_radius[{t}]"),
            unit: "m",
            doc: format!(
                "radius about the z axis up to which liquid stands {thin} mm high, {t} s after the begin"
            ),
        };
        self.spec.times.iter().map(statistic).collect()
    }

    fn see(&mut self, frame: &Frame) {
        let radius = frame.liquid_front(self.spec.depth);
        self.clock.see(frame);
        self.series.push(frame.time, radius.unwrap_or(f64::NAN));
    }

    fn values(&self, pour: &Pour) -> Vec<f64> {
        self.spec
            .times
            .iter()
            .map(|&time| self.series.at(self.clock.time(time), holds(pour)))
            .collect()
    }

    fn series(&self) -> &[Series] {
        std::slice::from_ref(&self.series)
    }
}
