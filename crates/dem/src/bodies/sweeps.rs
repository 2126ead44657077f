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

use super::around::Around;
use super::batch::{Batch, assemble, sweep};
use super::body::Moving;
use super::contact::{Other, Point};
use super::lever::{Arm, Lever, Rows};
use crate::body::{Body, SharedBodies};
use crate::lanes::{LANES, Row};
use crate::turning::turns_alike;
use granulcal_scene::Solid;

/// Colours that a body's mask can distinguish; points beyond them get a batch of their own.
const COLOURS: usize = 63;

/// Batches that a sweep has left open, or as good as it found them, are asked again in every so many sweeps, and before
/// the end.
const WHOLE: usize = 3;

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
    /// Change of an impulse at which its batch goes on in every sweep, not in every so many only `[m/s]`.
    pub idle: f64,
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

/// The points of a substep in batches, as bodies of a shape are solved best.
#[derive(Clone, Debug)]
pub(super) enum Batches {
    Round(BatchesOf<Arm>),
    Other(BatchesOf<Rows>),
}

impl Batches {
    pub fn of(solid: &Solid) -> Self {
        if turns_alike(&solid.inertia) {
            Self::Round(BatchesOf::default())
        } else {
            Self::Other(BatchesOf::default())
        }
    }

    /// Solves points that know their impulse, with the bias of each, and gives the bodies the velocities that they come
    /// to. If those before a number are known, as they were solved last, and their bodies have not been touched since,
    /// they are taken up again as they were but for the bias of those that are corrected.
    pub fn solve(
        &mut self,
        points: &[Point],
        again: (usize, &[usize]),
        moving: &mut [Moving],
        around: &Around<'_>,
        rule: Sweeps,
    ) -> Settled {
        match self {
            Self::Round(batches) => batches.solve(points, again, moving, around, rule),
            Self::Other(batches) => batches.solve(points, again, moving, around, rule),
        }
    }

    /// Gives each point the impulse that it has come to, and then to `take`.
    pub fn put_back(&self, points: &mut [Point], take: impl FnMut(&Point)) {
        match self {
            Self::Round(batches) => batches.put_back(points, take),
            Self::Other(batches) => batches.put_back(points, take),
        }
    }
}

/// The points of a substep in batches, with the velocities that they change.
#[derive(Clone, Debug)]
pub(super) struct BatchesOf<L> {
    all: Vec<Batch<L>>,
    /// How many of them are in use.
    used: usize,
    /// The batch and the lane of each point.
    places: Vec<(u32, u32)>,
    /// The colours of each body's points.
    masks: Vec<u64>,
    /// Velocity and s of every body, then of the resting one and of walls that move.
    bodies: Vec<Body>,
    /// F of every body.
    frames: Vec<Matrix3<f64>>,
}

impl<L> Default for BatchesOf<L> {
    fn default() -> Self {
        Self {
            all: Vec::new(),
            used: 0,
            places: Vec::new(),
            masks: Vec::new(),
            bodies: Vec::new(),
            frames: Vec::new(),
        }
    }
}

impl<L: Lever> BatchesOf<L> {
    fn solve(
        &mut self,
        points: &[Point],
        (known, corrected): (usize, &[usize]),
        moving: &mut [Moving],
        around: &Around<'_>,
        rule: Sweeps,
    ) -> Settled {
        if known == 0 {
            self.begin(moving, around.solid);
        }
        for &number in corrected {
            let (batch, lane) = self.places[number];
            let bias = points[number].bias(moving, around.dt, around.small);
            self.all[batch as usize].aim(lane as usize, bias);
        }
        self.add(&points[known..], moving, around);
        let settled = self.settle(rule);
        self.give_back(moving);
        settled
    }

    /// Takes the bodies over.
    fn begin(&mut self, moving: &[Moving], solid: &Solid) {
        (self.used, self.masks) = (0, vec![0; moving.len()]);
        self.places.clear();
        self.frames.clear();
        self.frames.extend(moving.iter().map(|body| L::frame(body, solid)));
        self.bodies.clear();
        self.bodies.extend(moving.iter().zip(&self.frames).map(|(moving, frame)| {
            // s = F^-1 omega = F^T I omega, with the tensor in the scene's axes.
            let local = moving.pose.seen(&moving.omega).component_mul(&solid.inertia);
            body(moving.velocity, frame.tr_mul(&(moving.pose.axes * local)))
        }));
        self.bodies.push(Body::default());
    }

    /// Puts points into batches: those that push first, apart from those that are open, of which most batches stay as
    /// they are in a sweep.
    fn add(&mut self, points: &[Point], moving: &[Moving], around: &Around<'_>) {
        let known = self.places.len();
        self.places.resize(known + points.len(), (0, 0));
        let (open, pushing): (Vec<_>, Vec<_>) =
            (0..points.len() as u32).partition(|&number| points[number as usize].is_open());
        for some in [open, pushing] {
            for numbers in together(points, &some, &mut self.masks) {
                self.fill(points, (known, &numbers), moving, around);
            }
        }
    }

