//! Forces that pull grains together across a gap: an impulse along the normal in every substep, `F dt` with the mean
//! force F over the gaps that the pair goes through.
//!
//! A closed contact answers with an impulse of its own, so friction feels the pull as it would a weight, and a contact
//! opens where it is drawn by more than F: `0 <= w_n _|_ lambda_n >= 0` with F among the forces. A pair that leaves the
//! reach of the force within the substep loses the work that is left, W(h), and no more,
//!
//! ```text
//! v_n -> sqrt(v_n^2 - 2 (w_i + w_j) W(h)),   W(h) = integral of F from h on
//! ```
//!
//! however short the time is that it needs: grains that rebound go farther in a substep than a force reaches.

use std::f64::consts::PI;
use std::sync::Arc;

use granulcal_scene::{Adhesion, Capillary, Effect, Scene};
use nalgebra::Vector3;

use super::acts::{Acts, EffectContext};
use super::bridges::Bridges;
use super::drag;
use super::near::{self, Meeting, Near};
use crate::particles::Particles;
use crate::wall::Walls;

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
    /// What grains gain that come nearer, and lose that part, is no energy created; where they touch their contact
    /// answers in the same substep, and nothing is gained.
    fn act_across_gaps(
        &self,
        particles: &mut Particles,
        context: &EffectContext<'_>,
        bridges: &mut Bridges,
    ) -> f64 {
        bridges.next.clear();
        let work = near::each(particles, context, |particles, near| {
            let forces = self.forces(near, bridges, particles, context.walls);
            if !forces.iter().any(Force::is_on) {
                return 0.0;
            }
            let meeting = Meeting::of(near, particles, context.walls);
            let impulse = meeting.pull(&forces, near.gap / self.radius, self.radius, context.dt);
            let of_pull = if near.gap > TOUCH * self.radius { meeting.work(impulse) } else { 0.0 };
            of_pull + meeting.push(particles, near, &(-impulse * near.normal))
        });
        bridges.next.sort_unstable();
        std::mem::swap(&mut bridges.joined, &mut bridges.next);
        work
    }
}

/// A force across a gap between two surfaces.
#[derive(Clone, Copy, Debug)]
enum Force<'a> {
    None,
    /// With the pull of touching typical grains over a typical mass `[m/s^2]`, and the radius of Derjaguin `[radii]`.
    Capillary(&'a Capillary, f64, f64),
    Adhesion(&'a Adhesion, f64, f64),
}

impl Force<'_> {
    fn is_on(&self) -> bool {
        !matches!(self, Force::None)
    }

    /// Over a typical mass `[m/s^2]`, at a gap in radii.
    fn at(&self, gap: f64) -> f64 {
        match *self {
            Force::None => 0.0,
            Force::Capillary(bridge, touch, derjaguin) => touch * bridge.pull(gap, derjaguin),
            Force::Adhesion(surface, touch, derjaguin) => touch * surface.pull(gap, derjaguin),
        }
    }

    /// Work that is left to part the surfaces, over a typical mass and radius `[m/s^2]`.
    fn work(&self, gap: f64) -> f64 {
        match *self {
            Force::None => 0.0,
            Force::Capillary(bridge, touch, derjaguin) => touch * bridge.work(gap, derjaguin),
            Force::Adhesion(surface, touch, derjaguin) => touch * surface.work(gap, derjaguin),
        }
    }

    /// Gap at which it ends, in radii `[-]`.
    fn reach(&self) -> f64 {
        match self {
            Force::None => 0.0,
            Force::Capillary(bridge, ..) => bridge.rupture(),
            Force::Adhesion(surface, ..) => surface.range,
        }
    }
}

impl Meeting {
    /// Work of a pull's impulse against the opening of the gap, per typical mass `[m^2/s^2]`: what the pair gains.
    fn work(&self, impulse: f64) -> f64 {
        -impulse * (self.opening - 0.5 * impulse * self.inverse_mass)
    }

