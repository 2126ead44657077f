//! Non-smooth Gauss-Seidel: sweeps over the contacts, each solved exactly against the present velocities.
//!
//! For each contact in turn (docs/theory/contact.md, box 2):
//!
//! ```text
//! lambda_n <- max(0, lambda_n - (w_n + b) / A_n)
//! lambda_t <- projection on |.| <= mu_s lambda_n of lambda_t - u_t / A_t
//! lambda_r <- lambda_r - rho / A_r: its part across n projected on |.| <= mu_r lambda_n,
//!             its part along n on |.| <= mu_t lambda_n
//! ```
//!
//! Equal spheres make the contact's own Delassus block diagonal, so this is its exact solution; at walls and
//! between unequal spheres sliding and rolling couple, and the three lines are one pass inside the contact.
//! Contacts of a batch share no grain: the order within a batch cannot change a bit.

use granulcal_scene::SolverSettings;

use crate::body::{Body, SharedBodies};
use crate::clumps::Clumps;
use crate::contact::{Batch, LawLanes};
use crate::contact_set::ContactSet;
use crate::lanes::{Lanes, Reg, Reg3, Width, widest};
use crate::law::{TANGENTIAL_INERTIA, project_ball};
use crate::parallel::Threads;
use crate::solver::solve_info::SolveInfo;
use crate::solver::velocities::Velocities;

/// How far a sweep still was from the end.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Progress {
    /// Fastest closing `-(w_n + b)` that a contact had when its turn came `[m/s]`.
    pub closing: f64,
    /// Largest change of the impulses of a contact `[m/s]`.
    pub change: f64,
}

impl Progress {
    fn max(self, other: Self) -> Self {
        Self { closing: self.closing.max(other.closing), change: self.change.max(other.change) }
    }
}

/// Sweeps over all contacts: at least `settings.sweeps` times unless the impulses have settled, and until none closes
/// too fast, but no more than `settings.max_sweeps` times. In a quiet state at least `settings.quiet_sweeps` times
/// unless the impulses change by less than `quiet_tolerance` `[m/s]`.
pub(crate) fn solve(
    sets: &mut [&mut ContactSet],
    bodies: &mut [Body],
    settings: &SolverSettings,
    quiet_tolerance: Option<f64>,
    radius: f64,
    mut clumps: Option<&mut Clumps>,
    threads: &Threads,
) -> SolveInfo {
    let too_fast = settings.closing * radius / settings.dt;
    let settled = settings.settled * radius / settings.dt;
    let mut work = SolveInfo::default();
    let (mut has_settled, mut has_stopped) = (false, false);
    let mut join = |bodies: &mut [Body]| {
        if let Some(clumps) = &mut clumps {
            clumps.join(bodies);
        }
    };
    join(bodies);
    for sweeps in 1..=settings.max_sweeps {
        // The last sweeps are plain ones: they leave a contact by itself exactly solved.
        let asked =
            if quiet_tolerance.is_none() || has_stopped { 0 } else { settings.quiet_sweeps };
        let is_enough = has_settled || sweeps >= settings.sweeps.max(asked);
        let relaxation = if is_enough { 1.0 } else { settings.relaxation };
        let Progress { closing, change } =
            sweep(sets, bodies, SweepOptions::relaxed(relaxation), threads);
        join(bodies);
        work = SolveInfo { sweeps, closing, ..work };
        if is_enough && closing <= too_fast {
            return work;
        }
        has_settled = change <= settled;
        has_stopped = quiet_tolerance.is_some_and(|tolerance| change <= tolerance);
    }
    SolveInfo { unconverged: work.closing > too_fast, ..work }
}

/// Sweeps `count` times, from velocities that contain the impulses.
pub(crate) fn sweep_plainly(sets: &mut [&mut ContactSet], bodies: &mut [Body], count: usize) {
    for _ in 0..count {
        sweep(sets, bodies, SweepOptions::relaxed(1.0), &Threads::default());
    }
}

/// How a sweep treats the contacts.
#[derive(Clone, Copy, Debug)]
pub(super) struct SweepOptions {
    /// Over-relaxation `[-]`.
    relaxation: f64,
    /// Whether a batch that stays open is passed over.
    passes_over: bool,
}

