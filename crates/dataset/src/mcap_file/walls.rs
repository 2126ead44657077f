//! The walls of a scene as foxglove.SceneUpdate: what Foxglove draws beside the grains.

use foxglove::messages::{
    Color, CubePrimitive, CylinderPrimitive, Point3, Pose, Quaternion, SceneEntity, SceneUpdate,
    TriangleListPrimitive, Vector3 as Vector,
};
use granulcal_scene::{BoxSide, Funnel, Scene, Shape};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::stamp::{WORLD, timestamp};

const WALL: Color = Color { r: 0.55, g: 0.6, b: 0.75, a: 0.35 };
const GROUND: Color = Color { r: 0.35, g: 0.35, b: 0.35, a: 1.0 };
/// Half the side of the ground and of planes that are drawn, and half their thickness `[m]`.
const REACH: f64 = 1.0;
const THIN: f64 = 5e-4;

/// The walls at `time` `[s]`.
pub(super) fn walls(scene: &Scene, time: f64) -> SceneUpdate {
    let mut entities = vec![ground(time)];
    if let Some(funnel) = &scene.funnel {
        let mut entity = empty("funnel", time);
        let pose = funnel.motion.pose(time);
        entity.cylinders = funnel_parts(funnel)
            .into_iter()
            .filter(|(from, to, _)| (to - from).norm() > 0.0)
            .map(|(from, to, radii)| shell(&pose, &from, &to, radii))
            .collect();
        entities.push(entity);
    }
    for (i, wall) in scene.walls.iter().enumerate() {
        let mut entity = empty(&format!("walls.{i}"), time);
        draw(&mut entity, &wall.shape, &wall.motion.pose(time));
        entities.push(entity);
    }
    SceneUpdate { deletions: Vec::new(), entities }
}

/// Whether a wall moves, so that it has to be drawn in every frame.
pub(super) fn move_ever(scene: &Scene) -> bool {
    let of_funnel = scene.funnel.iter().map(|funnel| &funnel.motion);
    let mut all = of_funnel.chain(scene.walls.iter().map(|wall| &wall.motion));
    all.any(|motion| !motion.is_still())
}

fn empty(id: &str, time: f64) -> SceneEntity {
    SceneEntity {
        timestamp: timestamp(time),
        frame_id: WORLD.to_owned(),
        id: id.to_owned(),
        ..SceneEntity::default()
    }
}

fn ground(time: f64) -> SceneEntity {
    let below = Translation3::new(0.0, 0.0, -THIN).into();
    let cube = cube(&below, [2.0 * REACH, 2.0 * REACH, 2.0 * THIN], GROUND);
    SceneEntity { cubes: vec![cube], ..empty("ground", time) }
}

type Part = (Vector3<f64>, Vector3<f64>, [f64; 2]);

fn funnel_parts(funnel: &Funnel) -> [Part; 2] {
    let at = |z| Vector3::new(0.0, 0.0, z);
    let neck = funnel.height + funnel.stem_length;
    let rim = neck + funnel.cone_length;
    let (stem, wide) = (funnel.stem_radius, funnel.rim_radius);
    [(at(funnel.height), at(neck), [stem, stem]), (at(neck), at(rim), [stem, wide])]
}

fn draw(entity: &mut SceneEntity, shape: &Shape, pose: &Isometry3<f64>) {
    match shape {
        Shape::Plane { point, normal } => {
            let here = pose * upright(&Vector3::from(*point), &Vector3::from(*normal));
            let lowered = here * Translation3::new(0.0, 0.0, -THIN);
            entity.cubes.push(cube(&lowered, [2.0 * REACH, 2.0 * REACH, 2.0 * THIN], WALL));
        }
        Shape::Cone { from, to, radius_from, radius_to, .. } => {
            let (from, to) = (Vector3::from(*from), Vector3::from(*to));
            entity.cylinders.push(shell(pose, &from, &to, [*radius_from, *radius_to]));
        }
        Shape::Cylinder { from, to, radius, .. } => {
            let (from, to) = (Vector3::from(*from), Vector3::from(*to));
            entity.cylinders.push(shell(pose, &from, &to, [*radius, *radius]));
        }
        Shape::Disc { centre, normal, radius } => {
            let half = THIN * Vector3::from(*normal).normalize();
            let centre = Vector3::from(*centre);
            let (from, to) = (centre - half, centre + half);
            entity.cylinders.push(shell(pose, &from, &to, [*radius, *radius]));
        }
        Shape::Box { min, max, open } => {
            let sides = BoxSide::ALL.into_iter().filter(|side| !open.contains(side));
            let (min, max) = (Vector3::from(*min), Vector3::from(*max));
            entity.cubes.extend(sides.map(|side| plate(pose, &min, &max, side)));
        }
        Shape::Mesh(file) => {
            if let Some(mesh) = &file.mesh {
                let unit = file.unit;
                let point =
                    |&[x, y, z]: &[f64; 3]| Point3 { x: unit * x, y: unit * y, z: unit * z };
                entity.triangles.push(TriangleListPrimitive {
                    pose: Some(as_pose(pose)),
                    points: mesh.vertices().iter().map(point).collect(),
                    color: Some(WALL),
                    colors: Vec::new(),
                    indices: mesh.triangles().iter().flatten().copied().collect(),
                });
            }
        }
    }
}

