//! A liquid among the grains that flows by itself: what it does to them, and they to it.
//!
//! ```text
//! m dv/dt = (m - w m_f) g + w m_f e_r a_p + w k (U - v),   U = <v> + e_r (u - <v>.e_r)
//! rho_f q du/dt = ... + sum of w k (v.e_r - u) over an area
//! ```
//!
//! The liquid is a sheet about the z axis (`liquid/flow.rs`) with a surface h(r) and a velocity u outwards. A grain
//! feels it with the share w of its volume that is below that surface: buoyancy, the pressure that accelerates the
//! liquid there by a_p, half of what it displaces as added mass, and Di Felice's drag in a packing (`effect/drag.rs`,
//! which is Ergun's within a third) over `permeability`. What the drag gives to a grain it takes from the liquid,
//! radially; up and around the liquid goes with the grain's neighbours `<v>`, the ground among them. Drag is implicit
//! (`liquid/drag.rs`).
//!
//! Source: two phases, each with its momentum, averaged over the depth: Pitman and Le, Phil. Trans. R. Soc. A 363
//! (2005) 1573, doi:10.1098/rsta.2005.1596; slip of water and grains in a collapse: Meng et al., J. Fluid Mech. 943
//! (2022) A19, doi:10.1017/jfm.2022.400.

mod drag;
mod flow;
mod ground;
mod motion;
mod rows;
mod solids;

use std::f64::consts::PI;

use granulcal_scene::{Effect, Fluid, Motion, Scene, Shape};
use nalgebra::Vector3;

use crate::effect::{Drag, EffectContext, neighbours};
use crate::particles::Particles;
use drag::Dragged;
pub(crate) use flow::RadialFlow;
use flow::between;
use ground::Ground;
use motion::advance;
use solids::Solids;

/// Mass of liquid that goes with a grain past it, over what it displaces `[-]`.
const ADDED: f64 = 0.5;

/// The liquid of a scene.
#[derive(Clone, Debug)]
pub(crate) struct Liquid {
    spec: granulcal_scene::Liquid,
    drag: Drag,
    /// Density of the liquid over the grains' `[-]`.
    ratio: f64,
    /// Density over the mass of a typical grain `[1/m^3]`.
    mass: f64,
    ring: f64,
    tube: Option<Tube>,
    /// None before its begin.
    flow: Option<RadialFlow>,
}

/// The tube that the liquid stands in.
#[derive(Clone, Debug)]
struct Tube {
    /// Its lower end at its stated place `[m]`.
    lower: f64,
    motion: Motion,
}

impl Tube {
    /// The first upright cylinder about the z axis that is as wide as the liquid, within a grain's radius.
    fn of(scene: &Scene) -> Option<Self> {
        scene.walls.iter().find_map(|wall| match wall.shape {
            Shape::Cylinder { from, to, radius, .. }
                if [from, to].iter().all(|end| end[0] == 0.0 && end[1] == 0.0)
                    && (radius - scene.effects.liquid.radius).abs() < scene.grains.radius() =>
            {
                Some(Self { lower: from[2].min(to[2]), motion: wall.motion.clone() })
            }
            _ => None,
        })
    }

    /// The gap below it at `time` `[m]`.
    fn gap(&self, time: f64) -> f64 {
        (self.lower + self.motion.pose(time).translation.z).max(0.0)
    }
}

impl Liquid {
    /// The liquid of a scene, if there is one.
    pub fn of(scene: &Scene) -> Option<Self> {
        let spec = scene.effects.liquid;
        let grains = &scene.grains;
        let fluid = Fluid {
            density: spec.density,
            viscosity: spec.viscosity,
            added_mass: 0.0,
            crowding: 1.0,
            ..Fluid::default()
        };
        // Rings are a grain's radius wide, and end where the column does.
        let rings = (spec.radius / grains.radius()).round().max(1.0);
        spec.is_on().then(|| Self {
            spec,
            drag: Drag::of(fluid, grains, scene.gravity[2].abs()),
            ratio: spec.density / grains.density,
            mass: spec.density / (grains.density * 4.0 / 3.0 * PI * grains.radius().powi(3)),
            ring: spec.radius / rings,
            tube: Tube::of(scene),
            flow: None,
        })
    }