impl SweepOptions {
    /// Exact local solutions, from impulses that the steps of another method may have taken off their cones.
    pub const EXACT: Self = Self { relaxation: 1.0, passes_over: false };

    /// From impulses on their cones: where there is no normal impulse there is none.
    fn relaxed(relaxation: f64) -> Self {
        Self { relaxation, passes_over: true }
    }
}

/// Whether the second body of every contact of a set rests and need not be read.
pub(super) fn is_at_rest(set: &ContactSet) -> bool {
    set.is_at_walls() && !set.has_wall_bodies()
}

/// One sweep over the sets in their order.
pub(super) fn sweep(
    sets: &mut [&mut ContactSet],
    bodies: &mut [Body],
    options: SweepOptions,
    threads: &Threads,
) -> Progress {
    let mut worst = Progress::default();
    for set in sets {
        let kernel = match (set.is_soft(), is_at_rest(set)) {
            (true, _) => sweep_soft,
            (_, true) => sweep_walls,
            _ => sweep_pairs,
        };
        let sweep = |batches: &mut [Batch], laws: &[LawLanes], bodies: &SharedBodies<'_>| {
            kernel(batches, laws, bodies, options)
        };
        worst = worst.max(for_each_phase(set, bodies, threads, sweep));
    }
    worst
}

/// Adds what the impulses that the contacts of a set carry do to the velocities: the warm start.
pub(super) fn warm_start(set: &mut ContactSet, bodies: &mut [Body], threads: &Threads) {
    let kernel = if is_at_rest(set) { apply_walls } else { apply_pairs };
    for_each_phase(set, bodies, threads, kernel);
}

