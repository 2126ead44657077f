//! The methods against closed forms of one contact and against each other.

use granulcal_scene::{Complementarity, NewtonSettings, Preset, ReferenceSettings};
use proptest::prelude::*;

use super::*;
use crate::blocks::Blocks;
use crate::contact::{ContactKey, ContactLaw};
use crate::contact_set::{BodyKind, Laws};
use crate::lanes::Row;
use crate::solver::residual::ResidualSums;
use crate::{Material, Scene, Simulation};

/// One contact between grains 0 and 1, or of grain 0 at a wall, with the normal z.
fn contact(at_wall: bool, bias: f64, law: ContactLaw) -> ContactSet {
    let mut set = ContactSet::default();
    let listed = [ContactKey { i: 0, partner: u32::from(!at_wall) }];
    let second = if at_wall { BodyKind::RestingWall } else { BodyKind::Grain };
    set.rebuild(&listed, &Blocks::default(), 2, second, &Laws::Each(|_: &ContactKey| law));
    set.batches[0].normal.set(0, [0.0, 0.0, 1.0]);
    set.batches[0].bias.0[0] = bias;
    set
}

fn law(sliding_friction: f64, rolling_friction: f64) -> ContactLaw {
    ContactLaw {
        inverse_mass: [1.0, 1.0],
        lever: [0.5, 0.5],
        sliding_friction,
        rolling_friction,
        torsional_friction: 0.0,
        compliance: 0.0,
        rolling_speed: 0.0,
    }
}

/// A grain of mass 1/2 at a wall.
fn wall_law(sliding_friction: f64, rolling_friction: f64) -> ContactLaw {
    let law = law(sliding_friction, rolling_friction);
    ContactLaw { inverse_mass: [2.0, 0.0], lever: [1.0, 0.0], ..law }
}

fn body(velocity: [f64; 3], spin: [f64; 3]) -> Body {
    let row = |[x, y, z]: [f64; 3]| Row([x, y, z, 0.0]);
    Body { velocity: row(velocity), spin: row(spin) }
}

/// Every method, iterated until nothing but rounding is left; Newton with either equation.
fn thorough() -> Vec<SolverSettings> {
    let base = Preset::Default.settings();
    let newton = |complementarity| SolverSettings {
        method: Method::NewtonPcr,
        newton: NewtonSettings { outer: 400, inner: 20, relaxation: 1.0, complementarity },
        ..base
    };
    let reference = ReferenceSettings { residual: 1e-13, max_sweeps: 4000 };
    vec![
        SolverSettings { sweeps: 400, max_sweeps: 400, settled: f64::MIN_POSITIVE, ..base },
        SolverSettings { method: Method::Reference, reference, ..base },
        newton(Complementarity::FischerBurmeister),
        newton(Complementarity::MinMap),
    ]
}

/// Solves `set` from `bodies` (the last of which rests) and returns both.
fn solved(
    set: &ContactSet,
    bodies: &[Body],
    settings: &SolverSettings,
) -> (ContactSet, Vec<Body>, SolveInfo) {
    let (mut set, mut bodies) = (set.clone(), bodies.to_vec());
    let work = solve(&mut [&mut set], &mut bodies, settings, None, 2e-3, None, &Threads::default());
    (set, bodies, work)
}

#[test]
fn words_round_trip() {
    for method in Method::ALL {
        assert_eq!(method.to_string().parse::<Method>().expect("its own word"), method);
        let toml = toml::Value::try_from(method).expect("a word");
        assert_eq!(toml.as_str(), Some(method.name()));
        assert_eq!(toml.try_into::<Method>().expect("its own word"), method);
    }
    let error = "jacobi".parse::<Method>().expect_err("no such method").to_string();
    assert!(["jacobi", "nsgs", "newton_pcr", "reference"].iter().all(|word| error.contains(word)));
}

