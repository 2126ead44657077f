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

pub(super) mod rings;

use self::rings::RINGS;
use super::survey::Diagnostic;
use crate::stats::Behaviour;

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
