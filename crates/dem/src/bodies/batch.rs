//! Eight points of contact that share no body, and one round of the law for them.

use super::contact::{Other, Point};
use super::lever::Lever;
use crate::body::SharedBodies;
use crate::lanes::{LANES, Lanes, Lanes3, Reg, Reg3, Width, widest};
use crate::law::project_ball;
use nalgebra::{Matrix3, Vector3};

/// Eight points.
#[derive(Clone, Debug)]
pub(super) struct Batch<L> {
    i: [u32; LANES],
    /// The resting body at a wall that rests, one of its own at a wall that moves.
    j: [u32; LANES],
    used: u32,
    normal: Lanes3,
    /// W n.
    pushed: Lanes3,
    lever_i: L,
    lever_j: L,
    /// 1 for a body, 0 for a wall.
    moves_j: Lanes,
    bias: Lanes,
    friction: Lanes,
    compliance_n: Lanes,
    compliance_t: Lanes,
    impulse: Lanes3,
}

impl<L: Lever> Batch<L> {
    pub fn empty(resting: u32) -> Self {
        Self {
            i: [resting; LANES],
            j: [resting; LANES],
            used: 0,
            normal: Lanes3::ZERO,
            pushed: Lanes3::ZERO,
            lever_i: L::NONE,
            lever_j: L::NONE,
            moves_j: Lanes::ZERO,
            bias: Lanes::ZERO,
            friction: Lanes::ZERO,
            compliance_n: Lanes::ZERO,
            compliance_t: Lanes::ZERO,
            impulse: Lanes3::ZERO,
        }
    }

    /// Takes all points out.
    pub fn clear(&mut self) {
        self.used = 0;
    }

    /// Appends a point with its bias; `j` is its second body among those of the sweeps, `frames` are F of all bodies.
    /// Returns its lane.
    #[inline(always)]
    pub fn add(&mut self, j: u32, point: &Point, bias: f64, frames: &[Matrix3<f64>]) -> u32 {
        let lane = self.used as usize;
        self.used += 1;
        (self.i[lane], self.j[lane]) = (point.i() as u32, j);
        self.normal.set(lane, point.normal.into());
        self.lever_i.set(lane, &point.arm, &frames[point.i()]);
        match &point.other {
            Other::Wall { .. } => {
                self.lever_j.set(lane, &Vector3::zeros(), &Matrix3::zeros());
                self.moves_j.0[lane] = 0.0;
            }
            Other::Body { j, arm } => {
                self.lever_j.set(lane, arm, &frames[*j as usize]);
                self.moves_j.0[lane] = 1.0;
            }
        }
        self.bias.0[lane] = bias;
        self.friction.0[lane] = point.friction;
        self.impulse.set(lane, point.impulse.into());
        lane as u32
    }

    /// Gives a point another bias.
    pub fn aim(&mut self, lane: usize, bias: f64) {
        self.bias.0[lane] = bias;
    }

    /// Leaves nothing in the lanes that are not in use.
    pub fn clear_rest(&mut self, resting: u32) {
        let (no_arm, no_frame) = (Vector3::zeros(), Matrix3::zeros());
        for lane in self.used as usize..LANES {
            (self.i[lane], self.j[lane]) = (resting, resting);
            self.lever_i.set(lane, &no_arm, &no_frame);
            self.lever_j.set(lane, &no_arm, &no_frame);
            self.moves_j.0[lane] = 0.0;
            self.bias.0[lane] = 0.0;
            self.friction.0[lane] = 0.0;
            self.normal.set(lane, [1.0, 0.0, 0.0]);
            self.impulse.set(lane, [0.0; 3]);
        }
    }

    /// The impulse of a point.
    pub fn impulse(&self, lane: usize) -> Vector3<f64> {
        self.impulse.get(lane).into()
    }

    /// Makes what is needed of the blocks `W = (1 + B_i B_i^T) + (1 + B_j B_j^T)`.
    #[inline(always)]
    fn assemble<W: Width>(&mut self) {
        let mass = Reg::<W>::splat(1.0) + Reg::load(&self.moves_j);
        let n = Reg3::load(&self.normal);
        let s = across(n);
        let t = n.cross(s);
        let turns = |along: Reg3<W>| (self.lever_i.turn(along), self.lever_j.turn(along));
        let ((i_n, j_n), (i_s, j_s), (i_t, j_t)) = (turns(n), turns(s), turns(t));
        let of_n = mass + i_n.dot(i_n) + j_n.dot(j_n);
        let (of_s, of_t) = (i_s.dot(i_s) + j_s.dot(j_s), i_t.dot(i_t) + j_t.dot(j_t));
        let both = i_s.dot(i_t) + j_s.dot(j_t);
        let half = Reg::splat(0.5);
        let apart = half * (of_s - of_t);
        let root = apart.times_plus(apart, both * both).sqrt();
        let largest = mass + half * (of_s + of_t) + root;
        let pushed = n.scale(mass) + self.lever_i.velocity(i_n) + self.lever_j.velocity(j_n);
        let one = Reg::splat(1.0);
        pushed.store(&mut self.pushed);
        one.over(of_n).store(&mut self.compliance_n);
        one.over(largest).store(&mut self.compliance_t);
    }

