//! What is observed of a scene while it goes on and at its end, beside its camera's image: docs/scenes.md,
//! "Observations". Each kind gives statistics of its own.

use serde::{Deserialize, Serialize};

use crate::check::{finite, non_negative, positive};
use crate::error::SceneError;

/// Most samples of a pour: beyond it the rate is a mistake.
const MAX_SAMPLES: f64 = 1e6;
/// Widest profile from its centre, in grains' diameters: pictures of it are kept in memory.
const MAX_WIDTH: f64 = 1000.0;
/// Longest link between grains of one body, in sums of their radii.
const MAX_LINK: f64 = 10.0;

/// What is observed, how often and from when on. A kind that is not stated is not observed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Observe {
    /// Samples in a simulated second `[1/s]`.
    pub rate: f64,
    /// Time zero of the observation, from which on there are samples `[s]`.
    #[serde(default)]
    pub begin: f64,
    /// The free surface from the side.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surface: Option<ObserveSurface>,
    /// The front of a spreading body from above.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub front: Option<ObserveFront>,
    /// The front of the liquid of `effects.liquid`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub liquid: Option<ObserveLiquid>,
    /// Where the clock of `front` and `liquid` begins, if it is not `begin`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clock: Option<ObserveClock>,
    /// The share that has run out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub discharge: Option<ObserveDischarge>,
    /// Where the grains are at the end, by percentiles of their distance from an axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius: Option<ObserveRadius>,
    /// Grains that are outside a circle at the end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spill: Option<ObserveSpill>,
    /// The camera's image while the grains fall.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub images: Option<ObserveImages>,
}

/// The mean height of the free surface, seen along y from the begin of the observation to the end of the pour.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObserveSurface {
    /// Origin of the profile in the scene, x and z `[m]`: the centre of a drum.
    pub centre: [f64; 2],
    /// Where the height is taken, from `centre`, rising `[m]`.
    pub x: Vec<f64>,
    /// The slope is that of a line through the surface where |x| is at most this `[m]`.
    pub slope_within: f64,
    /// Share of the time for which a point below the surface is hidden by grains `[-]`.
    #[serde(default = "half")]
    pub level: f64,
}

/// The radius of the front against time, seen from above.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObserveFront {
    /// Where the axis meets the ground, x and y `[m]`.
    #[serde(default)]
    pub axis: [f64; 2],
    /// When the radius is taken, after `begin`, rising `[s]`.
    pub times: Vec<f64>,
    /// Share of a circle about the axis that grains cover at the front `[-]`.
    #[serde(default = "half")]
    pub level: f64,
    /// Grains within so many sums of their radii of each other are one body, and the front is the outline of the
    /// largest; 0 for a front by `level` `[-]`.
    #[serde(default)]
    pub link: f64,
    /// Whether the radius is taken at the end of the pour, too.
    #[serde(default = "yes", skip_serializing_if = "is_yes")]
    pub end: bool,
}

/// The radius about the z axis up to which there is liquid, against time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObserveLiquid {
    /// When the radius is taken, after `begin`, rising `[s]`.
    pub times: Vec<f64>,
    /// Height of the liquid's surface at its front `[m]`: what is thinner is not seen.
    #[serde(default = "half_a_millimetre")]
    pub depth: f64,
}

/// A clock of `front` and `liquid` that begins when the front of the liquid of `effects.liquid` comes by.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObserveClock {
    /// Radius about the z axis at which the liquid's front begins it `[m]`.
    pub liquid_at: f64,
    /// Height of the liquid's surface at that front `[m]`.
    #[serde(default = "half_a_millimetre")]
    pub depth: f64,
}

/// The share of the grains' mass that is below a height, against time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObserveDischarge {
    /// Grains with their centre below have run out `[m]`.
    pub below: f64,
    /// When the share is taken, after `begin`, rising `[s]`.
    pub times: Vec<f64>,
    /// A pour that comes to rest with less than this share run out is jammed `[%]`.
    #[serde(default)]
    pub jammed_below: f64,
}

/// Percentiles of the distance from an axis at the end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObserveRadius {
    /// Where the axis meets the ground, x and y `[m]`.
    #[serde(default)]
    pub axis: [f64; 2],
    /// Shares of the grains' mass within the radius, rising `[%]`.
    pub percentiles: Vec<f64>,
}

/// Grains that are outside a circle at the end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObserveSpill {
    /// Where the axis meets the ground, x and y `[m]`.
    #[serde(default)]
    pub axis: [f64; 2],
    /// Radius of the circle, for example of a bowl's rim `[m]`.
    pub radius: f64,
}

