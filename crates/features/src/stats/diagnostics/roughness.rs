//! How rough the surface is about its own mean over the azimuth.
//!
//! In rings one grain diameter wide about the pour axis, with z̄_k the mean height of the points of ring k,
//!
//! \\[ \mathrm{roughness} = \sqrt{ \frac{1}{n} \sum_k \sum_{i \in k} (z_i - \bar z_k)^2 } \\]
//!
//! A smooth cone has none but the slope within a ring; terraces and clods have, whatever the radial profile.
//!
//! Source: the root mean square roughness of ISO 25178-2 (Sq), about the mean over the azimuth in place of a plane.

use super::survey::{Diagnostic, Survey};
use crate::stats::Behaviour;

/// Root mean square height about the mean over the azimuth.
pub(super) const ROUGHNESS: Diagnostic = Diagnostic {
    name: "roughness",
    unit: "m",
    doc: "root mean square of the heights about their mean in rings one grain diameter wide",
    behaviour: Behaviour::LENGTH,
    value: roughness,
};

fn roughness(survey: &Survey) -> f64 {
    let farthest = survey.r.iter().copied().fold(0.0, f64::max);
    // No wider than a ring a point, so that far scattered points take no memory.
    let rings = (farthest / survey.grain_diameter).min(survey.r.len() as f64) as usize + 1;
    let ring = |r: f64| ((r / survey.grain_diameter) as usize).min(rings - 1);
    let (mut counts, mut means) = (vec![0_u32; rings], vec![0.0; rings]);
    for (&r, &z) in survey.r.iter().zip(&survey.z) {
        counts[ring(r)] += 1;
        means[ring(r)] += z;
    }
    for (mean, &count) in means.iter_mut().zip(&counts) {
        *mean /= f64::from(count.max(1));
    }
    let squares = survey.r.iter().zip(&survey.z).map(|(&r, &z)| (z - means[ring(r)]).powi(2));
    (squares.sum::<f64>() / survey.r.len() as f64).sqrt()
}
