//! Which bodies may meet in a substep: pairs of balls, found by cells.

use nalgebra::Vector3;

use super::around::Around;
use super::body::Moving;
use super::motion::Motion;
use crate::cells::pairs_within;

/// Pairs are sought so much farther than a body goes, for the impacts that make it faster, in its reach `[-]`.
pub(super) const SLACK: f64 = 0.1;

/// They are known for as much farther as lets every body go so far, in its reach `[-]`, and for so many substeps as
/// fast as it was when they were found.
const SKIN: f64 = 0.125;
const AHEAD: f64 = 6.0;

/// Two bodies whose balls may meet in a substep.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair {
    pub i: usize,
    pub j: usize,
    /// How far from each other they may be at the begin of the substep and meet in it `[m]`.
    pub range: f64,
    /// They are at least so far from each other at the begin of the substep; minus infinity where nothing is known
    /// `[m]`.
    pub clear: f64,
}

/// Pairs of bodies that may come near each other for as long as none has gone far.
#[derive(Clone, Debug, Default)]
pub(super) struct Neighbours {
    /// Where the bodies were when they were sought `[m]`.
    centres: Vec<Vector3<f64>>,
    /// How far each may go from there, to the end of a substep, for its pairs to be known `[m]`.
    allowed: Vec<f64>,
    /// In order, the lower number first.
    pairs: Vec<(u32, u32)>,
    /// Which of them were given in this substep.
    is_given: Vec<bool>,
}

impl Neighbours {
    /// Pairs whose balls may meet, each once and in order: they depend on the places and motions alone.
    pub fn near(
        &mut self,
        around: &Around<'_>,
        bodies: &[Moving],
        motions: &[Motion],
    ) -> Vec<Pair> {
        let mut pairs = Vec::with_capacity(self.pairs.len());
        self.is_given.fill(false);
        self.more(around, bodies, motions, |_| true, &mut pairs);
        pairs
    }

    /// Adds those that were not given yet in this substep of the bodies in question.
    pub fn more(
        &mut self,
        around: &Around<'_>,
        bodies: &[Moving],
        motions: &[Motion],
        is_asked: impl Fn(usize) -> bool,
        given: &mut Vec<Pair>,
    ) {
        let reach = around.solid.reach;
        let balls: Vec<_> = bodies.iter().zip(motions).map(Ball::of).collect();
        let apart = 2.0 * (1.0 + SLACK) * reach;
        let base = apart + around.least();
        if self.seek(&balls, base, SKIN * reach, around.dt) {
            self.mark(given);
        }
        for (&(i, j), is_given) in self.pairs.iter().zip(&mut self.is_given) {
            let (i, j) = (i as usize, j as usize);
            if *is_given || !(is_asked(i) || is_asked(j)) {
                continue;
            }
            let (a, b) = (&balls[i], &balls[j]);
            let square = (b.centre - a.centre).norm_squared();
            // No pair is faster than both of its bodies.
            let most = base + around.dt * (a.fastest + b.fastest);
            if square >= most * most {
                continue;
            }
            let range = around.range(&motions[i], Some(&motions[j]));
            if square < (apart + range) * (apart + range) {
                *is_given = true;
                given.push(Pair { i, j, range, clear: square.sqrt() - 2.0 * reach });
            }
        }
    }

    /// Notes which pairs were given: what is given in a substep does not depend on when they were found.
    fn mark(&mut self, given: &[Pair]) {
        let mut given: Vec<_> = given.iter().map(|pair| (pair.i as u32, pair.j as u32)).collect();
        given.sort_unstable();
        let is_given = self.pairs.iter().map(|pair| given.binary_search(pair).is_ok());
        self.is_given = is_given.collect();
    }

    /// Finds the pairs anew unless all are known that are nearer than `base` and the ways of their bodies in a substep;
    /// returns whether it has.
    fn seek(&mut self, balls: &[Ball], base: f64, skin: f64, dt: f64) -> bool {
        let is_within = |((ball, centre), allowed): ((&Ball, &Vector3<f64>), &f64)| {
            (ball.centre - centre).norm() + dt * ball.fastest <= *allowed
        };
        if self.centres.len() == balls.len()
            && balls.iter().zip(&self.centres).zip(&self.allowed).all(is_within)
        {
            return false;
        }
        self.centres.clear();
        self.centres.extend(balls.iter().map(|ball| ball.centre));
        self.allowed.clear();
        self.allowed.extend(balls.iter().map(|ball| skin + AHEAD * dt * ball.fastest));
        self.pairs.clear();
        let slow = base + 4.0 * skin;
        pairs_within(&self.centres, &self.allowed, base, slow, |i, j| self.pairs.push((i, j)));
        self.pairs.sort_unstable_by_key(|&(i, j)| u64::from(i) << 32 | u64::from(j));
        true
    }
}

/// A body as the search sees it.
#[derive(Clone, Copy, Debug)]
struct Ball {
    centre: Vector3<f64>,
    /// How fast its points move at most `[m/s]`.
    fastest: f64,
}

impl Ball {
    fn of((body, motion): (&Moving, &Motion)) -> Self {
        Self { centre: body.pose.centre, fastest: motion.fastest() }
    }
}