    /// One round of the two lines for each point; returns whether all are open and stay so, or no impulse has changed
    /// by more than `idle`^2.
    #[inline(always)]
    #[allow(unsafe_code)]
    fn solve<W: Width>(
        &mut self,
        bodies: &SharedBodies<'_>,
        idle: Reg<W>,
        sums: &mut Sums<W>,
    ) -> bool {
        let zero = Reg::<W>::splat(0.0);
        // SAFETY: the indices are of bodies that `BatchesOf` has taken over, and nobody else has them.
        let ([mut v_i, mut s_i], [mut v_j, mut s_j]) =
            unsafe { (bodies.gather::<W>(&self.i), bodies.gather::<W>(&self.j)) };
        let n = Reg3::load(&self.normal);
        let old = Reg3::load(&self.impulse);
        let u = v_i - v_j + self.lever_i.velocity(s_i) - self.lever_j.velocity(s_j);
        let closing = zero - (n.dot(u) + Reg::load(&self.bias));
        let was = n.dot(old);
        // A batch without impulses that stays open is left as it is.
        if W::less_bits(zero.0, was.0) | W::less_bits(zero.0, closing.0) == 0 {
            return true;
        }
        let normal = closing.times_plus(Reg::load(&self.compliance_n), was).max(zero);
        let u = u.plus(normal - was, Reg3::load(&self.pushed));
        let sliding = old.minus(was, n);
        let across = u.minus(n.dot(u), n);
        let wanted = sliding.minus(Reg::load(&self.compliance_t), across);
        let new = project_ball(wanted, Reg::load(&self.friction) * normal).plus(normal, n);
        let change = new - old;
        v_i = v_i + change;
        s_i = s_i + self.lever_i.turn(change);
        v_j = v_j.minus(Reg::load(&self.moves_j), change);
        s_j = s_j - self.lever_j.turn(change);
        let square = change.dot(change);
        sums.add(square, closing, normal);
        new.store(&mut self.impulse);
        // SAFETY: as above; no two lanes share a body but the resting one, which gets what it has.
        unsafe {
            bodies.scatter::<W>(self.used, &self.i, v_i, s_i);
            bodies.scatter::<W>(self.used, &self.j, v_j, s_j);
        }
        W::less_bits(idle.0, square.0) == 0
    }
}

/// A unit vector across another.
#[inline(always)]
fn across<W: Width>(n: Reg3<W>) -> Reg3<W> {
    let (zero, one) = (Reg::splat(0.0), Reg::splat(1.0));
    // Across x or y, whichever is farther from n.
    let (along_x, bar) = (n.x * n.x, Reg::splat(0.36));
    let along = |yes: Reg<W>, no: Reg<W>| along_x.if_less(bar, yes, no);
    let other = Reg3 { x: along(one, zero), y: along(zero, one), z: zero };
    let across = n.cross(other);
    across.scale(one.over(across.norm()))
}

widest! {
    /// Makes what is needed of all blocks.
    pub(super) fn assemble<W, L: Lever>(batch: &mut Batch<L>) {
        batch.assemble::<W>();
    }
}

widest! {
    /// Solves the points of those batches once that are idle, or those that are not, or both: those are idle that stay
    /// open or change by no more than `idle` `[m/s]`.
    pub(super) fn sweep<W, L: Lever>(
        batches: &mut [Batch<L>],
        is_idle: &mut [bool],
        asked: [bool; 2],
        bodies: &SharedBodies<'_>,
        backwards: bool,
        idle: f64,
    ) -> Progress {
        let idle = Reg::splat(idle * idle);
        let mut sums = Sums::<W>::default();
        let count = batches.len();
        for place in 0..count {
            let number = if backwards { count - 1 - place } else { place };
            if asked[usize::from(is_idle[number])] {
                is_idle[number] = batches[number].solve(bodies, idle, &mut sums);
            }
        }
        sums.progress()
    }
}

/// The worst of a sweep.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Progress {
    /// Largest change of an impulse `[m/s]`.
    pub change: f64,
    /// Fastest that a point closed beyond what its gap allows `[m/s]`.
    pub closing: f64,
    /// Squares of all changes, and of the normal impulses `[m^2/s^2]`.
    squares: [f64; 2],
}

impl Progress {
    /// Root mean square of all changes over that of the normal impulses `[-]`.
    pub fn residual(&self) -> f64 {
        let [changes, normals] = self.squares;
        if normals > 0.0 { (changes / normals).sqrt() } else { 0.0 }
    }

    /// Of a sweep in two parts.
    pub fn and(self, other: Self) -> Self {
        Self {
            change: self.change.max(other.change),
            closing: self.closing.max(other.closing),
            squares: [0, 1].map(|k| self.squares[k] + other.squares[k]),
        }
    }
}

/// What a sweep gathers, lane by lane.
#[derive(Clone, Copy)]
struct Sums<W: Width> {
    largest: Reg<W>,
    closing: Reg<W>,
    changes: Reg<W>,
    normals: Reg<W>,
}

impl<W: Width> Default for Sums<W> {
    fn default() -> Self {
        let zero = Reg::splat(0.0);
        Self { largest: zero, closing: zero, changes: zero, normals: zero }
    }
}

impl<W: Width> Sums<W> {
    #[inline(always)]
    fn add(&mut self, square_of_change: Reg<W>, closing: Reg<W>, normal: Reg<W>) {
        self.largest = self.largest.max(square_of_change);
        self.closing = self.closing.max(closing);
        self.changes = self.changes + square_of_change;
        self.normals = normal.times_plus(normal, self.normals);
    }

    #[inline(always)]
    fn progress(self) -> Progress {
        let lanes = |value: Reg<W>| {
            let mut lanes = Lanes::ZERO;
            value.store(&mut lanes);
            lanes.0
        };
        let largest = |value| lanes(value).into_iter().fold(0.0, f64::max);
        let squares = [self.changes, self.normals].map(|v| lanes(v).iter().sum::<f64>());
        Progress { change: largest(self.largest).sqrt(), closing: largest(self.closing), squares }
    }
}
