//! The diagnostic statistics on formations whose answers are known.

use std::f64::consts::TAU;

use super::*;
use crate::rng::Stream;
use nalgebra::{Vector2, Vector3};

const SPACING: f64 = 5e-4;
const GRAIN: f64 = 4e-3;

/// Pixels of a height field over a square of ground, those above the ground only.
fn pixels(half_width: f64, height: impl Fn(f64, f64) -> f64) -> Vec<Vector3<f64>> {
    let side = (2.0 * half_width / SPACING) as i32;
    // Off the axes by part of a pixel: a camera's grid is nowhere special.
    let at = |i: i32| f64::from(i) * SPACING - half_width + 0.37 * SPACING;
    (0..side * side)
        .map(|i| {
            let (x, y) = (at(i % side), at(i / side));
            Vector3::new(x, y, height(x, y))
        })
        .filter(|p| p.z > 0.0)
        .collect()
}

/// A discs of pixels as tall as a grain.
fn grain(x: f64, y: f64) -> Vec<Vector3<f64>> {
    let cap = |dx: f64, dy: f64| 0.25 * GRAIN * GRAIN - dx * dx - dy * dy;
    let disc = pixels(0.6 * GRAIN, |dx, dy| cap(dx, dy).max(0.0).sqrt());
    disc.into_iter().map(|p| p + Vector3::new(x, y, 0.0)).collect()
}

fn values(points: &[Vector3<f64>], pour_axis: Option<Vector2<f64>>) -> Values {
    let settings = DiagnosticSettings { pour_axis, grain_diameter: GRAIN, spacing: SPACING };
    Values(diagnostics(points, &settings).unwrap())
}

struct Values([f64; DIAGNOSTIC_COUNT]);

impl Values {
    fn get(&self, name: &str) -> f64 {
        self.0[DIAGNOSTICS.iter().position(|statistic| statistic.name == name).unwrap()]
    }
}

#[test]
fn a_cone_has_its_profile_and_its_slope() {
    let (radius, steepness) = (0.05, 0.4);
    let cone = pixels(0.06, |x, y| steepness * (radius - x.hypot(y)));
    let got = values(&cone, None);
    // The share q of a disc's points lies within R √q.
    assert!((got.get("r_95") / (radius * 0.95_f64.sqrt()) - 1.0).abs() < 2e-3);
    assert!((got.get("r_99") / (radius * 0.99_f64.sqrt()) - 1.0).abs() < 2e-3);
    assert!((got.get("profile_slope") / -steepness - 1.0).abs() < 0.01);
    assert_eq!(got.get("ring_depth"), 1.0);
    let outer = radius * 0.95_f64.sqrt();
    for (ring, statistic) in profile::HEIGHTS.iter().enumerate() {
        // Mean of r over a ring from a to b: ⅔ (b³ - a³)/(b² - a²).
        let edge = |k: usize| outer * (k as f64 / profile::HEIGHTS.len() as f64).sqrt();
        let (a, b) = (edge(ring), edge(ring + 1));
        let mean = 2.0 / 3.0 * (b.powi(3) - a.powi(3)) / (b * b - a * a);
        let expected = steepness * (radius - mean);
        let found = got.get(statistic.name);
        assert!((found - expected).abs() < 0.02 * expected + 1e-4, "{}", statistic.name);
    }
    // Twice the flank, twice the slope.
    let steep = values(&pixels(0.06, |x, y| 2.0 * steepness * (radius - x.hypot(y))), None);
    assert!((steep.get("profile_slope") / got.get("profile_slope") - 2.0).abs() < 1e-12);
}

#[test]
fn a_crater_has_a_depth_and_bare_ground_counts_as_nothing() {
    let crater = |floor: f64| {
        pixels(0.07, move |x, y| {
            let rim = 0.012 * (-((x.hypot(y) - 0.04) / 0.008).powi(2)).exp();
            if rim > 1e-3 {
                rim
            } else if x.hypot(y) < 0.04 {
                floor
            } else {
                0.0
            }
        })
    };
    let bare = values(&crater(0.0), Some(Vector2::zeros()));
    assert_eq!(bare.get("ring_depth"), 0.0);
    assert_eq!(bare.get("height_ring_01"), 0.0);
    assert!(bare.get("profile_slope") < -0.2);
    let filled = values(&crater(0.003), Some(Vector2::zeros()));
    assert!((filled.get("ring_depth") - 0.003 / 0.012).abs() < 0.03);
    // Bare in every other column: the same points over twice the ground.
    let striped = |x: f64| (x / SPACING).floor().rem_euclid(2.0) < 0.5;
    let full = pixels(0.05, |x, y| if x.hypot(y) < 0.04 { 0.01 } else { 0.0 });
    let half: Vec<_> = full.iter().copied().filter(|p| striped(p.x)).collect();
    let half = values(&half, None).get("height_ring_10");
    assert!((half / 0.005 - 1.0).abs() < 0.05, "{half}");
}

