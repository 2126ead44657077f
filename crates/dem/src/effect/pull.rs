//! Forces that pull grains together across a gap: an impulse F dt along the normal at the begin of every substep.
//!
//! A closed contact answers with an impulse of its own, so friction feels the pull as it would a weight, and a contact
//! opens where it is drawn by more than F: `0 <= w_n _|_ lambda_n >= 0` with F among the forces.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::bed::Bed;
use crate::contact_set::ContactSet;
use crate::lanes::Row;
use crate::period::Period;
use crate::scene::{Adhesion, Capillary, Effect, Scene};
use crate::wall::Walls;

/// The pairs that a bridge joins, sorted: first grain, then second grain or the number of grains plus the wall's surface.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Bridges {
    joined: Vec<(u32, u32)>,
    #[serde(skip)]
    next: Vec<(u32, u32)>,
}

/// What pulls in a scene.
#[derive(Clone, Debug)]
pub(crate) struct Pull {
    capillary: Option<Capillary>,
    adhesion: Option<Adhesion>,
    /// Acceleration of a typical grain that is pulled by its weight `[m/s^2]`.
    weight: f64,
    /// Radius of a typical grain `[m]`.
    radius: f64,
}

/// Two surfaces as a pull sees them.
struct Near {
    /// First grain, and second grain or the number of grains plus the wall's surface.
    pair: (u32, u32),
    gap: f64,
    /// `[m]`
    derjaguin: f64,
    /// From the second to the first.
    normal: Vector3<f64>,
    is_wall: bool,
}

impl Pull {
    /// `inverse_inertia`: mass of a grain over its mass with what of the fluid moves with it.
    pub fn of(scene: &Scene, inverse_inertia: f64) -> Option<Self> {
        let (capillary, adhesion) = (scene.effects.capillary, scene.effects.adhesion);
        let pull = Self {
            capillary: capillary.is_on().then_some(capillary),
            adhesion: adhesion.is_on().then_some(adhesion),
            weight: Vector3::from(scene.gravity).norm() * inverse_inertia,
            radius: scene.grains.radius(),
        };
        (pull.capillary.is_some() || pull.adhesion.is_some()).then_some(pull)
    }

    /// How far it reaches `[m]`.
    pub fn reach(&self) -> f64 {
        let capillary = self.capillary.as_ref().map_or(0.0, Capillary::rupture);
        self.radius * self.adhesion.as_ref().map_or(0.0, |a| a.range).max(capillary)
    }

    /// Pulls all that is near for `dt` `[s]`: pairs of grains and grains at walls; bridges form at a touch and go at their rupture.
    pub fn act(
        &self,
        bed: &mut Bed,
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
        if let Some(adhesion) = &self.adhesion {
            let share = if near.is_wall { adhesion.walls } else { 1.0 };
            force += share * adhesion.bond * adhesion.pull(gap, derjaguin);
        }
        if let Some(capillary) = &self.capillary {
            let share = if near.is_wall { capillary.walls } else { 1.0 };
            let holds =
                gap < capillary.rupture() && bridges.joined.binary_search(&near.pair).is_ok();
            if share > 0.0 && (gap <= TOUCH || holds) {
                force += share * capillary.bond * capillary.pull(gap, derjaguin);
                bridges.next.push(near.pair);
            }
        }
        force * self.weight
    }
}

/// Gap below which surfaces touch and a bridge forms, in radii `[-]`: what the solver leaves between resting grains.
const TOUCH: f64 = 1e-3;

fn pairs(set: &ContactSet, places: &[Row], period: Option<Period>) -> impl Iterator<Item = Near> {
    set.lanes().map(move |(number, lane)| {
        let batch = &set.batches[number];
        let (i, j) = (batch.i[lane], batch.j[lane]);
        let (a, b) = (places[i as usize], places[j as usize]);
        let (direct, [r_i, r_j]) = (a.vector() - b.vector(), [a.0[3], b.0[3]]);
        let apart = period.map_or(direct, |period| period.nearest(direct));
        let distance = apart.norm();
        Near {
            pair: (i, j),
            gap: distance - r_i - r_j,
            derjaguin: 2.0 * r_i * r_j / (r_i + r_j),
            normal: if distance > 0.0 { apart / distance } else { Vector3::z() },
            is_wall: false,
        }
    })
}

fn at_walls(
    set: &ContactSet,
    places: &[Row],
    count: u32,
    walls: &Walls,
) -> impl Iterator<Item = Near> {
    set.lanes().map(move |(number, lane)| {
        let (grain, surface) = (set.batches[number].i[lane], set.at_walls[number].wall[lane]);
        let place = places[grain as usize];
        let near = walls.nearest(surface as usize, &place.vector(), 0.0);
        Near {
            pair: (grain, count + surface),
            gap: near.distance - place.0[3],
            derjaguin: 2.0 * place.0[3],
            normal: near.normal,
            is_wall: true,
        }
    })
}