    /// What changes as it flows.
    pub fn state(&self) -> Option<&RadialFlow> {
        self.flow.as_ref()
    }

    /// Goes on from a state.
    ///
    /// # Errors
    /// What is wrong.
    pub fn take(&mut self, state: Option<RadialFlow>) -> Result<(), &'static str> {
        let is_like = state.as_ref().is_none_or(|flow| {
            flow.ring == self.ring && flow.speed.len() == flow.thickness.len() + 1
        });
        if !is_like {
            return Err("a liquid that is not the scene's");
        }
        self.flow = state;
        Ok(())
    }

    /// Height of the surface in each ring among these grains, and the rings' width `[m]`; none before its begin.
    pub fn profile(&self, particles: &Particles) -> Option<(f64, Vec<f64>)> {
        let flow = self.flow.as_ref()?;
        Some((self.ring, flow.heights(&Solids::of(particles, self.ring))))
    }

    /// Flows for a substep that begins at `time`, once gravity has acted on the grains, and acts on them; returns the
    /// energy that it gives them, per typical mass `[m^2/s^2]`.
    pub fn act(
        &mut self,
        particles: &mut Particles,
        context: &EffectContext<'_>,
        time: f64,
    ) -> f64 {
        if time < self.spec.begin {
            return 0.0;
        }
        let gravity = context.gravity.norm();
        let solids = Solids::of(particles, self.ring);
        let count = (self.spec.radius / self.ring).round() as usize;
        let flow = self.flow.get_or_insert_with(|| {
            RadialFlow::at_rest(self.ring, count, self.spec.height, &solids)
        });
        let gate = self.tube.as_ref().map(|tube| (count, tube.gap(time)));
        let ground = Ground {
            gravity,
            viscosity: self.spec.viscosity / self.spec.density,
            puddle: self.spec.puddle(gravity),
            suction: (self.spec.suction(2.0 * context.radius, gravity), context.radius),
            gate,
        };
        let sheet = Sheet::of(flow, &solids);
        let unit = (self.ring, 2.0 * PI * self.ring * self.ring * self.mass);
        let around = neighbours(particles, context.pairs, &(context.dt * context.gravity));
        let (mut wet, mut dragged) = (Vec::new(), Vec::new());
        let mut given = 0.0;
        for (grain, near) in around.iter().enumerate() {
            let share = sheet.wet(particles, grain);
            if share == 0.0 || particles.has_left(grain) {
                continue;
            }
            let energy = Along::of(particles, grain);
            let (drag, strength) = (&self.drag, share / self.spec.permeability);
            let (_, mean) = near.crowd_and_mean();
            let crowd = sheet.crowd(particles, grain);
            let speed = sheet.speed(flow, particles, grain);
            let rate = beside(particles, grain, (drag, strength), (crowd, &mean, speed), context);
            wet.push((grain, share, energy));
            let added = ADDED * share * self.ratio;
            dragged.push(dragged_one(particles, grain, (rate, added), unit));
        }
        advance(flow, &solids, &ground, &mut dragged, context.dt);
        for ((grain, share, energy), one) in wet.into_iter().zip(dragged) {
            let (_, outwards) = from_axis(&particles.position(grain));
            let gained = one.speed - particles.velocity(grain).dot(&outwards);
            let along = flow.pressure_at(one.at) * outwards - context.gravity;
            let push = gained * outwards + context.dt * share * self.ratio * along;
            particles.bodies[grain].velocity.add(&push);
            given += Along::of(particles, grain).gained_since(&energy, particles.mass(grain));
        }
        given
    }
}

