//! The state of all grains: positions, velocities, sizes.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::body::Body;
use crate::energy::{Energy, Falling, Heights};
use crate::lanes::Row;
use crate::law::INVERSE_INERTIA;
use crate::parallel::Threads;
use crate::period::Period;

/// Grains that a thread takes at once.
const SHARE: usize = if cfg!(test) { 16 } else { 4096 };

/// Grains as arrays. `spheres` and `bodies` have one entry more than there are grains: the resting body that
/// walls and empty lanes refer to. Where walls move, further bodies stand for them, one for each contact.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Particles {
    /// Centre and radius of each grain `[m]`.
    pub spheres: Vec<Row>,
    pub bodies: Vec<Body>,
    /// How far into the substep each grain's sphere is `[s]`: the time of its last impact, else 0.
    pub clocks: Vec<f64>,
    /// The clocks of this substep once the spheres are back at its begin; empty without an impact.
    #[serde(skip)]
    pub struck: Vec<f64>,
    /// Mass of a typical grain over the grain's mass `[-]`; impulses are in units of that mass.
    pub inverse_mass: Vec<f64>,
    /// Whether each grain has left the scene; empty as long as none has.
    left: Vec<bool>,
    /// Along which axis space repeats; the scene says it, not the state.
    #[serde(skip)]
    pub period: Option<Period>,
}

impl Particles {
    /// Grains at rest, each with its centre and radius `[m]` and its inverse mass.
    pub fn new(mut spheres: Vec<Row>, inverse_mass: Vec<f64>, period: Option<Period>) -> Self {
        let count = inverse_mass.len();
        spheres.push(Row::default());
        Self {
            spheres,
            bodies: vec![Body::default(); count + 1],
            clocks: vec![0.0; count],
            struck: Vec::new(),
            inverse_mass,
            left: Vec::new(),
            period,
        }
    }

