//! Bodies at the edges of boxes: on the top of a wall, over the side of a table, across two edges, across a ridge.

use super::*;
use granulcal_scene::BoxSide;

/// A box of which the sides stay that are not open.
fn sides(min: [f64; 3], max: [f64; 3], stay: &[BoxSide]) -> Wall {
    let open = BoxSide::ALL.into_iter().filter(|side| !stay.contains(side)).collect();
    Wall::fixed(Shape::Box { min, max, open }, WallMaterial::default())
}

fn among(shape: GrainShape, friction: f64, restitution: f64, walls: Vec<Wall>) -> Exam {
    let mut exam = Exam::new(shape, friction, restitution);
    exam.walls = Walls::of(&Scene { walls, ..Scene::drop(0.1) });
    exam
}

const HEIGHT: f64 = 0.03;

/// A table x < 0 of one side of a box.
fn table() -> Wall {
    sides([-0.05, -0.05, 0.0], [0.0, 0.05, HEIGHT], &[BoxSide::ZMax])
}

#[test]
fn a_cube_stays_on_a_table_if_its_centre_does() {
    for (centre, stays) in [(-0.05, true), (-0.3, true), (0.05, false), (0.3, false)] {
        let mut exam = among(cube(), 0.8, 0.0, vec![table()]);
        let turned = UnitQuaternion::from_euler_angles(0.0, 0.0, 0.4);
        exam.put([centre * SIZE, 0.0, HEIGHT + 0.5 * SIZE], turned);
        let (mut deepest, start) = (0.0_f64, exam.energy());
        for _ in 0..(1.5 / DT) as usize {
            deepest = deepest.max(exam.step().deepest);
            assert!(exam.energy() < start * (1.0 + 1e-3), "{} of {start}", exam.energy());
        }
        let at = exam.body(0).0;
        assert!(deepest < 0.05 * SIZE, "{centre}: {}", deepest / SIZE);
        if stays {
            let moved = (at - Vector3::new(centre * SIZE, 0.0, HEIGHT + 0.5 * SIZE)).norm();
            assert!(moved < 1e-2 * SIZE, "{centre}: {}", moved / SIZE);
        } else {
            // On the ground, wherever it has rolled to.
            assert!(at.z < 0.9 * SIZE, "{centre}: {at}");
        }
    }
}

#[test]
fn a_plate_lies_across_two_edges_as_high_as_they_are() {
    // Two upright sides, nearer to each other than the plate is wide: all of its corners hang in the air.
    let stay = [BoxSide::XMin, BoxSide::XMax];
    let walls = |x: f64| vec![sides([-x * SIZE, -0.05, 0.0], [x * SIZE, 0.05, HEIGHT], &stay)];
    // The longest extent of a hull is its size.
    let plate = GrainShape::Box { aspect: [2.0, 2.0, 0.5] };
    for (shape, apart) in [
        (plate.clone(), 0.7),
        (
            GrainShape::Hull {
                points: (0..8)
                    .map(|n: i32| {
                        let half =
                            |bit: i32, half: f64| if n >> bit & 1 == 1 { half } else { -half };
                        [half(0, 1.0), half(1, 1.0), half(2, 0.25)]
                    })
                    .collect(),
            },
            0.35,
        ),
    ] {
        let mut exam = among(shape, 0.5, 0.3, walls(apart));
        // A hull lies along its principal axes, its thickness along that of the largest moment.
        let solid = &exam.bodies.solid;
        let thin = solid.half_extents.imin();
        let half = solid.half_extents[thin];
        let to_z = UnitQuaternion::rotation_between(&Vector3::ith(thin, 1.0), &Vector3::z());
        let turned = UnitQuaternion::from_euler_angles(0.03, 0.02, 0.0) * to_z.unwrap_or_default();
        let wide = solid.half_extents.max();
        exam.put([0.0, 0.0, HEIGHT + half + 0.2 * SIZE], turned);
        exam.run(1.0);
        let (centre, velocity, omega) = exam.body(0);
        let high = (centre.z - HEIGHT - half) / SIZE;
        assert!(wide > 0.49 * SIZE && high.abs() < 5e-3, "{high}");
        assert!(velocity.norm() < 1e-3 && omega.norm() * SIZE < 2e-3, "{velocity} {omega}");
    }
    // Put down without a fall it is as high as the closed form to the slop.
    let mut exam = among(plate, 0.5, 0.0, walls(0.7));
    exam.put([0.0, 0.0, HEIGHT + 0.25 * SIZE], UnitQuaternion::identity());
    exam.run(1.0);
    let high = (exam.body(0).0.z - HEIGHT - 0.25 * SIZE) / SIZE;
    assert!(high.abs() < 3e-3, "{high}");
}

