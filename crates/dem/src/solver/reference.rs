//! A solution to compare others with: Gauss-Seidel with conjugate directions, to a stated residual.
//!
//! Silcowitz-Hansen, Niebe and Erleben 2010; docs/theory/solvers.md, box 3. With `g = lambda - GS(lambda)`, what a
//! sweep still takes away, the minus gradient of a function whose rest is the solution:
//!
//! ```text
//! lambda <- GS(lambda),  p <- -g
//! repeat
//!     lambda <- GS(lambda),  beta <- |g|^2 / |g before|^2
//!     beta > 1:  p <- 0                                      a restart
//!     else:      lambda <- lambda + beta p,  p <- beta p - g
//! ```

use granulcal_scene::ReferenceSettings;

use crate::body::Body;
use crate::contact_set::ContactSet;
use crate::parallel::Threads;
use crate::solver::components::{
    Components, add_scaled, add_velocities, dot, impulses, put_impulses, scale_and_add, spread,
};
use crate::solver::nsgs::{self, SweepOptions};
use crate::solver::residual::ResidualSums;
use crate::solver::solve_info::SolveInfo;

/// Sweeps between two evaluations of the residual, which costs a sweep.
const LOOK: usize = 8;

/// Iterates to `settings.residual`; the work is unconverged if that takes more than `settings.max_sweeps`.
pub(super) fn solve(
    sets: &mut [&mut ContactSet],
    bodies: &mut [Body],
    settings: &ReferenceSettings,
    threads: &Threads,
) -> SolveInfo {
    let count = sets.iter().map(|set| set.batches.len()).sum();
    let mut direction = vec![Components::ZERO; count]; // p
    let mut direction_velocities = vec![Body::default(); bodies.len()]; // M^-1 J^T p
    let mut taken_before = f64::INFINITY; // |g before|^2
    let mut work = SolveInfo { unconverged: true, ..SolveInfo::default() };
    let mut before = impulses(sets);
    loop {
        work.closing = nsgs::sweep(sets, bodies, SweepOptions::EXACT, threads).closing;
        work.sweeps += 1;
        let is_last = work.sweeps >= settings.max_sweeps;
        if (work.sweeps.is_multiple_of(LOOK) || is_last)
            && ResidualSums::of(sets, bodies).is_below(settings.residual)
        {
            work.unconverged = false;
            return work;
        }
        if is_last {
            return work;
        }
        let swept = impulses(sets);
        scale_and_add(&mut before, -1.0, &swept); // -g
        let taken = dot(&before, &before);
        let beta = taken / taken_before;
        taken_before = taken;
        // Also a restart after a NaN, and in the first sweep, where beta is 0.
        if beta <= 1.0 {
            // The sum lies off the cones; the next sweep puts it back.
            let mut next = swept;
            add_scaled(&mut next, beta, &direction);
            put_impulses(sets, &next);
            add_velocities(bodies, beta, &direction_velocities);
            scale_and_add(&mut direction, beta, &before);
            before = next;
        } else {
            direction.fill(Components::ZERO);
            before = swept;
        }
        direction_velocities.fill(Body::default());
        spread(sets, &direction, &mut direction_velocities);
    }
}
