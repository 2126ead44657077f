//! Bodies against answers that are known: one body first, then a stack and a heap.

mod edges;
mod flight;

use nalgebra::{UnitQuaternion, Vector3};

use super::body::{Moving, RigidBody};
use super::{Bodies, Step, Sweeps};
use crate::energy::Falling;
use crate::law::Small;
use crate::wall::Walls;
use crate::{GRAVITY, Material, Scene};
use granulcal_scene::{Ends, GrainShape, Shape, Solid, Wall, WallMaterial};

const DT: f64 = 1.0 / 2000.0;
const SIZE: f64 = 4e-3;
// The least as many as the most unless the impulses have settled to rounding: exams ask about the law.
const SWEEPS: Sweeps = Sweeps { least: 200, most: 200, settled: 1e-12, closing: 1e-9, idle: 0.0 };

/// Bodies over the ground z = 0 with a gravity of their own.
struct Exam {
    bodies: Bodies,
    gravity: Vector3<f64>,
    walls: Walls,
    material: Material,
}

impl Exam {
    #[allow(clippy::needless_pass_by_value)] // shapes are written where they are asked about
    fn new(shape: GrainShape, sliding_friction: f64, restitution: f64) -> Self {
        let solid = Solid::new(&shape, SIZE).unwrap();
        let material = Material { sliding_friction, restitution, ..Material::default() };
        let scene = Scene { material, ..Scene::drop(0.1) };
        Self {
            bodies: Bodies::new(solid, Small::OF_LARGE, Vec::new()),
            gravity: Vector3::new(0.0, 0.0, -GRAVITY),
            walls: Walls::of(&scene),
            material,
        }
    }

    /// The ground is a slope that falls towards +x.
    fn on_slope(mut self, angle: f64) -> Self {
        self.gravity = GRAVITY * Vector3::new(angle.sin(), 0.0, -angle.cos());
        self
    }

    fn put(&mut self, centre: [f64; 3], turned: UnitQuaternion<f64>) -> usize {
        self.bodies.all.push(RigidBody::still(centre.into(), turned));
        self.bodies.all.len() - 1
    }

    fn step(&mut self) -> Step {
        self.bodies.step(&self.gravity, &self.walls, &self.material, DT, SWEEPS)
    }

    fn run(&mut self, seconds: f64) {
        for _ in 0..(seconds / DT).round() as usize {
            self.step();
        }
    }

    fn body(&self, number: usize) -> (Vector3<f64>, Vector3<f64>, Vector3<f64>) {
        let body = &self.bodies.all[number];
        let moving = Moving::of(body, &self.bodies.solid);
        (moving.pose.centre, moving.velocity, moving.omega)
    }

    fn energy(&self) -> f64 {
        self.bodies.energy(&Falling { gravity: self.gravity, dt: DT }).total()
    }
}

fn cube() -> GrainShape {
    GrainShape::Box { aspect: [1.0; 3] }
}

#[test]
fn a_cube_slides_with_the_closed_form_and_rests_where_it_must() {
    for (angle, friction) in [(0.5_f64, 0.3_f64), (0.6, 0.2), (0.3, 0.0)] {
        let mut exam = Exam::new(cube(), friction, 0.0).on_slope(angle);
        exam.put([0.0, 0.0, 0.5 * SIZE], UnitQuaternion::identity());
        exam.run(0.2);
        let (_, velocity, omega) = exam.body(0);
        let expected = 0.2 * GRAVITY * (angle.sin() - friction * angle.cos());
        assert!((velocity.x / expected - 1.0).abs() < 1e-9, "{angle}: {} {expected}", velocity.x);
        assert!(velocity.y.abs() < 1e-12 && omega.norm() < 1e-9, "{velocity} {omega}");
    }
    // Steep, but held: tan 0.5 = 0.546.
    let mut exam = Exam::new(cube(), 0.55, 0.0).on_slope(0.5);
    exam.put([0.0, 0.0, 0.5 * SIZE], UnitQuaternion::identity());
    exam.run(0.5);
    let (centre, ..) = exam.body(0);
    assert!(centre.xy().norm() < 1e-7, "{centre}");
}

