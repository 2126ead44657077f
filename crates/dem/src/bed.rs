//! The state of all grains: positions, velocities, sizes.

use std::marker::PhantomData;

use nalgebra::Vector3;

use crate::lanes::{Lanes, Width};
use crate::scene::Scene;

/// Linear and scaled angular velocity of one body, padded to a cache line.
///
/// `spin` is `r * omega` `[m/s]`: with it the contact equations of unequal spheres have the
/// same coefficients as those of equal ones.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Body {
    pub velocity: [f64; 4],
    pub spin: [f64; 4],
}

impl Body {
    /// Velocity and spin as one row of a batch.
    #[inline(always)]
    #[allow(unsafe_code)] // the same 64 bytes under another name
    pub fn row(&self) -> &Lanes {
        // SAFETY: both types are eight f64 in a row, aligned to 64 bytes.
        unsafe { &*std::ptr::from_ref(self).cast() }
    }

    /// The same row to write to.
    #[inline(always)]
    #[allow(unsafe_code)]
    pub fn row_mut(&mut self) -> &mut Lanes {
        // SAFETY: as in `row`.
        unsafe { &mut *std::ptr::from_mut(self).cast() }
    }
}

/// Bodies that several threads change at once, each the grains of its own contacts.
///
/// The colouring guarantees that no two contacts that are solved at the same time share a grain; the
/// resting body, which they do share, is never written.
pub(crate) struct SharedBodies<'a> {
    first: *mut Body,
    /// Grains; the resting body comes after them.
    count: u32,
    lifetime: PhantomData<&'a mut [Body]>,
}

// SAFETY: see the type; every access goes through `load` and `store`.
#[allow(unsafe_code)]
unsafe impl Sync for SharedBodies<'_> {}

impl<'a> SharedBodies<'a> {
    /// Shares `bodies`, of which the last is the resting one.
    pub fn new(bodies: &'a mut [Body]) -> Self {
        let count = bodies.len() as u32 - 1;
        Self { first: bodies.as_mut_ptr(), count, lifetime: PhantomData }
    }

    /// Velocity and spin of a body as one row.
    #[inline(always)]
    #[allow(unsafe_code)]
    pub fn load<W: Width>(&self, body: u32) -> W::Value {
        assert!(body <= self.count);
        // SAFETY: in bounds; nobody writes this body now.
        unsafe { W::load((*self.first.add(body as usize)).row()) }
    }

    /// Puts velocity and spin of a grain back; the resting body stays as it is.
    #[inline(always)]
    #[allow(unsafe_code)]
    pub fn store<W: Width>(&self, body: u32, row: W::Value) {
        if body < self.count {
            // SAFETY: in bounds; nobody else reads or writes this body now.
            unsafe { W::store(row, (*self.first.add(body as usize)).row_mut()) }
        }
    }
}

/// Grains as arrays. `bodies` has one entry more than there are grains: the resting body that
/// walls and empty lanes refer to.
#[derive(Clone, Debug)]
pub(crate) struct Bed {
    pub positions: Vec<Vector3<f64>>,
    pub bodies: Vec<Body>,
    pub radii: Vec<f64>,
    /// Mass of a typical grain over the grain's mass `[-]`; impulses are in units of that mass.
    pub inverse_mass: Vec<f64>,
}

/// Inverse moment of inertia of a sphere times its mass and squared radius, 5/2.
pub(crate) const INVERSE_INERTIA: f64 = 2.5;

impl Bed {
    pub fn new(scene: &Scene, seed: u64) -> Self {
        let count = scene.grains.count;
        Self {
            positions: scene.start.positions(scene, seed),
            bodies: vec![Body::default(); count + 1],
            radii: vec![scene.grains.radius(); count],
            inverse_mass: vec![1.0; count],
        }
    }

    pub fn count(&self) -> usize {
        self.positions.len()
    }

    pub fn velocity(&self, grain: usize) -> Vector3<f64> {
        let [x, y, z, _] = self.bodies[grain].velocity;
        Vector3::new(x, y, z)
    }

    pub fn angular_velocity(&self, grain: usize) -> Vector3<f64> {
        let [x, y, z, _] = self.bodies[grain].spin;
        Vector3::new(x, y, z) / self.radii[grain]
    }

    /// Sets velocity `[m/s]` and angular velocity `[rad/s]` of a grain.
    pub fn set_motion(&mut self, grain: usize, velocity: &Vector3<f64>, angular: &Vector3<f64>) {
        let spin = self.radii[grain] * angular;
        self.bodies[grain] = Body {
            velocity: [velocity.x, velocity.y, velocity.z, 0.0],
            spin: [spin.x, spin.y, spin.z, 0.0],
        };
    }

