//! A sheet of liquid that spreads about an axis over level ground, with solids in it: shallow water on rings.
//!
//! ```text
//! r dq/dt + d(r q u)/dr = 0,   h = min(q / 0.4, q + s)
//! q (du/dt + u du/dr) = -g q dh/dr + d/dr (q h^2 / 3 (d/dt D(u) + k D(u - v))) - f u |u| / 8,   D(u) = 1/r d(r u)/dr
//! f = max(24 / Re, 0.223 Re^-1/4),   Re = q |u| / nu
//! ```
//!
//! q is the volume of liquid over an area, s that of solids, h the height of the liquid's surface, u its velocity outwards.
//! Solids are packed from the ground: below their surface the liquid has the 0.4 between them, above it all. What spreads
//! sinks, and must be let down: without the second term, which is the mass of that motion, the edge of a column would be
//! off at once at twice the speed of a wave (Serre, La Houille Blanche 39 (1953) 374; Green and Naghdi, J. Fluid Mech. 78
//! (1976) 237, of which it is what is linear in the velocity). Friction on the ground is that of a sheet on a smooth bed, laminar or Blasius' (Chow, Open-Channel Hydraulics (1959), section
//! 1-3).
//!
//! Volumes stand in rings, velocities at the circles between them; velocities are advected such that momentum is kept
//! (Stelling and Duinmeijer, International Journal for Numerical Methods in Fluids 43 (2003) 1329, doi:10.1002/fld.537),
//! which tells bores and dry fronts alike. Friction is implicit. At the edge to dry ground surface tension holds the sheet
//! back with `g e^2 / 2` over a length of edge, e the thickness of a puddle at rest. Under a tube that is being lifted the
//! liquid has the gap alone.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use crate::effect::PACKED;

/// Share of a ring that anything may cross in a step `[-]`.
const COURANT: f64 = 0.4;
/// A thinner sheet is dry ground `[m]`.
const DRY: f64 = 1e-6;
/// Steps in a call, at most: what is faster than that is no flow.
const MOST_STEPS: usize = 64;
/// Rings, at most: liquid that goes farther is gone.
const MOST_RINGS: usize = 2048;

/// What the flow goes by, besides itself.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ground {
    /// Magnitude of gravity `[m/s^2]`.
    pub gravity: f64,
    /// Kinematic viscosity nu `[m^2/s]`.
    pub viscosity: f64,
    /// Thickness e of a puddle at rest `[m]`.
    pub puddle: f64,
    /// The circle that a tube stands on, and the gap below it `[m]`.
    pub gate: Option<(usize, f64)>,
}

impl Ground {
    /// What is open above the ground at a circle `[m]`: all of it where no tube stands.
    fn gap_at(&self, circle: usize) -> f64 {
        self.gate.filter(|(at, _)| *at == circle).map_or(f64::INFINITY, |(_, gap)| gap)
    }
}

/// What grains do to the liquid in a substep.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Dragging {
    /// What their drag accelerates it by at each circle `[m/s^2]`.
    pub acceleration: Vec<f64>,
    /// Their velocity outwards at each circle `[m/s]`; that of the liquid where there are none.
    pub speed: Vec<f64>,
    /// Rate at which their drag takes the liquid's velocity past them, of each ring `[1/s]`.
    pub rate: Vec<f64>,
}

impl Dragging {
    /// Nothing, at these circles.
    pub fn none(circles: usize) -> Self {
        let [acceleration, speed, rate] = [circles, circles, circles - 1].map(|n| vec![0.0; n]);
        Self { acceleration, speed, rate }
    }

    /// Whether it is at so many circles.
    pub fn is_at(&self, circles: usize) -> bool {
        let Self { acceleration, speed, rate } = self;
        [acceleration.len(), speed.len(), rate.len() + 1] == [circles; 3]
    }
}