#[test]
fn a_brick_topples_where_its_weight_leaves_its_base() {
    // It is as wide as half of its height: tan of the angle at which it topples is 0.5.
    for (tangent, topples) in [(0.48_f64, false), (0.52, true)] {
        let tower = GrainShape::Box { aspect: [1.0, 1.0, 2.0] };
        let mut exam = Exam::new(tower, 2.0, 0.0).on_slope(tangent.atan());
        exam.put([0.0, 0.0, SIZE], UnitQuaternion::identity());
        exam.run(0.6);
        let up = exam.bodies.all[0].turned() * Vector3::z();
        assert_eq!(up.z < 0.5, topples, "tan {tangent}: {up}");
        if !topples {
            assert!(1.0 - up.z < 1e-9, "{up}");
        }
    }
}

#[test]
fn a_cylinder_rolls_about_its_axis_alone() {
    let angle = 0.2_f64;
    let mut exam = Exam::new(GrainShape::Cylinder { aspect: 1.0 }, 0.8, 0.0).on_slope(angle);
    exam.put([0.0, 0.0, 0.5 * SIZE], UnitQuaternion::identity());
    exam.run(0.3);
    let (centre, velocity, omega) = exam.body(0);
    // I = m r^2 / 2: two thirds of the acceleration of one that slides.
    let expected = 0.3 * GRAVITY * angle.sin() / 1.5;
    assert!((velocity.x / expected - 1.0).abs() < 1e-3, "{} {expected}", velocity.x);
    assert!((omega.y * 0.5 * SIZE / velocity.x - 1.0).abs() < 1e-3, "{omega}");
    assert!(omega.x.abs().max(omega.z.abs()) < 1e-6 * omega.y.abs(), "{omega}");
    assert!(velocity.y.abs() < 1e-9 && centre.y.abs() < 1e-9);
    // Turned by a quarter about the vertical it lies across and stays.
    let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
    let mut exam = Exam::new(GrainShape::Cylinder { aspect: 1.0 }, 0.8, 0.0).on_slope(angle);
    exam.put([0.0, 0.0, 0.5 * SIZE], turned);
    exam.run(0.3);
    assert!(exam.body(0).0.xy().norm() < 1e-9, "{}", exam.body(0).0);
}

#[test]
fn a_brick_lands_flat_on_its_closed_form_impulse() {
    for restitution in [0.0, 0.4, 0.9] {
        let brick = GrainShape::Box { aspect: [2.0, 1.5, 1.0] };
        let mut exam = Exam::new(brick, 0.5, restitution);
        let height = 0.02;
        exam.put([0.0, 0.0, 0.5 * SIZE + height], UnitQuaternion::identity());
        let (mut lowest, mut after) = (0.0_f64, 0.0_f64);
        for _ in 0..(0.2 / DT) as usize {
            exam.step();
            let (_, velocity, omega) = exam.body(0);
            assert!(omega.norm() < 1e-7, "{omega}");
            lowest = lowest.min(velocity.z);
            if lowest < -0.5 && velocity.z > -0.05 {
                after = velocity.z;
                break;
            }
        }
        let speed = (2.0 * GRAVITY * height).sqrt();
        // Velocities are half a substep old.
        let slack = GRAVITY * DT;
        assert!((after - restitution * speed).abs() < 1.01 * slack, "{restitution}: {after}");
    }
}

#[test]
fn a_free_body_keeps_energy_and_momentum_and_flips_about_its_middle_axis() {
    let mut exam = Exam::new(GrainShape::Box { aspect: [1.0, 2.0, 3.0] }, 0.0, 0.0);
    exam.gravity = Vector3::zeros();
    exam.put([0.0, 0.0, 1.0], UnitQuaternion::identity());
    // About y, the middle axis, with a disturbance of a thousandth.
    let inertia = exam.bodies.solid.inertia;
    let omega = Vector3::new(0.02, 20.0, 0.02);
    exam.bodies.all[0].momentum = inertia.component_mul(&omega).into();
    let (before, momentum) = (exam.energy(), exam.bodies.all[0].momentum);
    let mut has_flipped = false;
    for _ in 0..6000 {
        exam.step();
        let spin = exam.bodies.all[0].turned() * Vector3::y();
        has_flipped |= spin.y < -0.9;
        assert!((exam.energy() / before - 1.0).abs() < 1e-4, "{}", exam.energy() / before);
    }
    assert!(has_flipped);
    let now = Vector3::from(exam.bodies.all[0].momentum);
    assert!((now - Vector3::from(momentum)).norm() < 1e-10 * now.norm());
}

