//! A sheet of liquid that spreads about an axis over level ground, with solids in it: shallow water on rings.
//!
//! ```text
//! r dq/dt + d(r q u)/dr = 0,   h = q / eps up to the solids' top, q + s above it
//! q (du/dt + u du/dr) = -g q d(h - c)/dr + d/dr (q h^2 / 3 (d/dt D(u) + k D(u - v))) - f u |u| / 8,   D(u) = 1/r d(r u)/dr
//! f = max(24 / Re, 0.223 Re^-1/4),   Re = q |u| / nu
//! ```
//!
//! q is the volume of liquid over an area, s that of solids with the void eps between them (`solids.rs`), h the height
//! of the liquid's surface, c what menisci between grains draw it down by, u its velocity outwards. What spreads sinks,
//! and must be let down: without the second term, which is the mass of that motion, the edge of a column would be off
//! at once at twice the speed of a wave (Serre, La Houille Blanche 39 (1953) 374; Green and Naghdi, J. Fluid Mech. 78
//! (1976) 237, of which it is what is linear in the velocity); grains of velocity v that it sinks past, with a drag of
//! rate k, hold it up (Dupuit's assumption to the next order). Friction on the ground is that of a sheet on a smooth
//! bed, laminar or Blasius' (Chow, Open-Channel Hydraulics (1959), section 1-3).
//!
//! Volumes stand in rings, velocities at the circles between them; velocities are advected such that momentum is kept
//! (Stelling and Duinmeijer, International Journal for Numerical Methods in Fluids 43 (2003) 1329,
//! doi:10.1002/fld.537), which tells bores and dry fronts alike. Friction is implicit. At the edge to dry ground
//! surface tension holds the sheet back with `g e^2 / 2` over a length of edge, e the thickness of a puddle at rest.
//! Under a tube that is being lifted the liquid has the gap alone.

use serde::{Deserialize, Serialize};

use super::ground::{DRY, Ground};
use super::solids::{MOST_RINGS, Solids};

/// Liquid in rings about the axis.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct RadialFlow {
    /// Width of a ring `[m]`.
    pub ring: f64,
    /// Volume over area q of each ring `[m]`.
    pub thickness: Vec<f64>,
    /// Velocity outwards u at the circle inside each ring, and at the last one's outside `[m/s]`.
    pub speed: Vec<f64>,
    /// What its pressure accelerated it by at each of these circles in the last step `[m/s^2]`.
    #[serde(skip)]
    pub pressure: Vec<f64>,
}

impl RadialFlow {
    /// Liquid at rest up to `height` `[m]` in the first `count` rings, among `solids`.
    pub fn at_rest(ring: f64, count: usize, height: f64, solids: &Solids) -> Self {
        let thickness = (0..count).map(|at| solids.liquid_up_to(at, height)).collect();
        let speed = vec![0.0; count + 1];
        let pressure = speed.clone();
        let mut flow = Self { ring, thickness, speed, pressure };
        flow.make_room();
        flow
    }

    /// Radius of a ring's middle, in rings.
    pub fn middle(ring: usize) -> f64 {
        ring as f64 + 0.5
    }

    /// Height of the surface in a ring `[m]`; nothing beyond the last.
    pub fn height(&self, ring: usize, solids: &Solids) -> f64 {
        self.thickness.get(ring).map_or(0.0, |&q| solids.surface(ring, q))
    }

    /// Height of the surface in each ring `[m]`.
    pub fn heights(&self, solids: &Solids) -> Vec<f64> {
        (0..self.thickness.len()).map(|ring| self.height(ring, solids)).collect()
    }

    /// Velocity outwards at a distance from the axis in rings, linear between circles `[m/s]`.
    pub fn speed_at(&self, at: f64) -> f64 {
        between(&self.speed, at)
    }

    /// What pressure accelerates the liquid by there `[m/s^2]`.
    pub fn pressure_at(&self, at: f64) -> f64 {
        between(&self.pressure, at)
    }

    /// Mean kinetic energy of the liquid over its mass `[m^2/s^2]`.
    pub fn kinetic_energy(&self) -> f64 {
        let (mut energy, mut mass) = (0.0, 0.0);
        for (ring, q) in self.thickness.iter().enumerate() {
            let (volume, u) =
                (q * Self::middle(ring), 0.5 * (self.speed[ring] + self.speed[ring + 1]));
            energy += 0.5 * volume * u * u;
            mass += volume;
        }
        if mass > 0.0 { energy / mass } else { 0.0 }
    }

    /// Keeps dry rings around the liquid.
    pub fn make_room(&mut self) {
        let wet = self.thickness.iter().rposition(|&q| q > 0.0).map_or(0, |ring| ring + 1);
        let wanted = (wet + 2).min(MOST_RINGS);
        if self.thickness.len() < wanted {
            self.thickness.resize(wanted, 0.0);
            self.speed.resize(wanted + 1, 0.0);
        }
    }

    /// Volume that crosses each circle, over its angle, in rings `[m^2/s]`: liquid of the ring that it comes from.
    pub fn fluxes(&self, heights: &[f64], ground: &Ground) -> Vec<f64> {
        let flux = |(circle, &u): (usize, &f64)| {
            let from = if u > 0.0 { circle.checked_sub(1) } else { Some(circle) };
            let Some(from) = from.filter(|&ring| ring < self.thickness.len()) else { return 0.0 };
            let open = (ground.gap_at(circle) / heights[from].max(DRY)).min(1.0);
            circle as f64 * self.thickness[from] * open * u
        };
        self.speed.iter().enumerate().map(flux).collect()
    }

    /// Moves the liquid; no ring gives more than it has.
    pub fn move_on(&mut self, heights: &[f64], ground: &Ground, dt: f64) {
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

/// A value between two circles, or two middles of rings; nothing beyond the last.
pub(super) fn between(values: &[f64], at: f64) -> f64 {
    let of = |circle: usize| values.get(circle).copied().unwrap_or(0.0);
    let circle = at as usize;
    of(circle) + at.fract() * (of(circle + 1) - of(circle))
}