#[test]
fn modes_of_mass_and_rim_are_read_about_the_pour_axis() {
    let (mean, amplitude) = (0.04, 0.1);
    for order in 1..=3_u8 {
        for phase in [0.0, 0.7] {
            let m = f64::from(order);
            let star = pixels(0.06, |x, y| {
                let rim = mean * (1.0 + amplitude * (m * y.atan2(x) - phase).cos());
                if x.hypot(y) < rim { 0.01 } else { 0.0 }
            });
            let got = values(&star, Some(Vector2::zeros()));
            // A sector averages the wave over 15°.
            let seen = amplitude * (m * TAU / 48.0).sin() / (m * TAU / 48.0);
            let part = |name: &str, wave: &str| got.get(&format!("{name}_{wave}_{order}"));
            assert!((part("rim", "cos") - seen * phase.cos()).abs() < 3e-3, "{order} {phase}");
            assert!((part("rim", "sin") - seen * phase.sin()).abs() < 3e-3, "{order} {phase}");
            // Mass goes as R²: the mean of (1 + a cos)² e^{imφ} over that of (1 + a cos)².
            let mass = amplitude / (1.0 + 0.5 * amplitude * amplitude);
            assert!((part("mass", "cos") - mass * phase.cos()).abs() < 3e-3, "{order} {phase}");
            assert!((part("mass", "sin") - mass * phase.sin()).abs() < 3e-3, "{order} {phase}");
        }
    }
}

#[test]
fn an_offset_from_the_pour_axis_is_mode_one_and_the_centroid_hides_it() {
    let heap = pixels(0.06, |x, y| 0.4 * (0.04 - x.hypot(y)));
    let beside = values(&heap, Some(Vector2::new(-0.01, 0.0)));
    assert!(beside.get("mass_cos_1") > 0.3 && beside.get("mass_sin_1").abs() < 1e-3);
    assert!(beside.get("rim_cos_1") > 0.15);
    let centred = values(&heap, None);
    assert!(centred.get("mass_cos_1").abs() < 1e-3 && centred.get("rim_cos_1").abs() < 0.01);
}

#[test]
fn grains_and_clusters_are_told_apart() {
    let heap = pixels(0.03, |x, y| 0.5 * (0.025 - x.hypot(y)));
    let mut points = heap.clone();
    for i in 0..7 {
        points.extend(grain(0.06 + 0.01 * f64::from(i), 0.0));
    }
    let alone = values(&points, None);
    assert_eq!((alone.get("isolated_grains"), alone.get("clusters")), (7.0, 0.0));
    // Two that touch, and three in a row.
    for (x, count) in [(-0.06, 2), (-0.1, 3)] {
        for i in 0..count {
            points.extend(grain(x, f64::from(i) * GRAIN));
        }
    }
    let got = values(&points, None);
    assert_eq!((got.get("isolated_grains"), got.get("clusters")), (7.0, 2.0));
    assert_eq!(got.get("count_in_view"), points.len() as f64);
    // Without a heap the larger cluster is the formation.
    let rest = &points[heap.len()..];
    let got = values(rest, None);
    assert_eq!((got.get("isolated_grains"), got.get("clusters")), (7.0, 1.0));
    let got = values(&grain(0.0, 0.0), None);
    assert_eq!((got.get("isolated_grains"), got.get("clusters")), (1.0, 0.0));
}

/// The bodies by their definition: every pair of points, joined until nothing changes.
fn by_definition(points: &[Vector3<f64>], reach: f64) -> Vec<usize> {
    let mut body: Vec<usize> = (0..points.len()).collect();
    loop {
        let mut changed = false;
        for i in 0..points.len() {
            for j in 0..i {
                let near = (points[i] - points[j]).xy().norm() <= reach;
                if near && body[i] != body[j] {
                    let low = body[i].min(body[j]);
                    (body[i], body[j], changed) = (low, low, true);
                }
            }
        }
        if !changed {
            return body;
        }
    }
}

#[test]
fn bodies_equal_their_definition() {
    let mut stream = Stream::new(5);
    for count in [3, 10, 60, 200] {
        for reach in [0.02, 0.05, 0.1, 0.3] {
            let points: Vec<_> = (0..count)
                .map(|_| Vector3::new(stream.uniform(), stream.uniform(), stream.uniform()))
                .collect();
            let mut names = by_definition(&points, reach);
            names.sort_unstable();
            names.dedup();
            let spacing = reach / 1.5;
            // A circle without end: every body fits, so all are counted as grains.
            let settings = DiagnosticSettings { pour_axis: None, grain_diameter: 1e3, spacing };
            let got = diagnostics(&points, &settings).unwrap();
            let position = DIAGNOSTICS.iter().position(|s| s.name == "isolated_grains").unwrap();
            assert_eq!(got[position], names.len() as f64, "{count} {reach}");
        }
    }
}