/// A grain as the flow knows it; `unit` is the mass of liquid of its own unit of volume.
fn dragged_one(
    particles: &Particles,
    grain: usize,
    (rate, added): (f64, f64),
    (ring, unit): (f64, f64),
) -> Dragged {
    let (distance, outwards) = from_axis(&particles.position(grain));
    Dragged {
        at: distance / ring,
        mass: particles.mass(grain) / unit,
        rate,
        added,
        speed: particles.velocity(grain).dot(&outwards),
    }
}

/// Drags a grain up and around with its neighbours and takes its spin; returns the rate at which it is dragged
/// outwards, where the liquid has the velocity `speed`.
fn beside(
    particles: &mut Particles,
    grain: usize,
    (drag, share): (&Drag, f64),
    (crowd, mean, speed): (f64, &Vector3<f64>, f64),
    context: &EffectContext<'_>,
) -> f64 {
    let (_, outwards) = from_axis(&particles.position(grain));
    let stream = mean + (speed - mean.dot(&outwards)) * outwards;
    let apart = particles.velocity(grain) - stream;
    let slip = (apart - context.dt * context.gravity).norm();
    let [linear, angular] = drag.crowded_rates(particles.radius(grain), slip, crowd);
    let k = context.dt * share * linear;
    let body = &mut particles.bodies[grain];
    body.velocity.add(&(-k / (1.0 + k) * (apart - apart.dot(&outwards) * outwards)));
    body.spin.scale(1.0 / (1.0 + context.dt * share * angular));
    share * linear
}

/// Squares of a grain's velocity along each axis: what falls on something that holds it takes nothing from what goes
/// along.
struct Along(Vector3<f64>);

impl Along {
    fn of(particles: &Particles, grain: usize) -> Self {
        let velocity = particles.velocity(grain);
        Self(velocity.component_mul(&velocity))
    }

    /// Kinetic energy of what has become faster.
    fn gained_since(&self, before: &Self, mass: f64) -> f64 {
        0.5 * mass * (self.0 - before.0).map(|gain| gain.max(0.0)).sum()
    }
}

/// The surface of the liquid as grains see it.
struct Sheet {
    ring: f64,
    /// Height in each ring `[m]`.
    heights: Vec<f64>,
    /// How crowded each ring is below it, over a packing `[-]`.
    crowds: Vec<f64>,
}

impl Sheet {
    fn of(flow: &RadialFlow, solids: &Solids) -> Self {
        let heights = flow.heights(solids);
        let crowds = heights.iter().enumerate().map(|(ring, &height)| solids.crowd(ring, height));
        Self { ring: flow.ring, crowds: crowds.collect(), heights }
    }

    /// How crowded a grain is: the solids in its ring over those of a packing up to the surface, which a layer of
    /// grains on the ground has and its neighbours do not tell.
    fn crowd(&self, particles: &Particles, grain: usize) -> f64 {
        self.between(&self.crowds, from_axis(&particles.position(grain)).0)
    }

    /// A value at a distance from the axis, linear between the middles of rings.
    fn between(&self, values: &[f64], distance: f64) -> f64 {
        between(values, (distance / self.ring - 0.5).max(0.0))
    }

    /// Share of a grain's volume that is below the surface `[-]`.
    fn wet(&self, particles: &Particles, grain: usize) -> f64 {
        let (place, radius) = (particles.position(grain), particles.radius(grain));
        let surface = self.between(&self.heights, place.x.hypot(place.y));
        let depth = surface - (place.z - radius);
        let share = (depth / (2.0 * radius)).clamp(0.0, 1.0);
        share * share * (3.0 - 2.0 * share)
    }

    /// Velocity of the liquid outwards at a grain `[m/s]`.
    fn speed(&self, flow: &RadialFlow, particles: &Particles, grain: usize) -> f64 {
        flow.speed_at(from_axis(&particles.position(grain)).0 / self.ring)
    }
}

/// Distance from the z axis, and the direction away from it.
fn from_axis(place: &Vector3<f64>) -> (f64, Vector3<f64>) {
    let away = Vector3::new(place.x, place.y, 0.0);
    let distance = away.norm();
    (distance, if distance > 0.0 { away / distance } else { Vector3::zeros() })
}

#[cfg(test)]
mod tests;