#[test]
fn a_stack_of_ten_cubes_stands_ten_seconds() {
    let mut exam = Exam::new(cube(), 0.5, 0.3);
    for level in 0..10 {
        exam.put([0.0, 0.0, (f64::from(level) + 0.5) * SIZE], UnitQuaternion::identity());
    }
    exam.run(10.0);
    for (level, body) in exam.bodies.all.iter().enumerate() {
        let [x, y, z] = body.centre;
        let aside = x.hypot(y) / SIZE;
        let sunk = ((level as f64 + 0.5) * SIZE - z) / SIZE;
        let up = (body.turned() * Vector3::z()).z;
        assert!(aside < 0.01 && sunk.abs() < 0.05, "{level}: {aside} aside, {sunk} sunk");
        assert!(1.0 - up < 1e-4, "{level}: {up}");
    }
}

#[test]
fn no_energy_is_created_in_a_heap() {
    for shape in [
        cube(),
        GrainShape::Cylinder { aspect: 1.0 },
        GrainShape::Superquadric { aspect: [1.0, 0.8, 0.6], exponents: [4.0, 4.0] },
    ] {
        let mut exam = Exam::new(shape, 0.4, 0.8);
        let turn = |k: i32| {
            let angle = |f: f64| (f * f64::from(k)).sin() * 3.0;
            UnitQuaternion::from_euler_angles(angle(1.3), angle(2.1), angle(0.7))
        };
        for k in 0..27 {
            let at = |n: i32| 2.2 * SIZE * f64::from(n - 1);
            exam.put([at(k % 3), at(k / 3 % 3), 0.01 + at(k / 9) + 2.2 * SIZE], turn(k));
        }
        let (mut least, mut created, mut deepest) = (exam.energy(), 0.0_f64, 0.0_f64);
        let start = least;
        for _ in 0..(0.4 / DT) as usize {
            deepest = deepest.max(exam.step().deepest);
            let now = exam.energy();
            created = created.max(now - least);
            least = least.min(now);
        }
        assert!(created < 1e-3 * start, "{created} of {start}");
        // A corner that no manifold had before may enter by the way of a substep: 0.23 mm was seen.
        assert!(deepest < 0.1 * SIZE, "{deepest}");
        let lowest = exam.bodies.all.iter().map(|b| b.centre[2]).fold(f64::MAX, f64::min);
        assert!(lowest > 0.25 * SIZE, "{lowest}");
    }
}

#[test]
fn a_cube_lies_on_the_end_of_a_pipe() {
    // It is wider than the pipe: no corner of it meets a wall, and no surface of the pipe its faces.
    let (from, to) = ([0.0; 3], [0.0, 0.0, 0.01]);
    let pipe = Shape::Cylinder { from, to, radius: 0.35 * SIZE, closed: Ends::None };
    for aside in [0.0, 0.2 * SIZE] {
        let mut exam = Exam::new(cube(), 0.5, 0.3);
        let wall = Wall::fixed(pipe.clone(), WallMaterial::default());
        exam.walls = Walls::of(&Scene { walls: vec![wall], ..Scene::drop(0.1) });
        let turned = UnitQuaternion::from_euler_angles(0.1, 0.05, 0.3);
        exam.put([aside, 0.0, 0.01 + 0.7 * SIZE], turned);
        exam.run(1.0);
        let (centre, velocity, omega) = exam.body(0);
        assert!((centre.z - 0.01 - 0.5 * SIZE).abs() < 0.02 * SIZE, "{centre}");
        let slow = velocity.norm() < 1e-3 && omega.norm() * SIZE < 2e-3;
        assert!(slow, "{velocity} {omega}");
    }
}

