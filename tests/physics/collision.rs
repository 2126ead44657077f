//! Two grains that meet in flight: one comes back from the ground, the other is on its way down.

use granulcal::dem::{GRAVITY, Ground, Material, Preset, Scene, Simulation, Start, WallMaterial};
use nalgebra::Vector3;

use crate::scenes::{Motion, RADIUS, block, motion, one_grain, start};

/// Two grains one above the other over ground that gives all energy back.
fn pair(grains: Material, jitter: f64) -> Scene {
    let (counts, spacing, base) = ([1, 1, 2], 0.02, 0.05);
    let mut scene = block(counts, spacing, base, grains);
    scene.start = Start::Grid { counts, spacing, jitter, base };
    scene.ground = Ground {
        material: WallMaterial {
            sliding_friction: Some(0.0),
            restitution: Some(1.0),
            ..WallMaterial::default()
        },
    };
    scene
}

/// Both grains before and after the substep in which they collide, gravity's share taken off the latter.
fn collide(scene: &Scene, seed: u64) -> ([Motion; 2], [Motion; 2]) {
    let dt = scene.settings().dt;
    let mut simulation = Simulation::new(scene, seed).expect("a valid scene");
    let both = |simulation: &_| [motion(simulation, 0), motion(simulation, 1)];
    loop {
        let before = both(&simulation);
        simulation.advance(dt);
        let mut after = both(&simulation);
        for grain in &mut after {
            grain.v.z += GRAVITY * dt;
        }
        if (after[1].v - before[1].v).norm() > 1e-9 {
            assert!(before[0].x.z > 2.0 * RADIUS, "the lower grain is off the ground");
            return (before, after);
        }
        assert!(simulation.time() < 1.0, "the grains never met");
    }
}

/// Unit vector from the upper to the lower grain when they touch: the root of `|d + w t| = 2 r`.
fn touch(before: &[Motion; 2]) -> Vector3<f64> {
    let apart = before[0].x - before[1].x;
    let relative = before[0].v - before[1].v;
    let (a, b) = (relative.norm_squared(), apart.dot(&relative));
    let c = apart.norm_squared() - 4.0 * RADIUS * RADIUS;
    let time = (-b - (b * b - a * c).sqrt()) / a;
    (apart + time * relative).normalize()
}

fn momentum(grains: &[Motion; 2]) -> Vector3<f64> {
    grains[0].v + grains[1].v
}

/// Kinetic energy over mass: |v|^2 / 2 + |r omega|^2 / 5.
fn energy(grains: &[Motion; 2]) -> f64 {
    grains.iter().map(|g| 0.5 * g.v.norm_squared() + 0.2 * g.w.norm_squared()).sum()
}

#[test]
fn a_head_on_elastic_pair_exchanges_velocities() {
    for preset in Preset::ALL {
        let mut scene = pair(Material { restitution: 1.0, ..Material::default() }, 0.0);
        scene.preset = preset;
        let (before, after) = collide(&scene, 1);
        assert!((momentum(&after) - momentum(&before)).norm() < 1e-12);
        assert!((energy(&after) / energy(&before) - 1.0).abs() < 1e-12);
        assert!((after[0].v - before[1].v).norm() < 1e-12);
        assert!((after[1].v - before[0].v).norm() < 1e-12);
    }
}

#[test]
fn an_oblique_pair_keeps_its_momentum_and_its_restitution() {
    let mut most_oblique = 1.0_f64;
    for seed in 0..24 {
        let grains = Material {
            restitution: 0.6,
            tangential_restitution: 0.3 * f64::from(seed as u32 % 3),
            ..Material::default()
        };
        // Kept below a diameter between the axes, or the grains would miss.
        let (before, after) = collide(&pair(grains, 1.2e-3), seed);
        assert!((momentum(&after) - momentum(&before)).norm() < 1e-12, "seed {seed}");
        let normal = touch(&before);
        most_oblique = most_oblique.min(normal.z.abs());
        let approach = |grains: &[Motion; 2]| normal.dot(&(grains[0].v - grains[1].v));
        let bounced = approach(&after) + 0.6 * approach(&before);
        assert!(bounced.abs() < 1e-12, "seed {seed}: {bounced} {before:?} {after:?}");
        assert!(energy(&after) < energy(&before), "seed {seed}");
        // Friction acts at arm's length r on equal grains: their spins change alike, but for rolling
        // friction, which is mu_r = 0.1.
        let (a, b) = (after[0].w - before[0].w, after[1].w - before[1].w);
        let unlike = (a - b) - normal * normal.dot(&(a - b));
        assert!(unlike.norm() < 0.2 * a.norm(), "seed {seed}: {unlike:?} of {a:?}");
    }
    assert!(most_oblique < 0.9, "{most_oblique}");
}

