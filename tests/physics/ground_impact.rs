//! One impact on the ground with sliding and rolling friction, against the exact path of both.
//!
//! In the plane, with the normal impulse p as the time, sliding u = v + W and rolling W (W = r omega, positive:
//! backwards) obey
//!
//!     v' = -a,    W' = -5/2 a - 5/2 b,    u' = -7/2 a - 5/2 b,    |a| <= mu_s,    |b| <= mu_r:
//!
//! a is mu_s sign(u) while u slides and what keeps u = 0 else, b is mu_r sign(W) while it rolls and what keeps W = 0
//! else (docs/theory/contact.md, Friction of an impact). Both are constant between changes.

use granulcal::dem::{GRAVITY, Material, Preset, SolverSettings};
use nalgebra::Vector3;

use crate::scenes::{Motion, RADIUS, material, motion, one_grain, start};

/// `[v, W]` after a normal impulse.
fn exact([mut v, mut w]: [f64; 2], mu_s: f64, mu_r: f64, impulse: f64) -> [f64; 2] {
    let mut left = impulse;
    for _ in 0..20 {
        let u = v + w;
        let (slides, rolls) = (u.abs() > 1e-12, w.abs() > 1e-12);
        let (a, b) = match (slides, rolls) {
            (true, true) => (mu_s * u.signum(), mu_r * w.signum()),
            // W' = 0 wants b = -a; if rolling friction cannot, it rolls against b.
            (true, false) => {
                let a = mu_s * u.signum();
                (a, (-a).clamp(-mu_r, mu_r))
            }
            // u' = 0 wants a = -5/7 b.
            (false, true) => {
                let b = mu_r * w.signum();
                ((-5.0 / 7.0 * b).clamp(-mu_s, mu_s), b)
            }
            (false, false) => return [v, w],
        };
        let (du, dw) = (-3.5 * a - 2.5 * b, -2.5 * a - 2.5 * b);
        let zero = |x: f64, dx: f64| if x * dx < -1e-15 { -x / dx } else { f64::INFINITY };
        let next = left.min(if slides { zero(u, du) } else { f64::INFINITY });
        let next = next.min(if rolls { zero(w, dw) } else { f64::INFINITY });
        v -= a * next;
        w += dw * next;
        left -= next;
        if left <= 1e-15 {
            break;
        }
    }
    [v, w]
}

/// The state after a sphere has met the ground at 1 m/s; `preset` settings with a step as small as the test wants.
fn impact(material: Material, [v, w]: [f64; 2]) -> Motion {
    let settings = SolverSettings { dt: 1e-3, ..Preset::Default.settings() };
    let mut scene = one_grain(RADIUS + 2.4e-3, material);
    scene.gravity = [0.0; 3];
    let mut simulation = start(&scene).with_settings(settings).expect("valid settings");
    let omega = Vector3::new(0.0, -w / RADIUS, 0.0);
    simulation.set_motion(0, Vector3::new(v, 0.0, -1.0), omega).expect("a valid motion");
    simulation.advance(8e-3);
    motion(&simulation, 0)
}

fn assert_exact(mu: [f64; 2], e: f64, before: [f64; 2], tolerance: f64) {
    let grain = impact(material(mu[0], mu[1], e), before);
    let [v, w] = exact(before, mu[0], mu[1], 1.0 + e);
    let error = (grain.v.x - v).abs().max((-grain.w.y - w).abs());
    assert!(error < tolerance, "mu {mu:?}, e {e}, {before:?}: {grain:?}, exact {v}, {w}");
}

#[test]
fn a_grain_that_has_stuck_does_not_slide_again() {
    // mu_s 0.5, mu_r 0.3, e 0.3: v and r omega (forward) before and after.
    let rows = [
        ([0.5, 0.0], [0.0786, 0.0786]),
        ([1.0, 0.0], [0.4357, 0.4357]),
        ([0.5, 0.5], [0.2214, 0.2214]),
        ([1.0, 1.0], [0.7214, 0.7214]),
        ([0.0, 0.4], [0.0, 0.0]),
    ];
    for ([v, forward], after) in rows {
        let grain = impact(material(0.5, 0.3, 0.3), [v, -forward]);
        let error = (grain.v.x - after[0]).abs().max((grain.w.y - after[1]).abs());
        assert!(error < 1e-3, "{v}, {forward}: {grain:?}");
    }
}

