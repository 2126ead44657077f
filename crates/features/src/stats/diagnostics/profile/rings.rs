//! Mean heights in rings of equal area and what is read from them: the equations are in the head of `profile.rs`.

use std::f64::consts::PI;

/// Rings of the profile.
pub(crate) const RINGS: usize = 20;

/// The profile and what is read from it.
#[derive(Debug, Clone)]
pub(crate) struct Profile {
    pub(crate) heights: [f64; RINGS],
    pub(crate) slope: f64,
    pub(crate) ring_depth: f64,
}

impl Profile {
    pub(crate) fn new(r: &[f64], z: &[f64], outer: f64, spacing: f64) -> Self {
        let (mut counts, mut totals) = ([0_u32; RINGS], [0.0; RINGS]);
        for (&r, &z) in r.iter().zip(z) {
            if r > outer {
                continue;
            }
            // The outermost points of all, r = R, belong to the last ring; 0/0 to the first.
            let ring = ((r / outer).powi(2) * RINGS as f64) as usize;
            let ring = ring.min(RINGS - 1);
            counts[ring] += 1;
            totals[ring] += z;
        }
        let pixels = PI * (outer / spacing).powi(2) / RINGS as f64;
        let heights: [f64; RINGS] = std::array::from_fn(|ring| {
            // A ring smaller than its points is covered; one without points is bare.
            totals[ring] / pixels.max(f64::from(counts[ring])).max(f64::MIN_POSITIVE)
        });
        let (peak, highest) =
            heights.iter().copied().enumerate().fold((0, f64::NEG_INFINITY), |best, ring| {
                if ring.1 > best.1 { ring } else { best }
            });
        let ring_depth = if highest > 0.0 { heights[0].max(0.0) / highest } else { 1.0 };
        // Within a pixel there is no flank.
        let slope = if outer < spacing { 0.0 } else { slope(&heights[peak..], peak) / outer };
        Self { heights, slope, ring_depth }
    }
}

/// Slope of ring heights, from ring number `first` on, over the radius in units of R; 0 of fewer than two
/// rings with anything in them.
fn slope(heights: &[f64], first: usize) -> f64 {
    let rings: Vec<(f64, f64)> = (first..)
        .zip(heights)
        .map(|(ring, &h)| (((ring as f64 + 0.5) / RINGS as f64).sqrt(), h))
        .filter(|(_, h)| *h > 0.0)
        .collect();
    if rings.len() < 2 {
        return 0.0;
    }
    let total: f64 = rings.iter().map(|(_, h)| h).sum();
    let mean = |value: &dyn Fn(f64, f64) -> f64| {
        rings.iter().map(|&(rho, h)| h / total * value(rho, h)).sum::<f64>()
    };
    let (middle, height) = (mean(&|rho, _| rho), mean(&|_, h| h));
    mean(&|rho, h| (rho - middle) * (h - height)) / mean(&|rho, _| (rho - middle).powi(2))
}