/// Calls `kernel` for the batches of every colour, in parts; returns the worst of its values. The batches of a
/// colour share no grain and may go to the threads in any order without changing a bit.
fn for_each_phase(
    set: &mut ContactSet,
    bodies: &mut [Body],
    threads: &Threads,
    kernel: impl Fn(&mut [Batch], &[LawLanes], &SharedBodies<'_>) -> Progress + Sync,
) -> Progress {
    // The kernels index the bodies without looking: the indices were made for as many.
    assert!(set.fits(bodies));
    let ContactSet { batches, laws, parts, phases, .. } = set;
    let bodies = SharedBodies::new(bodies);
    let mut largest = Progress::default();
    for phase in phases.iter() {
        let work = |batches: &mut [Batch]| kernel(batches, laws, &bodies);
        largest = largest.max(threads.parts(batches, &parts[phase.clone()], work, Progress::max));
    }
    largest
}

widest! {
    fn sweep_pairs<W>(
        batches: &mut [Batch],
        laws: &[LawLanes],
        bodies: &SharedBodies<'_>,
        options: SweepOptions,
    ) -> Progress {
        sweep_batches::<W, false, false>(batches, laws, bodies, options)
    }
}

widest! {
    fn sweep_walls<W>(
        batches: &mut [Batch],
        laws: &[LawLanes],
        bodies: &SharedBodies<'_>,
        options: SweepOptions,
    ) -> Progress {
        sweep_batches::<W, true, false>(batches, laws, bodies, options)
    }
}

widest! {
    fn sweep_soft<W>(
        batches: &mut [Batch],
        laws: &[LawLanes],
        bodies: &SharedBodies<'_>,
        options: SweepOptions,
    ) -> Progress {
        sweep_batches::<W, true, true>(batches, laws, bodies, options)
    }
}

/// Solves batch after batch. `AT_WALLS`: the second body is the resting one, and stays so. `SOFT`: the contacts give
/// way.
#[inline(always)]
fn sweep_batches<W: Width, const AT_WALLS: bool, const SOFT: bool>(
    batches: &mut [Batch],
    laws: &[LawLanes],
    bodies: &SharedBodies<'_>,
    options: SweepOptions,
) -> Progress {
    let (mut closing, mut square) = (Reg::<W>::splat(0.0), Reg::<W>::splat(0.0));
    for batch in batches {
        let law = &laws[batch.law as usize];
        solve_batch::<W, AT_WALLS, SOFT>(batch, law, bodies, options, &mut closing, &mut square);
    }
    Progress { closing: largest(closing), change: largest(square).sqrt() }
}

widest! {
    fn apply_pairs<W>(batches: &mut [Batch], laws: &[LawLanes], bodies: &SharedBodies<'_>) -> Progress {
        apply_batches::<W, false>(batches, laws, bodies)
    }
}

widest! {
    fn apply_walls<W>(batches: &mut [Batch], laws: &[LawLanes], bodies: &SharedBodies<'_>) -> Progress {
        apply_batches::<W, true>(batches, laws, bodies)
    }
}

/// The largest lane, if it is positive.
#[inline(always)]
fn largest<W: Width>(value: Reg<W>) -> f64 {
    let mut lanes = Lanes::ZERO;
    value.store(&mut lanes);
    lanes.0.into_iter().fold(0.0, f64::max)
}

/// Adds what the impulses of each batch do to the velocities.
#[inline(always)]
fn apply_batches<W: Width, const AT_WALLS: bool>(
    batches: &mut [Batch],
    laws: &[LawLanes],
    bodies: &SharedBodies<'_>,
) -> Progress {
    let zero = Reg::<W>::splat(0.0);
    for batch in batches {
        let Impulses { n, t, r } = Impulses::load(batch);
        // Both friction impulses vanish with the normal one.
        if W::less_bits(zero.0, n.0) != 0 {
            let law = &laws[batch.law as usize];
            let mut velocities = Velocities::<W>::gather::<AT_WALLS>(batch, bodies);
            velocities.push(law, &Reg3::load(&batch.normal), n, t);
            velocities.roll(law, r);
            velocities.scatter::<AT_WALLS>(batch, bodies);
        }
    }
    Progress::default()
}

/// The impulses of each contact.
#[derive(Clone, Copy)]
pub(super) struct Impulses<W: Width> {
    pub n: Reg<W>,
    t: Reg3<W>,
    r: Reg3<W>,
}

impl<W: Width> Impulses<W> {
    #[inline(always)]
    pub fn load(batch: &Batch) -> Self {
        Self {
            n: Reg::load(&batch.lambda_n),
            t: Reg3::load(&batch.lambda_t),
            r: Reg3::load(&batch.lambda_r),
        }
    }

    /// `|lambda - old|^2` of all three impulses.
    #[inline(always)]
    pub fn square_of_change(&self, old: &Self) -> Reg<W> {
        let (n, t, r) = (self.n - old.n, self.t - old.t, self.r - old.r);
        n.times_plus(n, t.dot(t)) + r.dot(r)
    }

    #[inline(always)]
    fn store(&self, batch: &mut Batch) {
        self.n.store(&mut batch.lambda_n);
        self.t.store(&mut batch.lambda_t);
        self.r.store(&mut batch.lambda_r);
    }
}

/// Solves each contact of a batch against the present velocities and puts the new ones back.
#[inline(always)]
fn solve_batch<W: Width, const AT_WALLS: bool, const SOFT: bool>(
    batch: &mut Batch,
    law: &LawLanes,
    bodies: &SharedBodies<'_>,
    options: SweepOptions,
    fastest: &mut Reg<W>,
    largest_square: &mut Reg<W>,
) {
    let mut velocities = Velocities::<W>::gather::<AT_WALLS>(batch, bodies);
    let old = Impulses::load(batch);
    let closing = closing::<W, SOFT>(batch, law, &velocities);
    // A batch without impulses that stays open is left as it is.
    let zero = Reg::<W>::splat(0.0);
    let acting = W::less_bits(zero.0, old.n.0) | W::less_bits(zero.0, closing.0);
    if acting == 0 && options.passes_over {
        return;
    }
    let relaxation = Reg::splat(options.relaxation);
    let new = local_solution::<W, SOFT>(batch, law, closing, relaxation, old, &mut velocities);
    *fastest = fastest.max(closing);
    *largest_square = largest_square.max(new.square_of_change(&old));
    new.store(batch);
    velocities.scatter::<AT_WALLS>(batch, bodies);
}

/// How fast each contact closes against its constraint, `-(w_n + b)`; a soft one, `-(w_n + b + give lambda_n)`.
#[inline(always)]
pub(super) fn closing<W: Width, const SOFT: bool>(
    batch: &Batch,
    law: &LawLanes,
    velocities: &Velocities<W>,
) -> Reg<W> {
    let w_n = Reg3::load(&batch.normal).dot(velocities.v_i - velocities.v_j);
    let opening = w_n + Reg::load(&batch.bias);
    let opening = if SOFT {
        opening + Reg::load(&law.compliance) * Reg::load(&batch.lambda_n)
    } else {
        opening
    };
    Reg::splat(0.0) - opening
}

/// The exact solution of each contact of a batch by itself, or as much beyond it as `relaxation` exceeds 1,
/// on the cones; updates the velocities to match.
#[inline(always)]
pub(super) fn local_solution<W: Width, const SOFT: bool>(
    batch: &Batch,
    law: &LawLanes,
    closing: Reg<W>,
    relaxation: Reg<W>,
    old: Impulses<W>,
    velocities: &mut Velocities<W>,
) -> Impulses<W> {
    let n = Reg3::load(&batch.normal);
    let compliance_n = relaxation * Reg::load(&law.compliance_n);
    // Of a soft contact only the normal gives way.
    let compliance_t = if SOFT {
        relaxation.over(Reg::splat(TANGENTIAL_INERTIA) * Reg::load(&law.inverse_mass_i))
    } else {
        compliance_n * Reg::splat(1.0 / TANGENTIAL_INERTIA)
    };
    let lambda_n = closing.times_plus(compliance_n, old.n).max(Reg::splat(0.0));

    let Velocities { v_i, w_i, v_j, w_j } = *velocities;
    let dv = v_i - v_j;
    let u_t = (dv + n.cross(w_i + w_j)).minus(n.dot(dv), n);
    let limit = Reg::load(&law.sliding_friction) * lambda_n;
    let lambda_t = project_ball(old.t.minus(compliance_t, u_t), limit);
    velocities.push(law, &n, lambda_n - old.n, lambda_t - old.t);

    // Where sliding changes the rolling velocity take it afresh; elsewhere need not wait for the friction.
    let (w_i, w_j) = if law.couples { (velocities.w_i, velocities.w_j) } else { (w_i, w_j) };
    let rho = w_i.scale(Reg::load(&law.lever_i)).minus(Reg::load(&law.lever_j), w_j);
    let wanted = old.r.minus(relaxation * Reg::load(&law.compliance_r), rho);
    let about = n.dot(wanted);
    let limit = Reg::load(&law.rolling_friction) * lambda_n;
    let mut across = wanted.minus(about, n);
    if law.rolling_speed > 0.0 {
        let plain = old.r.minus(Reg::load(&law.compliance_r), rho);
        across = slow_rolling(law, limit, plain.minus(n.dot(plain), n));
    }
    let rolling = project_ball(across, limit);
    let limit = Reg::load(&law.torsional_friction) * lambda_n;
    let lambda_r = rolling.plus(about.min(limit).max(Reg::splat(0.0) - limit), n);
    velocities.roll(law, lambda_r - old.r);
    Impulses { n: lambda_n, t: lambda_t, r: lambda_r }
}

/// The rolling impulse that is `limit |rho| / v_0` where rolling would go on with `rho`, of the one that would stop it:
/// `lambda = -(limit / v_0) (rho + A_r (lambda - old))` has the solution `s (old - rho / A_r)`,
/// `s = limit / (limit + v_0 / A_r)`.
#[inline(always)]
fn slow_rolling<W: Width>(law: &LawLanes, limit: Reg<W>, stopping: Reg3<W>) -> Reg3<W> {
    let soft = Reg::splat(law.rolling_speed) * Reg::load(&law.compliance_r);
    // An empty lane has neither.
    stopping.scale(limit.over((limit + soft).max(Reg::splat(f64::MIN_POSITIVE))))
}