#[test]
fn a_pareto_tail_has_its_index() {
    let mut stream = Stream::new(6);
    for alpha in [2.0, 4.0] {
        let points: Vec<_> = (0..200_000)
            .map(|_| {
                let (sin, cos) = (TAU * stream.uniform()).sin_cos();
                let r = 0.01 * (1.0 - stream.uniform()).powf(-1.0 / alpha);
                Vector3::new(r * cos, r * sin, 0.001)
            })
            .collect();
        let got = values(&points, Some(Vector2::zeros())).get("tail_index");
        // 10,000 points beyond r_95: a standard error of 1 %.
        assert!((got * alpha - 1.0).abs() < 0.04, "{got}");
    }
}

#[test]
fn refuses_settings_that_are_none() {
    let points = grain(0.0, 0.0);
    let good = DiagnosticSettings { pour_axis: None, grain_diameter: GRAIN, spacing: SPACING };
    let bad = [
        DiagnosticSettings { grain_diameter: 0.0, ..good },
        DiagnosticSettings { grain_diameter: f64::NAN, ..good },
        DiagnosticSettings { spacing: -1.0, ..good },
        DiagnosticSettings { spacing: 1e4, ..good },
        DiagnosticSettings { pour_axis: Some(Vector2::new(f64::NAN, 0.0)), ..good },
        DiagnosticSettings { pour_axis: Some(Vector2::new(0.0, 2e100)), ..good },
    ];
    for settings in bad {
        let got = diagnostics(&points, &settings);
        assert!(matches!(got, Err(FeatureError::OutOfRange { .. })), "{settings:?}");
    }
    let far = [points, vec![Vector3::new(1e12, 0.0, 0.0)]].concat();
    assert!(matches!(diagnostics(&far, &good), Err(FeatureError::OutOfRange { .. })));
}

#[test]
fn clods_are_patches_and_a_heap_is_one() {
    let cone = pixels(0.06, |x, y| 0.4 * (0.05 - x.hypot(y)));
    assert_eq!(values(&cone, None).get("patches"), 1.0);
    // Five clods of 6 mm in a crust of 1 mm, less than half a grain of 4 mm: bodies of the mask are one, patches five.
    let clods = pixels(0.06, |x, y| {
        let near = |k: i32| {
            let (sin, cos) = (TAU * f64::from(k) / 5.0).sin_cos();
            (x - 0.03 * cos).hypot(y - 0.03 * sin) < 0.008
        };
        if (0..5).any(near) {
            0.006
        } else if x.hypot(y) < 0.05 {
            0.001
        } else {
            0.0
        }
    });
    let got = values(&clods, Some(Vector2::zeros()));
    assert_eq!((got.get("patches"), got.get("clusters")), (5.0, 0.0));
    let flat = pixels(0.04, |x, y| if x.hypot(y) < 0.03 { 0.001 } else { 0.0 });
    assert_eq!(values(&flat, None).get("patches"), 0.0);
}

#[test]
fn roughness_is_about_the_mean_over_the_azimuth() {
    let (height, amplitude) = (0.010, 0.002);
    // sqrt(1/2) of the amplitude of a wave round the azimuth, whatever the radius.
    let waves = pixels(0.05, |x, y| {
        if x.hypot(y) < 0.045 { height + amplitude * (6.0 * y.atan2(x)).cos() } else { 0.0 }
    });
    let got = values(&waves, Some(Vector2::zeros())).get("roughness");
    assert!((got / (amplitude * 0.5_f64.sqrt()) - 1.0).abs() < 0.01, "{got}");
    // A cone has the slope within a ring: s D / sqrt(12); 1 % less for eight pixels across it, and less in the middle.
    let cone = pixels(0.06, |x, y| 0.4 * (0.05 - x.hypot(y)));
    let got = values(&cone, Some(Vector2::zeros())).get("roughness");
    assert!((got / (0.4 * GRAIN / 12_f64.sqrt()) - 0.98).abs() < 0.03, "{got}");
    // Two grains far apart take no memory for the rings between.
    let far: Vec<_> = grain(0.0, 0.0).into_iter().chain(grain(9e5, 0.0)).collect();
    let settings = DiagnosticSettings { pour_axis: None, grain_diameter: 1e-6, spacing: SPACING };
    assert!(diagnostics(&far, &settings).is_ok());
}

#[test]
fn a_shoulder_is_where_half_of_the_height_is_left() {
    let at = |points: &[Vector3<f64>]| values(points, Some(Vector2::zeros())).get("shoulder");
    // Half of a cone's innermost ring, which is a little lower than its tip, over 0.97 R.
    let cone = at(&pixels(0.06, |x, y| 0.4 * (0.05 - x.hypot(y))));
    assert!((cone - 0.59).abs() < 0.02, "{cone}");
    // A terrace of 10 mm that ends at 30 mm, on a crust of 1 mm to 50 mm; 95 % of the points within 48.7 mm.
    let terrace = at(&pixels(0.06, |x, y| match x.hypot(y) {
        r if r < 0.03 => 0.010,
        r if r < 0.05 => 0.001,
        _ => 0.0,
    }));
    assert!((terrace - 0.03 / 0.0487).abs() < 0.03, "{terrace}");
    let plateau = at(&pixels(0.06, |x, y| if x.hypot(y) < 0.05 { 0.01 } else { 0.0 }));
    assert_eq!(plateau, 1.0);
}