#[test]
fn a_plate_lies_on_a_closed_box_that_is_narrower() {
    let half = 0.6 * SIZE;
    let walls = vec![sides([-half, -half, 0.0], [half, half, HEIGHT], &BoxSide::ALL)];
    let mut exam = among(GrainShape::Box { aspect: [2.0, 2.0, 0.5] }, 0.5, 0.3, walls);
    let turned = UnitQuaternion::from_euler_angles(0.1, 0.05, 0.5);
    exam.put([0.1 * SIZE, 0.0, HEIGHT + 0.6 * SIZE], turned);
    exam.run(1.0);
    let (centre, velocity, omega) = exam.body(0);
    let high = (centre.z - HEIGHT - 0.25 * SIZE) / SIZE;
    assert!(high.abs() < 5e-3, "{high}");
    assert!(velocity.norm() < 1e-3 && omega.norm() * SIZE < 2e-3, "{velocity} {omega}");
}

/// Nine grains that fall on the top of an upright side, or on the outlet of a tray, are nowhere deep in it.
#[test]
fn what_falls_on_an_edge_is_not_in_it() {
    let upright = || sides([-0.03, 0.0, 0.0], [0.03, 0.03, HEIGHT], &[BoxSide::YMin]);
    let floor = || sides([-0.03, -0.03, 0.0], [0.03, 0.0015, HEIGHT], &[BoxSide::ZMax]);
    for shape in [cube(), GrainShape::Cylinder { aspect: 1.5 }] {
        for seed in 0..8 {
            let wall = if seed % 2 == 0 { upright() } else { floor() };
            let mut exam = among(shape.clone(), 0.4, 0.3, vec![wall]);
            let angle = |k: i32, f: f64| 3.0 * (f * f64::from(9 * seed + k + 1)).sin();
            for k in 0..9 {
                let at = |n: i32| 2.0 * SIZE * f64::from(n - 1) + 1e-4 * angle(k, 0.3);
                let turned = [1.3, 2.1, 0.7].map(|f| angle(k, f));
                let turned = UnitQuaternion::from_euler_angles(turned[0], turned[1], turned[2]);
                exam.put([at(k % 3), at(k / 3), HEIGHT + 0.02], turned);
            }
            let (mut deepest, start) = (0.0_f64, exam.energy());
            for _ in 0..(0.4 / DT) as usize {
                deepest = deepest.max(exam.step().deepest);
                assert!(exam.energy() <= start * (1.0 + 1e-4), "{} of {start}", exam.energy());
            }
            assert!(deepest < 0.1 * SIZE, "{seed}: {}", deepest / SIZE);
        }
    }
}

/// A start on a rim or on an edge is told with its wall.
#[test]
fn overlaps_with_edges_have_their_wall() {
    let walls = vec![sides([-0.03, 0.0, 0.0], [0.03, 0.03, HEIGHT], &[BoxSide::YMin])];
    let mut exam = among(cube(), 0.4, 0.3, walls);
    exam.put([0.0, 0.0, HEIGHT + 0.4 * SIZE], UnitQuaternion::identity());
    let overlaps = exam.bodies.overlaps(&exam.walls, &exam.material);
    assert!(!overlaps.is_empty());
    for (body, within, depth) in overlaps {
        let super::super::Within::Wall(surface) = within else { panic!() };
        assert_eq!((body, exam.walls.owner(surface)), (0, 1));
        assert!((depth - 0.1 * SIZE).abs() < 1e-6 * SIZE, "{}", depth / SIZE);
    }
}