#[test]
fn a_frictionless_impact_leaves_with_its_bias() {
    // w_n + b = 0 behind it: lambda_n = (approach - b) / A_n with A_n = 2.
    let set = contact(true, -0.5, wall_law(0.0, 0.0));
    let bodies = [body([0.3, 0.0, -1.0], [0.0; 3]), Body::default(), Body::default()];
    for settings in thorough() {
        let (set, bodies, _) = solved(&set, &bodies, &settings);
        assert!((set.batches[0].lambda_n.0[0] - 0.75).abs() < 1e-14, "{}", settings.method);
        assert!((bodies[0].velocity.0[2] - 0.5).abs() < 1e-14);
        assert_eq!(bodies[0].velocity.0[0], 0.3);
    }
}

#[test]
fn an_open_contact_has_no_impulse_whatever_it_began_with() {
    let mut set = contact(true, 2.0, wall_law(0.5, 0.5));
    set.batches[0].lambda_n.0[0] = 0.25;
    set.batches[0].lambda_t.set(0, [0.1, 0.0, 0.0]);
    let bodies = [body([0.0, 0.0, -1.0], [0.0; 3]), Body::default(), Body::default()];
    for settings in thorough() {
        let (set, bodies, _) = solved(&set, &bodies, &settings);
        assert_eq!(set.batches[0].lambda_n.0[0], 0.0);
        assert_eq!(set.batches[0].lambda_t.get(0), [0.0; 3]);
        for (got, expected) in bodies[0].velocity.0.iter().zip([0.0, 0.0, -1.0, 0.0]) {
            assert!((got - expected).abs() < 1e-14, "{}: {:?}", settings.method, bodies[0]);
        }
        assert!(bodies[0].spin.0[1].abs() < 1e-14, "{}: {:?}", settings.method, bodies[0]);
    }
}

#[test]
fn a_sliding_pair_sticks_or_slips() {
    // Equal grains, A_n = 2, A_t = 7: to stick takes u_t / 7 = 0.2, and lambda_n = 1 / 2.
    let bodies = [body([1.4, 0.0, -1.0], [0.0; 3]), Body::default(), Body::default()];
    for (friction, expected) in [(0.8, 0.2), (0.3, 0.15)] {
        let set = contact(false, 0.0, law(friction, 0.0));
        for settings in thorough() {
            let (set, after, _) = solved(&set, &bodies, &settings);
            let lambda_t = set.batches[0].lambda_t.get(0);
            assert!((set.batches[0].lambda_n.0[0] - 0.5).abs() < 1e-12);
            assert!((lambda_t[0] + expected).abs() < 1e-12, "{}: {lambda_t:?}", settings.method);
            assert!((after[0].velocity.0[0] - (1.4 - expected)).abs() < 1e-12);
            // v_i += lambda_t, w -= 5/2 n x lambda_t for both grains.
            assert!((after[1].spin.0[1] - 2.5 * expected).abs() < 1e-12);
        }
    }
}

#[test]
fn a_spinning_grain_stops_or_is_braked_about_the_normal() {
    // Equal grains: rho = 1/2, A_r = 5/4, to stop takes 0.4. At a wall: rho = 1, A_r = 5, 0.2. lambda_n = 1 / 2.
    let bodies = [body([0.0, 0.0, -1.0], [0.0, 0.0, 1.0]), Body::default(), Body::default()];
    for (at_wall, to_stop) in [(false, 0.4), (true, 0.2)] {
        for (torsional_friction, rolling_friction) in [(0.9, 0.0), (0.3, 0.5), (0.0, 0.5)] {
            let law =
                if at_wall { wall_law(0.5, rolling_friction) } else { law(0.5, rolling_friction) };
            let law = ContactLaw { torsional_friction, ..law };
            let expected = f64::min(to_stop, 0.5 * torsional_friction);
            for settings in thorough() {
                let (set, after, _) = solved(&contact(at_wall, 0.0, law), &bodies, &settings);
                let [x, y, torsion] = set.batches[0].lambda_r.get(0);
                assert!((torsion + expected).abs() < 1e-12, "{}: {torsion}", settings.method);
                assert_eq!((x, y), (0.0, 0.0));
                // w_i += 5/2 c_i l_i lambda_r, w_j -= 5/2 c_j l_j lambda_r.
                let turn = if at_wall { 5.0 * expected } else { 1.25 * expected };
                assert!((after[0].spin.0[2] - (1.0 - turn)).abs() < 1e-12);
                let other = if at_wall { 0.0 } else { turn };
                assert!((after[1].spin.0[2] - other).abs() < 1e-12);
            }
        }
    }
}

