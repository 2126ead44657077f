//! Sweeps over the points of a substep, eight at a time.
//!
//! Points are coloured so that those of a batch share no body: the lanes of a batch are solved at the same time, batch
//! after batch, forwards and backwards in turn. With F = R I^(-1/2) and F s = omega a point's velocity and an impulse's
//! effect need no inertia,
//!
//! ```text
//! u = v_i + B_i s_i - v_j - B_j s_j,    B = -[r] F
//! v_i += lambda,   s_i += B_i^T lambda,   v_j -= lambda,   s_j -= B_j^T lambda
//! ```
//!
//! and every width of registers gives the same bits.

use nalgebra::{Matrix3, Vector3};

use super::body::Moving;
use super::contact::{Point, WALL};
use crate::body::{Body, SharedBodies};
use crate::lanes::{LANES, Lanes, Lanes3, Reg, Reg3, Row, Width, widest};
use crate::law::project_ball;
use granulcal_scene::Solid;

/// Colours that a body's mask can distinguish; points beyond them get a batch of their own.
const COLOURS: usize = 63;

/// When the sweeps over all points of a substep end: the rule of spheres (`solver/nsgs.rs`).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sweeps {
    /// At least, unless the impulses have settled.
    pub least: usize,
    /// At most.
    pub most: usize,
    /// Largest change of an impulse in a sweep that has settled `[m/s]`.
    pub settled: f64,
    /// Fastest that a point may close beyond what its gap allows `[m/s]`.
    pub closing: f64,
}

/// What sweeps have come to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Settled {
    pub sweeps: usize,
    /// Change of the impulses in the last sweep over the normal ones, both as root mean squares `[-]`.
    pub residual: f64,
    /// Whether the impulses had not settled when the sweeps were used up.
    pub unconverged: bool,
}

/// Eight points.
#[derive(Clone, Debug)]
struct Batch {
    i: [u32; LANES],
    /// The resting body at a wall that rests, one of its own at a wall that moves.
    j: [u32; LANES],
    /// Where each point is in the list.
    number: [u32; LANES],
    used: u32,
    normal: Lanes3,
    /// W n.
    pushed: Lanes3,
    /// Rows of B.
    turn_i: [Lanes3; 3],
    turn_j: [Lanes3; 3],
    /// 1 for a body, 0 for a wall.
    moves_j: Lanes,
    bias: Lanes,
    friction: Lanes,
    compliance_n: Lanes,
    compliance_t: Lanes,
    impulse: Lanes3,
}

impl Batch {
    fn empty(resting: u32) -> Self {
        Self {
            i: [resting; LANES],
            j: [resting; LANES],
            number: [0; LANES],
            used: 0,
            normal: Lanes3::ZERO,
            pushed: Lanes3::ZERO,
            turn_i: [Lanes3::ZERO; 3],
            turn_j: [Lanes3::ZERO; 3],
            moves_j: Lanes::ZERO,
            bias: Lanes::ZERO,
            friction: Lanes::ZERO,
            compliance_n: Lanes::ZERO,
            compliance_t: Lanes::ZERO,
            impulse: Lanes3::ZERO,
        }
    }

    /// Leaves nothing in the lanes that are not in use.
    fn clear_rest(&mut self, resting: u32) {
        for lane in self.used as usize..LANES {
            (self.i[lane], self.j[lane]) = (resting, resting);
            self.bias.0[lane] = 0.0;
            self.normal.set(lane, [0.0; 3]);
            self.impulse.set(lane, [0.0; 3]);
        }
    }

    /// Appends a point; `turns` are B of both bodies.
    fn add(&mut self, number: usize, j: u32, point: &Point, turns: [Matrix3<f64>; 2]) {
        let lane = self.used as usize;
        self.used += 1;
        (self.i[lane], self.j[lane], self.number[lane]) = (point.i as u32, j, number as u32);
        self.normal.set(lane, point.normal.into());
        self.pushed.set(lane, (point.block * point.normal).into());
        for (rows, turn) in [&mut self.turn_i, &mut self.turn_j].into_iter().zip(turns) {
            for (row, lanes) in rows.iter_mut().enumerate() {
                lanes.set(lane, [turn[(row, 0)], turn[(row, 1)], turn[(row, 2)]]);
            }
        }
        self.moves_j.0[lane] = if point.j == WALL { 0.0 } else { 1.0 };
        self.bias.0[lane] = point.bias;
        self.friction.0[lane] = point.friction;
        [self.compliance_n.0[lane], self.compliance_t.0[lane]] = point.compliance;
        self.impulse.set(lane, point.impulse.into());
    }
}