/// Two grains without gravity, in view however far they fly.
fn weightless_pair(preset: Preset, grains: Material) -> Scene {
    let mut scene = one_grain(0.05, grains);
    scene.preset = preset;
    scene.gravity = [0.0; 3];
    scene.camera.field_width = 1000.0;
    scene.grains.count = 2;
    scene
}

/// The contact problem of the substep before the touch must not push what will pass: the first normal's prediction is
/// too near by `w_t^2 dt / (2 d)`, and by more where the centres go far beside each other.
#[test]
fn a_fast_oblique_pair_meets_alike_wherever_in_a_substep() {
    let elastic = Material {
        restitution: 1.0,
        sliding_friction: 0.0,
        rolling_friction: 0.0,
        torsional_friction: 0.0,
        ..Material::default()
    };
    for preset in Preset::ALL {
        let mut scene = weightless_pair(preset, elastic);
        for number in 0..200 {
            // They touch after a way of 1 to 9 radii along x, beside each other as far as the first goes along y.
            let way = RADIUS * (1.0 + 0.04 * f64::from(number));
            let from = [-RADIUS - way, -3.0 * way, 0.05];
            scene.start = Start::Positions { positions: vec![from, [RADIUS, 0.0, 0.05]] };
            let mut simulation = Simulation::new(&scene, 1).expect("a valid scene");
            let velocity = Vector3::new(1.0, 3.0, 0.0);
            simulation.set_motion(0, velocity, Vector3::zeros()).expect("a grain");
            simulation.advance(0.03);
            let v = [0, 1].map(|grain| motion(&simulation, grain).v);
            // The normal is x: what is along it is exchanged.
            let left = (v[0] - Vector3::y() * 3.0).norm() + (v[1] - Vector3::x()).norm();
            assert!(left < 1e-9, "{preset} {number}: {v:?}");
        }
    }
}

/// A pair of equal mass and radius that nothing else acts on keeps it, wherever in a substep it meets.
#[test]
fn a_pair_in_flight_keeps_its_angular_momentum() {
    let rough = Material {
        restitution: 0.8,
        sliding_friction: 0.4,
        rolling_friction: 0.0,
        torsional_friction: 0.0,
        ..Material::default()
    };
    let of = |simulation: &Simulation| -> Vector3<f64> {
        let grains = [0, 1].map(|grain| motion(simulation, grain));
        grains.iter().map(|g| g.x.cross(&g.v) + 0.4 * RADIUS * g.w).sum()
    };
    for preset in Preset::ALL {
        let mut scene = weightless_pair(preset, rough);
        let (mut met, mut worst) = (0, 0.0_f64);
        for number in 0..200 {
            let any = |f: f64| (f * (f64::from(number) + 1.0)).sin();
            let beside = RADIUS * any(3.7);
            let positions = vec![[-4.0 * RADIUS, beside, 0.5], [4.0 * RADIUS, -beside, 0.5]];
            scene.start = Start::Positions { positions };
            let mut simulation = Simulation::new(&scene, 1).expect("a valid scene");
            for (grain, side) in [1.0, -1.0].into_iter().enumerate() {
                let f = 1.0 + grain as f64;
                // Beside each other they go as the first grain goes along y and z.
                let across = Vector3::new(0.0, any(1.3), any(2.1)) * 2.0;
                let velocity = Vector3::x() * side * (1.5 + any(0.3 * f)) + across;
                let spin = 100.0 * Vector3::new(any(0.9 * f), any(1.7 * f), any(2.9 * f));
                simulation.set_motion(grain, velocity, spin).expect("a grain");
            }
            let (before, momentum) = (of(&simulation), simulation.velocities());
            simulation.advance(0.03);
            met += usize::from(simulation.velocities() != momentum);
            worst = worst.max((of(&simulation) - before).norm() / (2.0 * RADIUS * 3.0));
        }
        assert!(met > 100 && worst < 1e-5, "{preset}: {met} met, {worst:e} lost");
    }
}

#[test]
fn tangential_restitution_reverses_the_sliding_of_a_sticking_impact() {
    // So much friction that every impact sticks, and no rolling friction.
    let grains = Material {
        sliding_friction: 10.0,
        rolling_friction: 0.0,
        restitution: 0.5,
        tangential_restitution: 0.4,
        torsional_friction: 0.0,
        ..Material::default()
    };
    for seed in 0..8 {
        let (before, after) = collide(&pair(grains, 1.2e-3), seed);
        let normal = touch(&before);
        let sliding = |grains: &[Motion; 2]| {
            let u = grains[0].v - grains[1].v + normal.cross(&(grains[0].w + grains[1].w));
            u - normal * normal.dot(&u)
        };
        let left = sliding(&after) + 0.4 * sliding(&before);
        assert!(left.norm() < 1e-12, "seed {seed}: {left:?}");
    }
}

