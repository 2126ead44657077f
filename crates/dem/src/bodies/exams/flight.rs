//! Bodies that meet in flight, with nothing else near: what two bodies keep.

use nalgebra::{UnitQuaternion, Vector3};

use super::{Exam, SIZE, cube};
use granulcal_scene::GrainShape;

/// Momentum, angular momentum about the origin `[m^2/s]`.
fn kept(exam: &Exam) -> [Vector3<f64>; 2] {
    let all = exam.bodies.all.iter();
    let [mut linear, mut angular] = [Vector3::zeros(); 2];
    for body in all {
        let velocity = Vector3::from(body.velocity);
        linear += velocity;
        angular += Vector3::from(body.centre).cross(&velocity) + Vector3::from(body.momentum);
    }
    [linear, angular]
}

/// Two bodies fly at each other, spinning and passing aside: at random places in a substep, so that the gap is
/// anything.
#[test]
fn two_bodies_that_collide_keep_their_angular_momentum() {
    let brick = GrainShape::Box { aspect: [1.0, 2.0, 3.0] };
    let can = GrainShape::Cylinder { aspect: 1.0 };
    for (shape, friction) in [(cube(), 0.4), (cube(), 0.0), (brick, 0.4), (can, 0.4)] {
        let (mut struck, mut worst, mut gained) = (0, 0.0_f64, 0.0_f64);
        for seed in 0..300 {
            let any = |f: f64| (f * (f64::from(seed) + 1.0)).sin();
            let mut exam = Exam::new(shape.clone(), friction, 0.9);
            exam.gravity = Vector3::zeros();
            for (number, side) in [-1.0, 1.0].into_iter().enumerate() {
                let f = 1.0 + number as f64;
                let turned = UnitQuaternion::from_euler_angles(
                    3.0 * any(1.3 * f),
                    3.0 * any(2.1 * f),
                    3.0 * any(0.7 * f),
                );
                exam.put([side * SIZE, 0.4 * side * any(3.7) * SIZE, 0.5], turned);
                let velocity = Vector3::new(-2.0 * side, 3.0 * any(0.3 * f), 3.0 * any(2.3 * f));
                let omega = 100.0 * Vector3::new(any(0.9 * f), any(1.7 * f), any(2.9 * f));
                exam.bodies.set_motion(number, &velocity, &omega);
            }
            let (before, energy) = (kept(&exam), exam.energy());
            let mut impacts = 0;
            for _ in 0..10 {
                impacts += exam.step().impacts;
            }
            struck += usize::from(impacts > 0);
            let after = kept(&exam);
            worst = worst.max((after[1] - before[1]).norm() / (SIZE * 2.0));
            assert!((after[0] - before[0]).norm() < 1e-12);
            gained = gained.max(exam.energy() / energy - 1.0);
        }
        assert!(struck > 100 && worst < 1e-11, "{shape:?}: {struck} struck, {worst:e} lost");
        assert!(gained < 1e-6, "{shape:?}: {gained:e} of the energy gained");
    }
}

/// Elastic bricks without friction that bounce on the ground while they spin.
#[test]
fn a_bouncing_brick_keeps_its_energy() {
    let brick = GrainShape::Box { aspect: [1.0, 1.0, 4.0] };
    for seed in 0..12 {
        let any = |f: f64| 3.0 * (f * (f64::from(seed) + 1.0)).sin();
        let mut exam = Exam::new(brick.clone(), 0.0, 1.0);
        let turned = UnitQuaternion::from_euler_angles(any(1.3), any(2.1), any(0.7));
        exam.put([0.0, 0.0, 0.05], turned);
        let omega = 70.0 * Vector3::new(any(0.9), any(1.7), any(2.9));
        exam.bodies.set_motion(0, &Vector3::zeros(), &omega);
        let start = exam.energy();
        for _ in 0..4000 {
            exam.step();
            let share = exam.energy() / start;
            assert!((share - 1.0).abs() < 0.03, "{seed}: {share}");
        }
    }
}
