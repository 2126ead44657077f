//! What is near to what: pairs of grains and grains at walls, as forces across a gap see them.

use nalgebra::Vector3;

use super::acts::EffectContext;
use crate::contact_set::ContactSet;
use crate::lanes::Row;
use crate::particles::Particles;
use crate::period::Period;
use crate::wall::Walls;

/// Two surfaces.
pub(super) struct Near {
    /// First grain, and second grain or the number of grains plus the wall's surface.
    pub pair: (u32, u32),
    pub gap: f64,
    /// Radius of Derjaguin, 2 R_eff `[m]`.
    pub derjaguin: f64,
    /// From the second to the first.
    pub normal: Vector3<f64>,
    /// The nearest point of the wall; of a pair nothing.
    pub point: Vector3<f64>,
    pub is_wall: bool,
}

/// How two surfaces move against each other.
pub(super) struct Meeting {
    /// Velocity of the wall's point, or of the second grain `[m/s]`.
    pub other: Vector3<f64>,
    /// How fast their gap opens `[m/s]`.
    pub opening: f64,
    /// Of both together, over that of a typical grain `[-]`.
    pub inverse_mass: f64,
    /// When in this substep one of them has had its last impact `[s]`; 0 for none, and before impacts are resolved.
    pub struck: f64,
}

impl Meeting {
    pub fn of(near: &Near, particles: &Particles, walls: &Walls) -> Self {
        let (i, j) = (near.pair.0 as usize, near.pair.1 as usize);
        let (other, inverse_mass) = if near.is_wall {
            let wall = walls.wall(j - particles.count());
            (wall.motion_at(&near.point).0, particles.inverse_mass[i])
        } else {
            (particles.velocity(j), particles.inverse_mass[i] + particles.inverse_mass[j])
        };
        let opening = (particles.velocity(i) - other).dot(&near.normal);
        let of = |grain: usize| particles.struck.get(grain).copied().unwrap_or(0.0);
        let struck = if near.is_wall { of(i) } else { of(i).max(of(j)) };
        Self { other, opening, inverse_mass, struck }
    }

    /// Gives the first grain an impulse over a typical mass `[m/s]` and the second the opposite one; returns the work
    /// of a wall, per typical mass `[m^2/s^2]`.
    pub fn push(&self, particles: &mut Particles, near: &Near, impulse: &Vector3<f64>) -> f64 {
        particles.kick(near.pair.0 as usize, impulse);
        if near.is_wall {
            return impulse.dot(&self.other);
        }
        particles.kick(near.pair.1 as usize, &-impulse);
        0.0
    }
}

/// Lets `act` act on all that is near, pairs of grains and then grains at walls; returns the sum of what it returns.
pub(super) fn each(
    particles: &mut Particles,
    context: &EffectContext<'_>,
    mut act: impl FnMut(&mut Particles, &Near) -> f64,
) -> f64 {
    // Velocities change while the force acts, spheres do not.
    let spheres = particles.spheres.clone();
    let between = pairs(context.pairs, &spheres, particles.period);
    let count = particles.count() as u32;
    let near = between.chain(at_walls(context.at_walls, &spheres, count, context.walls));
    near.map(|near| act(particles, &near)).sum()
}

/// The pairs that are listed.
fn pairs(set: &ContactSet, spheres: &[Row], period: Option<Period>) -> impl Iterator<Item = Near> {
    set.lanes().map(move |(number, lane)| {
        let batch = &set.batches[number];
        let (i, j) = (batch.i[lane], batch.j[lane]);
        let (a, b) = (spheres[i as usize], spheres[j as usize]);
        let (direct, [r_i, r_j]) = (a.vector() - b.vector(), [a.0[3], b.0[3]]);
        let apart = period.map_or(direct, |period| period.nearest(direct));
        let distance = apart.norm();
        Near {
            pair: (i, j),
            gap: distance - r_i - r_j,
            derjaguin: 2.0 * r_i * r_j / (r_i + r_j),
            normal: if distance > 0.0 { apart / distance } else { Vector3::z() },
            point: Vector3::zeros(),
            is_wall: false,
        }
    })
}

/// The grains that are listed at walls.
fn at_walls(
    set: &ContactSet,
    spheres: &[Row],
    count: u32,
    walls: &Walls,
) -> impl Iterator<Item = Near> {
    set.lanes().map(move |(number, lane)| {
        let (grain, surface) = (set.batches[number].i[lane], set.at_walls[number].wall[lane]);
        let sphere = spheres[grain as usize];
        let near = walls.nearest(surface as usize, &sphere.vector(), 0.0);
        Near {
            pair: (grain, count + surface),
            gap: near.distance - sphere.0[3],
            derjaguin: 2.0 * sphere.0[3],
            normal: near.normal,
            point: sphere.vector() - near.distance * near.normal,
            is_wall: true,
        }
    })
}
