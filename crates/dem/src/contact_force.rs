//! What grains press on each other with: forces of the lasting contacts, one by one.

use nalgebra::Vector3;

use crate::contact_set::ContactSet;
use crate::particles::Particles;
use crate::problem::Partner;
use crate::wall::Walls;

/// A lasting contact that carried something in the last substep. Its force is lambda / dt: exact at rest, while it
/// changes from substep to substep where grains collide, and lacks what impacts give.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactForce {
    /// The grain, by its number at the start ([`crate::Simulation::numbers`]); of one of several spheres, the sphere.
    pub grain: usize,
    /// What it touches: another grain, or a wall in the order of [`crate::Simulation::wall_loads`].
    pub partner: Partner,
    /// Where it touches `[m]`: on the grain's surface, at the end of the substep.
    pub point: Vector3<f64>,
    /// Unit normal from the partner to the grain.
    pub normal: Vector3<f64>,
    /// Force on the grain, normal and friction, over [`crate::Simulation::unit_mass`] `[m/s^2]`; the partner has the
    /// opposite one.
    pub force: Vector3<f64>,
}

/// The contacts of a set that carry something.
pub(crate) fn of<'a>(
    set: &'a ContactSet,
    particles: &'a Particles,
    walls: &'a Walls,
    dt: f64,
) -> impl Iterator<Item = ContactForce> + 'a {
    set.lanes().filter_map(move |(number, lane)| {
        let batch = &set.batches[number];
        let lambda_n = batch.lambda_n.0[lane];
        let normal = Vector3::from(batch.normal.get(lane));
        let partner = match set.at_walls.get(number) {
            Some(at) => Partner::Wall(walls.owner(at.wall[lane] as usize)),
            None => Partner::Grain(batch.j[lane] as usize),
        };
        let grain = batch.i[lane] as usize;
        (lambda_n > 0.0).then(|| ContactForce {
            grain,
            partner,
            point: particles.position(grain) - particles.radius(grain) * normal,
            normal,
            force: (lambda_n * normal + Vector3::from(batch.lambda_t.get(lane))) / dt,
        })
    })
}
