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

use nalgebra::{Matrix3, Vector3};

use super::body::{Moving, last_hit};
use super::pose::Pose;
use crate::law::Small;
use crate::wall::Wall;

/// Points of a manifold are one within this distance in the bodies' reach and this cosine of their normals `[-]`.
pub(super) const SAME_PLACE: f64 = 0.1;
const SAME_NORMAL: f64 = 0.99;

/// What the points of a manifold have in common: whether they are between bodies, body i, and body j or the wall's
/// surface. In the order of these: those at walls first.
pub(super) type Name = (bool, u32, u32);

/// What body i touches.
#[derive(Clone, Copy, Debug)]
pub(super) enum Other {
    /// A surface of the walls, which moves there with this velocity `[m/s]`.
    Wall { surface: u32, velocity: Vector3<f64> },
    /// Body j, there at this arm from its centre `[m]`.
    Body { j: u32, arm: Vector3<f64> },
}

/// A point of contact.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    i: u32,
    pub other: Other,
    /// From what is touched to i.
    pub normal: Vector3<f64>,
    /// From the centre of i `[m]`.
    pub arm: Vector3<f64>,
    /// `[m]`
    pub gap: f64,
    pub friction: f64,
    pub restitution: f64,
    /// Where it is on body i, in its own axes `[m]`: by this it is known again.
    pub mark: Vector3<f64>,
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
    /// A point at the centre of i, without friction and restitution.
    pub fn new(i: usize, other: Other, normal: Vector3<f64>, gap: f64) -> Self {
        Self {
            i: i as u32,
            other,
            normal,
            arm: Vector3::zeros(),
            gap,
            friction: 0.0,
            restitution: 0.0,
            mark: Vector3::zeros(),
            impulse: Vector3::zeros(),
        }
    }

    /// A point of body i, there at `mark` in its own axes, at a wall's surface.
    pub fn at_wall(
        i: usize,
        surface: usize,
        wall: &Wall,
        body: &Pose,
        mark: Vector3<f64>,
        normal: Vector3<f64>,
        gap: f64,
    ) -> Self {
        let arm = body.axes * mark;
        let velocity = wall.motion_at(&(body.centre + arm)).0;
        let (friction, restitution) = (wall.material.sliding_friction, wall.material.restitution);
        let other = Other::Wall { surface: surface as u32, velocity };
        Self { arm, friction, restitution, mark, ..Self::new(i, other, normal, gap) }
    }

    /// Body i.
    pub fn i(&self) -> usize {
        self.i as usize
    }

    /// Body j; none at a wall.
    pub fn j(&self) -> Option<usize> {
        match self.other {
            Other::Wall { .. } => None,
            Other::Body { j, .. } => Some(j as usize),
        }
    }

    /// Whether nothing is pressed on it yet.
    pub fn is_open(&self) -> bool {
        self.gap > 0.0 && self.impulse == Vector3::zeros()
    }

    /// The manifold that it belongs to.
    pub fn name(&self) -> Name {
        match self.other {
            Other::Wall { surface, .. } => (false, self.i, surface),
            Other::Body { j, .. } => (true, self.i, j),
        }
    }

    /// What a moving wall has put in by its impulse, over the mass `[m^2/s^2]`.
    pub fn work_of_wall(&self) -> f64 {
        match self.other {
            Other::Wall { velocity, .. } => self.impulse.dot(&velocity),
            Other::Body { .. } => 0.0,
        }
    }

    /// This point, found where its bodies will be at the end of the substep, as it is now: with the gap from which
    /// their velocities lead to the one that is foreseen.
    pub fn foreseen<'p>(
        mut self,
        bodies: &[Moving],
        later: impl Fn(usize) -> &'p Pose,
        dt: f64,
    ) -> Self {
        self.carry(|body| *later(body), |body| bodies[body].pose);
        self.gap -= dt * self.normal.dot(&self.velocity(bodies));
        self.gap -= self.gap_of_last_motion(bodies) - self.gap;
        self
    }

    /// Moves it with its bodies, from where these lay to where they lie: half way between its places on both, for only
    /// an impulse at one place keeps their angular momentum.
    pub fn carry(&mut self, lay: impl Fn(usize) -> Pose, lies: impl Fn(usize) -> Pose) {
        let carried = |body: usize, arm: &Vector3<f64>| {
            let pose = lies(body);
            (pose.centre, pose.axes * lay(body).seen(arm))
        };
        let (centre, of_i) = carried(self.i(), &self.arm);
        self.arm = of_i;
        if let Other::Body { j, arm } = &mut self.other {
            let (other, of_j) = carried(*j as usize, arm);
            let half = 0.5 * (other + of_j - centre - of_i);
            *arm = of_j - half;
            self.arm += half;
        }
    }

    /// Whether it says what another of its manifold says, of bodies of this reach `[m]`.
    pub fn is_like(&self, other: &Self, reach: f64) -> bool {
        (self.mark - other.mark).norm() < SAME_PLACE * reach
            && self.normal.dot(&other.normal) > SAME_NORMAL
    }

    /// What an impulse at another point between the same two does to the velocity here.
    pub fn response(&self, of: &Self, bodies: &[Moving]) -> Matrix3<f64> {
        let of_i = bodies[self.i()].response(&self.arm, &of.arm);
        match (&self.other, &of.other) {
            (Other::Body { j, arm }, Other::Body { arm: of, .. }) => {
                of_i + bodies[*j as usize].response(arm, of)
            }
            _ => of_i,
        }
    }

    /// What the law needs of its block.
    pub fn block(&self, block: &Matrix3<f64>) -> Block {
        let n = self.normal;
        let other = if n.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
        let s = n.cross(&other).normalize();
        let t = n.cross(&s);
        let (a, b, c) = (s.dot(&(block * s)), s.dot(&(block * t)), t.dot(&(block * t)));
        let largest = 0.5 * (a + c) + (0.25 * (a - c) * (a - c) + b * b).sqrt();
        let pushed = block * n;
        Block { pushed, compliance: [1.0 / n.dot(&pushed), 1.0 / largest] }
    }

    /// The bias, from where the last motions of its bodies begin `[m/s]`.
    pub fn bias(&self, bodies: &[Moving], dt: f64, small: &Small) -> f64 {
        let aside = self.gap_of_last_motion(bodies) - self.gap;
        if self.gap < 0.0 { small.push(self.gap, dt) + aside / dt } else { (self.gap + aside) / dt }
    }

    /// The gap that the last motions of its bodies would have begun with at the begin of the substep `[m]`: bodies that
    /// an impact has turned back in it come from elsewhere.
    pub fn gap_of_last_motion(&self, bodies: &[Moving]) -> f64 {
        if self.last_hit(bodies) == 0.0 {
            return self.gap;
        }
        let mut aside = bodies[self.i()].shift_at(&self.arm);
        if let Other::Body { j, arm } = &self.other {
            aside -= bodies[*j as usize].shift_at(arm);
        }
        self.gap + self.normal.dot(&aside)
    }

    /// When the later of the last impacts of its bodies was, 0 if there was none `[s]`.
    pub fn last_hit(&self, bodies: &[Moving]) -> f64 {
        last_hit(bodies, self.i(), self.j())
    }

    /// Velocity of i relative to what it touches there `[m/s]`.
    #[inline(always)]
    pub fn velocity(&self, bodies: &[Moving]) -> Vector3<f64> {
        let of_i = bodies[self.i()].velocity_at(&self.arm);
        match &self.other {
            Other::Wall { velocity, .. } => of_i - velocity,
            Other::Body { j, arm } => of_i - bodies[*j as usize].velocity_at(arm),
        }
    }

    /// What of an impulse of before its normal and its friction allow.
    pub fn admitted(&self, impulse: &Vector3<f64>) -> Vector3<f64> {
        let along = self.normal.dot(impulse);
        let (normal, across) = (along.max(0.0), impulse - along * self.normal);
        let (limit, length) = (self.friction * normal, across.norm());
        let scale = if length > limit { limit / length } else { 1.0 };
        normal * self.normal + scale * across
    }

    /// Gives both bodies an impulse.
    #[inline(always)]
    pub fn give(&self, bodies: &mut [Moving], impulse: &Vector3<f64>) {
        bodies[self.i()].push(&self.arm, impulse);
        if let Other::Body { j, arm } = &self.other {
            bodies[*j as usize].push(arm, &-impulse);
        }
    }

    /// One round of the two lines at this velocity, without bias; returns the change of the impulse `[m/s]`.
    #[inline(always)]
    pub fn solve(&mut self, block: &Block, u: Vector3<f64>) -> Vector3<f64> {
        let (n, old) = (self.normal, self.impulse);
        let was = n.dot(&old);
        let normal = (was - n.dot(&u) * block.compliance[0]).max(0.0);
        let u = u + block.pushed * (normal - was);
        let wanted = old - was * n - block.compliance[1] * (u - n.dot(&u) * n);
        let (limit, square) = (self.friction * normal, wanted.norm_squared());
        let slides = square > limit * limit;
        let tangent = if slides { wanted * (limit / square.sqrt()) } else { wanted };
        self.impulse = normal * n + tangent;
        self.impulse - old
    }
}
