//! What the spheres of rigid bodies come to in a substep beside what their first normals and velocities said.
//!
//! A body that is struck within the contact solve goes elsewhere than it did when contacts were listed, its spheres go
//! round arcs, and what passes another no longer does so at the speed that it had. So the ends of the ways are looked
//! at once the contacts are solved, as those of convex bodies are (docs/theory/bodies.md, foreseen points):
//!
//! ```text
//! delta = g_end - (g + dt w_n),   b = b(g) + delta / dt    where w_n + b < 0
//! ```

use nalgebra::Vector3;

use super::{Contacts, is_off};
use crate::contact_context::ContactContext;
use crate::contact_set::ContactSet;
use crate::particles::Particles;

/// A contact at the begin of a substep.
struct Meeting {
    /// Unit normal from the second grain, or from the wall.
    normal: Vector3<f64>,
    /// `[m]`
    gap: f64,
    /// The same at the end of the ways.
    gap_at_end: f64,
}

impl Contacts {
    /// Lists what the grains come to whose way ends at `ends` `[m]`, apart from their paths. The new ones touch nothing
    /// before they are foreseen.
    pub fn follow_ends(
        &mut self,
        ends: &[Vector3<f64>],
        particles: &Particles,
        around: &ContactContext,
    ) {
        let dt = around.settings.dt;
        // `assemble` has counted the present substep already.
        let begin = (self.age - 1) as f64 * dt;
        for (grain, end) in ends.iter().enumerate() {
            if is_off(&(end - self.paths[grain].at(begin + dt)), around) {
                self.renew(grain, begin, particles, around);
            }
        }
    }

    /// Gives the contacts in which the grains would lie deeper at `ends` `[m]` than the law lets them, by more than
    /// sweeps may leave, the bias that leads there; whether there is one.
    pub fn foresee(
        &mut self,
        ends: &[Vector3<f64>],
        particles: &Particles,
        around: &ContactContext,
    ) -> bool {
        let of_pair = |i: usize, j: usize| {
            let sum = particles.radius(i) + particles.radius(j);
            let apart = particles.position(i) - particles.position(j);
            let distance = apart.norm();
            let normal = if distance > 0.0 { apart / distance } else { Vector3::z() };
            let gap_at_end = (ends[i] - ends[j]).norm() - sum;
            Meeting { normal, gap: distance - sum, gap_at_end }
        };
        let of_wall = |i: usize, surface: usize| {
            let at = |place: &Vector3<f64>, now| around.walls.nearest(surface, place, now);
            let (near, end) = (at(&particles.position(i), 0.0), at(&ends[i], around.settings.dt));
            let radius = particles.radius(i);
            // What has come through lies beyond the wall.
            let side = if near.side * end.side < 0 { -1.0 } else { 1.0 };
            let gap_at_end = side * end.distance - radius;
            Meeting { normal: near.normal, gap: near.distance - radius, gap_at_end }
        };
        let meeting = |i: usize, j: usize, surface: Option<usize>| {
            surface.map_or_else(|| of_pair(i, j), |surface| of_wall(i, surface))
        };
        let pairs = foresee(&mut self.pairs, particles, around, meeting);
        let at_walls = foresee(&mut self.at_walls, particles, around, meeting);
        pairs | at_walls
    }
}

/// [`Contacts::foresee`] of one set; `meeting` is of both bodies, and of the wall if the second stands for one.
fn foresee(
    set: &mut ContactSet,
    particles: &Particles,
    around: &ContactContext,
    meeting: impl Fn(usize, usize, Option<usize>) -> Meeting,
) -> bool {
    let (dt, settings) = (around.settings.dt, &around.settings);
    let closing = settings.closing * around.least / dt;
    let mut is_any = false;
    for number in 0..set.batches.len() {
        let batch = &mut set.batches[number];
        for lane in batch.lanes() {
            let (i, j) = (batch.i[lane] as usize, batch.j[lane] as usize);
            let surface = set.at_walls.get(number).map(|at| at.wall[lane] as usize);
            let Meeting { normal, gap, gap_at_end } = meeting(i, j, surface);
            if !gap.is_finite() || !gap_at_end.is_finite() {
                continue;
            }
            let apart = particles.velocity(i) - particles.bodies[j].velocity.vector();
            let w_n = normal.dot(&apart);
            let own = if gap < 0.0 { around.small.push(gap, dt) } else { gap / dt };
            let b = own + (gap_at_end - gap) / dt - w_n;
            let is_new = batch.bias.0[lane] == f64::INFINITY;
            if is_new {
                batch.normal.set(lane, normal.into());
            }
            if w_n + b < -closing && b < batch.bias.0[lane] {
                batch.bias.0[lane] = b;
                is_any = true;
            }
        }
    }
    is_any
}