/// Liquid in rings about the axis.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct RadialFlow {
    /// Width of a ring `[m]`.
    pub ring: f64,
    /// Volume over area q of each ring `[m]`.
    pub thickness: Vec<f64>,
    /// Velocity outwards u at the circle inside each ring, and at the last one's outside `[m/s]`.
    pub speed: Vec<f64>,
    /// What the grains did to it in the last substep.
    pub grains: Dragging,
    /// What its pressure accelerated it by at each of these circles in the last step `[m/s^2]`.
    #[serde(skip)]
    pub pressure: Vec<f64>,
}

/// Height of the liquid's surface where there are `q` of liquid and `s` of solids `[m]`.
fn surface(q: f64, s: f64) -> f64 {
    (q / (1.0 - PACKED)).min(q + s)
}

impl RadialFlow {
    /// Liquid at rest up to `height` `[m]` in the first `count` rings, among `solids`.
    pub fn at_rest(ring: f64, count: usize, height: f64, solids: &[f64]) -> Self {
        let there = |&s: &f64| ((1.0 - PACKED) * height).max(height - s);
        let none = std::iter::repeat(&0.0);
        let thickness: Vec<_> = solids.iter().chain(none).take(count).map(there).collect();
        let speed = vec![0.0; count + 1];
        let (grains, pressure) = (Dragging::none(count + 1), speed.clone());
        let mut flow = Self { ring, thickness, speed, grains, pressure };
        flow.make_room();
        flow
    }

    /// Radius of a ring's middle, in rings.
    fn middle(ring: usize) -> f64 {
        ring as f64 + 0.5
    }

    /// Height of the surface in a ring `[m]`; nothing beyond the last.
    pub fn height(&self, ring: usize, solids: &[f64]) -> f64 {
        let at = |values: &[f64]| values.get(ring).copied().unwrap_or(0.0);
        surface(at(&self.thickness), at(solids))
    }

    /// Volume of liquid that moves with a circle's velocity, from one ring's middle to the next `[m^3]`.
    pub fn volume_at(&self, circle: usize) -> f64 {
        let half = |ring: usize| Self::middle(ring) * self.thickness.get(ring).unwrap_or(&0.0);
        let inside = if circle == 0 { 0.0 } else { half(circle - 1) };
        PI * self.ring * self.ring * (inside + half(circle))
    }

    /// Volume of liquid in a ring `[m^3]`.
    pub fn volume_of(&self, ring: usize) -> f64 {
        2.0 * PI * self.ring * self.ring * Self::middle(ring) * self.thickness[ring]
    }

    /// Keeps dry rings around the liquid.
    fn make_room(&mut self) {
        let wet = self.thickness.iter().rposition(|&q| q > 0.0).map_or(0, |ring| ring + 1);
        let wanted = (wet + 2).min(MOST_RINGS);
        if self.thickness.len() < wanted {
            self.thickness.resize(wanted, 0.0);
            self.speed.resize(wanted + 1, 0.0);
            self.grains.acceleration.resize(wanted + 1, 0.0);
            self.grains.speed.resize(wanted + 1, 0.0);
            self.grains.rate.resize(wanted, 0.0);
        }
    }

    /// Flows for `dt` `[s]` over the ground and between `solids`, their volume over area in each ring `[m]`.
    pub fn advance(&mut self, solids: &[f64], ground: &Ground, dt: f64) {
        let mut left = dt;
        for step in (0..MOST_STEPS).rev() {
            self.make_room();
            let heights: Vec<_> =
                (0..self.thickness.len()).map(|ring| self.height(ring, solids)).collect();
            let deepest = heights.iter().copied().fold(0.0, f64::max);
            let fastest = self.speed.iter().map(|u| u.abs()).fold(0.0, f64::max);
            let fastest = fastest + (ground.gravity * deepest).sqrt();
            let longest = COURANT * self.ring / fastest.max(f64::MIN_POSITIVE);
            let dt = if step == 0 { left } else { left.min(longest) };
            self.accelerate(&heights, ground, dt);
            self.move_on(&heights, ground, dt);
            left -= dt;
            if left <= 0.0 {
                return;
            }
        }
    }

