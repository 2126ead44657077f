//! Newton's restitution as a bias, for bodies whose impacts are no events.

use nalgebra::Vector3;

use crate::contact_context::ContactContext;
use crate::contact_set::ContactSet;
use crate::particles::Particles;

/// Gives the contacts of a set their restitution: what closes faster than an impact must and touches
/// within the substep may not leave slower than `-e w_n`. Source: Moreau 1988 as in Acary and Brogliato 2008, 10.1.
pub(crate) fn rebound(set: &mut ContactSet, particles: &Particles, around: &ContactContext) {
    let at_walls = set.is_at_walls();
    for number in 0..set.batches.len() {
        for lane in set.batches[number].lanes() {
            let batch = &set.batches[number];
            let (i, j) = (batch.i[lane] as usize, batch.j[lane] as usize);
            let apart = particles.velocity(i) - particles.velocity(j);
            let w_n = Vector3::from(batch.normal.get(lane)).dot(&apart);
            if w_n >= -around.small.impact_speed || w_n + batch.bias.0[lane] >= 0.0 {
                continue;
            }
            let restitution = if at_walls {
                around.walls.wall(set.at_walls[number].wall[lane] as usize).material.restitution
            } else {
                around.material.restitution
            };
            let restitution = around.effects.restitution_at(restitution, -w_n);
            if restitution > 0.0 {
                set.batches[number].bias.0[lane] = restitution * w_n;
            }
        }
    }
}
