//! What the effects of a scene do in a substep, as plug-ins, without influence on a single bit when off
//! (docs/theory/effects.md). Their numbers are in `scene/effects/`.

mod attraction;
mod drag;
mod elastic_layer;
mod film;
mod near;
mod pore_surface;

use nalgebra::Vector3;

pub(crate) use attraction::{Attraction, Bridges};
use drag::Drag;
pub(crate) use elastic_layer::ElasticLayer;
use film::Film;
use granulcal_scene::{Effect, RestitutionSpeed, Scene, Vibration};

/// What the effects of a scene do in a substep; what is off is absent.
#[derive(Clone, Debug)]
pub(crate) struct Acting {
    /// Gravity less buoyancy, in the frame of the table `[m/s^2]`.
    pub gravity: Vector3<f64>,
    pub vibration: Option<Vibration>,
    pub drag: Option<Drag>,
    pub pull: Option<Attraction>,
    pub film: Option<Film>,
    pub restitution: Option<RestitutionSpeed>,
    pub pad: Option<ElasticLayer>,
    /// See [`RollingForm::speed`].
    pub rolling_speed: f64,
}

impl Acting {
    pub fn of(scene: &Scene) -> Self {
        let effects = &scene.effects;
        let mut gravity = Vector3::from(scene.gravity);
        if effects.tilt.is_on() {
            gravity = effects.tilt.turn(&gravity);
        }
        let drag = effects
            .fluid
            .is_on()
            .then(|| Drag::of(effects.fluid, &scene.grains, scene.gravity[2].abs()));
        if let Some(drag) = &drag {
            gravity *= drag.weight;
        }
        let inverse_inertia = drag.as_ref().map_or(1.0, |drag| drag.inverse_inertia);
        Self {
            gravity,
            vibration: effects.vibration.is_on().then_some(effects.vibration),
            pull: Attraction::of(scene, inverse_inertia),
            film: Film::of(scene, inverse_inertia),
            drag,
            restitution: effects.restitution_speed.is_on().then_some(effects.restitution_speed),
            pad: effects.layer.is_on().then(|| ElasticLayer::of(scene)),
            rolling_speed: effects.rolling_form.speed,
        }
    }

    /// Gravity and what a shaking table adds to it at `time` `[m/s^2]`.
    pub fn gravity_at(&self, time: f64) -> Vector3<f64> {
        match &self.vibration {
            Some(vibration) => self.gravity + vibration.acceleration_at(time) * Vector3::z(),
            None => self.gravity,
        }
    }

    /// How far the longest force across a gap reaches `[m]`; 0 without one.
    pub fn reach(&self) -> f64 {
        let film = self.film.as_ref().map_or(0.0, Film::reach);
        self.pull.as_ref().map_or(0.0, Attraction::reach).max(film)
    }

    /// The restitution of an impact at `speed` `[m/s]` that would be `restitution` at the speed of reference.
    pub fn restitution_at(&self, restitution: f64, speed: f64) -> f64 {
        self.restitution.as_ref().map_or(restitution, |law| law.at(restitution, speed))
    }
}