/// The points of a substep in batches, with the velocities that they change.
#[derive(Clone, Debug, Default)]
pub(super) struct Batches {
    all: Vec<Batch>,
    /// Velocity and s of every body, then of the resting one and of walls that move.
    bodies: Vec<Body>,
    /// F of every body.
    frames: Vec<Matrix3<f64>>,
}

impl Batches {
    /// Puts assembled points that know their bias and impulse into batches.
    pub fn fill(&mut self, points: &[Point], moving: &[Moving], solid: &Solid) {
        let Self { all: batches, bodies, frames } = self;
        let resting = moving.len() as u32;
        frames.clear();
        frames.extend(moving.iter().map(|body| body.frame(solid)));
        let spin_of = |frame: &Matrix3<f64>, omega: &Vector3<f64>| {
            solid.inertia.component_mul(&(frame.transpose() * omega))
        };
        let body = |velocity, spin| Body {
            velocity: Row::new(&velocity, 0.0),
            spin: Row::new(&spin, 0.0),
        };
        let each_body = moving.iter().zip(frames.iter());
        bodies.clear();
        bodies.extend(each_body.map(|(m, frame)| body(m.velocity, spin_of(frame, &m.omega))));
        bodies.push(Body::default());
        let (colours, starts) = colour(points, moving.len());
        batches.resize_with(starts[COLOURS + 1], || Batch::empty(resting));
        for batch in batches.iter_mut() {
            batch.used = 0;
        }
        let mut next = starts;
        for ((number, point), colour) in points.iter().enumerate().zip(colours) {
            let at = next[colour];
            let j = if point.j != WALL {
                point.j as u32
            } else if point.wall_velocity == Vector3::zeros() {
                resting
            } else {
                bodies.push(body(point.wall_velocity, Vector3::zeros()));
                bodies.len() as u32 - 1
            };
            let turn = |arm: &Vector3<f64>, body: usize| -arm.cross_matrix() * frames[body];
            let of_j = if point.j == WALL { Matrix3::zeros() } else { turn(&point.arm_j, point.j) };
            batches[at].add(number, j, point, [turn(&point.arm_i, point.i), of_j]);
            if batches[at].used as usize == LANES || colour == COLOURS {
                next[colour] += 1;
            }
        }
        for batch in batches.iter_mut() {
            batch.clear_rest(resting);
        }
    }

    /// Sweeps until the rule says that it is enough.
    pub fn settle(&mut self, rule: Sweeps) -> Settled {
        let unconverged = !self.all.is_empty();
        let mut settled = Settled { sweeps: 0, residual: 0.0, unconverged };
        let mut has_settled = false;
        for sweeps in 1..=if unconverged { rule.most } else { 0 } {
            let worst = sweep(&mut self.all, &mut self.bodies, sweeps % 2 == 0);
            settled.sweeps = sweeps;
            settled.residual = worst.residual;
            let is_enough = has_settled || sweeps >= rule.least;
            if is_enough && worst.closing <= rule.closing {
                settled.unconverged = false;
                break;
            }
            has_settled = worst.change <= rule.settled;
        }
        settled
    }

    /// Hands impulses and velocities back.
    pub fn put_back(&self, points: &mut [Point], moving: &mut [Moving]) {
        for batch in &self.all {
            for lane in 0..batch.used as usize {
                points[batch.number[lane] as usize].impulse = batch.impulse.get(lane).into();
            }
        }
        for ((body, solved), frame) in moving.iter_mut().zip(&self.bodies).zip(&self.frames) {
            body.velocity = solved.velocity.vector();
            body.omega = frame * solved.spin.vector();
        }
    }
}

/// The colour of each point: the lowest that neither of its bodies has yet; and the first batch of each, with their
/// number behind the last.
fn colour(points: &[Point], bodies: usize) -> (Vec<usize>, [usize; COLOURS + 2]) {
    let mut masks = vec![0_u64; bodies];
    let mut counts = [0; COLOURS + 1];
    let mut of = |point: &Point| {
        let both = [Some(point.i), (point.j != WALL).then_some(point.j)];
        let taken = both.iter().flatten().fold(0, |mask, &body| mask | masks[body]);
        let colour = (taken.trailing_ones() as usize).min(COLOURS);
        for &body in both.iter().flatten() {
            masks[body] |= if colour < COLOURS { 1 << colour } else { 0 };
        }
        counts[colour] += 1;
        colour
    };
    let colours = points.iter().map(&mut of).collect();
    let mut starts = [0; COLOURS + 2];
    for (colour, &count) in counts.iter().enumerate() {
        let batches = if colour == COLOURS { count } else { usize::div_ceil(count, LANES) };
        starts[colour + 1] = starts[colour] + batches;
    }
    (colours, starts)
}

