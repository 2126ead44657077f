//! The grains and walls of an impact, with their motion while it lasts.

use nalgebra::Vector3;

use super::friction::{Friction, Slip};
use super::links::Link;
use crate::law::INVERSE_INERTIA;
use crate::particles::Particles;

/// No grain, or no member.
const NONE: u32 = u32::MAX;

/// A grain, or a wall as one contact sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Member {
    pub velocity: Vector3<f64>,
    pub spin: Vector3<f64>,
    pub grain: usize,
    is_wall: bool,
    /// Whether its contacts are links.
    is_linked: bool,
    is_hit: bool,
}

/// The members in the order in which they were found.
#[derive(Clone, Debug, Default)]
pub(super) struct Members {
    all: Vec<Member>,
    /// The member that each grain is.
    of_grain: Vec<u32>,
}

impl Members {
    pub fn clear(&mut self) {
        for member in self.all.drain(..) {
            if !member.is_wall {
                self.of_grain[member.grain] = NONE;
            }
        }
    }

    /// The member that a grain is.
    pub fn grain(&mut self, grain: usize, particles: &Particles) -> usize {
        if self.of_grain.len() < particles.count() {
            self.of_grain.resize(particles.count(), NONE);
        }
        if self.of_grain[grain] == NONE {
            self.of_grain[grain] = self.all.len() as u32;
            let body = &particles.bodies[grain];
            self.all.push(Member {
                velocity: body.velocity.vector(),
                spin: body.spin.vector(),
                grain,
                is_wall: false,
                is_linked: false,
                is_hit: false,
            });
        }
        self.of_grain[grain] as usize
    }

    /// A new member for a wall with this motion at the contact.
    pub fn wall(&mut self, velocity: Vector3<f64>, spin: Vector3<f64>) -> usize {
        let grain = NONE as usize;
        let is_wall = true;
        self.all.push(Member { velocity, spin, grain, is_wall, is_linked: true, is_hit: false });
        self.all.len() - 1
    }

    pub fn grain_of(&self, member: usize) -> usize {
        self.all[member].grain
    }

    /// Velocity and spin, if it is a wall.
    pub fn wall_motion(&self, member: usize) -> Option<(Vector3<f64>, Vector3<f64>)> {
        let Member { velocity, spin, is_wall, .. } = self.all[member];
        is_wall.then_some((velocity, spin))
    }

    pub fn set_linked(&mut self, member: usize) {
        self.all[member].is_linked = true;
    }

    pub fn is_linked(&self, member: usize) -> bool {
        self.all[member].is_linked
    }

    /// Notes that a member was hit; whether its contacts are not links yet.
    #[inline]
    pub fn set_hit(&mut self, member: usize) -> bool {
        let member = &mut self.all[member];
        member.is_hit = true;
        !member.is_linked
    }

    /// The grains that were hit.
    pub fn hit(&self) -> impl Iterator<Item = &Member> {
        self.all.iter().filter(|member| member.is_hit && !member.is_wall)
    }

    /// w_n of two members along a normal `[m/s]`.
    #[inline]
    pub fn closing_rate(&self, [i, j]: &[usize; 2], normal: &Vector3<f64>) -> f64 {
        normal.dot(&(self.all[*i].velocity - self.all[*j].velocity))
    }

    /// How the surfaces of a link move past each other.
    #[inline]
    pub fn slip(&self, link: &Link) -> Slip {
        let ([i, j], [l_i, l_j], n) = (link.ends, link.lever, &link.normal);
        let (a, b) = (&self.all[i], &self.all[j]);
        let dv = a.velocity - b.velocity;
        let u = dv + n.cross(&(a.spin + b.spin)) - n.dot(&dv) * n;
        let rho = l_i * a.spin - l_j * b.spin;
        Slip { u, r: rho.cross(n), about: n.dot(&rho) }
    }

    /// Applies a normal impulse of a link to both.
    #[inline]
    pub fn push(&mut self, link: &Link, push: f64) {
        let ([i, j], [c_i, c_j]) = (link.ends, link.inverse_mass);
        self.all[i].velocity += (c_i * push) * link.normal;
        self.all[j].velocity -= (c_j * push) * link.normal;
    }

    /// Applies friction of a link to both.
    #[inline]
    pub fn rub(&mut self, link: &Link, friction: &Friction) {
        let ([i, j], [c_i, c_j], [l_i, l_j]) = (link.ends, link.inverse_mass, link.lever);
        let n = &link.normal;
        let twist = INVERSE_INERTIA * n.cross(&friction.t);
        let roll = INVERSE_INERTIA * (n.cross(&friction.m) + friction.about * n);
        let member = &mut self.all[i];
        member.velocity += c_i * friction.t;
        member.spin += c_i * (l_i * roll - twist);
        let member = &mut self.all[j];
        member.velocity -= c_j * friction.t;
        member.spin -= c_j * (l_j * roll + twist);
    }
}
