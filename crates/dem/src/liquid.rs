//! A liquid among the grains that flows by itself: what it does to them, and they to it.
//!
//! ```text
//! m dv/dt = (m - w m_f) g + w m_f e_r a_p + w k (U - v),   U = <v> + e_r (u - <v>.e_r)
//! rho_f q du/dt = ... + sum of w k (v.e_r - u) over an area
//! ```
//!
//! The liquid is a sheet about the z axis (`liquid/flow.rs`) with a surface h(r) and a velocity u outwards. A grain feels
//! it with the share w of its volume that is below that surface: buoyancy, the pressure that accelerates
//! the liquid there by a_p, and Di Felice's drag in a packing (`effect/drag.rs`, which is Ergun's within a third) over `permeability`.
//! What the drag gives to a grain it takes from the liquid, radially; up and around the liquid goes with the grain's
//! neighbours `<v>`, the ground among them. Drag is implicit in what either has after it, one grain after the other, so
//! that no drag is too strong for the substep. Added mass is left out.
//!
//! Source: two phases, each with its momentum, averaged over the depth: Pitman and Le, Phil. Trans. R. Soc. A 363 (2005)
//! 1573, doi:10.1098/rsta.2005.1596; slip of water and grains in a collapse: Meng et al., J. Fluid Mech. 943 (2022) A19,
//! doi:10.1017/jfm.2022.400.

mod flow;

use std::f64::consts::PI;

use granulcal_scene::{Effect, Fluid, Motion, Scene, Shape};
use nalgebra::Vector3;

use crate::effect::{Drag, EffectContext, neighbours};
use crate::particles::Particles;
pub(crate) use flow::RadialFlow;
use flow::{Dragging, Ground};

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
    pub fn state(&self) -> &Option<RadialFlow> {
        &self.flow
    }

    /// Goes on from a state.
    ///
    /// # Errors
    /// What is wrong.
    pub fn take(&mut self, state: Option<RadialFlow>) -> Result<(), &'static str> {
        let is_like = state.as_ref().is_none_or(|flow| {
            let circles = flow.thickness.len() + 1;
            flow.ring == self.ring && flow.speed.len() == circles && flow.grains.is_at(circles)
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
        let solids = solids(particles, self.ring);
        let heights = (0..flow.thickness.len()).map(|ring| flow.height(ring, &solids));
        Some((self.ring, heights.collect()))
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
        let solids = solids(particles, self.ring);
        let count = (self.spec.radius / self.ring).round() as usize;
        let flow = self.flow.get_or_insert_with(|| {
            RadialFlow::at_rest(self.ring, count, self.spec.height, &solids)
        });
        let gate = self.tube.as_ref().map(|tube| (count, tube.gap(time)));
        let ground = Ground {
            gravity,
            viscosity: self.spec.viscosity / self.spec.density,
            puddle: self.spec.puddle(gravity),
            gate,
        };
        flow.advance(&solids, &ground, context.dt);
        let heights: Vec<_> =
            (0..flow.thickness.len()).map(|ring| flow.height(ring, &solids)).collect();
        let mut masses: Vec<_> =
            (0..flow.speed.len()).map(|circle| self.mass * flow.volume_at(circle)).collect();
        // At the axis nothing flows.
        masses[0] *= f64::INFINITY;
        let pressure = flow.pressure.clone();
        let sheet =
            Sheet { ring: self.ring, heights: &heights, masses: &masses, pressure: &pressure };
        let around = neighbours(particles, context.pairs, &(context.dt * context.gravity));
        let (still, mut given) = (flow.speed.clone(), 0.0);
        let mut felt = Felt::new(&still);
        for (grain, near) in around.iter().enumerate() {
            let wet = sheet.wet(particles, grain);
            if wet == 0.0 || particles.has_left(grain) {
                continue;
            }
            let before = particles.velocity(grain);
            let (crowd, mean) = near.crowd_and_mean();
            self.push(particles, grain, &sheet, wet, context);
            let flow = self.flow.as_mut().expect("a liquid that has begun");
            let drag = (&self.drag, wet / self.spec.permeability);
            exchange(particles, grain, &sheet, flow, &mut felt, drag, (crowd, &mean), context);
            // Along each axis, for what falls on something that holds it takes nothing from what goes along.
            let after = particles.velocity(grain);
            let gained = after.component_mul(&after) - before.component_mul(&before);
            given += 0.5 * particles.mass(grain) * gained.map(|gain| gain.max(0.0)).sum();
        }
        let flow = self.flow.as_mut().expect("a liquid that has begun");
        flow.grains = felt.dragging(flow, &still, self.mass, context.dt);
        given
    }

    /// Buoyancy, and the pressure below a surface that slopes.
    fn push(
        &self,
        particles: &mut Particles,
        grain: usize,
        sheet: &Sheet<'_>,
        wet: f64,
        context: &EffectContext<'_>,
    ) {
        let (distance, outwards) = from_axis(&particles.position(grain));
        let along = |(circle, weight): &(usize, f64)| weight * sheet.pressure[*circle];
        let pressure: f64 = sheet.circles(distance).iter().map(along).sum();
        let step = context.dt * wet * self.ratio;
        let push = pressure * outwards - context.gravity;
        particles.bodies[grain].velocity.add(&(step * push));
    }
}

