//! A soft layer on the ground: a bed of springs and dampers above the hard ground (Winkler; Kelvin and Voigt).
//!
//! ```text
//! F = max(0, k s + c ds/dt)   for a grain whose lowest point is s below the layer's surface, 0 < s <= thickness
//! k = stiffness m g / R,      c = 2 damping sqrt(k m)
//! ```
//!
//! Implicit in the substep's velocity, so that no layer is too stiff: with `w_n = -ds/dt` at its end,
//! `lambda_n = dt (k (s - dt w_n) - c w_n)`, which is a contact that gives way,
//!
//! ```text
//! 0 <= w_n + b + a lambda_n _|_ lambda_n >= 0,    a = 1 / (dt (dt k + c)),    b = -a dt k s
//! ```
//!
//! with the ground's friction on its own `lambda_n`. Source: Winkler 1867 as in Johnson, Contact Mechanics (1985), 4.3;
//! the contact that gives way as in Lacoursiere 2007 (doctoral thesis, Umea), 4.4. The hard ground lies below it and
//! keeps its own coefficients: no thickness is no layer. Prior of the thickness: uniform over 0 to a radius.

use std::sync::Arc;

use granulcal_scene::{Effect, Scene};
use nalgebra::Vector3;

use super::acts::Acts;
use crate::blocks::Blocks;
use crate::contact::{ContactKey, ContactLaw};
use crate::contact_set::{BodyKind, ContactSet, Laws};
use crate::lanes::Lanes;
use crate::particles::Particles;

/// A layer as the solver sees it, over a typical mass.
#[derive(Clone, Copy, Debug)]
struct ElasticLayer {
    /// k `[1/s^2]`
    rigidity: f64,
    /// c `[1/s]`
    damping: f64,
}

/// The layer of a scene, if there is one.
pub(super) fn of(scene: &Scene) -> Option<Arc<dyn Acts>> {
    let layer = scene.effects.layer;
    let made = || {
        let weight = Vector3::from(scene.gravity).norm();
        let rigidity = layer.stiffness * weight / scene.grains.radius();
        ElasticLayer { rigidity, damping: 2.0 * layer.damping * rigidity.sqrt() }
    };
    layer.is_on().then(|| Arc::new(made()) as _)
}

impl ElasticLayer {
    /// a `[-]`: how far a contact gives way to an impulse in a substep.
    fn compliance(&self, dt: f64) -> f64 {
        1.0 / (dt * (dt * self.rigidity + self.damping))
    }

    /// b of a contact of so much gap `[m]`, negative inside the layer `[m/s]`.
    fn bias(&self, gap: f64, dt: f64) -> f64 {
        if gap < 0.0 { self.compliance(dt) * dt * self.rigidity * gap } else { gap / dt }
    }
}

impl Acts for ElasticLayer {
    fn has_contacts(&self) -> bool {
        true
    }

    /// Lists the grains that are in the layer by the end of a substep of `dt` `[s]`.
    fn assemble(
        &self,
        set: &mut ContactSet,
        particles: &Particles,
        dt: f64,
        ground: &dyn Fn(usize) -> ContactLaw,
    ) {
        let gap = |grain: usize| particles.position(grain).z - particles.radius(grain);
        let comes = |&grain: &usize| gap(grain) + dt * particles.velocity(grain).z.min(0.0) < 0.0;
        let listed: Vec<ContactKey> = particles
            .present()
            .filter(comes)
            .map(|i| ContactKey { i: i as u32, partner: 0 })
            .collect();
        let compliance = self.compliance(dt);
        let law = |contact: &ContactKey| ContactLaw { compliance, ..ground(contact.i as usize) };
        let (blocks, count) = (Blocks::default(), particles.count());
        set.rebuild(&listed, &blocks, count, BodyKind::SoftLayer, &Laws::Each(law));
        for batch in &mut set.batches {
            batch.bias = Lanes::splat(f64::INFINITY);
            for lane in batch.lanes() {
                batch.bias.0[lane] = self.bias(gap(batch.i[lane] as usize), dt);
            }
        }
    }

    fn energy(&self, particles: &Particles) -> f64 {
        let depth = |grain| (particles.radius(grain) - particles.position(grain).z).max(0.0);
        let spring = |grain| 0.5 * self.rigidity * depth(grain) * depth(grain);
        particles.present().map(spring).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_contact_that_gives_way_is_a_spring_and_a_damper() {
        let pad = ElasticLayer { rigidity: 4e4, damping: 300.0 };
        let (dt, gap, w_n) = (1e-4, -2e-4, 0.03);
        // The impulse of the complementarity condition at this velocity, and of the force at the substep's end.
        let lambda = -(w_n + pad.bias(gap, dt)) / pad.compliance(dt);
        let force = -pad.rigidity * (gap + dt * w_n) - pad.damping * w_n;
        assert!((lambda - dt * force).abs() < 1e-12 * dt * force.abs(), "{lambda}");
    }
}
