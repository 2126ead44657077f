//! Time zero of what is observed: the begin of the observation, or when the scene's liquid comes by.

use granulcal_scene::ObserveClock;

use super::observation::Frame;

/// Says when a stated time is.
#[derive(Clone, Debug)]
pub(super) struct Clock {
    spec: Option<ObserveClock>,
    /// The last sample before the liquid has come by: its time and the front's radius.
    before: Option<(f64, f64)>,
    zero: Option<f64>,
}

impl Clock {
    pub(super) fn new(spec: Option<&ObserveClock>) -> Self {
        Self { spec: spec.copied(), before: None, zero: None }
    }

    /// Takes a sample.
    pub(super) fn see(&mut self, frame: &Frame) {
        let (Some(spec), None) = (self.spec, self.zero) else { return };
        let Some(radius) = frame.liquid_front(spec.depth) else { return };
        if radius < spec.liquid_at {
            self.before = Some((frame.time, radius));
            return;
        }
        // Linear since the sample before; one that is the first to see it is late by nobody knows how much.
        self.zero = self.before.map(|(time, last)| {
            time + (frame.time - time) * (spec.liquid_at - last) / (radius - last)
        });
    }

    /// When a stated time is, after the begin of the observation `[s]`; NaN where its zero is not known.
    pub(super) fn time(&self, stated: f64) -> f64 {
        match self.spec {
            None => stated,
            Some(_) => self.zero.map_or(f64::NAN, |zero| zero + stated),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(time: f64, radius: f64) -> Frame {
        // Rings of 1 mm, full up to the radius: half a ring beyond the last middle.
        let rings = (radius * 1e3).round() as usize;
        let liquid = Some((1e-3, vec![1e-2; rings]));
        let (positions, radii, radii_out) = (Vec::new(), Vec::new(), Vec::new());
        Frame { time, stands_for: time, positions, radii, radii_out, liquid }
    }

    #[test]
    fn its_zero_is_when_the_liquid_comes_by() {
        let spec = ObserveClock { liquid_at: 0.0105, depth: 5e-3 };
        let mut clock = Clock::new(Some(&spec));
        assert!(clock.time(0.1).is_nan());
        for (time, radius) in [(0.0, 0.008), (0.1, 0.010), (0.2, 0.012), (0.3, 0.009), (0.4, 0.02)]
        {
            clock.see(&frame(time, radius));
        }
        // Half of a full ring lies beyond its middle where the surface falls to half: radii are as stated.
        assert!((clock.time(0.05) - (0.125 + 0.05)).abs() < 1e-12, "{}", clock.time(0.0));
        assert_eq!(Clock::new(None).time(0.3), 0.3);
    }

    #[test]
    fn a_liquid_that_was_past_it_from_the_begin_tells_no_time() {
        let spec = ObserveClock { liquid_at: 0.005, depth: 5e-3 };
        let mut clock = Clock::new(Some(&spec));
        clock.see(&frame(0.0, 0.02));
        assert!(clock.time(0.1).is_nan());
    }
}
