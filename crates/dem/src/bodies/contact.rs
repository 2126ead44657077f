//! One point at which two bodies, or a body and a wall, touch.
//!
//! ```text
//! u = v_i + omega_i x r_i - v_j - omega_j x r_j,    w_n = n . u
//! W = (1 - [r_i] I_i^-1 [r_i]) + (1 - [r_j] I_j^-1 [r_j]),    u += W lambda
//! 0 <= w_n + b  _|_  lambda_n >= 0
//! lambda_t = proj(lambda_t - u_t / W_t,  |.| <= mu_s lambda_n)
//! ```
//!
//! Unlike a ball's, the block W couples the normal to the tangent, so that the two lines are repeated until they stand:
//! by the sweeps over all points, and in an impact over those of its manifold.

use nalgebra::Vector3;

use super::body::Moving;
use super::pose::Pose;
use crate::law::{CORRECTION, CORRECTION_SPEED, SLOP};

/// Points of a manifold are one within this distance in the bodies' reach and this cosine of their normals `[-]`.
const SAME_PLACE: f64 = 0.1;
const SAME_NORMAL: f64 = 0.99;
/// No body: a wall.
pub(super) const WALL: usize = usize::MAX;

/// What points are in the order of.
pub(super) type Rank = (bool, (usize, usize, usize));

/// The rank of the points of a manifold.
pub(super) fn rank(name: (usize, usize, usize)) -> Rank {
    (name.1 != WALL, name)
}

/// A point of contact.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    pub i: usize,
    /// [`WALL`] for a wall.
    pub j: usize,
    /// The wall's surface, 0 between bodies; with the bodies it names the manifold.
    pub surface: usize,
    /// From j to i.
    pub normal: Vector3<f64>,
    pub arm_i: Vector3<f64>,
    pub arm_j: Vector3<f64>,
    /// Velocity of the wall there `[m/s]`.
    pub wall_velocity: Vector3<f64>,
    /// `[m]`
    pub gap: f64,
    pub friction: f64,
    pub restitution: f64,
    /// Where it is on body i, in its own axes `[m]`: by this it is known again.
    pub mark: Vector3<f64>,
    pub bias: f64,
    /// On body i `[m/s]`.
    pub impulse: Vector3<f64>,
}

/// What the law needs of a point's block W.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block {
    /// W n.
    pushed: Vector3<f64>,
    /// Reciprocals of the normal element and of the largest tangential eigenvalue.
    compliance: [f64; 2],
}

impl Point {
    /// A point without its numbers for the solve.
    pub fn new(i: usize, j: usize, surface: usize, normal: Vector3<f64>, gap: f64) -> Self {
        Self {
            i,
            j,
            surface,
            normal,
            arm_i: Vector3::zeros(),
            arm_j: Vector3::zeros(),
            wall_velocity: Vector3::zeros(),
            gap,
            friction: 0.0,
            restitution: 0.0,
            mark: Vector3::zeros(),
            bias: 0.0,
            impulse: Vector3::zeros(),
        }
    }

    /// The bodies and the surface: they name its manifold.
    pub fn name(&self) -> (usize, usize, usize) {
        (self.i, self.j, self.surface)
    }

    /// The order of the points: those at walls first, those of a manifold together.
    pub fn rank(&self) -> Rank {
        rank(self.name())
    }

    /// This point, found where its bodies will be at the end of the substep, as it is now: with the gap from which their
    /// velocities lead to the one that is foreseen.
    pub fn foreseen(mut self, bodies: &[Moving], later: &[Pose], dt: f64) -> Self {
        let turned_back =
            |body: usize, arm: &Vector3<f64>| bodies[body].pose.axes * later[body].seen(arm);
        self.arm_i = turned_back(self.i, &self.arm_i);
        if self.j != WALL {
            self.arm_j = turned_back(self.j, &self.arm_j);
        }
        self.gap -= dt * self.normal.dot(&self.velocity(bodies));
        self.gap -= self.gap_of_last_motion(bodies) - self.gap;
        self
    }

