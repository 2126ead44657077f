//! Bodies that are not round in Rapier, for `bodies.py`: prints one JSON object of numbers.
//!
//! Lengths are counted in sizes of a grain and times in sqrt(size / 1 m), as in `rapier.rs`.

use std::time::Instant;

use rapier3d::parry::shape::HalfSpace;
use rapier3d::prelude::*;

const SIZE: f32 = 4e-3;
const HALF: f32 = 0.5 * SIZE;
const DT: f32 = 1.0 / 2000.0;
const GRAVITY: f32 = 9.81;
const HEAP: usize = 125;

struct Exam {
    world: PhysicsWorld,
    bodies: Vec<RigidBodyHandle>,
    friction: f32,
}

impl Exam {
    /// Bodies over the plane z = 0; gravity is turned by `angle` towards +x.
    fn new(friction: f32, angle: f32, gravity: f32) -> Self {
        let mut world = PhysicsWorld::new();
        world.gravity = Vector::new(gravity * angle.sin(), 0.0, -gravity * angle.cos());
        let parameters = &mut world.integration_parameters;
        parameters.dt = DT;
        parameters.length_unit = SIZE;
        let rate = SIZE.sqrt().recip();
        parameters.contact_softness.natural_frequency *= rate;
        parameters.static_contact_softness.natural_frequency *= rate;
        parameters.normalized_max_corrective_velocity *= rate;
        parameters.normalized_max_linear_velocity = f32::MAX;
        let plane = ColliderBuilder::new(SharedShape::new(HalfSpace::new(Vector::Z)));
        world.insert_collider(plane.friction(friction), None);
        Self { world, bodies: Vec::new(), friction }
    }

    fn put(&mut self, shape: ColliderBuilder, at: [f32; 3], turned: [f32; 3]) {
        let body = RigidBodyBuilder::dynamic()
            .translation(Vector::new(at[0], at[1], at[2]))
            .rotation(Vector::new(turned[0], turned[1], turned[2]))
            .can_sleep(false);
        let collider = shape.friction(self.friction).density(1300.0);
        self.bodies.push(self.world.insert(body, collider).0);
    }

    fn run(&mut self, seconds: f32) {
        for _ in 0..(seconds / DT).round() as usize {
            self.world.step();
        }
    }

    fn body(&self, number: usize) -> &RigidBody {
        &self.world.bodies[self.bodies[number]]
    }

    /// How far the axis of the first body is from upright `[rad]`.
    fn tilt(&self) -> f32 {
        (self.body(0).rotation() * Vector::Z).z.clamp(-1.0, 1.0).acos()
    }
}

fn cube() -> ColliderBuilder {
    ColliderBuilder::cuboid(HALF, HALF, HALF)
}

fn main() {
    let mut found: Vec<(&str, f32)> = Vec::new();
    let mut exam = Exam::new(0.3, 0.5, GRAVITY);
    exam.put(cube(), [0.0, 0.0, HALF], [0.0; 3]);
    exam.run(0.2);
    let expected = 0.2 * GRAVITY * (0.5_f32.sin() - 0.3 * 0.5_f32.cos());
    found.push(("slides", exam.body(0).linvel().x / expected));

    let mut exam = Exam::new(0.55, 0.5, GRAVITY);
    exam.put(cube(), [0.0, 0.0, HALF], [0.0; 3]);
    exam.run(0.5);
    let place = exam.body(0).translation();
    found.push(("held", place.x.hypot(place.y) / SIZE));

    let tower = |tangent: f32| {
        let mut exam = Exam::new(2.0, tangent.atan(), GRAVITY);
        exam.put(ColliderBuilder::cuboid(HALF, HALF, SIZE), [0.0, 0.0, SIZE], [0.0; 3]);
        exam.run(0.6);
        exam.tilt()
    };
    found.push(("stands", tower(0.48)));
    let topples = tower(0.52) > 1.0;

    let mut exam = Exam::new(0.8, 0.2, GRAVITY);
    // Rapier's cylinders stand along y, as this one lies.
    exam.put(ColliderBuilder::cylinder(HALF, HALF), [0.0, 0.0, HALF], [0.0; 3]);
    exam.run(0.3);
    found.push(("rolls", exam.body(0).linvel().x / (0.3 * GRAVITY * 0.2_f32.sin() / 1.5)));

    let mut exam = Exam::new(0.5, 0.0, GRAVITY);
    for level in 0..10 {
        exam.put(cube(), [0.0, 0.0, (level as f32 + 0.5) * SIZE], [0.0; 3]);
    }
    exam.run(10.0);
    let (mut aside, mut sunk) = (0.0_f32, 0.0_f32);
    for level in 0..10 {
        let place = exam.body(level).translation();
        aside = aside.max(place.x.hypot(place.y) / SIZE);
        sunk = sunk.max(level as f32 + 0.5 - place.z / SIZE);
    }
    found.extend([("aside", aside), ("sunk", sunk)]);

    let mut exam = Exam::new(0.0, 0.0, 0.0);
    let long = ColliderBuilder::cuboid(HALF, 2.0 * HALF, 3.0 * HALF);
    exam.put(long, [0.0, 0.0, 1.0], [0.0; 3]);
    let handle = exam.bodies[0];
    exam.world.bodies[handle].set_angvel(Vector::new(0.02, 20.0, 0.02), true);
    let energy = |exam: &Exam| exam.body(0).kinetic_energy();
    let begin = energy(&exam);
    let (mut least, mut most) = (begin, begin);
    for _ in 0..6000 {
        exam.run(DT);
        least = least.min(energy(&exam));
        most = most.max(energy(&exam));
    }
    found.push(("drift", (most - least) / begin));

    let mut exam = Exam::new(0.4, 0.0, GRAVITY);
    for k in 0..HEAP {
        let at = |n: usize| 2.2 * SIZE * (n as f32 - 2.0);
        let angle = |degrees: f32| (degrees * k as f32).to_radians();
        let place = [at(k % 5), at(k / 5 % 5), at(k / 25) + 6.6 * SIZE];
        exam.put(cube(), place, [angle(37.0), angle(71.0), angle(13.0)]);
    }
    let began = Instant::now();
    let mut deepest = 0.0_f32;
    let steps = 1000;
    for _ in 0..steps {
        exam.world.step();
        for number in 0..HEAP {
            let body = exam.body(number);
            for corner in 0..8 {
                let sign = |bit: usize| if corner >> bit & 1 == 0 { -HALF } else { HALF };
                let arm = body.rotation() * Vector::new(sign(0), sign(1), sign(2));
                deepest = deepest.max(-(body.translation() + arm).z);
            }
        }
    }
    let each = began.elapsed().as_secs_f32() / (HEAP * steps) as f32;
    found.extend([("deep", deepest / SIZE), ("cost", 1e6 * each)]);

    let numbers: Vec<String> = found.iter().map(|(name, v)| format!("\"{name}\": {v}")).collect();
    let falls = if topples { "yes" } else { "no" };
    println!("{{{}, \"topples\": \"{falls}\"}}", numbers.join(", "));
}