/// Drag between a grain and the liquid, at a share of the rate in a packing.
fn exchange(
    particles: &mut Particles,
    grain: usize,
    sheet: &Sheet<'_>,
    flow: &mut RadialFlow,
    felt: &mut Felt,
    (drag, share): (&Drag, f64),
    (crowd, mean): (f64, &Vector3<f64>),
    context: &EffectContext<'_>,
) {
    let (distance, outwards) = from_axis(&particles.position(grain));
    let circles = sheet.circles(distance);
    let speed: f64 = circles.iter().map(|(circle, weight)| weight * flow.speed[*circle]).sum();
    let stream = mean + (speed - mean.dot(&outwards)) * outwards;
    let velocity = particles.velocity(grain);
    let slip = (velocity - context.dt * context.gravity - stream).norm();
    let [linear, angular] = drag.crowded_rates(particles.radius(grain), slip, crowd);
    let k = context.dt * share * linear;
    let apart = velocity - stream;
    let radial = apart.dot(&outwards);
    let beside = apart - radial * outwards;
    // What a unit of impulse changes of the liquid's velocity at the grain.
    let mass = particles.mass(grain);
    let yields = circles.iter().map(|(circle, weight)| weight * weight / sheet.masses[*circle]);
    let k_r =
        if circles.is_empty() { 0.0 } else { k / (1.0 + k * (1.0 + mass * yields.sum::<f64>())) };
    let body = &mut particles.bodies[grain];
    body.velocity.add(&(-k / (1.0 + k) * beside - k_r * radial * outwards));
    body.spin.scale(1.0 / (1.0 + context.dt * share * angular));
    let coefficient = share * linear * mass;
    if let Some(rate) = felt.rates.get_mut((distance / sheet.ring) as usize) {
        *rate += coefficient;
    }
    for (circle, weight) in circles {
        felt.weights[circle] += weight * coefficient;
        felt.sums[circle] += weight * coefficient * velocity.dot(&outwards);
        flow.speed[circle] += weight * mass * k_r * radial / sheet.masses[circle];
    }
}

/// What is summed over the grains for the liquid: drag coefficients of rings, and with the velocities outwards of circles.
struct Felt {
    rates: Vec<f64>,
    weights: Vec<f64>,
    sums: Vec<f64>,
}

impl Felt {
    fn new(speed: &[f64]) -> Self {
        let none = vec![0.0; speed.len()];
        Self { rates: none.clone(), weights: none.clone(), sums: none }
    }

    /// What the liquid remembers of it; `mass` is its density over a typical grain's mass.
    fn dragging(&self, flow: &RadialFlow, before: &[f64], mass: f64, dt: f64) -> Dragging {
        let changes = flow.speed.iter().zip(before).map(|(now, then)| (now - then) / dt);
        let mean = |circle: usize| {
            let weight = self.weights[circle];
            if weight > 0.0 { self.sums[circle] / weight } else { flow.speed[circle] }
        };
        let rate = |ring: usize| {
            let mass = mass * flow.volume_of(ring);
            if mass > 0.0 { self.rates[ring] / mass } else { 0.0 }
        };
        Dragging {
            acceleration: changes.collect(),
            speed: (0..flow.speed.len()).map(mean).collect(),
            rate: (0..flow.thickness.len()).map(rate).collect(),
        }
    }
}