/// The 16 statistics of the camera's image at several times, without noise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObserveImages {
    /// When the images are taken, after `begin`, rising `[s]`: each is of the first sample that is due at or after its
    /// time, on the substep nearest to where it is due.
    pub times: Vec<f64>,
    /// Grains with their centre above are in no image, as those that a funnel still hides `[m]`; none are left out if
    /// absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub below: Option<f64>,
}

fn half() -> f64 {
    0.5
}

const fn half_a_millimetre() -> f64 {
    5e-4
}

const fn yes() -> bool {
    true
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
const fn is_yes(value: &bool) -> bool {
    *value
}

impl Observe {
    /// Whether it asks for the front of the scene's liquid.
    pub(crate) fn asks_for_liquid(&self) -> bool {
        self.liquid.is_some() || self.clock.is_some()
    }

    /// Whether anything is looked at before the end.
    fn is_over_time(&self) -> bool {
        self.surface.is_some()
            || self.front.is_some()
            || self.asks_for_liquid()
            || self.discharge.is_some()
            || self.images.is_some()
    }

    pub(crate) fn check(&self, horizon: f64, diameter: f64) -> Result<(), SceneError> {
        positive("observe.rate", self.rate)?;
        non_negative("observe.begin", self.begin)?;
        if self.begin >= horizon {
            return Err(SceneError::range("observe.begin", self.begin, "less than end.horizon"));
        }
        let rest = horizon - self.begin;
        if self.rate * rest > MAX_SAMPLES {
            let allowed = "at most a million samples until end.horizon";
            return Err(SceneError::range("observe.rate", self.rate, allowed));
        }
        // Values between begin and end would be drawn on the straight line that joins them.
        if self.is_over_time() && self.rate * rest < 1.0 {
            let allowed = "samples a second, at least one between observe.begin and end.horizon";
            return Err(SceneError::range("observe.rate", self.rate, allowed));
        }
        if let Some(surface) = &self.surface {
            surface.centre.iter().try_for_each(|&c| finite("observe.surface.centre", c))?;
            let wide = MAX_WIDTH * diameter;
            let allowed = "within 1000 diameters of a grain";
            rising("observe.surface.x", &surface.x, (-wide, wide), allowed)?;
            positive("observe.surface.slope_within", surface.slope_within)?;
            if surface.slope_within > wide {
                let (name, got) = ("observe.surface.slope_within", surface.slope_within);
                return Err(SceneError::range(name, got, allowed));
            }
            share("observe.surface.level", surface.level)?;
        }
        if let Some(front) = &self.front {
            front.axis.iter().try_for_each(|&c| finite("observe.front.axis", c))?;
            let allowed = "from 0 to end.horizon less observe.begin";
            rising("observe.front.times", &front.times, (0.0, rest), allowed)?;
            share("observe.front.level", front.level)?;
            if front.link != 0.0 && !(1.0..=MAX_LINK).contains(&front.link) {
                let allowed = "0, or from 1 to 10 sums of two radii";
                return Err(SceneError::range("observe.front.link", front.link, allowed));
            }
            if front.times.is_empty() && !front.end {
                let allowed = "at least one time where observe.front.end is false";
                return Err(SceneError::range("observe.front.times", 0.0, allowed));
            }
        }
        if let Some(liquid) = &self.liquid {
            let allowed = "from 0 to end.horizon less observe.begin";
            rising("observe.liquid.times", &liquid.times, (0.0, rest), allowed)?;
            positive("observe.liquid.depth", liquid.depth)?;
        }
        if let Some(clock) = &self.clock {
            positive("observe.clock.liquid_at", clock.liquid_at)?;
            positive("observe.clock.depth", clock.depth)?;
        }
        if let Some(discharge) = &self.discharge {
            finite("observe.discharge.below", discharge.below)?;
            let allowed = "from 0 to end.horizon less observe.begin";
            rising("observe.discharge.times", &discharge.times, (0.0, rest), allowed)?;
            let got = discharge.jammed_below;
            if !(0.0..=100.0).contains(&got) {
                let name = "observe.discharge.jammed_below";
                return Err(SceneError::range(name, got, "from 0 to 100"));
            }
        }
        if let Some(radius) = &self.radius {
            radius.axis.iter().try_for_each(|&c| finite("observe.radius.axis", c))?;
            let name = "observe.radius.percentiles";
            rising(name, &radius.percentiles, (0.0, 100.0), "from 0 to 100")?;
        }
        if let Some(spill) = &self.spill {
            spill.axis.iter().try_for_each(|&c| finite("observe.spill.axis", c))?;
            positive("observe.spill.radius", spill.radius)?;
        }
        if let Some(images) = &self.images {
            let allowed = "from 0 to end.horizon less observe.begin";
            rising("observe.images.times", &images.times, (0.0, rest), allowed)?;
            images.below.map_or(Ok(()), |below| positive("observe.images.below", below))?;
        }
        Ok(())
    }
}

fn share(name: &str, got: f64) -> Result<(), SceneError> {
    if got > 0.0 && got < 1.0 {
        return Ok(());
    }
    Err(SceneError::range(name, got, "between 0 and 1"))
}

/// Refuses values that do not rise, or are not within `bounds`.
fn rising(
    name: &str,
    values: &[f64],
    (low, high): (f64, f64),
    allowed: &'static str,
) -> Result<(), SceneError> {
    let mut last = f64::NEG_INFINITY;
    for (index, &got) in values.iter().enumerate() {
        // NaN is in no range. Times that end with the horizon may miss it by a rounding.
        if !(got >= low && got <= high + 1e-12) {
            return Err(SceneError::range(format!("{name}.{index}"), got, allowed));
        }
        if got <= last {
            return Err(SceneError::range(
                format!("{name}.{index}"),
                got,
                "more than the one before",
            ));
        }
        last = got;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scene;

    fn scene() -> Scene {
        let front = ObserveFront {
            axis: [0.0; 2],
            times: vec![0.1, 0.2],
            level: 0.5,
            link: 1.5,
            end: true,
        };
        let discharge = ObserveDischarge { below: 0.0, times: vec![1.0], jammed_below: 50.0 };
        let observe = Observe {
            rate: 100.0,
            begin: 0.5,
            surface: None,
            front: Some(front),
            liquid: Some(ObserveLiquid { times: vec![0.1], depth: 1e-3 }),
            clock: Some(ObserveClock { liquid_at: 0.1, depth: 1e-3 }),
            discharge: Some(discharge),
            radius: Some(ObserveRadius { axis: [0.0; 2], percentiles: vec![10.0, 90.0] }),
            spill: Some(ObserveSpill { axis: [0.0; 2], radius: 0.05 }),
            images: Some(ObserveImages { times: vec![0.3, 0.4], below: Some(0.1) }),
        };
        let mut scene = Scene { observe: Some(observe), ..Scene::drop(0.1) };
        scene.effects.liquid.height = 0.02;
        scene
    }

    #[test]
    fn a_front_of_liquid_needs_a_liquid() {
        let mut scene = scene();
        scene.effects.liquid.height = 0.0;
        let error = scene.check().unwrap_err().to_string();
        assert!(error.starts_with("effects.liquid.height must be positive where"), "{error}");
    }

    #[test]
    fn observations_survive_toml_and_have_paths() {
        let scene = scene();
        scene.check().unwrap();
        assert_eq!(Scene::from_toml(&scene.to_toml().unwrap()).unwrap(), scene);
        let changed = scene.with("observe.front.times.1", 0.3).unwrap();
        assert_eq!(changed.get("observe.front.times.1").unwrap(), 0.3);
    }

    #[test]
    fn a_rate_is_no_interval() {
        // Begin is at 0.5 s and the horizon at 4 s: 0.01 is a hundredth of a second.
        let error = scene().with("observe.rate", 0.01).unwrap_err().to_string();
        assert!(error.contains("observe.rate must be samples a second, at least one"), "{error}");
        scene().with("observe.rate", 0.3).unwrap();
        // What is looked at at the end alone needs none.
        let mut scene = scene();
        let Observe { rate, begin, radius, spill, .. } = scene.observe.take().unwrap();
        let (surface, front, liquid, clock, discharge, images) = Default::default();
        let observe = Observe {
            rate,
            begin,
            surface,
            front,
            liquid,
            clock,
            discharge,
            radius,
            spill,
            images,
        };
        scene.observe = Some(observe);
        scene.with("observe.rate", 0.01).unwrap();
    }

    #[test]
    fn a_front_without_its_end_needs_a_time() {
        let mut scene = scene();
        scene.observe.as_mut().unwrap().front.as_mut().unwrap().end = false;
        scene.check().unwrap();
        assert_eq!(Scene::from_toml(&scene.to_toml().unwrap()).unwrap(), scene);
        scene.observe.as_mut().unwrap().front.as_mut().unwrap().times.clear();
        let error = scene.check().unwrap_err().to_string();
        assert!(error.contains("observe.front.times must be at least one time"), "{error}");
    }

    #[test]
    fn observations_that_cannot_be_are_named() {
        for (path, value) in [
            ("observe.rate", 0.0),
            ("observe.rate", 1e9),
            ("observe.begin", 4.0),
            ("observe.front.times.1", 0.1),
            ("observe.front.times.1", 3.6),
            ("observe.front.level", 1.0),
            ("observe.front.link", 0.5),
            ("observe.discharge.jammed_below", 101.0),
            ("observe.radius.percentiles.0", -1.0),
            ("observe.spill.radius", 0.0),
            ("observe.images.times.1", 0.2),
            ("observe.images.below", -0.1),
        ] {
            let error = scene().with(path, value).unwrap_err().to_string();
            assert!(error.contains(path), "{path}: {error}");
        }
    }
}
