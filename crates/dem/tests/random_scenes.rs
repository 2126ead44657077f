//! Whole scenes drawn at random, most of them hostile: nothing panics, hangs or is NaN, and the outcome says what
//! happened. A scene that was ever found to break something has a test of its own in `tests/physics/robustness.rs`.

use granulcal_dem::{
    BoxSide, EndRule, Ends, Funnel, Grains, Ground, Intruder, MAX_ENERGY_CREATED, Material, Motion,
    Outflow, Periodic, PeriodicAxis, Preset, Scene, Shape, Simulation, Start, Status, Wall,
    WallMaterial,
};
use nalgebra::Vector3;
use proptest::prelude::*;

/// Most grains and most substeps of a scene: together they bound the work.
const GRAINS: usize = 40;
const SUBSTEPS: f64 = 400.0;

/// Scenes drawn: as many as take some seconds, or as `PROPTEST_CASES` says for a longer search.
fn cases() -> u32 {
    std::env::var("PROPTEST_CASES").map_or(128, |cases| cases.parse().expect("a number of cases"))
}

/// A number between the bounds with a uniform logarithm.
fn log(low: f64, high: f64) -> impl Strategy<Value = f64> {
    (low.ln()..high.ln()).prop_map(f64::exp)
}

fn vector(range: std::ops::Range<f64>) -> impl Strategy<Value = [f64; 3]> {
    prop::array::uniform3(range)
}

fn material() -> impl Strategy<Value = Material> {
    let coefficient = |max: f64| prop_oneof![Just(0.0), Just(max), 0.0..1.0f64];
    let share = || prop_oneof![Just(0.0), Just(1.0), 0.0..1.0f64];
    let law = (0.0..0.2f64, coefficient(10.0), coefficient(10.0), coefficient(10.0));
    (coefficient(10.0), coefficient(1e3), coefficient(1e3), share(), share(), law).prop_map(
        |(sliding_friction, rolling_friction, torsional_friction, e, e_t, law)| Material {
            sliding_friction,
            rolling_friction,
            torsional_friction,
            restitution: e,
            tangential_restitution: e_t,
            softness: law.0,
            touching_exponent: law.1,
            impact_friction: law.2,
            rolling_dashpot: law.3,
            ..Material::default()
        },
    )
}

/// Where the grains of radius 1 begin.
fn begin() -> impl Strategy<Value = (usize, Start)> {
    let count = || prop_oneof![Just(0usize), Just(1), 0..=GRAINS];
    let grid = (count(), prop_oneof![Just(2.0), 2.0..6.0f64], 0.0..1.0f64, -30.0..30.0f64)
        .prop_map(|(count, spacing, share, base)| {
            let jitter = share * (spacing - 2.0) / 12f64.sqrt();
            (count, Start::Grid { counts: [3, 3, 5], spacing, jitter, base })
        });
    let ball =
        (count(), 0.0..100.0f64, log(1e-3, 0.74)).prop_map(|(count, height, solid_fraction)| {
            (count, Start::Ball { height, solid_fraction, jitter: 0.0, turned: false })
        });
    // Anywhere: apart, overlapping, in one point, below the ground, far away.
    let extent = prop_oneof![Just(0.0), log(1e-3, 1e2), log(1e2, 1e6)];
    let listed = (prop::collection::vec(vector(-1.0..1.0), 0..=GRAINS), extent, -3.0..60.0f64);
    let listed = listed.prop_map(|(points, extent, height)| {
        let place = |[x, y, z]: [f64; 3]| [extent * x, extent * y, extent * z + height];
        let positions: Vec<_> = points.into_iter().map(place).collect();
        (positions.len(), Start::Positions { positions })
    });
    let tube = (0..GRAINS, vector(-30.0..30.0), 2.0..6.0f64).prop_map(|(count, from, spacing)| {
        // A tube of 3 by 3 lanes, long enough.
        let length = spacing * (count as f64 / 9.0 + 1.0) + 4.0;
        let to = [from[0], from[1], from[2] + length];
        let radius = 1.5 * spacing + 1.0;
        (count, Start::Cylinder { from, to, radius, spacing, jitter: 0.0 })
    });
    prop_oneof![grid, ball, tube, listed]
}

/// A funnel for grains of radius 1: from one that a single grain just enters to a wide one.
fn funnel() -> impl Strategy<Value = Funnel> {
    (log(0.1, 30.0), log(1.001, 10.0), log(1.0, 10.0), log(0.1, 30.0), log(0.1, 10.0)).prop_map(
        |(height, stem_radius, widening, cone_length, stem_length)| Funnel {
            height,
            stem_radius,
            rim_radius: stem_radius * widening,
            cone_length,
            stem_length,
            material: WallMaterial::default(),
            motion: Motion::default(),
        },
    )
}

