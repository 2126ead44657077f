//! The pour in Rapier: balls, a half space, a triangle mesh of the funnel, and rolling resistance by hand.

use std::f32::consts::TAU;

use granulcal_dem::{Funnel, Material, Scene, Simulation};
use rapier3d::parry::shape::HalfSpace;
use rapier3d::prelude::*;

use crate::pile::Engine;

/// Facets around the funnel: its radius is off by at most 0.05 % of itself.
const FACETS: u32 = 96;

/// A world of Rapier with the grains at their start.
pub struct Rapier {
    world: PhysicsWorld,
    grains: Vec<RigidBodyHandle>,
    radius: f32,
    inertia: f32,
    rolling_at_pairs: f32,
    rolling_at_walls: f32,
    time_owed: f64,
}

impl Rapier {
    /// The scene with steps of `dt` `[s]`, the grains where granulcal puts them for this seed.
    ///
    /// Rapier is tuned for things of about a metre under gravity. Lengths are therefore counted in grain
    /// diameters L, and times, which Rapier does not scale, in sqrt(L / 1 m): its contact springs and its
    /// fastest correction of an overlap keep their ratio to free fall. Contacts are foreseen at half a
    /// diameter, about the way of a falling grain in a step of 1/600 s; the cap on speeds is lifted.
    pub fn new(scene: &Scene, start: &Simulation, dt: f64) -> Self {
        let mut world = PhysicsWorld::new();
        world.gravity = Vector::new(0.0, 0.0, scene.gravity[2] as f32);
        let parameters = &mut world.integration_parameters;
        parameters.dt = dt as f32;
        parameters.length_unit = scene.grains.diameter as f32;
        let rate = parameters.length_unit.sqrt().recip();
        parameters.contact_softness.natural_frequency *= rate;
        parameters.static_contact_softness.natural_frequency *= rate;
        parameters.normalized_max_corrective_velocity *= rate;
        parameters.normalized_prediction_distance = 0.5;
        parameters.normalized_max_linear_velocity = f32::MAX;

        let radius = scene.grains.radius() as f32;
        let density = scene.grains.density as f32;
        let mass = density * 4.0 / 3.0 * std::f32::consts::PI * radius.powi(3);
        let grains = start
            .positions()
            .iter()
            .map(|x| {
                let centre = Vector::new(x.x as f32, x.y as f32, x.z as f32);
                let body = RigidBodyBuilder::dynamic().translation(centre).can_sleep(false);
                let ball = coat(ColliderBuilder::ball(radius).density(density), &scene.material);
                world.insert(body, ball).0
            })
            .collect();
        let ground = SharedShape::new(HalfSpace::new(Vector::Z));
        let ground_material = scene.ground.material.over(&scene.material);
        world.insert_collider(coat(ColliderBuilder::new(ground), &ground_material), None);
        if let Some(funnel) = &scene.funnel {
            let (points, triangles) = mesh(funnel);
            let shell = ColliderBuilder::trimesh(points, triangles).expect("a mesh of triangles");
            world.insert_collider(coat(shell, &funnel.material.over(&scene.material)), None);
        }
        Self {
            world,
            grains,
            radius,
            inertia: 0.4 * mass * radius * radius,
            rolling_at_pairs: scene.material.rolling_friction as f32,
            rolling_at_walls: ground_material.rolling_friction as f32,
            time_owed: 0.0,
        }
    }

    /// Rolling and torsional resistance, which Rapier does not have: after a step every contact turns its two
    /// bodies against each other by at most mu_r R_eff lambda_n, and never past equal angular velocities.
    fn resist_rolling(&mut self) {
        let PhysicsWorld { narrow_phase, bodies, colliders, .. } = &mut self.world;
        for pair in narrow_phase.contact_pairs() {
            let impulse = pair.total_impulse_magnitude();
            if impulse <= 0.0 {
                continue;
            }
            let of = |handle| colliders.get(handle).and_then(Collider::parent);
            let (first, second) = (of(pair.collider1), of(pair.collider2));
            let spin = |body: Option<RigidBodyHandle>| {
                body.and_then(|handle| bodies.get(handle)).map_or(Vector::ZERO, RigidBody::angvel)
            };
            let relative = spin(first) - spin(second);
            // 1/I of the two, in units of a grain's 1/I: a wall does not turn.
            let (turning, limit) = match (first, second) {
                (Some(_), Some(_)) => (2.0, self.rolling_at_pairs * 0.5 * self.radius),
                _ => (1.0, self.rolling_at_walls * self.radius),
            };
            let stopping = relative * (self.inertia / turning);
            let share = (limit * impulse / stopping.length().max(f32::MIN_POSITIVE)).min(1.0);
            let change = stopping * (share / self.inertia);
            for (body, sign) in [(first, -1.0), (second, 1.0)] {
                if let Some(body) = body.and_then(|handle| bodies.get_mut(handle)) {
                    let omega = body.angvel() + change * sign;
                    body.set_angvel(omega, false);
                }
            }
        }
    }
}