#[test]
fn sliding_and_rolling_share_the_spin_as_the_law_says() {
    for mu_s in [0.0, 0.1, 0.5, 1.0] {
        for mu_r in [0.0, 0.05, 0.3, 1.0, 3.0] {
            for e in [0.0, 0.3, 0.9] {
                for v in [0.0, 0.2, 1.0, 5.0] {
                    for w in [-3.0, -0.7, -0.2, 0.0, 0.1, 0.5, 2.0] {
                        assert_exact([mu_s, mu_r], e, [v, w], 1e-9);
                    }
                }
            }
        }
    }
}

#[test]
fn the_boundary_between_sticking_and_sliding_is_where_the_law_has_it() {
    // Rolling resistance holds the spin where mu_r >= mu_s: a grain without spin sticks below mu_s (1 + e). Where it
    // does not, u falls by (7/2 mu_s - 5/2 mu_r) (1 + e), the spin at the end turning forward.
    for (mu_s, mu_r) in [(0.5, 0.3), (0.5, 0.6), (0.3, 0.0), (0.8, 0.1)] {
        for e in [0.0, 0.3, 0.8] {
            let limit = (3.5 * mu_s - 2.5 * f64::min(mu_r, mu_s)) * (1.0 + e);
            for (share, sticks) in [(0.999, true), (1.001, false)] {
                let grain = impact(material(mu_s, mu_r, e), [share * limit, 0.0]);
                let slip = grain.v.x - grain.w.y;
                assert_eq!(slip.abs() < 1e-9, sticks, "{mu_s}, {mu_r}, {e}: {slip}");
            }
        }
    }
}

/// How far a lone grain comes that is thrown from a height `[m]` with `[v, W]`: flights, impacts by [`exact`], and the
/// rest of its way on the ground, whose normal impulse is g in a second.
fn run_out([mu_s, mu_r]: [f64; 2], e: f64, height: f64, thrown: [f64; 2]) -> f64 {
    const SLICE: f64 = 1e-5;
    let (mut now, mut way) = (thrown, thrown[0] * (2.0 * height / GRAVITY).sqrt());
    let mut closing = (2.0 * GRAVITY * height).sqrt();
    while closing > 0.0 {
        // Below 5 cm/s an impact gives nothing back.
        let rebound = if closing >= 0.05 { e } else { 0.0 };
        now = exact(now, mu_s, mu_r, (1.0 + rebound) * closing);
        closing *= rebound;
        way += now[0] * 2.0 * closing / GRAVITY;
    }
    while now != [0.0; 2] && now[0].abs().max(now[1].abs()) > 1e-9 {
        let next = exact(now, mu_s, mu_r, GRAVITY * SLICE);
        way += 0.5 * (now[0] + next[0]) * SLICE;
        now = next;
    }
    way
}

/// Impacts that solve sliding, then rolling, once let them run 1.2 to 2 times as far.
#[test]
fn a_hundred_lone_grains_run_out_as_far_as_the_law_says() {
    for (mu_s, mu_r, e) in
        [(0.5, 0.3, 0.3), (0.5, 0.15, 0.3), (0.8, 0.3, 0.15), (0.4, 0.3, 0.5), (0.5, 0.6, 0.3)]
    {
        let (mut mean, mut law) = (0.0, 0.0);
        for number in 0..100 {
            // Heights, speeds and spins that fill their ranges evenly.
            let share = |step: f64| (0.5 + step * f64::from(number)).fract();
            let height = 0.02 + 0.06 * share(0.618_034);
            let thrown = [0.2 + 0.6 * share(0.754_878), -0.5 + share(0.569_840)];
            let mut simulation = start(&one_grain(RADIUS + height, material(mu_s, mu_r, e)));
            let omega = Vector3::new(0.0, -thrown[1] / RADIUS, 0.0);
            simulation
                .set_motion(0, Vector3::new(thrown[0], 0.0, 0.0), omega)
                .expect("a valid motion");
            let from = simulation.positions()[0].x;
            simulation.advance(2.5);
            let (way, exact) =
                (simulation.positions()[0].x - from, run_out([mu_s, mu_r], e, height, thrown));
            assert!((way - exact).abs() < 0.02 * exact.abs() + 2e-4, "{number}: {way}, {exact}");
            mean += way / 100.0;
            law += exact / 100.0;
        }
        println!(
            "mu_s {mu_s}, mu_r {mu_r}, e {e}: {:.2} mm, {:.2} by the law",
            1e3 * mean,
            1e3 * law
        );
        assert!((mean / law - 1.0).abs() < 0.005, "{mean}, {law}");
    }
}