    /// Makes a batch of the points with these numbers; before the points there are `known` ones.
    fn fill(
        &mut self,
        points: &[Point],
        (known, numbers): (usize, &[u32; LANES]),
        moving: &[Moving],
        around: &Around<'_>,
    ) {
        let resting = moving.len() as u32;
        if self.all.len() == self.used {
            self.all.push(Batch::empty(resting));
        }
        let batch = &mut self.all[self.used];
        batch.clear();
        for &number in numbers.iter().filter(|&&number| number != NONE) {
            let point = &points[number as usize];
            let j = match point.other {
                Other::Body { j, .. } => j,
                Other::Wall { velocity, .. } if velocity == Vector3::zeros() => resting,
                Other::Wall { velocity, .. } => {
                    self.bodies.push(body(velocity, Vector3::zeros()));
                    (self.bodies.len() - 1) as u32
                }
            };
            let bias = point.bias(moving, around.dt, around.small);
            let lane = batch.add(j, point, bias, &self.frames);
            self.places[known + number as usize] = (self.used as u32, lane);
        }
        batch.clear_rest(resting);
        assemble(batch);
        self.used += 1;
    }

    /// Sweeps until the rule says that it is enough.
    fn settle(&mut self, rule: Sweeps) -> Settled {
        let batches = &mut self.all[..self.used];
        let unconverged = !batches.is_empty();
        let mut settled = Settled { sweeps: 0, residual: 0.0, unconverged };
        let mut has_settled = false;
        let bodies = SharedBodies::new(&mut self.bodies);
        let mut is_idle = vec![false; batches.len()];
        let mut ask =
            |asked, backwards| sweep(batches, &mut is_idle, asked, &bodies, backwards, rule.idle);
        for sweeps in 1..=if unconverged { rule.most } else { 0 } {
            let backwards = sweeps % 2 == 0;
            let is_whole = sweeps % WHOLE == 1;
            let mut worst = ask([true, is_whole], backwards);
            let is_enough = has_settled || sweeps >= rule.least;
            if is_enough && worst.closing <= rule.closing && !is_whole {
                worst = worst.and(ask([false, true], backwards));
            }
            settled.sweeps = sweeps;
            settled.residual = worst.residual();
            if is_enough && worst.closing <= rule.closing {
                settled.unconverged = false;
                break;
            }
            has_settled = is_whole && worst.change <= rule.settled;
        }
        settled
    }

    /// Hands the impulses to the points, and these on.
    fn put_back(&self, points: &mut [Point], mut take: impl FnMut(&Point)) {
        for (&(batch, lane), point) in self.places.iter().zip(points) {
            point.impulse = self.all[batch as usize].impulse(lane as usize);
            take(point);
        }
    }

    /// Hands the velocities to the bodies.
    fn give_back(&self, moving: &mut [Moving]) {
        for ((body, solved), frame) in moving.iter_mut().zip(&self.bodies).zip(&self.frames) {
            body.velocity = solved.velocity.vector();
            body.omega = frame * solved.spin.vector();
        }
    }
}

fn body(velocity: Vector3<f64>, spin: Vector3<f64>) -> Body {
    Body { velocity: Row::new(&velocity, 0.0), spin: Row::new(&spin, 0.0) }
}

/// No point.
const NONE: u32 = u32::MAX;

/// Puts points together that share no body, eight at most: those of one colour, which is the lowest that neither body
/// has yet.
fn together(points: &[Point], some: &[u32], masks: &mut [u64]) -> Vec<[u32; LANES]> {
    masks.fill(0);
    let mut counts = [0; COLOURS + 1];
    let of = |number: &u32| {
        let point = &points[*number as usize];
        let both = [Some(point.i()), point.j()];
        let taken = both.iter().flatten().fold(0, |mask, &body| mask | masks[body]);
        let colour = (taken.trailing_ones() as usize).min(COLOURS);
        for &body in both.iter().flatten() {
            masks[body] |= if colour < COLOURS { 1 << colour } else { 0 };
        }
        // Beyond the last colour each is alone.
        counts[colour] += if colour < COLOURS { 1 } else { LANES };
        colour
    };
    let colours: Vec<_> = some.iter().map(of).collect();
    // The next free lane of each colour, counted through all batches.
    let mut next = [0; COLOURS + 2];
    for (colour, &count) in counts.iter().enumerate() {
        next[colour + 1] = next[colour] + usize::next_multiple_of(count, LANES);
    }
    let mut batches = vec![[NONE; LANES]; next[COLOURS + 1] / LANES];
    for (&number, colour) in some.iter().zip(colours) {
        batches[next[colour] / LANES][next[colour] % LANES] = number;
        next[colour] += if colour < COLOURS { 1 } else { LANES };
    }
    batches
}