/// A wall among grains of radius 1.
fn wall() -> impl Strategy<Value = Wall> {
    let end = || vector(-20.0..20.0);
    let shape = prop_oneof![
        (end(), vector(-1.0..1.0)).prop_map(|(point, normal)| Shape::Plane { point, normal }),
        (end(), end(), log(0.1, 30.0), log(0.1, 30.0)).prop_map(
            |(from, to, radius_from, radius_to)| Shape::Cone {
                from,
                to,
                radius_from,
                radius_to,
                closed: Ends::None,
            }
        ),
        (end(), end(), log(0.1, 30.0), ends()).prop_map(|(from, to, radius, closed)| {
            Shape::Cylinder { from, to, radius, closed }
        }),
        (end(), vector(-1.0..1.0), log(0.1, 30.0))
            .prop_map(|(centre, normal, radius)| { Shape::Disc { centre, normal, radius } }),
        (end(), vector(0.1..30.0), prop::sample::subsequence(&BoxSide::ALL[..], 0..6)).prop_map(
            |(min, size, open)| {
                let max = std::array::from_fn(|axis| min[axis] + size[axis]);
                Shape::Box { min, max, open }
            }
        ),
    ];
    let material = prop::option::of(material()).prop_map(|material| WallMaterial {
        sliding_friction: material.map(|m| m.sliding_friction),
        restitution: material.map(|m| m.restitution),
        ..WallMaterial::default()
    });
    (shape, material, motion()).prop_map(|(shape, material, motion)| Wall {
        shape,
        material,
        motion,
    })
}

fn ends() -> impl Strategy<Value = Ends> {
    prop::sample::select(vec![Ends::None, Ends::From, Ends::To, Ends::Both])
}

/// How a wall among grains of radius 1 moves: half of them do not.
fn motion() -> impl Strategy<Value = Motion> {
    let times = || (0.0..0.01, 0.0..0.1);
    let lift = (vector(-30.0..30.0), times()).prop_map(|(velocity, (begin, length))| {
        Motion::Lift { velocity, begin, end: begin + length }
    });
    let spin = (vector(-20.0..20.0), vector(-1.0..1.0), -30.0..30.0, times()).prop_map(
        |(point, axis, rate, (begin, _))| Motion::Spin { point, axis, rate, begin, end: None },
    );
    // At most one period in ten substeps, of the coarsest preset too.
    let shake = (vector(-1.0..1.0), 0.0..60.0, times()).prop_map(
        |(amplitude, frequency, (begin, length))| Motion::Shake {
            amplitude,
            frequency,
            begin,
            end: Some(begin + length),
        },
    );
    let still = || Just(Motion::default());
    prop_oneof![still(), still(), still(), lift, spin, shake]
}

fn gravity() -> impl Strategy<Value = [f64; 3]> {
    let down = log(1e-3, 1e3).prop_map(|g| [0.0, 0.0, -g]);
    let any = (vector(-1.0..1.0), log(1e-3, 1e3)).prop_map(|(v, g)| v.map(|c| g * c));
    prop_oneof![Just([0.0; 3]), Just([0.0, 0.0, -9.81]), down, any]
}

/// A scene whose lengths are `radius` times those that are drawn.
fn scene() -> impl Strategy<Value = Scene> {
    let radius = prop_oneof![Just(2e-3), Just(2e-3), log(1e-6, 1e3)];
    let walls = prop::collection::vec(wall(), 0..4);
    let end = (1.0..SUBSTEPS, log(1e-14, 1e-2));
    let preset = prop::sample::select(&Preset::ALL[..]);
    let period = prop::option::weighted(0.2, (any::<bool>(), -20.0..20.0, 8.0..60.0));
    let until = prop::option::of(prop_oneof![Just(100.0), 1.0..100.0]);
    let outflow = prop::option::weighted(0.2, (-5.0..30.0, until));
    let entry = (log(0.2, 20.0), log(0.1, 10.0), vector(-20.0..20.0), vector(-3.0..3.0), 0.0..1.0);
    let intruder = prop::option::weighted(0.2, entry);
    let finer = prop::option::weighted(0.3, 0.05..1.0);
    let rules = (end, period, outflow, intruder, finer);
    (radius, begin(), prop::option::of(funnel()), walls, gravity(), material(), preset, rules)
        .prop_map(
            |(
                radius,
                (count, start),
                funnel,
                walls,
                gravity,
                material,
                preset,
                ((substeps, energy), period, outflow, intruder, finer),
            )| Scene {
                name: "random".to_owned(),
                preset,
                substep: finer.map(|share: f64| share * preset.settings().dt),
                gravity,
                material,
                grains: Grains::balls(count, 2.0 * radius, 1300.0),
                start: scaled_start(start, radius),
                bed: None,
                // With neither of those two, as the scene's check asks.
                intruder: intruder.filter(|_| period.is_none() && outflow.is_none()).map(
                    |(size, density, position, velocity, enters)| Intruder {
                        diameter: 2.0 * radius * size,
                        density: 1300.0 * density,
                        position: position.map(|c| radius * c),
                        velocity,
                        enters: enters * horizon(substeps, finer, preset),
                    },
                ),
                ground: Ground::default(),
                funnel: funnel.map(|funnel| scaled_funnel(funnel, radius)),
                walls: walls.into_iter().map(|wall| scaled_wall(wall, radius)).collect(),
                end: EndRule {
                    horizon: horizon(substeps, finer, preset),
                    kinetic_energy: energy,
                    ..EndRule::default()
                },
                camera: granulcal_dem::CameraSpec::default(),
                effects: granulcal_dem::Effects::default(),
                periodic: period.map(|(is_x, from, length)| Periodic {
                    axis: if is_x { PeriodicAxis::X } else { PeriodicAxis::Y },
                    from: radius * from,
                    // Rounding must not make the shortest too short.
                    to: radius * (from + (1.0 + 1e-9) * length),
                }),
                outflow: outflow
                    .map(|(below, until): (f64, _)| Outflow { below: radius * below, until }),
                views: Vec::new(),
                observe: None,
            },
        )
}