/// A cube that leans over the rim of a bowl from outside, a corner inside and its centre outside, is not in the wall.
#[test]
fn a_cube_over_a_rim_is_not_in_the_wall() {
    let (height, radius, lean) = (0.01, 0.2, 20.0_f64.to_radians());
    let shape =
        Shape::Cylinder { from: [0.0; 3], to: [0.0, 0.0, height], radius, closed: Ends::None };
    let deepest = |from_rim: [f64; 2]| {
        let mut exam = Exam::new(cube(), 0.5, 0.0);
        let wall = Wall::fixed(shape.clone(), WallMaterial::default());
        exam.walls = Walls::of(&Scene { walls: vec![wall], ..Scene::drop(0.1) });
        exam.gravity = Vector3::zeros();
        // From its corner inside to its centre.
        let turned = UnitQuaternion::from_axis_angle(&-Vector3::y_axis(), lean);
        let to_centre = turned * (0.5 * SIZE * Vector3::new(1.0, 0.0, 1.0));
        let corner = Vector3::new(radius + from_rim[0], 0.0, height + from_rim[1]);
        exam.put((corner + to_centre).into(), turned);
        assert!(exam.body(0).0.x > radius);
        exam.step().deepest
    };
    // Its lower face passes over the rim, then the rim is in that face. Far below it two other corners are in the wall.
    assert_eq!(deepest([-0.15 * SIZE, -0.05 * SIZE]), 0.0);
    let into_face = deepest([-0.15 * SIZE, -0.08 * SIZE]);
    assert!(
        (into_face - (0.08 * lean.cos() - 0.15 * lean.sin()) * SIZE).abs() < 1e-5,
        "{into_face}"
    );
    let into_wall = deepest([(lean.sin() - 0.01) * SIZE, -1.5 * SIZE]);
    // They are at the ends of an edge, which is nearer to the round wall in its middle.
    let wanted = 0.01 * SIZE - 0.125 * SIZE * SIZE / radius;
    assert!((into_wall - wanted).abs() < 1e-7, "{into_wall}");
}

/// Tetrahedra that are thrown into the edges and corners of closed boxes and tubes stay in them.
#[test]
fn sharp_grains_stay_in_what_is_closed() {
    let points = vec![[1.0, 1.0, 1.0], [-1.0, -1.0, 1.0], [-1.0, 1.0, -1.0], [1.0, -1.0, -1.0]];
    let half = 0.02;
    let closed =
        Shape::Box { min: [-half, -half, 0.04], max: [half, half, 0.08], open: Vec::new() };
    let tube = Shape::Cylinder {
        from: [0.0, 0.0, 0.04],
        to: [0.0, 0.0, 0.08],
        radius: half,
        closed: Ends::Both,
    };
    for (shape, seed) in
        [closed, tube].into_iter().flat_map(|s| (0..6).map(move |k| (s.clone(), k)))
    {
        let mut exam = Exam::new(GrainShape::Hull { points: points.clone() }, 0.3, 0.5);
        let wall = Wall::fixed(shape, WallMaterial::default());
        exam.walls = Walls::of(&Scene { walls: vec![wall], ..Scene::drop(0.1) });
        exam.gravity = Vector3::new(6.0, 4.0, -GRAVITY);
        let angle = |f: f64| 3.0 * (f * (f64::from(seed) + 1.0)).sin();
        let turned = UnitQuaternion::from_euler_angles(angle(1.3), angle(2.1), angle(0.7));
        let body = exam.put([0.0, 0.0, 0.06], turned);
        for _ in 0..1000 {
            exam.step();
            let centre = exam.body(body).0;
            let across = centre.x.abs().max(centre.y.abs());
            assert!(across < half && (0.04..0.08).contains(&centre.z), "{seed}: {centre}");
        }
    }
}