/// The worst of a sweep.
#[derive(Clone, Copy, Debug, Default)]
struct Progress {
    /// Largest change of an impulse `[m/s]`.
    change: f64,
    /// Fastest that a point closed beyond what its gap allows `[m/s]`.
    closing: f64,
    /// Root mean square of all changes over that of the normal impulses `[-]`.
    residual: f64,
}

widest! {
    /// Solves every point once.
    fn sweep<W>(batches: &mut [Batch], bodies: &mut [Body], backwards: bool) -> Progress {
        let shared = SharedBodies::new(bodies);
        let mut sums = Sums::<W>::default();
        if backwards {
            for batch in batches.iter_mut().rev() {
                solve(batch, &shared, &mut sums);
            }
        } else {
            for batch in batches {
                solve(batch, &shared, &mut sums);
            }
        }
        sums.progress()
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
    fn progress(self) -> Progress {
        let lanes = |value: Reg<W>| {
            let mut lanes = Lanes::ZERO;
            value.store(&mut lanes);
            lanes.0
        };
        let largest = |value| lanes(value).into_iter().fold(0.0, f64::max);
        let [changes, normals] = [self.changes, self.normals].map(|v| lanes(v).iter().sum::<f64>());
        Progress {
            change: largest(self.largest).sqrt(),
            closing: largest(self.closing),
            residual: if normals > 0.0 { (changes / normals).sqrt() } else { 0.0 },
        }
    }
}

/// One round of the two lines for each point of a batch.
#[inline(always)]
#[allow(unsafe_code)]
fn solve<W: Width>(batch: &mut Batch, bodies: &SharedBodies<'_>, sums: &mut Sums<W>) {
    let zero = Reg::<W>::splat(0.0);
    // SAFETY: the indices are of bodies that `Batches::fill` has made, and nobody else has them.
    let ([mut v_i, mut s_i], [mut v_j, mut s_j]) =
        unsafe { (bodies.gather::<W>(&batch.i), bodies.gather::<W>(&batch.j)) };
    let n = Reg3::load(&batch.normal);
    let old = Reg3::load(&batch.impulse);
    let (turn_i, turn_j) = (load(&batch.turn_i), load(&batch.turn_j));
    let u = v_i - v_j + times(&turn_i, s_i) - times(&turn_j, s_j);
    let closing = zero - (n.dot(u) + Reg::load(&batch.bias));
    let was = n.dot(old);
    // A batch without impulses that stays open is left as it is.
    if W::less_bits(zero.0, was.0) | W::less_bits(zero.0, closing.0) == 0 {
        return;
    }
    let normal = closing.times_plus(Reg::load(&batch.compliance_n), was).max(zero);
    let u = u.plus(normal - was, Reg3::load(&batch.pushed));
    let sliding = old.minus(was, n);
    let across = u.minus(n.dot(u), n);
    let wanted = sliding.minus(Reg::load(&batch.compliance_t), across);
    let new = project_ball(wanted, Reg::load(&batch.friction) * normal).plus(normal, n);
    let change = new - old;
    v_i = v_i + change;
    s_i = s_i + times_transposed(&turn_i, change);
    v_j = v_j.minus(Reg::load(&batch.moves_j), change);
    s_j = s_j - times_transposed(&turn_j, change);
    let square = change.dot(change);
    sums.largest = sums.largest.max(square);
    sums.closing = sums.closing.max(closing);
    sums.changes = sums.changes + square;
    sums.normals = normal.times_plus(normal, sums.normals);
    new.store(&mut batch.impulse);
    // SAFETY: as above; no two lanes share a body but the resting one, which gets what it has.
    unsafe {
        bodies.scatter::<W>(batch.used, &batch.i, v_i, s_i);
        bodies.scatter::<W>(batch.used, &batch.j, v_j, s_j);
    }
}

/// Three rows; written out, for an array's own `map` is not inlined into the wide kernels.
#[inline(always)]
fn load<W: Width>([x, y, z]: &[Lanes3; 3]) -> [Reg3<W>; 3] {
    [Reg3::load(x), Reg3::load(y), Reg3::load(z)]
}

/// `rows * vector`.
#[inline(always)]
fn times<W: Width>(rows: &[Reg3<W>; 3], vector: Reg3<W>) -> Reg3<W> {
    Reg3 { x: rows[0].dot(vector), y: rows[1].dot(vector), z: rows[2].dot(vector) }
}

/// The transposed of `rows` times `vector`.
#[inline(always)]
fn times_transposed<W: Width>(rows: &[Reg3<W>; 3], vector: Reg3<W>) -> Reg3<W> {
    rows[0].scale(vector.x).plus(vector.y, rows[1]).plus(vector.z, rows[2])
}