/// A side of a box as a thin plate.
fn plate(
    pose: &Isometry3<f64>,
    min: &Vector3<f64>,
    max: &Vector3<f64>,
    side: BoxSide,
) -> CubePrimitive {
    let (axis, end) = match side {
        BoxSide::XMin => (0, min),
        BoxSide::XMax => (0, max),
        BoxSide::YMin => (1, min),
        BoxSide::YMax => (1, max),
        BoxSide::ZMin => (2, min),
        BoxSide::ZMax => (2, max),
    };
    let (mut centre, mut size) = (0.5 * (min + max), max - min);
    (centre[axis], size[axis]) = (end[axis], 2.0 * THIN);
    cube(&(pose * Translation3::from(centre)), size.into(), WALL)
}

/// A round wall between two points, its radii at both.
fn shell(
    pose: &Isometry3<f64>,
    from: &Vector3<f64>,
    to: &Vector3<f64>,
    radii: [f64; 2],
) -> CylinderPrimitive {
    let (middle, axis) = (0.5 * (from + to), to - from);
    let widest = radii[0].max(radii[1]);
    CylinderPrimitive {
        pose: Some(as_pose(&(pose * upright(&middle, &axis)))),
        size: Some(Vector { x: 2.0 * widest, y: 2.0 * widest, z: axis.norm() }),
        bottom_scale: radii[0] / widest,
        top_scale: radii[1] / widest,
        color: Some(WALL),
    }
}

/// The pose whose origin is `at` and whose z axis points along `axis`.
fn upright(at: &Vector3<f64>, axis: &Vector3<f64>) -> Isometry3<f64> {
    let half_turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    let turn = UnitQuaternion::rotation_between(&Vector3::z(), axis).unwrap_or(half_turn);
    Isometry3::from_parts(Translation3::from(*at), turn)
}

fn cube(pose: &Isometry3<f64>, size: [f64; 3], color: Color) -> CubePrimitive {
    let [x, y, z] = size;
    CubePrimitive { pose: Some(as_pose(pose)), size: Some(Vector { x, y, z }), color: Some(color) }
}

fn as_pose(pose: &Isometry3<f64>) -> Pose {
    let (at, turn) = (pose.translation.vector, pose.rotation);
    Pose {
        position: Some(Vector { x: at.x, y: at.y, z: at.z }),
        orientation: Some(Quaternion { x: turn.i, y: turn.j, z: turn.k, w: turn.w }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_funnel_stands_where_its_grains_run() {
        let update = walls(&Scene::funnel(0.12), 0.0);
        assert_eq!(update.entities.len(), 2);
        let funnel = &update.entities[1];
        let cone = &funnel.cylinders[1];
        let at = cone.pose.as_ref().unwrap().position.as_ref().unwrap();
        // Tip 12 cm, stem 1 cm, cone 7 cm: its middle is at 16.5 cm.
        assert!((at.z - 0.165).abs() < 1e-12, "{at:?}");
        let size = cone.size.as_ref().unwrap();
        assert!((size.x - 0.12).abs() < 1e-12 && (size.z - 0.07).abs() < 1e-12);
        assert!((cone.bottom_scale - 0.016 / 0.06).abs() < 1e-12 && cone.top_scale == 1.0);
        assert!(!move_ever(&Scene::funnel(0.12)));
    }
}
