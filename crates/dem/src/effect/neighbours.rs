//! The neighbours of grains: how crowded each is, and how those around it move.

use nalgebra::Vector3;

use crate::contact_set::ContactSet;
use crate::particles::Particles;

/// Gap below which two grains are neighbours, in radii `[-]`: what every preset lists.
const NEIGHBOUR: f64 = 0.25;
/// Neighbours inside a random packing: `python examples/neighbours.py` counts 7.9 and, of smoother beads, 8.7 deep in a
/// column.
const NEIGHBOURS: f64 = 8.0;

/// The neighbours of a grain.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Neighbours {
    pub count: f64,
    velocity: Vector3<f64>,
}

impl Neighbours {
    fn add(&mut self, velocity: &Vector3<f64>) {
        self.count += 1.0;
        self.velocity += velocity;
    }

    /// How crowded the grain is, and the mean velocity of its neighbours.
    pub fn crowd_and_mean(&self) -> (f64, Vector3<f64>) {
        if self.count == 0.0 {
            return (0.0, Vector3::zeros());
        }
        ((self.count / NEIGHBOURS).min(1.0), self.velocity / self.count)
    }
}

/// The neighbours of every grain, with their velocities before they fell by `fall` `[m/s]` in this substep.
pub(crate) fn neighbours(
    particles: &Particles,
    pairs: &ContactSet,
    fall: &Vector3<f64>,
) -> Vec<Neighbours> {
    let mut around = vec![Neighbours::default(); particles.count()];
    for (grain, near) in around.iter_mut().enumerate() {
        // The ground is a neighbour that rests.
        if particles.position(grain).z < (1.0 + NEIGHBOUR) * particles.radius(grain) {
            near.add(&Vector3::zeros());
        }
    }
    for (number, lane) in pairs.lanes() {
        let batch = &pairs.batches[number];
        let (i, j) = (batch.i[lane] as usize, batch.j[lane] as usize);
        let touching = particles.radius(i) + particles.radius(j);
        let apart = particles.nearest(particles.position(i) - particles.position(j)).norm();
        if apart - touching < 0.5 * NEIGHBOUR * touching {
            around[i].add(&(particles.velocity(j) - fall));
            around[j].add(&(particles.velocity(i) - fall));
        }
    }
    around
}
