//! Non-smooth Gauss-Seidel: sweeps over the contacts, each solved exactly against the present velocities.
//!
//! For each contact in turn (docs/theory/contact.md, box 1):
//!
//! ```text
//! lambda_n <- max(0, lambda_n - (w_n + b) / A_n)
//! lambda_t <- projection on |.| <= mu_s lambda_n of lambda_t - (u_t + b_t) / A_t
//! lambda_r <- projection on |.| <= mu_r lambda_n of lambda_r - rho / A_r
//! ```
//!
//! Equal spheres make the contact's own Delassus block diagonal, so this is its exact solution; at walls and
//! between unequal spheres sliding and rolling couple, and the three lines are one pass inside the contact.
//! Contacts of a batch share no grain: the order within a batch cannot change a bit.

use rayon::ThreadPool;
use rayon::prelude::*;

use crate::assemble::gather;
use crate::bed::{Body, INVERSE_INERTIA, SharedBodies};
use crate::contact::{Batch, ContactSet, LawLanes};
use crate::lanes::{LANES, Lanes, Lanes3, Reg, Reg3, Width, widest};
use crate::law::{TANGENTIAL_INERTIA, project_ball};
use crate::preset::SolverSettings;
use crate::solver::Work;

/// Batches of a colour below which a second thread costs more than it brings.
const PARALLEL_BATCHES: usize = 512;
/// Batches that a thread takes at once.
const SHARE: usize = 64;

/// Sweeps over all contacts, at least `settings.sweeps` times, until none closes faster than `too_fast`
/// `[m/s]` against its constraint, or `settings.max_sweeps` are used up.
pub(super) fn solve(
    sets: &mut [&mut ContactSet],
    bodies: &mut [Body],
    settings: &SolverSettings,
    too_fast: f64,
    pool: Option<&ThreadPool>,
) -> Work {
    let mut work = Work::default();
    while work.sweeps < settings.max_sweeps {
        work.closing = sweep_all(sets, bodies, pool);
        work.sweeps += 1;
        work.unconverged = work.closing > too_fast;
        if !work.unconverged && work.sweeps >= settings.sweeps {
            break;
        }
    }
    work
}

/// One sweep over the sets in their order; returns the fastest closing that it met `[m/s]`.
pub(super) fn sweep_all(
    sets: &mut [&mut ContactSet],
    bodies: &mut [Body],
    pool: Option<&ThreadPool>,
) -> f64 {
    sets.iter_mut().map(|set| sweep(set, bodies, pool)).fold(0.0, f64::max)
}

/// One sweep over the batches in their order; the batches of a colour share no grain and may go to the
/// threads of `pool` in any order without changing a bit.
///
/// Returns the fastest closing `-(w_n + b)` that a contact still had when its turn came `[m/s]`.
fn sweep(set: &mut ContactSet, bodies: &mut [Body], pool: Option<&ThreadPool>) -> f64 {
    let ContactSet { batches, laws, bias_t, colours, .. } = set;
    let bodies = SharedBodies::new(bodies);
    let Some(pool) = pool else {
        return sweep_batches(batches, laws, bias_t, &bodies);
    };
    let mut closing = 0.0_f64;
    for colour in colours.iter() {
        let bias_t = bias_t.get(colour.batches.clone()).unwrap_or_default();
        let batches = &mut batches[colour.batches.clone()];
        if batches.len() < PARALLEL_BATCHES || !colour.is_disjoint {
            closing = closing.max(sweep_batches(batches, laws, bias_t, &bodies));
            continue;
        }
        let shares = batches.par_chunks_mut(SHARE).enumerate();
        let fastest = shares.map(|(share, batches)| {
            let bias_t = bias_t.get(share * SHARE..).unwrap_or_default();
            sweep_batches(batches, laws, bias_t, &bodies)
        });
        closing = closing.max(pool.install(|| fastest.reduce(|| 0.0, f64::max)));
    }
    closing
}

