//! Two grains that meet in flight: one comes back from the ground, the other is on its way down.

use granulcal::dem::{GRAVITY, Ground, Material, Preset, Scene, Simulation, Start, WallMaterial};
use nalgebra::Vector3;

use crate::scenes::{Motion, RADIUS, block, motion};

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
    let dt = scene.preset.settings().dt;
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

fn momentum(grains: &[Motion; 2]) -> Vector3<f64> {
    grains[0].v + grains[1].v
}

/// Kinetic energy over mass: |v|^2 / 2 + |r omega|^2 / 5.
fn energy(grains: &[Motion; 2]) -> f64 {
    grains.iter().map(|g| 0.5 * g.v.norm_squared() + 0.2 * g.w.norm_squared()).sum()
}

#[test]
fn a_head_on_elastic_pair_exchanges_velocities() {
    for preset in [Preset::Fast, Preset::Default, Preset::Accurate] {
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
        let normal = (before[0].x - before[1].x).normalize();
        most_oblique = most_oblique.min(normal.z.abs());
        let approach = |grains: &[Motion; 2]| normal.dot(&(grains[0].v - grains[1].v));
        let bounced = approach(&after) + 0.6 * approach(&before);
        assert!(bounced.abs() < 1e-12, "seed {seed}: {bounced}");
        assert!(energy(&after) < energy(&before), "seed {seed}");
        // Friction acts at arm's length r on equal grains: their spins change alike, but for rolling
        // friction, which is mu_r = 0.1.
        let (a, b) = (after[0].w - before[0].w, after[1].w - before[1].w);
        let unlike = (a - b) - normal * normal.dot(&(a - b));
        assert!(unlike.norm() < 0.2 * a.norm(), "seed {seed}: {unlike:?} of {a:?}");
    }
    assert!(most_oblique < 0.9, "{most_oblique}");
}

#[test]
fn tangential_restitution_reverses_the_sliding_of_a_sticking_impact() {
    // So much friction that every impact sticks, and no rolling friction.
    let grains = Material {
        sliding_friction: 10.0,
        rolling_friction: 0.0,
        restitution: 0.5,
        tangential_restitution: 0.4,
    };
    for seed in 0..8 {
        let (before, after) = collide(&pair(grains, 1.2e-3), seed);
        let normal = (before[0].x - before[1].x).normalize();
        let sliding = |grains: &[Motion; 2]| {
            let u = grains[0].v - grains[1].v + normal.cross(&(grains[0].w + grains[1].w));
            u - normal * normal.dot(&u)
        };
        let left = sliding(&after) + 0.4 * sliding(&before);
        assert!(left.norm() < 1e-12, "seed {seed}: {left:?}");
    }
}
