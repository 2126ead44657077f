//! How large the grains of a scene are, whatever their shape.
//!
//! The radii of a simulation are those of balls: of each sphere of a clump, whose spheres overlap, and of the scene's
//! diameter for a convex body, which may be several times as long or a tenth as thick.

use std::f64::consts::PI;

use granulcal_scene::Scene;

/// Volume of grains of these radii `[m³]`.
pub(super) fn volume(scene: &Scene, radii: &[f64]) -> f64 {
    let grains = radii.len() as f64 / scene.effects.clump.members() as f64;
    if is_round(scene) {
        radii.iter().map(|radius| 4.0 / 3.0 * PI * radius.powi(3)).sum()
    } else {
        grains * volume_of_one(scene)
    }
}

/// Volume of a typical grain `[m³]`: a clump has that of the ball that the scene states.
pub(super) fn volume_of_one(scene: &Scene) -> f64 {
    let ball = PI / 6.0 * scene.grains.diameter.powi(3);
    scene.grains.solid().map_or(ball, |solid| solid.volume)
}

/// Least width of a grain of these radii, or less `[m]`. A body that a ball of radius R holds has no section larger
/// than that ball's, so that it is V / (pi R²) thick at least.
pub(super) fn least_width(scene: &Scene, radii: &[f64]) -> f64 {
    match scene.grains.solid() {
        Some(solid) => solid.volume / (PI * solid.reach.powi(2)),
        None => 2.0 * radii.iter().copied().fold(f64::INFINITY, f64::min),
    }
}

fn is_round(scene: &Scene) -> bool {
    scene.grains.shape.is_none() && scene.effects.clump.members() == 1
}

#[cfg(test)]
mod tests {
    use granulcal_scene::GrainShape;

    use super::*;
    use crate::plausible::Limits;

    fn limits(change: impl Fn(&mut Scene)) -> Limits {
        let mut scene = Scene::drop(0.1);
        scene.grains.count = 10;
        change(&mut scene);
        Limits::of(&scene, &granulcal_scene::Prior::default()).unwrap().unwrap()
    }

    #[test]
    fn a_clump_takes_the_room_of_its_ball() {
        let round = limits(|_| ());
        for (spheres, aspect) in [(2, 1.2), (4, 1.2), (4, 3.0)] {
            let clumps = limits(|scene| {
                (scene.effects.clump.spheres, scene.effects.clump.aspect) = (spheres, aspect);
            });
            let ratio = clumps.least_volume / round.least_volume;
            assert!((ratio - 1.0).abs() < 1e-9, "{spheres} {aspect}: {ratio}");
            assert!((clumps.volume / round.volume - 1.0).abs() < 1e-9, "{spheres} {aspect}");
        }
    }

    #[test]
    fn a_body_takes_its_own_room_and_lies_as_flat_as_it_is() {
        let round = limits(|_| ());
        for (shape, over_ball, thickness) in [
            (GrainShape::Box { aspect: [1.0, 1.0, 0.2] }, 0.2 * 6.0 / PI, 0.2),
            (GrainShape::Cylinder { aspect: 4.0 }, 1.5 * 4.0, 1.0),
        ] {
            let bodies = limits(|scene| scene.grains.shape = Some(shape.clone()));
            for (got, ball) in [
                (bodies.volume, round.volume),
                (bodies.least_volume, round.least_volume),
                (bodies.grain, round.grain),
            ] {
                assert!((got / ball / over_ball - 1.0).abs() < 1e-9, "{shape:?}: {got} {ball}");
            }
            assert!(bodies.least_height <= 0.5 * thickness * 4e-3, "{shape:?}: {bodies:?}");
        }
    }
}