/// Two grains that meet with the relative motion of a number, without gravity: before and after.
fn meet(grains: Material, number: u32) -> ([Motion; 2], [Motion; 2]) {
    // Directions and speeds that fill their ranges evenly: fractional parts of multiples of the golden ratios.
    let fraction = |factor: f64| (f64::from(number + 1) * factor).fract();
    let wave = |factor: f64| 2.0 * fraction(factor) - 1.0;
    let normal = Vector3::new(wave(0.8191), wave(0.6711), wave(0.5497)).normalize();
    let sideways = normal.cross(&Vector3::new(wave(0.4503), wave(0.3689), 1.1)).normalize();
    let (approach, slide) = (0.1 + 2.0 * fraction(0.7549), 2.0 * fraction(0.5698));
    let spins = [0.3021, 0.2475].map(|f| Vector3::new(wave(f), wave(0.5 * f), wave(2.0 * f)));

    let dt = Preset::Default.settings().dt;
    let mut scene = one_grain(1.0, grains);
    scene.gravity = [0.0; 3];
    scene.grains.count = 2;
    let relative = approach * normal + slide * sideways;
    // They touch 2.4 substeps after the start with `normal` between them.
    let apart = -(2.0 * RADIUS) * normal - 2.4 * dt * relative;
    let middle = Vector3::new(0.0, 0.0, 1.0);
    let positions = [middle, middle + -apart].map(Into::into).to_vec();
    scene.start = Start::Positions { positions };
    let mut simulation = start(&scene);
    for (grain, sign) in [(0, 0.5), (1, -0.5)] {
        let drift = Vector3::new(0.3, -0.2, 0.1);
        let velocity = drift + sign * relative;
        simulation.set_motion(grain, velocity, spins[grain] / RADIUS).expect("a valid motion");
    }
    let both = |simulation: &_| [motion(simulation, 0), motion(simulation, 1)];
    let before = both(&simulation);
    simulation.advance(6.0 * dt);
    (before, both(&simulation))
}

/// Angular momentum about the origin over mass and radius `[m/s]`.
fn angular_momentum(grains: &[Motion; 2]) -> Vector3<f64> {
    grains.iter().map(|g| g.x.cross(&g.v) / RADIUS + 0.4 * g.w).sum()
}

#[test]
fn a_pair_loses_what_the_law_takes() {
    for number in 0..200 {
        let grains = Material {
            sliding_friction: [0.0, 0.1, 0.5][number as usize % 3],
            rolling_friction: 0.0,
            torsional_friction: 0.0,
            restitution: [0.0, 0.5, 0.9, 1.0][number as usize % 4],
            ..Material::default()
        };
        let (before, after) = meet(grains, number);
        assert!((momentum(&after) - momentum(&before)).norm() < 1e-12, "{number}");
        // Relative motion at the contact. The loss is -lambda (u + u') / 2, with u' = -e w_n in the normal and
        // u' = u - 7 lambda_t in the tangential direction, lambda_t = min(u / 7, mu lambda_n).
        let change = after[0].v - before[0].v;
        assert!(change.norm() > 0.05, "{number}: no impact");
        let spins = before[0].w + before[1].w;
        let dv = before[0].v - before[1].v;
        let normal = touch(&before);
        let w_n = normal.dot(&dv);
        let slide = dv - w_n * normal + normal.cross(&spins);
        let lambda_n = -0.5 * (1.0 + grains.restitution) * w_n;
        let lambda_t = (slide.norm() / 7.0).min(grains.sliding_friction * lambda_n);
        let loss = -0.5 * lambda_n * (w_n - grains.restitution * w_n)
            + 0.5 * lambda_t * (2.0 * slide.norm() - 7.0 * lambda_t);
        let lost = energy(&before) - energy(&after);
        assert!((lost - loss).abs() < 1e-9 * energy(&before), "{number}: {lost}, expected {loss}");
    }
}

#[test]
fn a_pair_keeps_its_angular_momentum() {
    for number in 0..200 {
        let grains = Material { rolling_friction: 0.0, ..Material::default() };
        let (before, after) = meet(grains, number);
        let (then, now) = (angular_momentum(&before), angular_momentum(&after));
        assert!((now - then).norm() < 1e-9 * then.norm(), "{number}: {then:?} {now:?}");
    }
}