    /// The impulse of forces in a substep, over a typical mass `[m/s]`: what they take of the opening speed.
    fn pull(&self, forces: &[Force<'_>; 2], gap: f64, radius: f64, dt: f64) -> f64 {
        // From the contact on, where grains rest a little in each other or come from an impact.
        let from = gap.max(0.0);
        let sum = |of: &dyn Fn(&Force<'_>) -> f64| forces.iter().map(of).sum::<f64>();
        let reach = forces.iter().map(Force::reach).fold(0.0, f64::max);
        let rate = self.inverse_mass * sum(&|f| f.at(from));
        // What an impact has parted goes on from there; what rests is held for the whole substep.
        let is_parted = gap <= 0.0 && self.struck > 0.0 && self.opening > rate * dt;
        let time = if is_parted { dt - self.struck } else { dt };
        let whole = rate * time;
        let to = (gap + (self.opening - whole) * dt / radius).max(0.0);
        let slowed = if to <= reach {
            let way = to - from;
            let taken = if way.abs() < NO_WAY {
                whole
            } else {
                self.inverse_mass * sum(&|f| f.work(from) - f.work(to)) / way * time
            };
            // What parts goes v' dt and loses the work of that way: (v^2 - v'^2) / 2 = v' a dt.
            if self.opening > taken {
                self.opening + taken - self.opening.hypot(taken)
            } else {
                taken
            }
        } else {
            let work = self.inverse_mass * radius * sum(&|f| f.work(from));
            let left = self.opening * self.opening - 2.0 * work;
            (self.opening - left.max(0.0).sqrt()).min(whole)
        };
        // The place of what has parted is told backwards from the impact: it comes back to the contact at most.
        let most = if is_parted { self.opening + gap * radius / dt } else { f64::INFINITY };
        slowed.min(most).max(0.0) / self.inverse_mass
    }
}

impl Attraction {
    /// The forces between two surfaces; keeps the bridge if there is one.
    fn forces(
        &self,
        near: &Near,
        bridges: &mut Bridges,
        particles: &Particles,
        walls: &Walls,
    ) -> [Force<'_>; 2] {
        let (gap, derjaguin) = (near.gap / self.radius, near.derjaguin / self.radius);
        let mut forces = [Force::None; 2];
        if let Some((adhesion, touch)) = &self.adhesion {
            let share = if near.is_wall { adhesion.walls } else { 1.0 };
            if share > 0.0 && gap <= adhesion.range {
                forces[0] = Force::Adhesion(adhesion, share * touch, derjaguin);
            }
        }
        if let Some((capillary, touch)) = &self.capillary {
            let share = if near.is_wall { capillary.walls } else { 1.0 };
            let holds = gap < capillary.rupture()
                && (bridges.joined.binary_search(&near.pair).is_ok()
                    || near.is_wall && comes_over(near, bridges, particles, walls));
            if share > 0.0 && (gap <= TOUCH || holds) {
                forces[1] = Force::Capillary(capillary, share * touch, derjaguin);
                bridges.next.push(near.pair);
            }
        }
        forces
    }
}

/// Whether a bridge to another triangle of the same wall has come over to this one.
fn comes_over(near: &Near, bridges: &Bridges, particles: &Particles, walls: &Walls) -> bool {
    let (grain, count) = (near.pair.0, particles.count() as u32);
    let centre = particles.position(grain as usize);
    let first = bridges.joined.partition_point(|pair| *pair < (grain, count));
    let of_grain = bridges.joined[first..].iter().take_while(|pair| pair.0 == grain);
    let surface_of = |pair: &(u32, u32)| (pair.1 - count) as usize;
    let surface = surface_of(&near.pair);
    of_grain.map(surface_of).any(|left| walls.is_left_to(left, surface, &near.normal, &centre))
}

/// Way in a substep below which a force is the same all along it, in radii `[-]`.
const NO_WAY: f64 = 1e-9;
/// Gap below which surfaces touch and a bridge forms, in radii `[-]`: what the solver leaves between resting grains.
const TOUCH: f64 = 1e-3;