widest! {
    fn sweep_batches<W>(
        batches: &mut [Batch],
        laws: &[LawLanes],
        bias_t: &[Lanes3],
        bodies: &SharedBodies<'_>,
    ) -> f64 {
        let mut closing = Reg::<W>::splat(0.0);
        if bias_t.is_empty() {
            for batch in batches {
                solve_batch(batch, &laws[batch.law as usize], None, bodies, &mut closing);
            }
        } else {
            for (batch, bias_t) in batches.iter_mut().zip(bias_t) {
                solve_batch(batch, &laws[batch.law as usize], Some(bias_t), bodies, &mut closing);
            }
        }
        let mut lanes = Lanes::ZERO;
        closing.store(&mut lanes);
        lanes.0.into_iter().fold(0.0, f64::max)
    }
}

/// Velocities of both grains of each contact.
#[derive(Clone, Copy)]
pub(super) struct Velocities<W: Width> {
    pub v_i: Reg3<W>,
    pub w_i: Reg3<W>,
    pub v_j: Reg3<W>,
    pub w_j: Reg3<W>,
}

/// The impulses of each contact, and how fast it closed against its constraint before they were found.
#[derive(Clone, Copy)]
struct Impulses<W: Width> {
    closing: Reg<W>,
    n: Reg<W>,
    t: Reg3<W>,
    r: Reg3<W>,
}

impl<W: Width> Velocities<W> {
    #[inline(always)]
    pub fn gather(batch: &Batch, bodies: &SharedBodies<'_>) -> Self {
        let (v_i, w_i) = gather(&batch.i, |body| bodies.load::<W>(body));
        let (v_j, w_j) = gather(&batch.j, |body| bodies.load::<W>(body));
        Self { v_i, w_i, v_j, w_j }
    }

    #[inline(always)]
    pub fn scatter(&self, batch: &Batch, bodies: &SharedBodies<'_>) {
        scatter(&batch.i, bodies, self.v_i, self.w_i);
        scatter(&batch.j, bodies, self.v_j, self.w_j);
    }

    /// Applies normal and tangential impulses.
    #[inline(always)]
    pub fn push(&mut self, law: &LawLanes, n: &Reg3<W>, normal: Reg<W>, tangential: Reg3<W>) {
        let (mass_i, mass_j) = (Reg::load(&law.inverse_mass_i), Reg::load(&law.inverse_mass_j));
        let force = n.scale(normal) + tangential;
        let twist = n.cross(tangential).scale(Reg::splat(INVERSE_INERTIA));
        self.v_i = self.v_i + force.scale(mass_i);
        self.v_j = self.v_j - force.scale(mass_j);
        self.w_i = self.w_i - twist.scale(mass_i);
        self.w_j = self.w_j - twist.scale(mass_j);
    }

    /// Applies rolling impulses.
    #[inline(always)]
    pub fn roll(&mut self, law: &LawLanes, rolling: Reg3<W>) {
        let (mass_i, mass_j) = (Reg::load(&law.inverse_mass_i), Reg::load(&law.inverse_mass_j));
        let step = rolling.scale(Reg::splat(INVERSE_INERTIA));
        self.w_i = self.w_i + step.scale(mass_i * Reg::load(&law.lever_i));
        self.w_j = self.w_j - step.scale(mass_j * Reg::load(&law.lever_j));
    }
}

impl<W: Width> Impulses<W> {
    #[inline(always)]
    fn load(batch: &Batch) -> Self {
        Self {
            closing: Reg::splat(0.0),
            n: Reg::load(&batch.lambda_n),
            t: Reg3::load(&batch.lambda_t),
            r: Reg3::load(&batch.lambda_r),
        }
    }
}

/// Solves each contact of a batch against the present velocities and puts the new ones back.
#[inline(always)]
fn solve_batch<W: Width>(
    batch: &mut Batch,
    law: &LawLanes,
    bias_t: Option<&Lanes3>,
    bodies: &SharedBodies<'_>,
    closing: &mut Reg<W>,
) {
    let mut velocities = Velocities::<W>::gather(batch, bodies);
    let solved = local_solution(batch, law, bias_t, Impulses::load(batch), &mut velocities);
    *closing = closing.max(solved.closing);
    solved.n.store(&mut batch.lambda_n);
    solved.t.store(&mut batch.lambda_t);
    solved.r.store(&mut batch.lambda_r);
    velocities.scatter(batch, bodies);
}

