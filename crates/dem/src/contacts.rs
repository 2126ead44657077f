//! All contacts of a simulation: which are listed, and when the list is stale.
//!
//! A list made at time t covers every pair that comes nearer than a margin on straight paths. It stays
//! complete as long as every grain is within half the margin of its path. A grain that leaves it gets a new path
//! and the contacts that lie on it; when many do, the list is made afresh.

mod check;
mod foresee;

use std::ops::Range;

use crate::assemble::{self, Seen};
use crate::blocks::Blocks;
use crate::body::Body;
use crate::contact::{Batch, Candidate, ContactKey};
use crate::contact_context::ContactContext;
use crate::contact_set::{BodyKind, ContactSet, Laws};
use crate::lanes::Row;
use crate::neighbor::{Neighbours, PairSearch};
use crate::particles::Particles;
use crate::partners::Partners;
use crate::path::{Ball, Path, Reach};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Share of the grains from which on a new list is cheaper than single new paths.
const MANY: usize = 16;
/// Batches or grains that a thread takes at once.
const SHARE: usize = if cfg!(test) { 4 } else { 512 };

/// Pairs and grains at walls, with their search.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Contacts {
    pub pairs: ContactSet,
    pub at_walls: ContactSet,
    search: PairSearch,
    #[serde(skip)]
    blocks: Blocks,
    #[serde(skip)]
    found: Vec<Neighbours>,
    #[serde(skip)]
    around_path: Vec<u32>,
    #[serde(skip)]
    listed: Vec<ContactKey>,
    #[serde(skip)]
    far: Vec<ContactKey>,
    /// Grains, and walls with the number of grains added.
    partners: Partners,
    #[serde(skip)]
    near_walls: Vec<(ContactKey, bool)>,
    /// The way of each grain, from the time of the list on.
    paths: Vec<Path>,
    /// Paths that are newer than the list.
    renewed: usize,
    /// Substeps since the list was made.
    age: usize,
    #[serde(skip)]
    strayed: Vec<u32>,
}

impl Contacts {
    /// Calls for a new list before the next substep: something other than the solve has set a grain in motion.
    pub fn forget_list(&mut self) {
        self.age = usize::MAX;
    }

    /// Puts the grains that have left the period in at its other end; returns by how much that changes their energy in
    /// `gravity`, per typical mass `[m^2/s^2]`.
    pub fn wrap(&mut self, particles: &mut Particles, gravity: &Vector3<f64>) -> f64 {
        let Some(period) = particles.period else { return 0.0 };
        let mut gained = 0.0;
        for grain in 0..particles.count() {
            if let Some(shift) = period.shift(&particles.position(grain)) {
                particles.spheres[grain].add(&shift);
                if let Some(path) = self.paths.get_mut(grain) {
                    path.from += shift;
                }
                gained -= gravity.dot(&shift) / particles.inverse_mass[grain];
            }
        }
        gained
    }

    /// Lists what may touch in the coming substep.
    pub fn follow(&mut self, particles: &Particles, around: &ContactContext) {
        if self.paths.is_empty() || self.age >= around.settings.list_period {
            self.list(particles, around);
            return;
        }
        let now = self.age as f64 * around.settings.dt;
        self.strayed.clear();
        let (dt, paths) = (around.settings.dt, &self.paths);
        around.threads.gather_ranges(paths.len(), SHARE, &mut self.strayed, |grains, strayed| {
            for grain in grains {
                let at_end = particles.position(grain) + dt * particles.velocity(grain);
                if is_off(&(at_end - paths[grain].at(now + dt)), around) {
                    strayed.push(grain as u32);
                }
            }
        });
        if (self.strayed.len() + self.renewed) * MANY > particles.count() {
            self.list(particles, around);
            return;
        }
        for number in 0..self.strayed.len() {
            self.renew(self.strayed[number] as usize, now, particles, around);
        }
    }

    /// Lists what a grain may touch after an impact at `time` `[s]` into the substep, if it will leave its path.
    pub fn follow_after_impact(
        &mut self,
        grain: usize,
        time: f64,
        particles: &Particles,
        around: &ContactContext,
    ) {
        let dt = around.settings.dt;
        // `assemble` has counted the present substep already.
        let begin = (self.age - 1) as f64 * dt;
        let end = particles.sphere_at(grain, dt).vector();
        if is_off(&(end - self.paths[grain].at(begin + dt)), around) {
            self.renew(grain, begin + time, particles, around);
        }
    }

