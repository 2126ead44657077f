//! The natural-map residual of all contacts: how far their own exact solutions would still move the impulses.

use crate::body::{Body, SharedBodies};
use crate::contact_set::ContactSet;
use crate::lanes::{Lanes, Reg, Width, widest};
use crate::solver::nsgs::{Impulses, closing, local_solution};
use crate::solver::velocities::Velocities;

/// Sums of squares for the natural-map residual.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ResidualSums {
    squares: f64,
    impulses: f64,
}

impl ResidualSums {
    /// The sums over the contacts of all sets.
    pub fn of(sets: &[&mut ContactSet], bodies: &mut [Body]) -> Self {
        let mut sums = Self::default();
        for set in sets {
            let lanes = if set.is_soft() { residual_of_soft } else { residual_of_rigid };
            lanes(set, bodies, &mut sums.squares, &mut sums.impulses);
        }
        sums
    }

    /// Sum of the squares of the residual, how far its own exact solution would still move each impulse
    /// `[m^2/s^2]`.
    pub fn squares(&self) -> f64 {
        self.squares
    }

    /// Whether the relative residual is at most `bound`; true without any impulse.
    pub fn is_below(&self, bound: f64) -> bool {
        self.squares <= bound * bound * self.impulses
    }

    /// Root mean square of the residual over that of the normal impulses; 0 without any impulse.
    pub fn relative(&self) -> f64 {
        if self.impulses > 0.0 { (self.squares / self.impulses).sqrt() } else { 0.0 }
    }
}

widest! {
    fn residual_of_rigid<W>(set: &ContactSet, bodies: &mut [Body], squares: &mut f64, impulses: &mut f64) {
        residual_lanes::<W, false>(set, bodies, squares, impulses);
    }
}

widest! {
    fn residual_of_soft<W>(set: &ContactSet, bodies: &mut [Body], squares: &mut f64, impulses: &mut f64) {
        residual_lanes::<W, true>(set, bodies, squares, impulses);
    }
}

#[inline(always)]
fn residual_lanes<W: Width, const SOFT: bool>(
    set: &ContactSet,
    bodies: &mut [Body],
    squares: &mut f64,
    impulses: &mut f64,
) {
    assert!(set.fits(bodies));
    let bodies = SharedBodies::new(bodies);
    for batch in &set.batches {
        let law = &set.laws[batch.law as usize];
        let old = Impulses::<W>::load(batch);
        let mut velocities = Velocities::gather::<false>(batch, &bodies);
        let closing = closing::<W, SOFT>(batch, law, &velocities);
        let one = Reg::splat(1.0);
        let new = local_solution::<W, SOFT>(batch, law, closing, one, old, &mut velocities);
        let (mut square, mut impulse) = (Lanes::ZERO, Lanes::ZERO);
        new.square_of_change(&old).store(&mut square);
        (old.n * old.n).store(&mut impulse);
        // Lane after lane, so that every width sums in the same order; empty lanes hold zeros.
        for lane in batch.lanes() {
            *squares += square.0[lane];
            *impulses += impulse.0[lane];
        }
    }
}