#[test]
fn relaxed_newton_steps_leave_a_quarter_each() {
    // A closing contact stays active: each step of 0.75 leaves a quarter of what was left.
    let set = contact(true, 0.0, wall_law(0.0, 0.0));
    let bodies = [body([0.0, 0.0, -1.0], [0.0; 3]), Body::default(), Body::default()];
    for outer in 1..6 {
        let newton = NewtonSettings {
            outer,
            complementarity: Complementarity::MinMap,
            ..NewtonSettings::default()
        };
        let settings =
            SolverSettings { method: Method::NewtonPcr, newton, ..Preset::Paper.settings() };
        let (_, bodies, work) = solved(&set, &bodies, &settings);
        let left = 0.25_f64.powi(outer as i32);
        assert!((bodies[0].velocity.0[2] + left).abs() < 1e-14, "{outer}: {:?}", bodies[0]);
        assert!((work.closing - left).abs() < 1e-14);
        assert_eq!(work.guarded, 0);
    }
}

#[test]
fn newton_begins_with_nothing_that_is_not_finite() {
    // Grains exactly on their constraints, without impulses or motion: every psi and W is 0/0.
    let set = contact(false, 0.0, law(0.5, 0.5));
    for settings in thorough() {
        let (set, bodies, _) = solved(&set, &[Body::default(); 3], &settings);
        assert_eq!(bodies, [Body::default(); 3]);
        assert_eq!(set.batches[0].lambda_n.0[0], 0.0);
    }
}

#[test]
fn newton_never_ends_worse_than_it_began() {
    let mut scene = Scene::drop(0.01);
    scene.grains.count = 80;
    scene.preset = Preset::Paper;
    for (restitution, seconds) in [(0.3, 0.1), (0.9, 0.06)] {
        scene.material = Material::new(0.5, 0.2, restitution).expect("a valid material");
        let mut pour = Simulation::new(&scene, 1).expect("a valid scene");
        pour.advance(seconds);
        let problem = pour.frozen_solve().unwrap();
        for complementarity in [Complementarity::FischerBurmeister, Complementarity::MinMap] {
            for outer in [1, 2, 4, 16, 64] {
                let newton = NewtonSettings { outer, complementarity, ..NewtonSettings::default() };
                let settings = SolverSettings { newton, ..Preset::Paper.settings() };
                let [before, after] = problem.merits(&settings);
                assert!(after < before, "{complementarity:?} {outer}: {after} after {before}");
            }
        }
    }
}

#[test]
fn a_state_that_is_not_finite_ends_the_solve_all_the_same() {
    let set = contact(false, 0.0, law(0.5, 0.5));
    let bodies = [body([f64::NAN; 3], [0.0; 3]), Body::default(), Body::default()];
    for settings in thorough() {
        let (_, _, work) = solved(&set, &bodies, &settings);
        assert!(work.sweeps > 0);
    }
}

