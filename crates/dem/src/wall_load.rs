//! What walls carry: forces of the lasting contacts, summed wall by wall.

use nalgebra::Vector3;

use crate::contact_set::ContactSet;
use crate::wall::Walls;

/// Force of all grains on one wall, over [`crate::Simulation::unit_mass`], from the impulses of the lasting contacts in
/// a substep: lambda / dt. Over g it is the number of grains that the wall carries. At rest it is exact; while grains
/// collide it changes from substep to substep and lacks what impacts give.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WallLoad {
    /// Force on the wall, normal and friction `[m/s^2]`.
    pub force: Vector3<f64>,
    /// Sum of the magnitudes of the normal forces `[m/s^2]`, which do not cancel around a cylinder.
    pub normal_force: f64,
}

/// The loads of the walls, each over all its surfaces.
pub(crate) fn of(at_walls: &ContactSet, walls: &Walls, dt: f64) -> Vec<WallLoad> {
    let mut loads = vec![WallLoad::default(); walls.count()];
    for (batch, at) in at_walls.batches.iter().zip(&at_walls.at_walls) {
        for lane in batch.lanes() {
            let load = &mut loads[walls.owner(at.wall[lane] as usize)];
            let normal = Vector3::from(batch.normal.get(lane));
            let lambda_n = batch.lambda_n.0[lane];
            // The normal points to the grain: the wall feels the opposite.
            load.force -= (lambda_n * normal + Vector3::from(batch.lambda_t.get(lane))) / dt;
            load.normal_force += lambda_n / dt;
        }
    }
    loads
}

#[cfg(test)]
mod tests {
    use granulcal_scene::GrainShape;

    use super::*;
    use crate::{GRAVITY, Material, Scene, Shape, Simulation, Start, Wall, WallMaterial};

    /// The loads of one grain at `position` after 0.5 s.
    fn loads(scene: &mut Scene, position: [f64; 3]) -> Vec<WallLoad> {
        scene.grains.count = 1;
        scene.end.kinetic_energy = f64::MIN_POSITIVE;
        scene.start = Start::Positions { positions: vec![position] };
        let mut simulation = Simulation::new(scene, 1).unwrap();
        simulation.advance(0.5);
        simulation.wall_loads().unwrap()
    }

    #[test]
    fn a_held_grain_hands_gravity_to_the_ground() {
        let mut scene = Scene::drop(0.1);
        scene.material = Material::new(0.5, 1.0, 0.0).unwrap();
        scene.gravity = [2.0, -1.0, -9.0];
        let loads = loads(&mut scene, [0.0, 0.0, 0.002]);
        assert_eq!(loads.len(), 1);
        assert!((loads[0].force - Vector3::from(scene.gravity)).norm() < 1e-9, "{loads:?}");
        assert!((loads[0].normal_force - 9.0).abs() < 1e-9, "{loads:?}");
    }

    #[test]
    fn a_grain_of_two_spheres_weighs_as_one_and_of_a_shape_nothing_is_told() {
        let mut scene = Scene::drop(0.1);
        scene.material = Material::new(0.5, 1.0, 0.0).unwrap();
        scene.effects.clump.aspect = 1.5;
        let loads = loads(&mut scene, [0.0, 0.0, 0.003]);
        assert!((loads[0].normal_force / GRAVITY - 1.0).abs() < 1e-3, "{loads:?}");
        scene.effects.clump.aspect = 1.0;
        scene.grains.shape = Some(GrainShape::Cylinder { aspect: 1.0 });
        let error = Simulation::new(&scene, 1).unwrap().wall_loads().unwrap_err();
        assert_eq!(
            error.to_string(),
            "the load of a wall cannot be told of a scene with grains.shape"
        );
    }

    #[test]
    fn a_wedge_without_friction_shares_the_weight() {
        let mut scene = Scene::drop(0.1);
        scene.material = Material::new(0.0, 0.0, 0.0).unwrap();
        for x in [-1.0, 1.0] {
            let shape = Shape::Plane { point: [0.0, 0.0, 0.1], normal: [x, 0.0, 1.0] };
            scene.walls.push(Wall::fixed(shape, WallMaterial::default()));
        }
        let height = 0.1 + 0.002 * 2f64.sqrt();
        let loads = loads(&mut scene, [0.0, 0.0, height]);
        assert_eq!((loads.len(), loads[0]), (3, WallLoad::default()));
        for (load, x) in loads[1..].iter().zip([-1.0, 1.0]) {
            let expected = Vector3::new(-x, 0.0, -1.0) * (0.5 * GRAVITY);
            assert!((load.force - expected).norm() < 1e-6, "{load:?}");
            assert!((load.normal_force - 0.5f64.sqrt() * GRAVITY).abs() < 1e-6, "{load:?}");
        }
    }
}
