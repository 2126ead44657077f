//! The statistics against numpy, scipy and dcor.
//!
//! `data/statistics.json` is made by `data/generate_statistics.py`, which stands beside it.

use std::f64::consts::LN_2;

use granulcal_features::stats::chi::{MAX_DF, MIN_DF};
use granulcal_features::{PAPER16, Prepared};
use nalgebra::Vector3;
use serde_json::Value;

/// Relative agreement asked of everything that has a closed form.
const TOLERANCE: f64 = 1e-10;

fn sets() -> Vec<Value> {
    let text = include_str!("data/statistics.json");
    let file: Value = serde_json::from_str(text).unwrap();
    file["sets"].as_array().unwrap().clone()
}

fn prepared(set: &Value) -> Prepared {
    let points: Vec<[f64; 3]> = serde_json::from_value(set["points"].clone()).unwrap();
    Prepared::new(&points.into_iter().map(Vector3::from).collect::<Vec<_>>()).unwrap()
}

/// ln Γ of k/2 by the recurrence down from Stirling's series at a large argument.
fn ln_gamma(mut x: f64) -> f64 {
    let mut product = 0.0;
    while x < 40.0 {
        product += x.ln();
        x += 1.0;
    }
    let tau = std::f64::consts::TAU;
    (x - 0.5) * x.ln() - x + 0.5 * tau.ln() + 1.0 / (12.0 * x) - 1.0 / (360.0 * x.powi(3)) - product
}

/// Log likelihood of the chi distribution, as `scipy.stats.chi.logpdf(r, df, shift, scale).sum()`.
fn log_likelihood(r: &[f64], df: f64, shift: f64, scale: f64) -> f64 {
    r.iter()
        .map(|r| {
            let x = (r - shift) / scale;
            let power = if df == 1.0 { 0.0 } else { (df - 1.0) * x.ln() };
            (1.0 - 0.5 * df) * LN_2 - ln_gamma(0.5 * df) - scale.ln() + power - 0.5 * x * x
        })
        .sum()
}

#[test]
fn closed_forms_agree_to_ten_digits() {
    let mut compared = 0;
    for set in sets() {
        let points = prepared(&set);
        for statistic in &PAPER16 {
            // Absent: the chi fit, compared below, and what scipy leaves undefined.
            let Some(expected) = set["values"][statistic.name].as_f64() else { continue };
            let got = (statistic.value)(&points);
            let scale = expected.abs().max(if statistic.unit == "-" { 1e-2 } else { 1e-6 });
            let name = (&set["name"], statistic.name);
            assert!((got - expected).abs() <= TOLERANCE * scale, "{name:?}: {got} {expected}");
            compared += 1;
        }
    }
    assert!(compared >= 60 * 13, "{compared}");
}

#[test]
fn the_chi_fit_is_never_less_likely_than_scipys() {
    let mut within_bounds = 0;
    for set in sets() {
        let points = prepared(&set);
        let fit = points.chi();
        // Equal radii (a square of four points) have no density to compare.
        if fit.scale == 0.0 {
            continue;
        }
        let ours = log_likelihood(points.r(), fit.df, fit.shift, fit.scale);
        for scipy in set["chi"].as_array().unwrap() {
            let [df, shift, scale, expected] =
                ["df", "shift", "scale", "log_likelihood"].map(|name| scipy[name].as_f64());
            let (Some(df), Some(shift), Some(scale)) = (df, shift, scale) else { continue };
            if !(MIN_DF..=MAX_DF).contains(&df) {
                continue;
            }
            let theirs = log_likelihood(points.r(), df, shift, scale);
            // Where scipy's likelihood is finite, it is the same function.
            if let Some(expected) = expected {
                assert!((theirs - expected).abs() < 1e-8 * expected.abs().max(1.0));
            }
            let slack = 1e-9 * theirs.abs().max(1.0);
            assert!(ours >= theirs - slack, "{}: {ours} < {theirs} {fit:?}", set["name"]);
            within_bounds += 1;
        }
    }
    assert!(within_bounds >= 60, "{within_bounds}");
}