    /// Whether this can have become of `start`: as many grains, as large and as heavy, at the begin of a substep.
    ///
    /// # Errors
    /// What is wrong.
    pub fn check_like(&self, start: &Self) -> Result<(), &'static str> {
        let count = start.count();
        let is_like = self.spheres.len() == count + 1
            && self.bodies.len() > count
            && self.clocks == start.clocks
            && self.inverse_mass == start.inverse_mass
            && (self.left.is_empty() || self.left.len() == count)
            && self.spheres.iter().zip(&start.spheres).all(|(a, b)| a.0[3] == b.0[3])
            && self.spheres[count] == start.spheres[count]
            && self.bodies[count] == start.bodies[count];
        if is_like { Ok(()) } else { Err("grains that are not the scene's") }
    }

    pub fn count(&self) -> usize {
        self.inverse_mass.len()
    }

    /// Whether a grain has left the scene. It stays where it left, at rest, and touches nothing.
    #[inline]
    pub fn has_left(&self, grain: usize) -> bool {
        self.left.get(grain).is_some_and(|&left| left)
    }

    /// The grains that are in the scene.
    pub fn present(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.count()).filter(|&grain| !self.has_left(grain))
    }

    /// Takes the grains with their centre below `height` `[m]` out of the scene; whether there were any.
    pub fn remove_below(&mut self, height: f64) -> bool {
        let out: Vec<usize> = self.present().filter(|&i| self.position(i).z < height).collect();
        for &grain in &out {
            self.take_out(grain);
        }
        !out.is_empty()
    }

    /// Takes a grain out of the scene: it stays where it is, at rest.
    pub fn take_out(&mut self, grain: usize) {
        self.left.resize(self.count(), false);
        self.left[grain] = true;
        self.bodies[grain] = Body::default();
    }

    /// Lets a grain that was held out into the scene with a velocity `[m/s]`.
    pub fn let_in(&mut self, grain: usize, velocity: &Vector3<f64>) {
        self.left[grain] = false;
        self.set_motion(grain, velocity, &Vector3::zeros());
    }

    /// Moves a grain that is held out `[m]`.
    pub fn raise(&mut self, grain: usize, way: &Vector3<f64>) {
        self.spheres[grain].add(way);
    }

    /// Mass of a grain over that of a typical one `[-]`.
    pub fn mass(&self, grain: usize) -> f64 {
        1.0 / self.inverse_mass[grain]
    }

    /// Share of the grains' mass that has left `[-]`.
    pub fn outflow_fraction(&self) -> f64 {
        let mass = |grain: usize| 1.0 / self.inverse_mass[grain];
        let out: f64 = (0..self.count()).filter(|&i| self.has_left(i)).map(mass).sum();
        out / (0..self.count()).map(mass).sum::<f64>().max(f64::MIN_POSITIVE)
    }

    /// Keeps the grains that have left at rest, whatever has acted on all.
    pub fn freeze_removed(&mut self) {
        for (body, _) in self.bodies.iter_mut().zip(&self.left).filter(|(_, left)| **left) {
            *body = Body::default();
        }
    }

    /// Centre of a grain `[m]`.
    #[inline]
    pub fn position(&self, grain: usize) -> Vector3<f64> {
        self.spheres[grain].vector()
    }

    /// The way between two places, or to the image of one that is nearer where space repeats `[m]`.
    #[inline(always)]
    pub fn nearest(&self, apart: Vector3<f64>) -> Vector3<f64> {
        match &self.period {
            None => apart,
            Some(period) => period.nearest(apart),
        }
    }

    /// Radius of a grain `[m]`.
    #[inline]
    pub fn radius(&self, grain: usize) -> f64 {
        self.spheres[grain].0[3]
    }

    /// Whether all grains have one radius and one mass, and there are any.
    pub fn are_alike(&self) -> bool {
        let (radii, masses) = (self.spheres.iter().map(|row| row.0[3]), &self.inverse_mass);
        let mut radii = radii.take(self.count());
        let Some(first) = radii.next() else { return false };
        radii.all(|radius| radius == first) && masses.iter().all(|mass| *mass == masses[0])
    }

    #[inline]
    pub fn velocity(&self, grain: usize) -> Vector3<f64> {
        self.bodies[grain].velocity.vector()
    }

    /// Angular velocity times radius `[m/s]`.
    #[inline]
    pub fn spin(&self, grain: usize) -> Vector3<f64> {
        self.bodies[grain].spin.vector()
    }

    pub fn angular_velocity(&self, grain: usize) -> Vector3<f64> {
        self.spin(grain) / self.radius(grain)
    }

    /// Sets velocity `[m/s]` and angular velocity `[rad/s]` of a grain.
    pub fn set_motion(&mut self, grain: usize, velocity: &Vector3<f64>, angular: &Vector3<f64>) {
        let spin = self.radius(grain) * angular;
        self.bodies[grain] = Body { velocity: Row::new(velocity, 0.0), spin: Row::new(&spin, 0.0) };
    }

    /// Kinetic energy of a grain per typical mass, rotation included `[m^2/s^2]`.
    #[inline]
    pub fn kinetic_energy(&self, grain: usize) -> f64 {
        let Body { velocity, spin } = &self.bodies[grain];
        let square = |row: &Row| row.vector().norm_squared();
        0.5 * (square(velocity) + square(spin) / INVERSE_INERTIA) / self.inverse_mass[grain]
    }

    /// Kinetic energy of a grain's centre per typical mass `[m^2/s^2]`.
    #[inline]
    pub fn translation(&self, grain: usize) -> f64 {
        0.5 * self.velocity(grain).norm_squared() / self.inverse_mass[grain]
    }

    /// The mean of that over the grains in the scene; 0 without any.
    pub fn mean_translation(&self) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for grain in self.present() {
            sum += self.translation(grain);
            count += 1.0;
        }
        sum / f64::max(count, 1.0)
    }

    /// Energy of all grains; those that have left rest.
    pub fn energy(&self, falling: &Falling) -> Energy {
        let of = |grain: usize| {
            let (mass, half) = (self.mass(grain), falling.half());
            let gained = if self.has_left(grain) {
                0.0
            } else {
                half.dot(&(self.velocity(grain) + 0.5 * half))
            };
            Energy {
                kinetic: self.kinetic_energy(grain) + mass * gained,
                potential: mass * falling.potential(&self.position(grain)),
            }
        };
        (0..self.count()).map(of).sum()
    }

    /// What the heights of all grains hold; the lowest is one that is in the scene.
    pub fn heights(&self, gravity: &Vector3<f64>) -> Heights {
        let mut heights = Heights::default();
        let (mut mass, mut low) = (0.0, f64::INFINITY);
        for grain in 0..self.count() {
            let potential = -gravity.z * self.position(grain).z;
            heights.sum += self.mass(grain) * potential;
            mass += self.mass(grain);
            if !self.has_left(grain) {
                low = low.min(potential - gravity.z.abs() * self.radius(grain));
            }
        }
        // Where nobody is there is no lowest.
        heights.lowest = if low.is_finite() { mass * low } else { f64::INFINITY };
        heights
    }

    /// Work of an acceleration on all grains within `dt` `[s]`, per typical mass `[m^2/s^2]`.
    pub fn work_of(&self, acceleration: &Vector3<f64>, dt: f64) -> f64 {
        let step = dt * acceleration;
        let work = |i| (self.velocity(i) + 0.5 * step).dot(&step) / self.inverse_mass[i];
        self.present().map(work).sum()
    }

    /// Makes room for so many bodies that stand for moving walls, after the resting one.
    pub fn resize_wall_bodies(&mut self, count: usize) {
        self.bodies.resize(self.count() + 1 + count, Body::default());
    }

    /// Adds an impulse over a typical mass `[m/s]` to a grain's centre.
    pub fn kick(&mut self, grain: usize, impulse: &Vector3<f64>) {
        let step = self.inverse_mass[grain] * impulse;
        self.bodies[grain].velocity.add(&step);
    }

    /// Adds an impulse over a typical mass `[m/s]` at a grain's surface, where `outwards` is the normal.
    pub fn kick_at(&mut self, grain: usize, impulse: &Vector3<f64>, outwards: &Vector3<f64>) {
        self.kick(grain, impulse);
        let twist = INVERSE_INERTIA * self.inverse_mass[grain] * outwards.cross(impulse);
        self.bodies[grain].spin.add(&twist);
    }

    /// v += g dt.
    pub fn accelerate(&mut self, gravity: &Vector3<f64>, dt: f64, threads: &Threads) {
        let (count, step) = (self.count(), gravity * dt);
        let accelerate = |bodies: &mut [Body]| {
            for body in bodies {
                body.velocity.add(&step);
            }
        };
        threads.shares(&mut self.bodies[..count], SHARE, accelerate, |(), ()| ());
    }

    /// Where a grain is at `time` `[s]` into the substep, and its radius.
    #[inline(always)]
    pub fn sphere_at(&self, grain: usize, time: f64) -> Row {
        let mut sphere = self.spheres[grain];
        if grain < self.count() {
            sphere.add(&((time - self.clocks[grain]) * self.velocity(grain)));
        }
        sphere
    }

    /// Takes one grain to `time` `[s]` into the substep.
    pub fn advance(&mut self, grain: usize, time: f64) {
        self.spheres[grain] = self.sphere_at(grain, time);
        self.clocks[grain] = time;
    }

    /// Takes every grain back to the begin of the substep, to where its present motion would have begun.
    pub fn rewind(&mut self) {
        self.struck.clone_from(&self.clocks);
        for ((sphere, body), clock) in
            self.spheres.iter_mut().zip(&self.bodies).zip(&mut self.clocks)
        {
            if *clock != 0.0 {
                sphere.add(&(-*clock * body.velocity.vector()));
                *clock = 0.0;
            }
        }
    }

    /// x += v dt. Spheres need no orientation.
    pub fn move_on(&mut self, dt: f64) {
        let count = self.count();
        for (sphere, body) in self.spheres[..count].iter_mut().zip(&self.bodies) {
            sphere.add(&(dt * body.velocity.vector()));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three grains of different size and mass, in motion.
    fn particles() -> Particles {
        let spheres = [1e-3, 2e-3, 4e-3].map(|radius| Row([5.0 * radius, 0.0, 0.1, radius]));
        let mut particles = Particles::new(spheres.to_vec(), vec![8.0, 1.0, 0.125], None);
        for (i, body) in particles.bodies[..3].iter_mut().enumerate() {
            let i = i as f64;
            body.velocity = Row([1.0 + i, -2.0, 0.5 * i, 0.0]);
            body.spin = Row([0.1, 0.2 * i, -0.3, 0.0]);
        }
        particles
    }

    #[test]
    fn spin_is_radius_times_angular_velocity() {
        let particles = particles();
        assert_eq!(particles.angular_velocity(2), Vector3::new(0.1, 0.4, -0.3) / 4e-3);
        assert_eq!(particles.velocity(2), Vector3::new(3.0, -2.0, 1.0));
    }

    #[test]
    fn kinetic_energy_is_that_of_a_solid_sphere() {
        let particles = particles();
        for grain in 0..3 {
            let mass = 1.0 / particles.inverse_mass[grain];
            let inertia = 0.4 * mass * particles.radius(grain).powi(2);
            let expected = 0.5 * mass * particles.velocity(grain).norm_squared()
                + 0.5 * inertia * particles.angular_velocity(grain).norm_squared();
            assert!((particles.kinetic_energy(grain) / expected - 1.0).abs() < 1e-14);
        }
    }

    #[test]
    fn free_flight_keeps_the_energy() {
        let (mut particles, gravity, dt) = (particles(), Vector3::new(0.0, 0.0, -9.81), 1e-3);
        let falling = Falling { gravity, dt };
        let before = particles.energy(&falling).total();
        particles.accelerate(&gravity, dt, &Threads::default());
        particles.move_on(dt);
        assert!((particles.energy(&falling).total() / before - 1.0).abs() < 1e-13);
        assert_eq!(particles.bodies[3], Body::default()); // the resting body feels no gravity
    }
}
