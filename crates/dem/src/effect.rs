//! What the effects of a scene do in a substep, as plug-ins, without influence on a single bit when off
//! (docs/theory/effects.md). Their numbers are in `scene/effects/`; what an effect can do is [`Acts`].

mod acts;
mod attraction;
mod bridges;
mod drag;
mod elastic_layer;
mod film;
mod near;
mod neighbours;
mod pore_surface;
mod restitution_speed;
mod rolling_form;
mod tilt;
mod vibration;

use std::sync::Arc;

pub(crate) use acts::{Acts, EffectContext};
pub(crate) use bridges::Bridges;
pub(crate) use drag::{Drag, inverse_inertia};
use granulcal_scene::Scene;
use nalgebra::Vector3;
pub(crate) use neighbours::neighbours;
pub(crate) use pore_surface::PACKED;

use crate::contact::ContactLaw;
use crate::contact_set::ContactSet;
use crate::particles::Particles;

/// An effect that is on.
type Plugged = Arc<dyn Acts>;

/// Every effect that acts in a substep, in the order in which they do: what makes it of a scene in which it is on.
const ALL: &[fn(&Scene) -> Option<Plugged>] = &[
    tilt::of,
    vibration::of,
    // After what shakes the fluid with the grains: they float in it then as ever.
    drag::of,
    attraction::of,
    film::of,
    restitution_speed::of,
    elastic_layer::of,
    rolling_form::of,
];

/// What the effects of a scene do in a substep; what is off is absent.
#[derive(Clone, Debug)]
pub(crate) struct Acting {
    /// Gravity less buoyancy, in the frame of the table `[m/s^2]`.
    pub gravity: Vector3<f64>,
    /// What gravity is without any effect `[m/s^2]`.
    plain: Vector3<f64>,
    effects: Vec<Plugged>,
}

impl Acting {
    pub fn of(scene: &Scene) -> Self {
        let effects: Vec<_> = ALL.iter().filter_map(|of| of(scene)).collect();
        let plain = Vector3::from(scene.gravity);
        let turned = |gravity, effect: &Plugged| effect.gravity(gravity);
        Self { gravity: effects.iter().fold(plain, turned), plain, effects }
    }

    /// Gravity with what is added to it at `time` `[m/s^2]`; None where nothing ever is.
    pub fn gravity_at(&self, time: f64) -> Option<Vector3<f64>> {
        let mut is_added_to = false;
        let gravity = self.effects.iter().fold(self.plain, |gravity, effect| {
            let gravity = effect.gravity(gravity);
            let Some(added) = effect.added_gravity(time) else { return gravity };
            is_added_to = true;
            gravity + added
        });
        is_added_to.then_some(gravity)
    }

    /// How far the longest force across a gap reaches `[m]`; 0 without one.
    pub fn reach(&self) -> f64 {
        self.effects.iter().map(|effect| effect.reach()).fold(0.0, f64::max)
    }

    /// Changes the coefficients of a contact.
    pub fn change_law(&self, law: &mut ContactLaw) {
        self.effects.iter().for_each(|effect| effect.change_law(law));
    }

    /// The restitution of an impact at `speed` `[m/s]` that would be `restitution` at the speed of reference.
    pub fn restitution_at(&self, restitution: f64, speed: f64) -> f64 {
        self.effects.iter().fold(restitution, |e, effect| effect.restitution_at(e, speed))
    }

    /// Lets act what does so before gravity: what it finds is how grains move, not how they would fall; returns the
    /// work of moving walls, per typical mass `[m^2/s^2]`.
    pub fn act_before_gravity(
        &self,
        particles: &mut Particles,
        context: &EffectContext<'_>,
    ) -> f64 {
        self.effects.iter().map(|effect| effect.act_before_gravity(particles, context)).sum()
    }

    /// Lets act what does so with gravity, before contacts are assembled; returns the energy that it gives, per typical
    /// mass `[m^2/s^2]`.
    pub fn act_with_gravity(&self, particles: &mut Particles, context: &EffectContext<'_>) -> f64 {
        self.effects.iter().map(|effect| effect.act_with_gravity(particles, context)).sum()
    }

    /// Lets act what does so across gaps, after the impacts: what a pull adds in a substep to a closed contact is not
    /// an impact. Returns the energy that they give and the work of moving walls, per typical mass `[m^2/s^2]`.
    pub fn act_across_gaps(
        &self,
        particles: &mut Particles,
        context: &EffectContext<'_>,
        bridges: &mut Bridges,
    ) -> f64 {
        self.effects.iter().map(|effect| effect.act_across_gaps(particles, context, bridges)).sum()
    }

    /// Whether an effect has contacts of its own.
    pub fn has_contacts(&self) -> bool {
        self.effects.iter().any(|effect| effect.has_contacts())
    }

    /// Lists the contacts that an effect has of its own, with what they had before; `ground` has the coefficients of a
    /// grain on the hard ground.
    pub fn assemble(
        &self,
        set: &mut ContactSet,
        particles: &Particles,
        dt: f64,
        ground: &dyn Fn(usize) -> ContactLaw,
    ) {
        for effect in self.effects.iter().filter(|effect| effect.has_contacts()) {
            effect.assemble(set, particles, dt, ground);
        }
    }

    /// What the effects hold as springs do, per typical mass `[m^2/s^2]`.
    pub fn energy(&self, particles: &Particles) -> f64 {
        self.effects.iter().map(|effect| effect.energy(particles)).sum()
    }
}

#[cfg(test)]
mod tests {
    use granulcal_scene::Vibration;

    use super::*;

    #[test]
    fn of_a_plain_scene_nothing_acts() {
        let acting = Acting::of(&Scene::drop(0.02));
        assert!(acting.effects.is_empty());
        assert_eq!((acting.reach(), acting.gravity_at(1.0)), (0.0, None));
    }

    #[test]
    fn a_fluid_on_a_table_that_shakes_carries_as_much_as_on_one_that_rests() {
        let mut scene = Scene::drop(0.02);
        scene.effects.fluid.density = scene.grains.density;
        scene.effects.vibration.acceleration = 2.0;
        let Vibration { begin, frequency, .. } = scene.effects.vibration;
        let acting = Acting::of(&scene);
        let most = acting.gravity_at(begin + 0.25 / frequency).unwrap();
        assert!(acting.gravity.norm() < 1e-12 && most.norm() < 1e-12, "{most}");
    }

    #[test]
    fn what_acts_together_acts_in_the_order_of_the_list() {
        let mut scene = Scene::drop(0.02);
        scene.effects.tilt.y = 0.1;
        scene.effects.fluid.density = 1000.0;
        scene.effects.restitution_speed.exponent = 0.25;
        let acting = Acting::of(&scene);
        assert_eq!(acting.effects.len(), 3);
        let level = Vector3::from(scene.gravity);
        let turned = scene.effects.tilt.turn(&level);
        let ratio = acting.gravity.norm() / turned.norm();
        assert!(ratio < 1.0 && (acting.gravity - ratio * turned).norm() < 1e-12);
        assert_eq!(acting.restitution_at(0.6, 16.0), scene.effects.restitution_speed.at(0.6, 16.0));
    }
}