/// Cubes that are thrown into a corner of each other, spinning: what an impact turns must not be turned through others.
#[test]
fn spinning_cubes_do_not_enter_each_other() {
    let mut exam = Exam::new(cube(), 0.4, 0.5);
    let angle = |k: i32, f: f64| (f * f64::from(k)).sin() * 3.0;
    for k in 0..60 {
        let at = |n: i32| 1.9 * SIZE * f64::from(n - 1);
        let turned = UnitQuaternion::from_euler_angles(angle(k, 1.3), angle(k, 2.1), angle(k, 0.7));
        exam.put([at(k % 3), at(k / 3 % 4), 0.01 + at(k / 12) + 2.2 * SIZE], turned);
        let omega = 60.0 * Vector3::new(angle(k, 0.9), angle(k, 1.7), angle(k, 2.9));
        let velocity = Vector3::new(0.3 * angle(k, 3.1), 0.3 * angle(k, 0.3), -1.0);
        exam.bodies.set_motion(k as usize, &velocity, &omega);
    }
    let start = exam.energy();
    let mut deepest = 0.0_f64;
    for _ in 0..(0.3 / DT) as usize {
        deepest = deepest.max(exam.step().deepest);
        assert!(exam.energy() <= start * 1.001, "{} of {start}", exam.energy());
    }
    assert!(deepest < 0.04 * SIZE, "{} of a cube", deepest / SIZE);
}

/// What is out of a body's reach is not once an impact has changed its motion: the ground of a cube that another
/// strikes, the neighbour of a ball, and a ball that falls behind one which the ground stops.
#[test]
fn what_is_struck_enters_nothing() {
    let struck = |shape: &GrainShape, bodies: [(f64, f64); 3]| {
        let mut exam = Exam::new(shape.clone(), 0.3, 0.5);
        for (number, (height, speed)) in bodies.into_iter().enumerate() {
            // Not quite above each other: GJK has no way out along an axis of two lattices that lie alike.
            let aside = 0.01 * number as f64;
            let turned = UnitQuaternion::from_euler_angles(0.0, 0.0, 30.0 * aside);
            exam.put([aside * SIZE, 0.0, height * SIZE], turned);
            exam.bodies.set_motion(number, &Vector3::new(0.0, 0.0, -speed), &Vector3::zeros());
        }
        let start = exam.energy();
        for _ in 0..10 {
            exam.step();
            let heights: Vec<_> = exam.bodies.all.iter().map(|b| b.centre[2] / SIZE).collect();
            assert!(heights[0] > 0.49, "{heights:?}");
            assert!(heights.windows(2).all(|h| h[1] - h[0] > 0.99), "{heights:?}");
            assert!(exam.energy() <= start * (1.0 + 1e-9), "{} of {start}", exam.energy());
        }
    };
    struck(&cube(), [(0.6, 0.0), (1.8, 0.0), (2.9, 6.0)]);
    let ball = GrainShape::Superquadric { aspect: [1.0; 3], exponents: [2.0, 2.0] };
    struck(&ball, [(9.0, 0.0), (10.15, 0.0), (11.3, 6.0)]);
    struck(&ball, [(0.6, 6.0), (1.75, 6.0), (9.0, 0.0)]);
}

/// A cube that another throws against a shell within a substep does not go through it, as it does not through a plane.
#[test]
fn what_is_struck_goes_through_no_shell() {
    let radius = 0.2;
    let shape =
        Shape::Cylinder { from: [0.0, 0.0, -0.1], to: [0.0, 0.0, 0.1], radius, closed: Ends::None };
    let mut exam = Exam::new(cube(), 0.3, 0.5);
    let wall = Wall::fixed(shape, WallMaterial::default());
    exam.walls = Walls::of(&Scene { walls: vec![wall], ..Scene::drop(0.1) });
    exam.gravity = Vector3::zeros();
    for (number, (from_wall, speed)) in [(0.6, 0.0), (1.8, 6.0)].into_iter().enumerate() {
        exam.put([radius - from_wall * SIZE, 0.0, 0.05], UnitQuaternion::identity());
        exam.bodies.set_motion(number, &(speed * Vector3::x()), &Vector3::zeros());
    }
    for _ in 0..10 {
        exam.step();
        let at = exam.body(0).0.xy().norm();
        assert!(radius - at > 0.49 * SIZE, "{} of a cube from the wall", (radius - at) / SIZE);
    }
}