    /// Volume that crosses each circle, over its angle, in rings `[m^2/s]`: liquid of the ring that it comes from.
    fn fluxes(&self, heights: &[f64], ground: &Ground) -> Vec<f64> {
        let flux = |(circle, &u): (usize, &f64)| {
            let from = if u > 0.0 { circle.checked_sub(1) } else { Some(circle) };
            let Some(from) = from.filter(|&ring| ring < self.thickness.len()) else { return 0.0 };
            let open = (ground.gap_at(circle) / heights[from].max(DRY)).min(1.0);
            circle as f64 * self.thickness[from] * open * u
        };
        self.speed.iter().enumerate().map(flux).collect()
    }

    /// Changes velocities: what they carry with them, the pressure, the edge, the ground; the grains' drag, which has acted
    /// already, counts for how the liquid sinks.
    fn accelerate(&mut self, heights: &[f64], ground: &Ground, dt: f64) {
        let fluxes = self.fluxes(heights, ground);
        let old = self.speed.clone();
        let circles = self.thickness.len();
        // Mass of each circle, what acts on it but the pressure, and what the ground takes; nothing where nothing flows.
        let (mut mean, mut mass) = (vec![0.0; circles], vec![1.0; circles]);
        let (mut other, mut acts, mut taken) =
            (vec![0.0; circles], vec![0.0; circles], vec![0.0; circles]);
        for circle in 1..circles {
            let (q_in, q_out) = (self.thickness[circle - 1], self.thickness[circle]);
            let gap = ground.gap_at(circle);
            if gap <= 0.0 || (q_in < DRY && q_out < DRY) {
                self.speed[circle] = 0.0;
                continue;
            }
            let share = Self::middle(circle - 1) * q_in + Self::middle(circle) * q_out;
            // Below a tube that is what passes it.
            mean[circle] = (share / (2.0 * circle as f64)).min(gap);
            mass[circle] = circle as f64 * mean[circle];
            // What comes in on either side brings the velocity that it has there.
            let middle = |ring: usize| 0.5 * (fluxes[ring] + fluxes[ring + 1]);
            let gained = middle(circle - 1).max(0.0) * (old[circle - 1] - old[circle])
                - middle(circle).min(0.0) * (old[circle + 1] - old[circle]);
            other[circle] = gained / (mass[circle] * self.ring) + self.grains.acceleration[circle];
            let slope = (heights[circle] - heights[circle - 1]) / self.ring;
            let drives = other[circle] - ground.gravity * slope;
            // The edge to dry ground holds a sheet back, and never drives it.
            let holds = ground.gravity * ground.puddle.powi(2) / (2.0 * mean[circle] * self.ring);
            let is_edge = q_in < DRY || q_out < DRY;
            let outwards = if q_out < DRY { 1.0 } else { -1.0 };
            if is_edge && outwards * (old[circle] + dt * (drives - outwards * holds)) <= 0.0 {
                (mean[circle], mass[circle], self.speed[circle]) = (0.0, 1.0, 0.0);
                continue;
            }
            if is_edge {
                other[circle] -= outwards * holds;
            }
            acts[circle] = mass[circle] * (other[circle] - ground.gravity * slope);
            let deep = 0.5 * (heights[circle - 1] + heights[circle]);
            taken[circle] = friction(old[circle], mean[circle], deep, ground.viscosity);
        }
        let (mut own, mut next) = (mass.clone(), vec![0.0; circles]);
        // What spreads sinks: the energy of the motion down is q h^2 / 6 (div u)^2 over an area.
        for ring in 0..circles {
            let of = |circle: usize| {
                let open = (ground.gap_at(circle) / heights[ring.min(circle)].max(DRY)).min(1.0);
                let is_flowing = mean.get(circle).is_some_and(|&mean| mean > 0.0);
                if is_flowing {
                    open * circle as f64 / (Self::middle(ring) * self.ring)
                } else {
                    0.0
                }
            };
            let (inside, outside) = (-of(ring), of(ring + 1));
            // Grains that it sinks past hold it up.
            let rate = self.grains.rate[ring];
            let slip = |circle: usize| old[circle] - self.grains.speed[circle];
            let held = rate * (inside * slip(ring) + outside * slip(ring + 1));
            let sinks = Self::middle(ring) * self.thickness[ring] * heights[ring].powi(2) / 3.0;
            acts[ring] -= sinks * inside * held;
            if ring + 1 < circles {
                acts[ring + 1] -= sinks * outside * held;
            }
            let sinks = sinks * (1.0 + dt * rate);
            own[ring] += sinks * inside * inside;
            if ring + 1 < circles {
                next[ring] += sinks * inside * outside;
                own[ring + 1] += sinks * outside * outside;
            }
        }
        // Friction is implicit: (M + dt m k) du/dt = acts - m k u.
        for circle in 1..circles {
            own[circle] += dt * mass[circle] * taken[circle];
            acts[circle] -= mass[circle] * taken[circle] * self.speed[circle];
        }
        let gained = solve(own, &next, acts);
        self.pressure = vec![0.0; circles + 1];
        for circle in (1..circles).filter(|&circle| mean[circle] > 0.0) {
            let mut speed = old[circle] + dt * gained[circle];
            self.pressure[circle] = gained[circle] - other[circle] + taken[circle] * speed;
            speed -= dt * self.grains.acceleration[circle];
            self.speed[circle] = speed;
        }
    }

