//! Non-smooth Newton on a matrix-free conjugate residual solver (Macklin et al. 2019), guarded.
//!
//! docs/theory/solvers.md, box 2:
//!
//! ```text
//! repeat `outer` times
//!     S, f    <- the rows of complementarity at lambda, v
//!     d       <- `inner` iterations of PCR on (J M^-1 J^T + S) d = f
//!     lambda  <- lambda + relaxation d,  v <- v + relaxation M^-1 J^T d       guarded
//! lambda <- projection on the cones,  v to match
//! ```

use granulcal_scene::{Complementarity, NewtonSettings};

use complementarity::Rows;

use crate::body::Body;
use crate::contact_set::ContactSet;
use crate::law::TANGENTIAL_INERTIA;
use crate::parallel::Threads;
use crate::solver::components::{
    Components, Parts, add_scaled, batches, collect, impulses, scale_and_add, spread,
};
use crate::solver::newton_pcr::guard::Guard;
use crate::solver::pcr::{Diagonal, System};
use crate::solver::solve_info::SolveInfo;

mod complementarity;
mod guard;

/// Runs `settings.outer` guarded Newton steps; the work is unconverged if a contact still closes faster than
/// `too_fast` `[m/s]`.
pub(super) fn solve(
    sets: &mut [&mut ContactSet],
    bodies: &mut [Body],
    settings: &NewtonSettings,
    too_fast: f64,
    threads: &Threads,
) -> SolveInfo {
    let mut work = SolveInfo::default();
    let mut guard = Guard::new(sets, bodies, threads);
    let mut velocities = vec![Components::ZERO; batches(sets).count()];
    for _ in 0..settings.outer {
        collect(sets, bodies, &mut velocities);
        let mut system = linearise(sets, &velocities, settings.complementarity);
        work.sweeps += system.solve(sets, bodies.len(), settings.inner);
        let mut step = vec![Components::ZERO; velocities.len()];
        add_scaled(&mut step, settings.relaxation, &system.unknown);
        guard.advance(sets, bodies, &step);
    }
    project(sets, bodies);
    guard.conclude(sets, bodies);
    work.sweeps += guard.sweeps;
    work.guarded = guard.acted;
    work.closing = closing(sets, bodies, &mut velocities);
    work.unconverged = work.closing > too_fast;
    work
}

/// The Newton system at the present impulses and the `velocities` of the contacts.
fn linearise(
    sets: &[&mut ContactSet],
    velocities: &[Components],
    complementarity: Complementarity,
) -> System {
    let mut system = System::default();
    for ((set, number), velocities) in batches(sets).zip(velocities) {
        let (mut shift, mut inverse) = (Diagonal::ZERO, Diagonal::ZERO);
        let (mut right, mut unknown) = (Components::ZERO, Components::ZERO);
        let batch = &set.batches[number];
        let law = &set.laws[batch.law as usize];
        let impulses = Components::of(batch);
        for lane in batch.lanes() {
            let (velocity, impulse) = (velocities.get(lane), impulses.get(lane));
            let stiffness_n = 1.0 / law.compliance_n.0[lane];
            let stiffness_t = TANGENTIAL_INERTIA * stiffness_n;
            let stiffness_r = 1.0 / law.compliance_r.0[lane];
            let a = velocity.normal + batch.bias.0[lane];
            let normal = complementarity.normal(a, impulse.normal, stiffness_n);
            // The slowness that friction opposes, with W as its resistance; `None`: nothing to hold on to.
            let friction = |u: f64, lambda: f64, coefficient: f64, stiffness: f64| {
                let limit = coefficient * impulse.normal.max(0.0);
                complementarity.friction(u, lambda, limit, stiffness)
            };
            let (u_t, lambda_t) = (velocity.tangential, impulse.tangential);
            let mu_s = law.sliding_friction.0[lane];
            let slide = friction(norm(u_t), norm(lambda_t), mu_s, stiffness_t);
            let (rho, lambda_r) = (velocity.rolling, impulse.rolling);
            let mu_r = law.rolling_friction.0[lane];
            let roll = friction(norm(rho), norm(lambda_r), mu_r, stiffness_r);
            let (about, torsion) = (velocity.torsion, impulse.torsion);
            let mu_t = law.torsional_friction.0[lane];
            let spin = friction(about.abs(), torsion.abs(), mu_t, stiffness_r);

            let (f_n, x_n) = normal.map_or((0.0, -impulse.normal), |(_, f)| (f, 0.0));
            let (f_t, x_t) = friction_row(slide, u_t, lambda_t);
            let (f_r, x_r) = friction_row(roll, rho, lambda_r);
            let ([f_s], [x_s]) = friction_row(spin, [about], [torsion]);
            let row = |normal, tangential, rolling, torsion| Parts {
                normal,
                tangential,
                rolling,
                torsion,
            };
            right.set(lane, &row(f_n, f_t, f_r, f_s));
            unknown.set(lane, &row(x_n, x_t, x_r, x_s));
            let rows = [
                (normal.map(|(shift, _)| shift), stiffness_n),
                (slide, stiffness_t),
                (roll, stiffness_r),
                (spin, stiffness_r),
            ];
            for (part, (s, stiffness)) in rows.into_iter().enumerate() {
                shift.0[part].0[lane] = s.unwrap_or(0.0);
                inverse.0[part].0[lane] = s.map_or(0.0, |s| 1.0 / (stiffness + s));
            }
        }
        system.shift.push(shift);
        system.inverse.push(inverse);
        system.right.push(right);
        system.unknown.push(unknown);
    }
    system
}