    /// Those that a grain is listed with: grains, and walls with the number of grains added.
    pub fn partners(&self, grain: usize) -> impl Iterator<Item = u32> + '_ {
        self.partners.of(grain)
    }

    /// Gaps, normals and biases of every listed contact; `found` gets what may be an impact.
    pub fn assemble(
        &mut self,
        particles: &Particles,
        around: &ContactContext,
        lost: &mut [bool],
        found: &mut Vec<Candidate>,
    ) -> Seen {
        let (step, speed) = ((around.settings.dt, &around.small), around.impact_speed);
        self.age += 1;
        let assemble = |batches: &mut [Batch], found: &mut Vec<Candidate>| {
            assemble::assemble_pairs(batches, particles, step, speed, found)
        };
        let batches = &mut self.pairs.batches;
        let pairs = around.threads.gather(batches, SHARE, found, assemble, Seen::max);
        let at_walls = &mut self.at_walls;
        let walls =
            assemble::assemble_walls(at_walls, &around.walls, particles, step, speed, lost, found);
        pairs.max(walls)
    }

    /// The same for the contacts of grains that have had an impact.
    pub fn assemble_again(&mut self, particles: &Particles, around: &ContactContext) {
        let step = (around.settings.dt, &around.small);
        let refresh = |batches: &mut [Batch]| assemble::refresh_pairs(batches, particles, step);
        around.threads.shares(&mut self.pairs.batches, SHARE, refresh, |(), ()| ());
        assemble::refresh_walls(&mut self.at_walls, &around.walls, particles, step);
    }

    /// Puts the walls' motion into the bodies that stand for them, one for each contact at a wall.
    ///
    /// A contact sees its second body's surface at `v_j - n x w_j`, so `v_j = v_wall + n x w_j` with
    /// `w_j = r omega_wall`.
    pub fn move_walls(&self, particles: &mut Particles, around: &ContactContext) {
        if !around.has_moving_walls {
            return;
        }
        particles.resize_wall_bodies(self.at_walls.wall_bodies());
        for (number, lane) in self.at_walls.lanes() {
            let (batch, at) = (&self.at_walls.batches[number], &self.at_walls.at_walls[number]);
            let (grain, normal) = (batch.i[lane] as usize, Vector3::from(batch.normal.get(lane)));
            let radius = particles.radius(grain);
            let touching = particles.position(grain) - radius * normal;
            let (velocity, omega) = around.walls.wall(at.wall[lane] as usize).motion_at(&touching);
            let spin = radius * omega;
            particles.bodies[batch.j[lane] as usize] = Body {
                velocity: Row::new(&(velocity + normal.cross(&spin)), 0.0),
                spin: Row::new(&spin, 0.0),
            };
        }
    }

    /// Work that the walls have done on the grains in the lasting contacts of the substep, per typical mass
    /// `[m^2/s^2]`: impulse times the velocity of the wall, moment times its turning.
    pub fn work_of_walls(&self, particles: &Particles) -> f64 {
        let work = |(number, lane): (usize, usize)| {
            let batch = &self.at_walls.batches[number];
            let [normal, lambda_t, lambda_r] = [&batch.normal, &batch.lambda_t, &batch.lambda_r]
                .map(|l| Vector3::from(l.get(lane)));
            let body = &particles.bodies[batch.j[lane] as usize];
            let spin = body.spin.vector();
            let velocity = body.velocity.vector() - normal.cross(&spin);
            let force = batch.lambda_n.0[lane] * normal + lambda_t;
            force.dot(&velocity) + lambda_r.dot(&spin)
        };
        self.at_walls.lanes().map(work).sum()
    }

    /// Number of listed contacts.
    pub fn count(&self) -> usize {
        self.pairs.len() + self.at_walls.len()
    }

    /// A new list for all grains.
    fn list(&mut self, particles: &Particles, around: &ContactContext) {
        self.age = 0;
        self.renewed = 0;
        self.paths = Path::all_of(particles);
        let reach = around.reach();

        self.search.pairs(particles, &self.paths, reach, &around.threads, &mut self.found);
        // Where space repeats the first and the last block are neighbours, which phases do not know: one block.
        let middles = if particles.period.is_some() { &[] } else { self.search.middles() };
        let (longest, wide) = (self.search.longest(), self.search.wide());
        self.blocks.place(middles, longest, around.radius, wide);
        // Contacts that will act come first: their batches are full of them, the others are passed over whole.
        let members = around.members as u32;
        if members > 1 {
            self.found.retain(|pair| pair.i / members != pair.j / members);
        }
        self.listed.clear();
        self.far.clear();
        for &Neighbours { i, j: partner, come_near } in &self.found {
            if come_near { &mut self.listed } else { &mut self.far }
                .push(ContactKey { i, partner });
        }
        self.listed.append(&mut self.far);
        let law = |i, j| around.pair_law(particles, i, j);
        let laws = if particles.are_alike() {
            Laws::One(law(0, 0))
        } else {
            Laws::Each(|pair: &ContactKey| law(pair.i as usize, pair.partner as usize))
        };
        let (pairs, kind) = (&mut self.pairs, BodyKind::Grain);
        pairs.rebuild(&self.listed, &self.blocks, particles.count(), kind, &laws);

        self.list_walls(particles, around, reach);
        self.listed.clear();
        for &(contact, is_near) in &self.near_walls {
            if is_near { &mut self.listed } else { &mut self.far }.push(contact);
        }
        self.listed.append(&mut self.far);
        let second =
            if around.has_moving_walls { BodyKind::MovingWall } else { BodyKind::RestingWall };
        let laws = Laws::Each(|contact: &ContactKey| {
            around.wall_law(particles, contact.i as usize, contact.partner as usize)
        });
        self.at_walls.rebuild(&self.listed, &self.blocks, particles.count(), second, &laws);
    }

    /// Lists the walls within reach of each grain, and whether they may be touched.
    fn list_walls(&mut self, particles: &Particles, around: &ContactContext, reach: Reach) {
        self.near_walls.clear();
        let (paths, walls) = (&self.paths, &around.walls);
        let list = |grains: Range<usize>, found: &mut Vec<(ContactKey, bool)>| {
            for grain in grains.filter(|&grain| !particles.has_left(grain)) {
                let Path { from, velocity } = &paths[grain];
                let near = particles.radius(grain) + reach.near + reach.interval * velocity.norm();
                let range = near + around.margin - reach.near;
                walls.reached(from, range, |surface| {
                    let contact = ContactKey { i: grain as u32, partner: surface as u32 };
                    found.push((contact, walls.may_reach(surface, from, near)));
                });
            }
        };
        around.threads.gather_ranges(particles.count(), SHARE, &mut self.near_walls, list);
        let (found, near_walls, count) = (&self.found, &self.near_walls, particles.count() as u32);
        self.partners.rebuild(particles.count(), |add| {
            for pair in found {
                add(pair.i, pair.j);
                add(pair.j, pair.i);
            }
            for (contact, _) in near_walls {
                add(contact.i, count + contact.partner);
            }
        });
    }

    /// Gives a grain a new path from `now` `[s]` after the list on and lists what lies on it.
    fn renew(&mut self, grain: usize, now: f64, particles: &Particles, around: &ContactContext) {
        let settings = &around.settings;
        let left = settings.dt * settings.list_period as f64 - now;
        let (at, velocity) = (particles.position(grain), particles.velocity(grain));
        let path = Path { from: at, velocity };
        self.paths[grain] = Path { from: at - now * velocity, velocity };
        self.renewed += 1;

        let ball = Ball::swept(&path, particles.radius(grain), left, around.margin);
        self.around_path.clear();
        self.search.around(&ball, |other| self.around_path.push(other));
        if let Some(period) = &particles.period {
            for step in [period.step(), -period.step()] {
                let image = Ball { middle: ball.middle + step, ..ball };
                self.search.around(&image, |other| self.around_path.push(other));
            }
        }
        self.search.add(grain as u32, &ball);
        for number in 0..self.around_path.len() {
            let other = self.around_path[number] as usize;
            let is_own = other / around.members == grain / around.members;
            if is_own || self.partners.has(grain, other as u32) {
                continue;
            }
            let theirs = &self.paths[other];
            let theirs = Path { from: theirs.at(now), velocity: theirs.velocity };
            let limit = particles.radius(grain) + particles.radius(other) + around.margin;
            if path.comes_within(&theirs, particles, limit, left) {
                let (i, j) = (grain.min(other), grain.max(other));
                self.partners.add(i, j as u32);
                self.partners.add(j, i as u32);
                let contact = ContactKey { i: i as u32, partner: j as u32 };
                self.pairs.append(contact, false, around.pair_law(particles, i, j));
            }
        }
        let range = particles.radius(grain) + around.margin + left * velocity.norm();
        let (partners, at_walls) = (&mut self.partners, &mut self.at_walls);
        around.walls.reached(&at, range, |surface| {
            let partner = (particles.count() + surface) as u32;
            if !partners.has(grain, partner) {
                partners.add(grain, partner);
                let contact = ContactKey { i: grain as u32, partner: surface as u32 };
                at_walls.append(contact, true, around.wall_law(particles, grain, surface));
            }
        });
    }
}

/// Whether a grain this far from its path has left it.
fn is_off(deviation: &Vector3<f64>, around: &ContactContext) -> bool {
    deviation.norm_squared() > 0.25 * around.margin * around.margin
}