/// The liquid as grains see it in a substep.
struct Sheet<'a> {
    ring: f64,
    /// Surface in each ring `[m]`.
    heights: &'a [f64],
    /// Mass that has each circle's velocity, over that of a typical grain.
    masses: &'a [f64],
    /// What its pressure accelerates the liquid by at each circle `[m/s^2]`.
    pressure: &'a [f64],
}

impl Sheet<'_> {
    /// Height of the surface at a distance from the axis, linear between the middles of rings `[m]`.
    fn height(&self, distance: f64) -> f64 {
        let at = (distance.abs() / self.ring - 0.5).max(0.0);
        let ring = at as usize;
        let of = |ring: usize| self.heights.get(ring).copied().unwrap_or(0.0);
        of(ring) + at.fract() * (of(ring + 1) - of(ring))
    }

    /// Share of a grain's volume that is below the surface `[-]`.
    fn wet(&self, particles: &Particles, grain: usize) -> f64 {
        let (place, radius) = (particles.position(grain), particles.radius(grain));
        let depth = self.height(place.x.hypot(place.y)) - (place.z - radius);
        let share = (depth / (2.0 * radius)).clamp(0.0, 1.0);
        share * share * (3.0 - 2.0 * share)
    }

    /// The wet circles around a distance from the axis, each with the weight that its velocity has there.
    fn circles(&self, distance: f64) -> Vec<(usize, f64)> {
        let at = distance / self.ring;
        let (circle, share) = (at as usize, at.fract());
        let is_wet = |circle: usize| self.masses.get(circle).is_some_and(|&mass| mass > 0.0);
        match (is_wet(circle), is_wet(circle + 1)) {
            (true, true) => vec![(circle, 1.0 - share), (circle + 1, share)],
            (true, false) => vec![(circle, 1.0)],
            (false, true) => vec![(circle + 1, 1.0)],
            (false, false) => Vec::new(),
        }
    }
}

/// Distance from the z axis, and the direction away from it.
fn from_axis(place: &Vector3<f64>) -> (f64, Vector3<f64>) {
    let away = Vector3::new(place.x, place.y, 0.0);
    let distance = away.norm();
    (distance, if distance > 0.0 { away / distance } else { Vector3::zeros() })
}

/// Volume of the grains over the area of each ring `[m]`: a sphere's slices, as its shadow meets the rings.
fn solids(particles: &Particles, ring: f64) -> Vec<f64> {
    let mut volumes: Vec<f64> = Vec::new();
    for grain in particles.present() {
        let (place, radius) = (particles.position(grain), particles.radius(grain));
        let distance = place.x.hypot(place.y);
        let volume = 4.0 / 3.0 * PI * radius.powi(3);
        // Share of a sphere that is nearer than a plane at a distance from the axis.
        let nearer = |edge: f64| {
            let x = ((edge - distance) / radius).clamp(-1.0, 1.0);
            0.25 * (2.0 + 3.0 * x - x.powi(3))
        };
        let first = ((distance - radius) / ring).max(0.0) as usize;
        let last = ((distance + radius) / ring) as usize;
        if volumes.len() <= last {
            volumes.resize(last + 1, 0.0);
        }
        for (at, sum) in volumes.iter_mut().enumerate().take(last + 1).skip(first) {
            let [from, to] = [at, at + 1].map(|edge| edge as f64 * ring);
            // Beyond the axis it is in the ring on the other side.
            let beyond = nearer(-from) - nearer(-to);
            *sum += volume * (nearer(to) - nearer(from) + beyond);
        }
    }
    let area = |at: usize| PI * ring * ring * (2 * at + 1) as f64;
    volumes.iter().enumerate().map(|(at, volume)| volume / area(at)).collect()
}

#[cfg(test)]
mod tests;
