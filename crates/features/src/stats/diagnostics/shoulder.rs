//! Where the radial profile falls to half of its highest ring.
//!
//! From the highest of the twenty rings of `profile.rs` outwards, the first radius at which the mean height is half of
//! that ring's, linear between the radii ρ_k that halve the rings' areas, over r_95. A cone has it near the middle of
//! its flank; a terrace with a steep edge near 1; 1 where the profile does not fall so far.
//!
//! Source: the half width at half maximum of a peak.

use super::profile::rings::RINGS;
use super::survey::Diagnostic;
use crate::stats::Behaviour;

/// Radius of half the height.
pub(super) const SHOULDER: Diagnostic = Diagnostic {
    name: "shoulder",
    unit: "-",
    doc: "radius at which the radial height profile has fallen to half of its highest ring, over r_95",
    behaviour: Behaviour::WEIGHED_NUMBER,
    value: |survey| shoulder(&survey.profile().heights),
};

fn shoulder(heights: &[f64; RINGS]) -> f64 {
    let middle = |ring: usize| ((ring as f64 + 0.5) / RINGS as f64).sqrt();
    let (peak, highest) = heights
        .iter()
        .copied()
        .enumerate()
        .fold((0, f64::NEG_INFINITY), |best, ring| if ring.1 > best.1 { ring } else { best });
    let half = 0.5 * highest;
    let below = (peak + 1..RINGS).find(|&ring| heights[ring] < half);
    match below {
        Some(ring) if highest > 0.0 => {
            let (inner, outer) = (heights[ring - 1], heights[ring]);
            let share = (inner - half) / (inner - outer);
            middle(ring - 1) + share * (middle(ring) - middle(ring - 1))
        }
        _ => 1.0,
    }
}