/// The exact solution of each contact of a batch by itself; updates the velocities to match.
#[inline(always)]
fn local_solution<W: Width>(
    batch: &Batch,
    law: &LawLanes,
    bias_t: Option<&Lanes3>,
    old: Impulses<W>,
    velocities: &mut Velocities<W>,
) -> Impulses<W> {
    let n = Reg3::load(&batch.normal);
    let Velocities { v_i, w_i, v_j, w_j } = *velocities;
    let compliance_n = Reg::load(&law.compliance_n);
    let compliance_t = compliance_n * Reg::splat(1.0 / TANGENTIAL_INERTIA);

    let dv = v_i - v_j;
    let w_n = n.dot(dv);
    let zero = Reg::splat(0.0);
    let closing = zero - (w_n + Reg::load(&batch.bias));
    let lambda_n = (old.n + closing * compliance_n).max(zero);

    let mut u_t = dv + n.cross(w_i + w_j) - n.scale(w_n);
    if let Some(bias_t) = bias_t {
        u_t = u_t + Reg3::load(bias_t);
    }
    let limit = Reg::load(&law.sliding_friction) * lambda_n;
    let lambda_t = project_ball(old.t - u_t.scale(compliance_t), limit);

    velocities.push(law, &n, lambda_n - old.n, lambda_t - old.t);

    // At a wall the tangential impulse has just changed the rolling velocity: take it afresh.
    let Velocities { w_i, w_j, .. } = *velocities;
    let rho = w_i.scale(Reg::load(&law.lever_i)) - w_j.scale(Reg::load(&law.lever_j));
    let limit = Reg::load(&law.rolling_friction) * lambda_n;
    let lambda_r = project_ball(old.r - rho.scale(Reg::load(&law.compliance_r)), limit);
    velocities.roll(law, lambda_r - old.r);
    Impulses { closing, n: lambda_n, t: lambda_t, r: lambda_r }
}

#[inline(always)]
pub(super) fn scatter<W: Width>(
    index: &[u32; LANES],
    bodies: &SharedBodies<'_>,
    v: Reg3<W>,
    w: Reg3<W>,
) {
    let zero = W::splat(0.0);
    let rows = W::transpose([v.x.0, v.y.0, v.z.0, zero, w.x.0, w.y.0, w.z.0, zero]);
    for lane in 0..LANES {
        bodies.store::<W>(index[lane], rows[lane]);
    }
}

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
            sums.add(set, bodies);
        }
        sums
    }

    /// Adds the contacts of `set`: how far its own exact solution would still move each impulse.
    pub fn add(&mut self, set: &ContactSet, bodies: &mut [Body]) {
        residual_lanes(set, bodies, &mut self.squares, &mut self.impulses);
    }

    /// Sum of the squares of the residual `[m^2/s^2]`.
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
    fn residual_lanes<W>(
        set: &ContactSet,
        bodies: &mut [Body],
        squares: &mut f64,
        impulses: &mut f64,
    ) {
        let bodies = SharedBodies::new(bodies);
        for (number, batch) in set.batches.iter().enumerate() {
            let law = &set.laws[batch.law as usize];
            let old = Impulses::<W>::load(batch);
            let mut velocities = Velocities::gather(batch, &bodies);
            let new = local_solution(batch, law, set.bias_t.get(number), old, &mut velocities);
            let (n, t, r) = (new.n - old.n, new.t - old.t, new.r - old.r);
            let (mut square, mut impulse) = (Lanes::ZERO, Lanes::ZERO);
            (n * n + t.dot(t) + r.dot(r)).store(&mut square);
            (old.n * old.n).store(&mut impulse);
            // Lane after lane, so that every width sums in the same order; empty lanes hold zeros.
            for lane in batch.lanes() {
                *squares += square.0[lane];
                *impulses += impulse.0[lane];
            }
        }
    }
}