    /// Whether it says what another of its manifold says, of bodies of this reach `[m]`.
    pub fn is_like(&self, other: &Self, reach: f64) -> bool {
        (self.mark - other.mark).norm() < SAME_PLACE * reach
            && self.normal.dot(&other.normal) > SAME_NORMAL
    }

    /// What the law needs of its block.
    pub fn block(&self, bodies: &[Moving]) -> Block {
        let mut block = bodies[self.i].response(&self.arm_i);
        if self.j != WALL {
            block += bodies[self.j].response(&self.arm_j);
        }
        let n = self.normal;
        let other = if n.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
        let s = n.cross(&other).normalize();
        let t = n.cross(&s);
        let (a, b, c) = (s.dot(&(block * s)), s.dot(&(block * t)), t.dot(&(block * t)));
        let largest = 0.5 * (a + c) + (0.25 * (a - c) * (a - c) + b * b).sqrt();
        let pushed = block * n;
        Block { pushed, compliance: [1.0 / n.dot(&pushed), 1.0 / largest] }
    }

    /// Sets the bias, from where the last motions of its bodies begin.
    pub fn aim(&mut self, bodies: &[Moving], dt: f64) {
        let aside = self.gap_of_last_motion(bodies) - self.gap;
        self.bias = if self.gap < 0.0 {
            let push = (CORRECTION * (self.gap + SLOP) / dt).clamp(-CORRECTION_SPEED, 0.0);
            push + aside / dt
        } else {
            (self.gap + aside) / dt
        };
    }

    /// The gap that the last motions of its bodies would have begun with at the begin of the substep `[m]`: bodies that
    /// an impact has turned back in it come from elsewhere.
    pub fn gap_of_last_motion(&self, bodies: &[Moving]) -> f64 {
        if self.last_hit(bodies) == 0.0 {
            return self.gap;
        }
        let mut aside = bodies[self.i].shift_at(&self.arm_i);
        if self.j != WALL {
            aside -= bodies[self.j].shift_at(&self.arm_j);
        }
        self.gap + self.normal.dot(&aside)
    }

    /// When the later of the last impacts of its bodies was, 0 if there was none `[s]`.
    pub fn last_hit(&self, bodies: &[Moving]) -> f64 {
        let of_j = if self.j == WALL { 0.0 } else { bodies[self.j].hit };
        bodies[self.i].hit.max(of_j)
    }

    /// Velocity of i relative to j there `[m/s]`.
    #[inline(always)]
    pub fn velocity(&self, bodies: &[Moving]) -> Vector3<f64> {
        let of_i = bodies[self.i].velocity_at(&self.arm_i);
        match self.j {
            WALL => of_i - self.wall_velocity,
            j => of_i - bodies[j].velocity_at(&self.arm_j),
        }
    }

    /// Gives both bodies an impulse.
    #[inline(always)]
    pub fn give(&self, bodies: &mut [Moving], impulse: &Vector3<f64>) {
        bodies[self.i].push(&self.arm_i, impulse);
        if self.j != WALL {
            bodies[self.j].push(&self.arm_j, &-impulse);
        }
    }

    /// One round of the two lines, without bias; returns the change of the impulse `[m/s]`.
    #[inline(always)]
    pub fn solve(&mut self, block: &Block, bodies: &mut [Moving]) -> f64 {
        let (n, old, u) = (self.normal, self.impulse, self.velocity(bodies));
        let was = n.dot(&old);
        let normal = (was - n.dot(&u) * block.compliance[0]).max(0.0);
        let u = u + block.pushed * (normal - was);
        let wanted = old - was * n - block.compliance[1] * (u - n.dot(&u) * n);
        let (limit, length) = (self.friction * normal, wanted.norm());
        let tangent = if length > limit { wanted * (limit / length) } else { wanted };
        self.impulse = normal * n + tangent;
        let change = self.impulse - old;
        if change != Vector3::zeros() {
            self.give(bodies, &change);
        }
        change.norm()
    }
}