    /// Moves the liquid; no ring gives more than it has.
    fn move_on(&mut self, heights: &[f64], ground: &Ground, dt: f64) {
        let mut fluxes = self.fluxes(heights, ground);
        let over = |ring: usize| dt / (Self::middle(ring) * self.ring);
        for (ring, &q) in self.thickness.iter().enumerate() {
            let given = over(ring) * (fluxes[ring + 1].max(0.0) - fluxes[ring].min(0.0));
            if given > q {
                let share = q / given;
                let (inwards, outwards) = (fluxes[ring].min(0.0), fluxes[ring + 1].max(0.0));
                fluxes[ring] += (share - 1.0) * inwards;
                fluxes[ring + 1] += (share - 1.0) * outwards;
            }
        }
        for ring in 0..self.thickness.len() {
            let lost = over(ring) * (fluxes[ring + 1] - fluxes[ring]);
            self.thickness[ring] = (self.thickness[ring] - lost).max(0.0);
        }
    }
}

/// Solves a symmetric system of rows (next of the row before, own, next) by elimination.
fn solve(mut own: Vec<f64>, next: &[f64], mut acts: Vec<f64>) -> Vec<f64> {
    for row in 1..own.len() {
        let share = next[row - 1] / own[row - 1];
        own[row] -= share * next[row - 1];
        acts[row] -= share * acts[row - 1];
    }
    let mut beyond = 0.0;
    for row in (0..own.len()).rev() {
        acts[row] = (acts[row] - next[row] * beyond) / own[row];
        beyond = acts[row];
    }
    acts
}

/// Rate at which the ground takes velocity from a sheet of mean thickness `q` up to `deep` `[1/s]`.
fn friction(speed: f64, q: f64, deep: f64, viscosity: f64) -> f64 {
    let (speed, q, deep) = (speed.abs(), q.max(DRY), deep.max(DRY));
    // 24 / Re, without a division by a speed of zero.
    let laminar = 3.0 * viscosity / (deep * deep);
    if viscosity == 0.0 {
        return 0.0;
    }
    let reynolds = q * speed / viscosity;
    let blasius = 0.223 / 8.0 * reynolds.max(f64::MIN_POSITIVE).powf(-0.25) * speed / deep;
    laminar.max(blasius)
}

#[cfg(test)]
mod tests;