/// So many substeps of a preset, or of a share of them `[s]`.
fn horizon(substeps: f64, finer: Option<f64>, preset: Preset) -> f64 {
    substeps * finer.unwrap_or(1.0) * preset.settings().dt
}

fn scaled_start(start: Start, r: f64) -> Start {
    match start {
        Start::Grid { counts, spacing, jitter, base } => {
            // Rounding must not make neighbours of touching ones overlap.
            Start::Grid {
                counts,
                spacing: (1.0 + 1e-9) * r * spacing,
                jitter: r * jitter,
                base: r * base,
            }
        }
        Start::Ball { height, solid_fraction, jitter, turned } => {
            Start::Ball { height: r * height, solid_fraction, jitter, turned }
        }
        Start::Cylinder { from, to, radius, spacing, jitter } => Start::Cylinder {
            from: from.map(|c| r * c),
            to: to.map(|c| r * c),
            // Rounding must not shut out grains that just fit.
            radius: (1.0 + 1e-9) * r * radius,
            spacing: (1.0 + 1e-9) * r * spacing,
            jitter: r * jitter,
        },
        Start::Positions { positions } => Start::Positions {
            positions: positions.into_iter().map(|p| p.map(|c| r * c)).collect(),
        },
        // Of grains with a shape, which these scenes have not.
        start @ Start::Poses { .. } => start,
    }
}

fn scaled_funnel(funnel: Funnel, r: f64) -> Funnel {
    Funnel {
        height: r * funnel.height,
        rim_radius: r * funnel.rim_radius,
        stem_radius: r * funnel.stem_radius,
        cone_length: r * funnel.cone_length,
        stem_length: r * funnel.stem_length,
        ..funnel
    }
}

fn scaled_wall(wall: Wall, r: f64) -> Wall {
    let times = |v: [f64; 3]| v.map(|c| r * c);
    let shape = match wall.shape {
        Shape::Plane { point, normal } => Shape::Plane { point: times(point), normal },
        Shape::Cone { from, to, radius_from, radius_to, closed } => Shape::Cone {
            from: times(from),
            to: times(to),
            radius_from: r * radius_from,
            radius_to: r * radius_to,
            closed,
        },
        Shape::Cylinder { from, to, radius, closed } => {
            Shape::Cylinder { from: times(from), to: times(to), radius: r * radius, closed }
        }
        Shape::Disc { centre, normal, radius } => {
            Shape::Disc { centre: times(centre), normal, radius: r * radius }
        }
        Shape::Box { min, max, open } => Shape::Box { min: times(min), max: times(max), open },
        mesh @ Shape::Mesh(_) => mesh,
    };
    let motion = match wall.motion {
        Motion::Lift { velocity, begin, end } => {
            Motion::Lift { velocity: times(velocity), begin, end }
        }
        Motion::Spin { point, axis, rate, begin, end } => {
            Motion::Spin { point: times(point), axis, rate, begin, end }
        }
        Motion::Shake { amplitude, frequency, begin, end } => {
            Motion::Shake { amplitude: times(amplitude), frequency, begin, end }
        }
        other => other,
    };
    Wall { shape, motion, ..wall }
}

