//! The fit against data that were drawn from it, and against a plain search.

use super::*;
use crate::rng::Stream;

/// Log likelihood of the density itself, nothing profiled.
fn likelihood(radii: &[f64], df: f64, shift: f64, scale: f64) -> f64 {
    let constant = (1.0 - 0.5 * df) * 2.0_f64.ln() - ln_gamma(0.5 * df) - scale.ln();
    radii
        .iter()
        .map(|r| {
            let x = (r - shift) / scale;
            // 0 · ln 0 = 0: the half-normal density is finite at its edge.
            let power = if df == 1.0 { 0.0 } else { (df - 1.0) * x.ln() };
            constant + power - 0.5 * x * x
        })
        .sum()
}

/// Chi numbers with a whole number of degrees of freedom.
fn sample(seed: u64, df: usize, count: usize) -> Vec<f64> {
    let mut stream = Stream::new(seed);
    (0..count).map(|_| (0..df).map(|_| stream.normal().powi(2)).sum::<f64>().sqrt()).collect()
}

#[test]
fn recovers_the_distribution_that_made_the_data() {
    for df in [2, 3, 5] {
        let radii: Vec<f64> =
            sample(df as u64, df, 20_000).into_iter().map(|x| 0.03 + 0.01 * x).collect();
        let fit = ChiFit::new(&radii);
        // Shift and degrees of freedom trade against each other: both are loose, the scale less so.
        assert!((fit.df - df as f64).abs() < 0.15 * df as f64, "{df}: {fit:?}");
        assert!((fit.scale - 0.01).abs() < 5e-4, "{df}: {fit:?}");
        assert!((fit.shift - 0.03).abs() < 2e-3, "{df}: {fit:?}");
    }
}

#[test]
fn half_normal_data_stay_at_the_lower_bound() {
    let fit = ChiFit::new(&sample(9, 1, 500));
    assert!(fit.df < 1.3 && fit.shift.abs() < 0.02, "{fit:?}");
}

#[test]
fn data_skewed_to_the_left_stop_at_the_upper_bound() {
    // Radii of a uniform disc.
    let radii: Vec<f64> = (0..1000).map(|i| (f64::from(i) + 0.5).sqrt()).collect();
    let fit = ChiFit::new(&radii);
    assert_eq!(fit.df, MAX_DF);
    assert!(fit.shift < 0.0 && fit.scale.is_finite());
}

#[test]
fn no_point_of_a_fine_search_is_better() {
    let mut stream = Stream::new(4);
    for case in 0..12 {
        let count = 3 + 17 * case;
        let radii: Vec<f64> = (0..count)
            .map(|i| match case % 4 {
                0 => stream.uniform(),
                1 => stream.normal().abs().powi(3),
                2 => 0.05 + 0.01 * stream.normal(),
                _ => (i % 5) as f64,
            })
            .collect();
        let fit = ChiFit::new(&radii);
        let best = likelihood(&radii, fit.df, fit.shift, fit.scale);
        let (min, max) = extremes(&radii);
        for i in 0..80 {
            let df = MIN_DF * (MAX_DF / MIN_DF).powf(f64::from(i) / 79.0);
            for j in 0..80 {
                let gap = 1e-9 * 1e11_f64.powf(f64::from(j) / 79.0);
                let shift = min - gap * (max - min);
                let square: f64 = radii.iter().map(|r| (r - shift).powi(2)).sum();
                let scale = (square / count as f64 / df).sqrt();
                let other = likelihood(&radii, df, shift, scale);
                assert!(
                    other <= best + 1e-9,
                    "case {case}: {fit:?} {best} < {other}, {df} {shift}"
                );
            }
        }
    }
}

#[test]
fn scales_with_the_data() {
    let radii = sample(5, 3, 300);
    let fit = ChiFit::new(&radii);
    let scaled = ChiFit::new(&radii.iter().map(|r| 7.0 + 1e-3 * r).collect::<Vec<_>>());
    assert!((scaled.df / fit.df - 1.0).abs() < 1e-8);
    assert!((scaled.scale / (1e-3 * fit.scale) - 1.0).abs() < 1e-8);
    assert!((scaled.shift - 7.0 - 1e-3 * fit.shift).abs() < 1e-10);
}

#[test]
fn degenerate_data_have_a_fit() {
    assert_eq!(ChiFit::new(&[]), ChiFit { df: 1.0, shift: 0.0, scale: 0.0 });
    assert_eq!(ChiFit::new(&[0.5; 4]), ChiFit { df: 1.0, shift: 0.5, scale: 0.0 });
    for radii in [vec![0.0, 0.0, 1.0], vec![0.0, 1.0, 1.0], vec![1.0, 1.0 + 1e-9, 1.0 + 2e-9]] {
        let fit = ChiFit::new(&radii);
        assert!(fit.df.is_finite() && fit.shift.is_finite() && fit.scale > 0.0, "{fit:?}");
    }
    let tied = [vec![0.0; 900], vec![1.0; 100]].concat();
    let fit = ChiFit::new(&tied);
    assert_eq!(fit.df, 1.0);
    assert!((fit.scale - 0.1_f64.sqrt()).abs() < 1e-12, "{fit:?}");
}
