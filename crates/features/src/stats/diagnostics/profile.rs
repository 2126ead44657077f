//! The radial profile of the height, its slope, and how deep the middle lies.
//!
//! Twenty rings of equal area π R²/20 about the pour axis within R = r_95. A point stands for the ground
//! s² of its pixel, so a ring with n points is covered to c = min(1, 20 n s²/(π R²)), and
//!
//! \\[ h_k = c_k \frac{1}{n_k} \sum_{i \in k} z_i \\]
//!
//! is its mean height, bare ground counted as 0. The slope is that of the line through the rings from
//! the highest one outwards, (ρ_k, h_k) with ρ_k the radius that halves the ring's area, by least squares
//! with the weights h_k: scattered grains far out, which are flat, hardly count.
//!
//! \\[ \mathrm{profile\_slope} = \frac{\sum_{k \ge k^*} h_k (\rho_k - \bar\rho)(h_k - \bar h)}
//! {\sum_{k \ge k^*} h_k (\rho_k - \bar\rho)^2}, \qquad
//! \mathrm{ring\_depth} = \frac{h_1}{\max_k h_k} \\]
//!
//! Source: rings of equal area and the depth as h(0)/h_max are the loop's design; the flank's slope by
//! least squares is how angles of repose are read (Beakawi Al-Hashemi & Baghabra Al-Amoudi 2018,
//! doi:10.1016/j.powtec.2018.02.003).

use std::f64::consts::PI;

use super::{Diagnostic, Survey};
use crate::stats::Behaviour;

/// Rings of the profile.
pub(super) const RINGS: usize = 20;

/// Mean height in each ring, from the pour axis outwards.
pub(super) const HEIGHTS: [Diagnostic; RINGS] = [
    height::<0>("height_ring_01"),
    height::<1>("height_ring_02"),
    height::<2>("height_ring_03"),
    height::<3>("height_ring_04"),
    height::<4>("height_ring_05"),
    height::<5>("height_ring_06"),
    height::<6>("height_ring_07"),
    height::<7>("height_ring_08"),
    height::<8>("height_ring_09"),
    height::<9>("height_ring_10"),
    height::<10>("height_ring_11"),
    height::<11>("height_ring_12"),
    height::<12>("height_ring_13"),
    height::<13>("height_ring_14"),
    height::<14>("height_ring_15"),
    height::<15>("height_ring_16"),
    height::<16>("height_ring_17"),
    height::<17>("height_ring_18"),
    height::<18>("height_ring_19"),
    height::<19>("height_ring_20"),
];

const fn height<const RING: usize>(name: &'static str) -> Diagnostic {
    Diagnostic {
        name,
        unit: "m",
        doc: "mean height, bare ground counted, in a ring of a twentieth of the area within r_95",
        behaviour: Behaviour::WEIGHED_LENGTH,
        value: |survey| survey.profile().heights[RING],
    }
}

/// Slope of the outer flank.
pub(super) const SLOPE: Diagnostic = Diagnostic {
    name: "profile_slope",
    unit: "-",
    doc: "slope of the radial height profile from its highest ring outwards, negative downhill",
    behaviour: Behaviour::WEIGHED_NUMBER,
    value: |survey| survey.profile().slope,
};

/// How high the middle is.
pub(super) const RING_DEPTH: Diagnostic = Diagnostic {
    name: "ring_depth",
    unit: "-",
    doc: "height of the innermost ring over that of the highest: 1 for a heap, 0 for a bare centre",
    behaviour: Behaviour::WEIGHED_NUMBER,
    value: |survey| survey.profile().ring_depth,
};

/// The profile and what is read from it.
#[derive(Debug, Clone)]
pub(super) struct Profile {
    pub(super) heights: [f64; RINGS],
    pub(super) slope: f64,
    pub(super) ring_depth: f64,
}

impl Profile {
    pub(super) fn new(survey: &Survey) -> Self {
        let outer = survey.r_95;
        let (mut counts, mut totals) = ([0_u32; RINGS], [0.0; RINGS]);
        for (&r, &z) in survey.r.iter().zip(&survey.z) {
            if r > outer {
                continue;
            }
            // The outermost points of all, r = R, belong to the last ring; 0/0 to the first.
            let ring = ((r / outer).powi(2) * RINGS as f64) as usize;
            let ring = ring.min(RINGS - 1);
            counts[ring] += 1;
            totals[ring] += z;
        }
        let pixels = PI * (outer / survey.spacing).powi(2) / RINGS as f64;
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
        let slope =
            if outer < survey.spacing { 0.0 } else { slope(&heights[peak..], peak) / outer };
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
