//! The grains as the liquid finds them: how much of them there is in each ring, and up to where.
//!
//! ```text
//! s = sum of V / A,   b = 2 <z>,   eps = 1 - s / b
//! h = q / eps up to b, q + s above it
//! ```
//!
//! Of a body of grains that stands on the ground with the same void everywhere the top b is twice the mean height: a
//! layer of spheres has its diameter, and more void than a packing.

use std::f64::consts::PI;

use crate::effect::PACKED;
use crate::particles::Particles;

/// Rings, at most: liquid that comes to the last stands there.
pub(super) const MOST_RINGS: usize = 2048;
/// Solid fraction that no grains exceed `[-]`.
const DENSEST: f64 = 0.64;

/// Grains in rings about the axis.
#[derive(Clone, Debug, Default)]
pub(crate) struct Solids {
    /// Volume over area s in each ring `[m]`.
    thickness: Vec<f64>,
    /// Their top b there `[m]`.
    top: Vec<f64>,
}

impl Solids {
    /// The grains in rings of a width: a sphere's slices, as its shadow meets the rings.
    pub fn of(particles: &Particles, ring: f64) -> Self {
        // Volume, and volume times height.
        let mut sums: Vec<[f64; 2]> = Vec::new();
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
            // Grains that have been thrown far must not ask for rings that no liquid reaches.
            let last = (((distance + radius) / ring) as usize).min(MOST_RINGS);
            if sums.len() <= last {
                sums.resize(last + 1, [0.0; 2]);
            }
            for (at, sum) in sums.iter_mut().enumerate().take(last + 1).skip(first) {
                let [from, to] = [at, at + 1].map(|edge| edge as f64 * ring);
                // Beyond the axis it is in the ring on the other side.
                let beyond = nearer(-from) - nearer(-to);
                let part = volume * (nearer(to) - nearer(from) + beyond);
                sum[0] += part;
                sum[1] += part * place.z;
            }
        }
        let area = |at: usize| PI * ring * ring * (2 * at + 1) as f64;
        let thickness: Vec<_> =
            sums.iter().enumerate().map(|(at, sum)| sum[0] / area(at)).collect();
        let top = |(sum, s): (&[f64; 2], &f64)| {
            if *s > 0.0 { (2.0 * sum[1] / sum[0]).max(s / DENSEST) } else { 0.0 }
        };
        let top = sums.iter().zip(&thickness).map(top).collect();
        Self { thickness, top }
    }

    /// Volume over area and top of a ring `[m]`.
    fn at(&self, ring: usize) -> (f64, f64) {
        let of = |values: &[f64]| values.get(ring).copied().unwrap_or(0.0);
        (of(&self.thickness), of(&self.top))
    }

    /// Their top in a ring `[m]`; 0 without any.
    pub fn top(&self, ring: usize) -> f64 {
        self.at(ring).1
    }

    /// Height of the surface of liquid with a volume `q` over area in a ring `[m]`.
    pub fn surface(&self, ring: usize, q: f64) -> f64 {
        let (s, top) = self.at(ring);
        if q < top - s { q * top / (top - s) } else { q + s }
    }

    /// Volume over area of liquid that stands up to `height` in a ring `[m]`.
    pub fn liquid_up_to(&self, ring: usize, height: f64) -> f64 {
        let (s, top) = self.at(ring);
        if height < top { height * (1.0 - s / top) } else { height - s }
    }

    /// How crowded the grains are below a surface in a ring, over a packing `[-]`.
    pub fn crowd(&self, ring: usize, height: f64) -> f64 {
        let (s, top) = self.at(ring);
        if s > 0.0 { (s / (PACKED * height.max(top))).min(1.0) } else { 0.0 }
    }

    #[cfg(test)]
    pub fn packed(tops: &[f64]) -> Self {
        Self { thickness: tops.iter().map(|top| PACKED * top).collect(), top: tops.to_vec() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::Row;

    const RADIUS: f64 = 4e-3;

    fn grains(places: &[[f64; 3]]) -> Particles {
        let spheres = places.iter().map(|&[x, y, z]| Row([x, y, z, RADIUS])).collect();
        Particles::new(spheres, vec![1.0; places.len()], None)
    }

    #[test]
    fn solids_are_where_the_grains_are_and_no_more_than_they() {
        let places = [[0.0, 0.0, 0.1], [1e-3, 0.0, 0.2], [0.05, 0.02, 0.0], [-0.03, 0.0, RADIUS]];
        let ring = 2e-3;
        let found = Solids::of(&grains(&places), ring);
        let area = |at: usize| PI * ring * ring * (2 * at + 1) as f64;
        let total: f64 = found.thickness.iter().enumerate().map(|(at, s)| s * area(at)).sum();
        let grain = 4.0 / 3.0 * PI * RADIUS.powi(3);
        assert!((total / (4.0 * grain) - 1.0).abs() < 1e-12);
        // The grain at 30 mm lies in the rings from 26 to 34 mm, and reaches up to its diameter.
        let s = &found.thickness;
        assert!(s[12] == 0.0 && s[13] > 0.0 && s[16] > 0.0 && s[17] == 0.0);
        assert!((found.top(14) - 2.0 * RADIUS).abs() < 1e-15);
    }

    #[test]
    fn grains_far_away_ask_for_no_rings() {
        let near = [[0.0, 0.0, 0.1]];
        for far in [1e3, 1e9, 1e300] {
            let found = Solids::of(&grains(&[near[0], [far, 0.0, 0.1]]), 2e-3);
            assert!(found.thickness.len() <= MOST_RINGS + 1);
            let alone = Solids::of(&grains(&near), 2e-3);
            assert_eq!(found.thickness[..alone.thickness.len()], alone.thickness);
        }
    }

    #[test]
    fn a_surface_rises_faster_among_solids_than_above_them() {
        let solids = Solids::packed(&[0.02, 0.0]);
        assert!((solids.surface(0, 0.4 * 0.01) - 0.01).abs() < 1e-15);
        assert!((solids.surface(0, 0.018) - 0.03).abs() < 1e-15);
        assert_eq!(solids.surface(1, 0.01), 0.01);
        for (ring, height) in [(0, 0.01), (0, 0.02), (0, 0.03), (1, 0.01), (7, 0.02)] {
            let q = solids.liquid_up_to(ring, height);
            assert!((solids.surface(ring, q) - height).abs() < 1e-15, "{ring} {height}");
        }
        assert!((solids.crowd(0, 0.01) - 1.0).abs() < 1e-12);
        assert!((solids.crowd(0, 0.04) - 0.5).abs() < 1e-12);
    }
}