    /// Kinetic energy of a grain per typical mass, rotation included `[m^2/s^2]`.
    pub fn kinetic_energy(&self, grain: usize) -> f64 {
        let square = |a: &[f64; 4]| a[0] * a[0] + a[1] * a[1] + a[2] * a[2];
        let Body { velocity, spin } = &self.bodies[grain];
        0.5 * (square(velocity) + square(spin) / INVERSE_INERTIA) / self.inverse_mass[grain]
    }

    /// Kinetic and potential energy of all grains per typical mass `[m^2/s^2]`.
    pub fn energy(&self, gravity: &Vector3<f64>) -> f64 {
        (0..self.count())
            .map(|i| {
                self.kinetic_energy(i) - gravity.dot(&self.positions[i]) / self.inverse_mass[i]
            })
            .sum()
    }

    /// v += g dt.
    pub fn accelerate(&mut self, gravity: &Vector3<f64>, dt: f64) {
        let count = self.count();
        for body in &mut self.bodies[..count] {
            for axis in 0..3 {
                body.velocity[axis] += gravity[axis] * dt;
            }
        }
    }

    /// x += v dt. Spheres need no orientation.
    pub fn move_on(&mut self, dt: f64) {
        for (position, body) in self.positions.iter_mut().zip(&self.bodies) {
            for axis in 0..3 {
                position[axis] += body.velocity[axis] * dt;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::Portable;

    /// Three grains of different size and mass, in motion.
    fn bed() -> Bed {
        let mut scene = Scene::drop(0.1);
        scene.grains.count = 3;
        let mut bed = Bed::new(&scene, 1);
        bed.radii = vec![1e-3, 2e-3, 4e-3];
        bed.inverse_mass = vec![8.0, 1.0, 0.125];
        for (i, body) in bed.bodies[..3].iter_mut().enumerate() {
            let i = i as f64;
            body.velocity = [1.0 + i, -2.0, 0.5 * i, 0.0];
            body.spin = [0.1, 0.2 * i, -0.3, 0.0];
        }
        bed
    }

    #[test]
    fn spin_is_radius_times_angular_velocity() {
        let bed = bed();
        assert_eq!(bed.angular_velocity(2), Vector3::new(0.1, 0.4, -0.3) / 4e-3);
        assert_eq!(bed.velocity(2), Vector3::new(3.0, -2.0, 1.0));
    }

    #[test]
    fn kinetic_energy_is_that_of_a_solid_sphere() {
        let bed = bed();
        for grain in 0..3 {
            let mass = 1.0 / bed.inverse_mass[grain];
            let inertia = 0.4 * mass * bed.radii[grain].powi(2);
            let expected = 0.5 * mass * bed.velocity(grain).norm_squared()
                + 0.5 * inertia * bed.angular_velocity(grain).norm_squared();
            assert!((bed.kinetic_energy(grain) / expected - 1.0).abs() < 1e-14);
        }
    }

    #[test]
    fn free_flight_changes_energy_by_half_g_squared_dt_squared() {
        // v += g dt, then x += v dt: the potential drops by m g dt (v + g dt) while the kinetic
        // energy rises by m g dt (v + g dt / 2).
        let (mut bed, gravity, dt) = (bed(), Vector3::new(0.0, 0.0, -9.81), 1e-3);
        let before = bed.energy(&gravity);
        bed.accelerate(&gravity, dt);
        bed.move_on(dt);
        let mass = bed.inverse_mass.iter().map(|m| 1.0 / m).sum::<f64>();
        let expected = -0.5 * mass * (9.81 * dt).powi(2);
        assert!((bed.energy(&gravity) - before - expected).abs() < 1e-12);
        assert_eq!(bed.bodies[3], Body::default()); // the resting body feels no gravity
    }

    #[test]
    fn the_resting_body_is_read_but_never_written() {
        let mut bodies = bed().bodies;
        let shared = SharedBodies::new(&mut bodies);
        shared.store::<Portable>(3, [7.0; 8]);
        assert_eq!(shared.load::<Portable>(3), [0.0; 8]);
        shared.store::<Portable>(1, [7.0; 8]);
        assert_eq!(shared.load::<Portable>(1), [7.0; 8]);
        assert_eq!(bodies[1], Body { velocity: [7.0; 4], spin: [7.0; 4] });
    }
}