/// Mechanical energy per mass of a grain, from what everybody can see `[m^2/s^2]`: velocities are half a substep old.
fn energy(simulation: &Simulation, gravity: Vector3<f64>) -> f64 {
    let half = 0.5 * simulation.settings().dt * gravity;
    let spins = simulation.angular_velocities();
    let moving = simulation.velocities().into_iter().zip(simulation.radii()).zip(spins);
    let kinetic =
        moving.map(|((v, r), w)| 0.5 * (v + half).norm_squared() + 0.2 * (r * w).norm_squared());
    let potential = simulation.positions().into_iter().map(|x| -gravity.dot(&x));
    kinetic.sum::<f64>() + potential.sum::<f64>()
}

/// Energy of the grains' heights per mass of a grain, and that if all were where the lowest point of one is.
fn heights(simulation: &Simulation, gravity: Vector3<f64>) -> [f64; 2] {
    let grains = || simulation.positions().into_iter().zip(simulation.radii());
    let low =
        grains().map(|(x, r)| -gravity.z * x.z - gravity.z.abs() * r).fold(f64::MAX, f64::min);
    [grains().map(|(x, _)| -gravity.z * x.z).sum(), grains().count() as f64 * low]
}

/// Whether no wall is refused for how far its tip goes in a substep, which few of the drawn ones are.
fn turns_no_tip_through_grains(scene: &Scene) -> bool {
    scene.check().map_or_else(|error| !error.to_string().contains("speed of its tip"), |()| true)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(cases()))]
    #[test]
    fn whatever_the_scene_the_outcome_says_what_happened(
        scene in scene().prop_filter("a tip goes too far", turns_no_tip_through_grains),
        cut in 0.0..1.0f64,
    ) {
        let mut simulation = Simulation::new(&scene, 1).expect("a valid scene");
        let settings = *simulation.settings();
        let gravity = Vector3::from(scene.gravity);
        let cut = cut * scene.end.horizon;
        let (mut lowest, mut created) = (energy(&simulation, gravity), 0f64);
        let lift = gravity.norm() * scene.grains.radius() + scene.end.kinetic_energy;
        let [at_start, mut low] = heights(&simulation, gravity);
        let mut resumed = None;
        let searches = (scene.end.horizon / settings.dt / settings.list_period as f64) as usize + 20;
        for _ in 0..searches {
            simulation.advance(settings.list_period as f64 * settings.dt);
            let now = energy(&simulation, gravity);
            created = created.max(now - lowest);
            lowest = lowest.min(now);
            low = low.min(heights(&simulation, gravity)[1]);
            if resumed.is_none() && simulation.time() >= cut {
                let bytes = simulation.checkpoint();
                resumed = Some(Simulation::new(&scene, 1).unwrap().resume(&bytes).unwrap());
            }
        }
        let scale = (at_start - low).max(scene.grains.count as f64 * lift);
        // The horizon is the end, but for the searches that rest may take.
        prop_assert!(simulation.ended().is_some(), "{} s of {}", simulation.time(), scene.end.horizon);
        if let Some(resumed) = resumed {
            prop_assert_eq!(resumed.run().state_hash, simulation.state_hash());
        }

        let pour = simulation.into_pour();
        let vectors = [&pour.positions, &pour.velocities, &pour.angular_velocities];
        prop_assert!(vectors.into_iter().flatten().flat_map(|v| v.iter()).all(|c| c.is_finite()));
        let health = pour.health;
        prop_assert!(health.worst_penetration.is_finite() && health.energy_created.is_finite());
        let is_sound = health.grains_lost == 0
            && health.worst_penetration <= settings.max_penetration
            && health.energy_created <= MAX_ENERGY_CREATED;
        prop_assert_eq!(is_sound, pour.status != Status::Unhealthy, "{:?} {:?}", pour.status, health);
        // Walls that move put energy in, and so do a slope without end and a ball that enters; what leaves takes its
        // own with it.
        let is_closed = scene.walls.iter().all(|wall| wall.motion.is_still())
            && scene.periodic.is_none()
            && scene.outflow.is_none()
            && scene.intruder.is_none();
        if is_sound && is_closed {
            prop_assert!(created <= MAX_ENERGY_CREATED * scale * (1.0 + 1e-9), "{created} {health:?}");
        }
        let held = pour.positions.iter().filter(|centre| scene.is_in_funnel(centre, 0.0)).count();
        prop_assert_eq!(held, pour.grains_in_funnel);
        let entered = scene.intruder.is_some_and(|ball| ball.enters <= pour.simulated_s - settings.dt);
        let grains = scene.grains.count + usize::from(entered);
        prop_assert_eq!(pour.positions.len() + pour.radii_out.len(), grains);
        match pour.status {
            Status::Jammed => prop_assert!(held > 0),
            Status::AtRest | Status::OutOfView => prop_assert_eq!(held, 0),
            Status::RanOut | Status::Horizon | Status::Unhealthy => {}
        }
    }
}
