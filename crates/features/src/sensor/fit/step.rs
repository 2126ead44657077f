//! The step in which a stereo camera delivers its disparity.

use std::f64::consts::TAU;

use super::frames::FlatFrames;

/// Steps that are tried `[px]`: whole fractions of a pixel, coarsest first.
const FRACTIONS: std::ops::RangeInclusive<u32> = 1..=128;
/// Distinct disparities below which nothing can be said.
const LEAST_VALUES: usize = 20;
/// Coherence from which the values count as multiples: values spread at random reach
/// 1/√n, and rounding to the depth unit, held below a quarter of the step, leaves more than this.
const LEAST_COHERENCE: f64 = 0.7;

/// The largest step 1/k px of which the disparities are multiples; 0 where there is none.
///
/// Rounding to `depth_unit` blurs a disparity d by d²/(f B) of it: values for which that is more than
/// a quarter of the step have no say.
pub(super) fn of_disparity(frames: &FlatFrames, depth_unit: f64, focal_baseline: f64) -> f64 {
    let mut distinct: Vec<f64> =
        frames.values.iter().flatten().copied().filter(|d| d.is_finite()).collect();
    distinct.sort_by(f64::total_cmp);
    distinct.dedup();
    for fraction in FRACTIONS {
        let step = 1.0 / f64::from(fraction);
        let sharp = |d: &&f64| **d * **d / focal_baseline * depth_unit < 0.25 * step;
        let (mut cos, mut sin, mut count) = (0.0, 0.0, 0_usize);
        for d in distinct.iter().filter(sharp) {
            let phase = TAU * d / step;
            cos += phase.cos();
            sin += phase.sin();
            count += 1;
        }
        if count >= LEAST_VALUES && cos.hypot(sin) >= LEAST_COHERENCE * count as f64 {
            return step;
        }
    }
    0.0
}