/// Right side and first guess of the row `(A + W) d = -(u + W lambda)`; without a W, `d = -lambda`.
fn friction_row<const AXES: usize>(
    weight: Option<f64>,
    u: [f64; AXES],
    lambda: [f64; AXES],
) -> ([f64; AXES], [f64; AXES]) {
    match weight {
        Some(weight) => {
            (std::array::from_fn(|axis| -(u[axis] + weight * lambda[axis])), [0.0; AXES])
        }
        None => ([0.0; AXES], lambda.map(|component| -component)),
    }
}

/// Puts every impulse on its cone and the velocities to match.
fn project(sets: &mut [&mut ContactSet], bodies: &mut [Body]) {
    let mut moved = impulses(sets);
    for set in sets.iter_mut() {
        for batch in &mut set.batches {
            let law = &set.laws[batch.law as usize];
            let mut projected = Components::ZERO;
            let impulses = Components::of(batch);
            for lane in batch.lanes() {
                let Parts { normal, tangential, rolling, torsion } = impulses.get(lane);
                let lambda_n = normal.max(0.0);
                let on_ball = |lambda: [f64; 3], coefficient: f64| {
                    let (limit, norm) = (coefficient * lambda_n, norm(lambda));
                    let factor = if norm > limit { limit / norm } else { 1.0 };
                    lambda.map(|component| factor * component)
                };
                let limit = law.torsional_friction.0[lane] * lambda_n;
                let parts = Parts {
                    normal: lambda_n,
                    tangential: on_ball(tangential, law.sliding_friction.0[lane]),
                    rolling: on_ball(rolling, law.rolling_friction.0[lane]),
                    torsion: torsion.min(limit).max(-limit),
                };
                projected.set(lane, &parts);
            }
            projected.put(batch);
        }
    }
    scale_and_add(&mut moved, -1.0, &impulses(sets));
    spread(sets, &moved, bodies);
}

/// Fastest closing `-(w_n + b)` of any contact `[m/s]`.
fn closing(sets: &[&mut ContactSet], bodies: &mut [Body], velocities: &mut [Components]) -> f64 {
    collect(sets, bodies, velocities);
    let mut fastest = 0.0_f64;
    for ((set, number), velocities) in batches(sets).zip(&*velocities) {
        let batch = &set.batches[number];
        for lane in batch.lanes() {
            fastest = fastest.max(-(velocities.get(lane).normal + batch.bias.0[lane]));
        }
    }
    fastest
}

fn norm(vector: [f64; 3]) -> f64 {
    vector.iter().map(|component| component * component).sum::<f64>().sqrt()
}