proptest! {
    #[test]
    fn every_method_solves_a_contact_of_any_kind(
        at_wall in any::<bool>(), radius in 0.3f64..3.0,
        mu_s in 0f64..1.0, mu_r in 0f64..1.0, mu_t in prop_oneof![Just(0.0), 0f64..1.0],
        v in prop::array::uniform3(-1f64..1.0), w in prop::array::uniform3(-1f64..1.0),
    ) {
        // Grain 1 is `radius` times as large as grain 0, of the same stuff; the wall is at rest.
        let mass = radius * radius * radius;
        let (inverse_mass, lever) = if at_wall {
            ([1.0, 0.0], [1.0, 0.0])
        } else {
            ([1.0, 1.0 / mass], [radius / (1.0 + radius), 1.0 / (1.0 + radius)])
        };
        let law = ContactLaw { inverse_mass, lever, torsional_friction: mu_t, ..law(mu_s, mu_r) };
        let set = contact(at_wall, -0.2, law);
        let bodies = [body(v, w), body([0.0, 0.0, 1.0], [0.1, -0.2, 0.3]), Body::default()];
        for settings in thorough() {
            let (mut set, mut after, _) = solved(&set, &bodies, &settings);
            let residual = ResidualSums::of(&[&mut set], &mut after);
            // W lags behind the impulses: where sliding and rolling couple, Newton converges only linearly.
            let bound = if settings.method == Method::NewtonPcr { 1e-3 } else { 1e-12 };
            prop_assert!(residual.is_below(bound), "{}: {residual:?}", settings.method);
            let batch = &set.batches[0];
            let ([x, y, torsion], lambda_n) = (batch.lambda_r.get(0), batch.lambda_n.0[0]);
            prop_assert!(x.hypot(y) <= mu_r * lambda_n + 1e-12);
            prop_assert!(torsion.abs() <= mu_t * lambda_n + 1e-12);
            if at_wall {
                prop_assert_eq!(after[1], bodies[1]);
                prop_assert_eq!(after[2], Body::default());
                continue;
            }
            let momentum = |bodies: &[Body], axis: usize| {
                bodies[0].velocity.0[axis] + mass * bodies[1].velocity.0[axis]
            };
            for axis in 0..3 {
                let change = momentum(&after, axis) - momentum(&bodies, axis);
                prop_assert!(change.abs() < 1e-12 * (1.0 + mass), "{axis}: {change}");
            }
        }
    }
}

/// A row of grains in many blocks, at each other or at a wall, with velocities that nothing orders.
fn row_of_grains(at_wall: bool) -> (ContactSet, Vec<Body>) {
    const GRAINS: u32 = 200;
    let second = if at_wall { BodyKind::RestingWall } else { BodyKind::Grain };
    let radius = 1e-3;
    let points: Vec<_> = (0..GRAINS)
        .map(|n| nalgebra::Vector3::new(2.0 * radius * f64::from(n), 0.0, 0.0))
        .collect();
    let mut blocks = Blocks::default();
    blocks.place(&points, 2.0 * radius, radius, &[]);
    let listed: Vec<_> = (0..GRAINS - u32::from(!at_wall))
        .map(|i| ContactKey { i, partner: if at_wall { 0 } else { i + 1 } })
        .collect();
    let law = if at_wall { wall_law(0.5, 0.1) } else { law(0.5, 0.1) };
    let mut set = ContactSet::default();
    set.rebuild(&listed, &blocks, GRAINS as usize, second, &Laws::Each(|_: &ContactKey| law));
    let along = if at_wall { [0.0, 0.0, 1.0] } else { [-1.0, 0.0, 0.0] };
    for batch in &mut set.batches {
        (0..batch.used as usize).for_each(|lane| batch.normal.set(lane, along));
    }
    let speed = |n: u32| (f64::from(n) * 0.7).sin();
    let moving = (0..GRAINS).map(|n| {
        let v = [speed(n), speed(3 * n + 1), speed(5 * n + 2)];
        body(v, [speed(7 * n), 0.5 * speed(2 * n), 0.0])
    });
    (set, moving.chain([Body::default()]).collect())
}

#[test]
fn threads_that_share_bodies_change_no_bit() {
    let settings = SolverSettings { sweeps: 3, max_sweeps: 3, ..Preset::Default.settings() };
    for at_wall in [false, true] {
        let (set, bodies) = row_of_grains(at_wall);
        let after = |threads: usize| {
            let (mut set, mut bodies) = (set.clone(), bodies.clone());
            let threads = Threads::new(threads).unwrap();
            solve(&mut [&mut set], &mut bodies, &settings, None, 2e-3, None, &threads);
            bodies
        };
        let alone = after(1);
        // Half of those at the wall leave it, and stay as they were.
        assert!(alone[..200].iter().zip(&bodies).filter(|(a, b)| a != b).count() > 60);
        assert_eq!(alone, after(2));
        assert_eq!(alone, after(3));
    }
}
