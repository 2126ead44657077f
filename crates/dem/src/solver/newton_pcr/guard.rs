//! What keeps Newton's steps from doing harm; docs/theory/solvers.md, box 2c.
//!
//! The *merit* of an iterate is the sum of squares of its natural-map residual, which vanishes at the solution
//! alone. A step is taken in full, by a half or by a quarter, the first of them that does not raise the merit; if
//! none does, a Gauss-Seidel sweep takes its place. At the end the impulses may do no more work than the biases ask
//! for, or sweeps follow. Nothing that is not finite passes, since no comparison with it holds.

use crate::parallel::Threads;

use crate::body::Body;
use crate::contact_set::ContactSet;
use crate::solver::components::{
    Components, add_scaled, add_velocities, batches, collect, impulses, put_impulses, spread,
};
use crate::solver::nsgs::{self, SweepOptions};
use crate::solver::residual::ResidualSums;

/// Shares of a step that are tried in turn.
const SHARES: [f64; 3] = [1.0, 0.5, 0.25];

/// Sweeps, at most, after the projection.
const MAX_SWEEPS: usize = 4;
/// Work of the impulses beyond that of the biases that is let pass, over the square of the normal impulses.
const EXCESS_WORK: f64 = 1e-3;

/// The merit of the present iterate and what the guard has done so far.
pub(super) struct Guard<'a> {
    merit: f64,
    /// M^-1 J^T of a step.
    change: Vec<Body>,
    threads: &'a Threads,
    /// Steps that were damped or replaced.
    pub acted: usize,
    /// Sweeps that replaced a step.
    pub sweeps: usize,
}

impl<'a> Guard<'a> {
    pub fn new(sets: &[&mut ContactSet], bodies: &mut [Body], threads: &'a Threads) -> Self {
        Self {
            merit: merit(sets, bodies),
            change: vec![Body::default(); bodies.len()],
            threads,
            acted: 0,
            sweeps: 0,
        }
    }

    /// Takes as much of `step` as does not raise the merit, or a sweep.
    pub fn advance(
        &mut self,
        sets: &mut [&mut ContactSet],
        bodies: &mut [Body],
        step: &[Components],
    ) {
        let (old_impulses, old_bodies) = (impulses(sets), bodies.to_vec());
        self.change.fill(Body::default());
        spread(sets, step, &mut self.change);
        let mut trial = old_impulses.clone();
        for share in SHARES {
            trial.copy_from_slice(&old_impulses);
            add_scaled(&mut trial, share, step);
            put_impulses(sets, &trial);
            bodies.copy_from_slice(&old_bodies);
            add_velocities(bodies, share, &self.change);
            let merit = merit(sets, bodies);
            if merit <= self.merit {
                self.merit = merit;
                self.acted += usize::from(share < 1.0);
                return;
            }
        }
        put_impulses(sets, &old_impulses);
        bodies.copy_from_slice(&old_bodies);
        self.sweep(sets, bodies);
    }

    /// After the projection on the cones: sweeps while the merit lies above the last step's or the impulses do
    /// work that the biases do not ask for.
    pub fn conclude(&mut self, sets: &mut [&mut ContactSet], bodies: &mut [Body]) {
        let bound = self.merit;
        self.merit = merit(sets, bodies);
        for _ in 0..MAX_SWEEPS {
            if self.merit <= bound && excess_work(sets, bodies) <= EXCESS_WORK {
                return;
            }
            self.sweep(sets, bodies);
        }
    }

    fn sweep(&mut self, sets: &mut [&mut ContactSet], bodies: &mut [Body]) {
        nsgs::sweep(sets, bodies, SweepOptions::EXACT, self.threads);
        self.merit = merit(sets, bodies);
        self.acted += 1;
        self.sweeps += 1;
    }
}

fn merit(sets: &[&mut ContactSet], bodies: &mut [Body]) -> f64 {
    ResidualSums::of(sets, bodies).squares()
}

/// `lambda . (u + b)` over `lambda_n . lambda_n`: the work that the impulses do beyond what the biases ask for,
/// which is never positive at the solution.
fn excess_work(sets: &[&mut ContactSet], bodies: &mut [Body]) -> f64 {
    let mut velocities = vec![Components::ZERO; batches(sets).count()];
    collect(sets, bodies, &mut velocities);
    let (mut work, mut square) = (0.0, 0.0);
    for ((set, number), velocities) in batches(sets).zip(&velocities) {
        let batch = &set.batches[number];
        let impulses = Components::of(batch);
        for lane in batch.lanes() {
            let (u, lambda) = (velocities.get(lane), impulses.get(lane));
            work += lambda.normal * (u.normal + batch.bias.0[lane]) + lambda.torsion * u.torsion;
            for axis in 0..3 {
                work += lambda.tangential[axis] * u.tangential[axis];
                work += lambda.rolling[axis] * u.rolling[axis];
            }
            square += lambda.normal * lambda.normal;
        }
    }
    // Without any impulse there is no work.
    if square == 0.0 { 0.0 } else { work / square }
}
