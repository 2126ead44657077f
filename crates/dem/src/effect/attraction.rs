//! Forces that pull grains together across a gap: an impulse F dt along the normal at the begin of every substep.
//!
//! A closed contact answers with an impulse of its own, so friction feels the pull as it would a weight, and a contact
//! opens where it is drawn by more than F: `0 <= w_n _|_ lambda_n >= 0` with F among the forces.

use std::f64::consts::PI;
use std::sync::Arc;

use granulcal_scene::{Adhesion, Capillary, Effect, Scene};
use nalgebra::Vector3;

use super::acts::{Acts, EffectContext};
use super::bridges::Bridges;
use super::drag;
use super::near::{Near, at_walls, pairs};
use crate::particles::Particles;

/// What pulls in a scene.
#[derive(Clone, Debug)]
struct Attraction {
    /// With the acceleration of a typical grain that touches another `[m/s^2]`.
    capillary: Option<(Capillary, f64)>,
    adhesion: Option<(Adhesion, f64)>,
    /// Radius of a typical grain `[m]`.
    radius: f64,
}

/// What pulls in a scene, if anything does.
pub(super) fn of(scene: &Scene) -> Option<Arc<dyn Acts>> {
    let (capillary, adhesion) = (scene.effects.capillary, scene.effects.adhesion);
    let radius = scene.grains.radius();
    let mass = scene.grains.density * 4.0 / 3.0 * PI * radius.powi(3);
    let weight = Vector3::from(scene.gravity).norm();
    let inverse_inertia = drag::inverse_inertia(scene);
    let capillary = capillary
        .is_on()
        .then(|| (capillary, capillary.touch(radius, mass, weight) * inverse_inertia));
    let adhesion = adhesion
        .is_on()
        .then(|| (adhesion, adhesion.touch(radius, mass, weight) * inverse_inertia));
    let pulls = capillary.is_some() || adhesion.is_some();
    pulls.then(|| Arc::new(Attraction { capillary, adhesion, radius }) as _)
}

impl Acts for Attraction {
    fn reach(&self) -> f64 {
        let capillary = self.capillary.as_ref().map_or(0.0, |(bridge, _)| bridge.rupture());
        self.radius
            * self.adhesion.as_ref().map_or(0.0, |(surface, _)| surface.range).max(capillary)
    }

    /// Pulls all that is near: pairs of grains and grains at walls; bridges form at a touch and go at their rupture.
    fn act_across_gaps(
        &self,
        particles: &mut Particles,
        context: &EffectContext<'_>,
        bridges: &mut Bridges,
    ) {
        bridges.next.clear();
        // Velocities change while the pull acts, spheres do not.
        let spheres = particles.spheres.clone();
        let between = pairs(context.pairs, &spheres, particles.period);
        let count = particles.count() as u32;
        for near in between.chain(at_walls(context.at_walls, &spheres, count, context.walls)) {
            let force = self.force(&near, bridges);
            if force > 0.0 {
                let impulse = force * context.dt * near.normal;
                let (i, j) = (near.pair.0 as usize, near.pair.1 as usize);
                particles.kick(i, &-impulse);
                if !near.is_wall {
                    particles.kick(j, &impulse);
                }
            }
        }
        bridges.next.sort_unstable();
        std::mem::swap(&mut bridges.joined, &mut bridges.next);
    }
}

impl Attraction {
    /// Force over a typical mass `[m/s^2]`; keeps the bridge if there is one.
    fn force(&self, near: &Near, bridges: &mut Bridges) -> f64 {
        let (gap, derjaguin) = (near.gap / self.radius, near.derjaguin / self.radius);
        let mut force = 0.0;
        if let Some((adhesion, touch)) = &self.adhesion {
            let share = if near.is_wall { adhesion.walls } else { 1.0 };
            force += share * touch * adhesion.pull(gap, derjaguin);
        }
        if let Some((capillary, touch)) = &self.capillary {
            let share = if near.is_wall { capillary.walls } else { 1.0 };
            let holds =
                gap < capillary.rupture() && bridges.joined.binary_search(&near.pair).is_ok();
            if share > 0.0 && (gap <= TOUCH || holds) {
                force += share * touch * capillary.pull(gap, derjaguin);
                bridges.next.push(near.pair);
            }
        }
        force
    }
}

/// Gap below which surfaces touch and a bridge forms, in radii `[-]`: what the solver leaves between resting grains.
const TOUCH: f64 = 1e-3;
