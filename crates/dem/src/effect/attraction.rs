//! Forces that pull grains together across a gap: an impulse F dt along the normal at the begin of every substep.
//!
//! A closed contact answers with an impulse of its own, so friction feels the pull as it would a weight, and a contact
//! opens where it is drawn by more than F: `0 <= w_n _|_ lambda_n >= 0` with F among the forces.

use std::f64::consts::PI;

use granulcal_scene::{Adhesion, Capillary, Effect, Scene};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::near::{Near, at_walls, pairs};
use crate::contact_set::ContactSet;
use crate::particles::Particles;
use crate::wall::Walls;

/// The pairs that a bridge joins, sorted: first grain, then second grain or the number of grains plus the wall's
/// surface.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Bridges {
    joined: Vec<(u32, u32)>,
    #[serde(skip)]
    next: Vec<(u32, u32)>,
}

/// What pulls in a scene.
#[derive(Clone, Debug)]
pub(crate) struct Attraction {
    /// With the acceleration of a typical grain that touches another `[m/s^2]`.
    capillary: Option<(Capillary, f64)>,
    adhesion: Option<(Adhesion, f64)>,
    /// Radius of a typical grain `[m]`.
    radius: f64,
}

impl Attraction {
    /// `inverse_inertia`: mass of a grain over its mass with what of the fluid moves with it.
    pub fn of(scene: &Scene, inverse_inertia: f64) -> Option<Self> {
        let (capillary, adhesion) = (scene.effects.capillary, scene.effects.adhesion);
        let radius = scene.grains.radius();
        let mass = scene.grains.density * 4.0 / 3.0 * PI * radius.powi(3);
        let weight = Vector3::from(scene.gravity).norm();
        let capillary = capillary
            .is_on()
            .then(|| (capillary, capillary.touch(radius, mass, weight) * inverse_inertia));
        let adhesion = adhesion
            .is_on()
            .then(|| (adhesion, adhesion.touch(radius, mass, weight) * inverse_inertia));
        let pull = Self { capillary, adhesion, radius };
        (pull.capillary.is_some() || pull.adhesion.is_some()).then_some(pull)
    }

    /// How far it reaches `[m]`.
    pub fn reach(&self) -> f64 {
        let capillary = self.capillary.as_ref().map_or(0.0, |(bridge, _)| bridge.rupture());
        self.radius
            * self.adhesion.as_ref().map_or(0.0, |(surface, _)| surface.range).max(capillary)
    }

    /// Pulls all that is near for `dt` `[s]`: pairs of grains and grains at walls; bridges form at a touch and go at
    /// their rupture.
    pub fn act(
        &self,
        bed: &mut Particles,
        [pair_set, wall_set]: [&ContactSet; 2],
        walls: &Walls,
        bridges: &mut Bridges,
        dt: f64,
    ) {
        bridges.next.clear();
        // Velocities change while the pull acts, places do not.
        let places = bed.places.clone();
        let between = pairs(pair_set, &places, bed.period);
        let count = bed.count() as u32;
        for near in between.chain(at_walls(wall_set, &places, count, walls)) {
            let force = self.force(&near, bridges);
            if force > 0.0 {
                let impulse = force * dt * near.normal;
                let (i, j) = (near.pair.0 as usize, near.pair.1 as usize);
                bed.kick(i, &-impulse);
                if !near.is_wall {
                    bed.kick(j, &impulse);
                }
            }
        }
        bridges.next.sort_unstable();
        std::mem::swap(&mut bridges.joined, &mut bridges.next);
    }

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