impl Engine for Rapier {
    fn advance(&mut self, seconds: f64) {
        let dt = f64::from(self.world.integration_parameters.dt);
        self.time_owed += seconds;
        while self.time_owed > 0.5 * dt {
            self.world.step();
            self.resist_rolling();
            self.time_owed -= dt;
        }
    }

    fn positions(&self) -> Vec<[f64; 3]> {
        let centre = |&grain: &RigidBodyHandle| self.world.bodies[grain].translation();
        self.grains.iter().map(centre).map(|x| [x.x.into(), x.y.into(), x.z.into()]).collect()
    }

    fn speeds(&self) -> Vec<f64> {
        self.grains.iter().map(|&grain| self.world.bodies[grain].linvel().length().into()).collect()
    }

    /// Between grains; from their centres, since Rapier's own distances may be a few steps old.
    fn overlap(&self) -> f64 {
        let centre = |handle| {
            let body = self.world.colliders.get(handle)?.parent()?;
            Some(self.world.bodies[body].translation())
        };
        let distances =
            self.world.narrow_phase.contact_pairs().filter_map(|pair| {
                Some((centre(pair.collider1)? - centre(pair.collider2)?).length())
            });
        let nearest = distances.fold(2.0 * self.radius, f32::min);
        f64::from(1.0 - nearest / (2.0 * self.radius))
    }
}

fn coat(collider: ColliderBuilder, material: &Material) -> ColliderBuilder {
    collider.friction(material.sliding_friction as f32).restitution(material.restitution as f32)
}

/// Vertices and triangles of the funnel's cone and stem.
fn mesh(funnel: &Funnel) -> (Vec<Vector>, Vec<[u32; 3]>) {
    let neck = funnel.height + funnel.stem_length;
    let rings = [
        (funnel.stem_radius, funnel.height),
        (funnel.stem_radius, neck),
        (funnel.rim_radius, funnel.rim_height()),
    ];
    let mut points = Vec::new();
    let mut triangles = Vec::new();
    for (level, (radius, z)) in rings.into_iter().enumerate() {
        let ring = level as u32 * FACETS;
        for facet in 0..FACETS {
            let angle = TAU * facet as f32 / FACETS as f32;
            let radius = radius as f32;
            points.push(Vector::new(radius * angle.cos(), radius * angle.sin(), z as f32));
            if level > 0 {
                let next = (facet + 1) % FACETS;
                let below = ring - FACETS;
                triangles.push([below + facet, below + next, ring + facet]);
                triangles.push([below + next, ring + next, ring + facet]);
            }
        }
    }
    (points, triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One grain rolling on the level: -5/7 mu_r g, the closed form of docs/theory/contact.md. The spin is
    /// braked after a step and sliding friction couples it to the velocity in the next.
    #[test]
    fn rolling_resistance_by_hand_brakes_as_the_theory_says() {
        let mut scene = Scene::drop(0.0);
        scene.grains.count = 1;
        scene.material.rolling_friction = 0.1;
        scene.material.restitution = 0.0;
        let start = Simulation::new(&scene, 1).unwrap();
        let mut rapier = Rapier::new(&scene, &start, 1.0 / 4800.0);
        rapier.advance(0.2);
        let grain = rapier.grains[0];
        let speed = 0.3;
        let body = &mut rapier.world.bodies[grain];
        body.set_linvel(Vector::new(speed, 0.0, 0.0), true);
        body.set_angvel(Vector::new(0.0, speed / rapier.radius, 0.0), true);
        rapier.advance(0.2);
        let expected = f64::from(speed) - 5.0 / 7.0 * 0.1 * 9.81 * 0.2;
        let got = rapier.speeds()[0];
        assert!((got - expected).abs() < 0.01 * expected, "{got} instead of {expected}");
    }
}
