use granulcal_features::{HeightMap, Part, Segmentation, Threshold, segment_height_map};
use granulcal_scene::{Bed, DepthSensor, NoiseField, StereoSensor};

use super::doubts::rounded_up;
use super::*;
use crate::{Recording, Source};

/// A cone in the middle of a field of half a metre, 4 mm to a pixel.
fn cone(height: f64, radius: f64) -> Formation {
    let (side, step) = (120, 4e-3);
    let middle = 0.5 * side as f64;
    let at = |pixel: usize| {
        let (u, v) = ((pixel % side) as f64 - middle, (pixel / side) as f64 - middle);
        (height * (1.0 - step * u.hypot(v) / radius)).max(0.0)
    };
    let z = (0..side * side).map(at).collect();
    let map = HeightMap::new(side, side, step, step, z).unwrap();
    let height_threshold = Threshold::Absolute(2e-4);
    let settings = Segmentation { height_threshold, ..Segmentation::default() };
    segment_height_map(&map, &settings).unwrap()
}

#[test]
fn a_heap_that_lacks_grains_or_is_in_another_unit_cannot_be_of_the_scene() {
    let limits = Limits::of(&Scene::funnel(0.12), &Prior::default()).unwrap().unwrap();
    // 2000 balls of 4 mm are 67 ml.
    assert!((limits.least_volume / 0.7 - 6.7e-5).abs() < 1e-6, "{limits:?}");
    assert_eq!(limits.violations(&cone(0.03, 0.06)), Vec::<String>::new());
    let few = limits.violations(&cone(0.02, 0.04));
    assert!(few.len() == 1 && few[0].contains("as many grains"), "{few:?}");
    let small = limits.violations(&cone(1e-3, 0.06));
    assert!(small.iter().any(|reason| reason.contains("unit of the depths")), "{small:?}");
    // Millimetres that were taken for metres.
    let giant = limits.violations(&cone(30.0, 0.06));
    assert!(giant[0].starts_with("the formation's height is 30 m"), "{giant:?}");
    assert!(giant[0].ends_with(": is the unit of the depths right?"), "{giant:?}");
    // Leftovers of a pour that has rolled out of view are a formation of the scene.
    assert_eq!(limits.violations(&cone(8e-3, 0.015)), Vec::<String>::new());
    let of_threshold = limits.doubts(&cone(0.03, 0.06));
    assert!(of_threshold.len() == 1 && of_threshold[0].contains("height_threshold"));
    assert!(of_threshold[0].contains("height_threshold = 0.001 m in both"), "{of_threshold:?}");
    let by_colour = Formation { is_by_colour: true, ..cone(0.03, 0.06) };
    let hollow = Formation { volume: -1e-6, ..by_colour.clone() };
    assert!(limits.violations(&hollow)[0].contains("of the ground's colour"));
    // Below three standard deviations the ground's noise is taken for grains, whatever the scene says.
    let noisy = Formation { threshold: 1e-3, ground_sd: 5e-4, ..cone(0.03, 0.06) };
    let of_noise = limits.doubts(&noisy);
    assert!(
        of_noise.len() == 1 && of_noise[0].contains("height_threshold = 0.0015 m here"),
        "{of_noise:?}"
    );
    assert_eq!([1.626e-3, 1e-3, 9.91e-3].map(rounded_up), ["0.0017", "0.001", "0.01"]);
    let still = Formation { ground_sd: 3e-4, ..noisy };
    assert_eq!(limits.doubts(&still), Vec::<String>::new());
    let from_nought = Limits { threshold: Some(0.0), ..limits };
    let all = Formation { threshold: 0.0, ground_sd: 0.0, ..still.clone() };
    assert_eq!(from_nought.doubts(&all), Vec::<String>::new());
    let coarse = Formation { resolution: (1e-2, 1e-2), ..still };
    let of_pixels = limits.doubts(&coarse);
    assert!(of_pixels.len() == 1 && of_pixels[0].contains("a pixel is 10 mm wide"));
    assert_eq!(limits.doubts(&by_colour), Vec::<String>::new());
    let limits = Limits { threshold: None, ..limits };
    assert!(limits.doubts(&cone(0.03, 0.06)).is_empty());
    let doubt = |formation: &Formation| limits.doubts(formation).join("; ");
    let seen = cone(0.03, 0.06);
    let mut heights = seen.heights.clone();
    // Of 120 columns those from the middle on are not seen.
    let blind = |pixel: &usize| pixel % 120 >= 60;
    (0..heights.len()).filter(blind).for_each(|pixel| heights[pixel] = None);
    let mask = (0..heights.len()).map(|pixel| seen.mask[pixel] && !blind(&pixel)).collect();
    let half = Formation { mask, heights, ..seen.clone() };
    assert!(doubt(&half).contains("of the formation's outline nothing is seen"));
    let uneven = Formation { ground_sd: 3e-3, ..seen.clone() };
    assert!(doubt(&uneven).contains("of two levels"), "{}", doubt(&uneven));
    let beyond = vec![Part { volume: 4e-5, height: 0.02 }, Part { volume: 3e-8, height: 4e-3 }];
    let chosen = Formation { left_out: beyond, ..seen.clone() };
    assert!(
        doubt(&chosen).starts_with("40 ml, 20 mm high, stand beyond the 0.58 m"),
        "{}",
        doubt(&chosen)
    );
    // It shows less than the scene's images, which matters where grains come to its edge.
    let mut mask = seen.mask.clone();
    mask[0] = true;
    let small = Formation { shown: Some(0.8), ..seen.clone() };
    let at_edge = Formation { mask, ..small.clone() };
    assert!(doubt(&small).is_empty() && doubt(&at_edge).contains("those that have rolled on"));
    // On a bed of some 10,000 grains it may be as small as it likes.
    let bed = Bed { radius: 0.1, height: 0.03, spacing: 4.5e-3, jitter: 0.0, settle: 0.3 };
    let mut on_bed = Scene { bed: Some(bed), ..Scene::drop(0.1) };
    on_bed.camera.projection = Projection::Orthographic;
    (on_bed.camera.pixels, on_bed.camera.downsample) = (200, 1);
    let limits = Limits::of(&on_bed, &Prior::default()).unwrap().unwrap();
    let limits = Limits { threshold: None, ..limits };
    assert_eq!(limits.violations(&cone(0.02, 0.04)), Vec::<String>::new());
    assert!(limits.doubts(&cone(0.02, 0.04)).is_empty());
    // What is left of it is bent, and a ring is in pieces.
    let pieces = field(&[(0.1, 0.0), (-0.1, 0.0)], HEAP, 1.0, -5e-4);
    assert_eq!(limits.doubts(&pieces), Vec::<String>::new());
    let on_a_table = funnel().doubts(&pieces).join("; ");
    assert!(on_a_table.contains("stand apart") && on_a_table.contains("is bent"), "{on_a_table}");
}

/// Heaps of a height and radius at places of a field of half a metre, 4 mm to a pixel, on a ground of some bow `[m]`,
/// all stretched along x.
fn field(heaps: &[(f64, f64)], (high, radius): (f64, f64), stretch: f64, bow: f64) -> Formation {
    let (side, step) = (146, 4e-3);
    let half = 0.5 * side as f64;
    let at = |pixel: usize| {
        let (u, v) = ((pixel % side) as f64 + 0.5 - half, (pixel / side) as f64 + 0.5 - half);
        let top = |&(x, y): &(f64, f64)| {
            high * (1.0 - (step * u / stretch - x).hypot(step * v - y) / radius)
        };
        bow * (u * u + v * v) / (half * half) + heaps.iter().map(top).fold(0.0, f64::max)
    };
    let map = HeightMap::new(side, side, step, step, (0..side * side).map(at).collect()).unwrap();
    let height_threshold = Threshold::Absolute(1e-3);
    let settings = Segmentation { height_threshold, ..Segmentation::default() };
    segment_height_map(&map, &settings).unwrap()
}

fn funnel() -> Limits {
    Limits::of(&Scene::funnel(0.12), &Prior::default()).unwrap().unwrap()
}

const HEAP: (f64, f64) = (0.03, 0.06);

#[test]
fn a_ground_at_another_distance_asks_for_the_unit_of_the_depths() {
    let limits = funnel();
    assert_eq!(limits.distance, Some((0.29, 0.29)));
    // Cameras stand at 20 cm to 80 cm.
    for near in [0.2, 0.29, 0.5, 0.8] {
        assert_eq!(limits.doubt_of_distance(near), None);
    }
    for far in [0.029, 0.0725, 1.16, 2.9] {
        let doubt = limits.doubt_of_distance(far).unwrap();
        let begins = format!("the ground is {far} m from the camera, of the scene's images 0.29 m");
        assert!(doubt.starts_with(&begins), "{doubt}");
        assert!(doubt.ends_with("is the unit of the depths right (depth_unit)?"));
    }
    // A scene of height maps has no camera anywhere.
    let mut mapped = Scene::funnel(0.12);
    (mapped.camera.projection, mapped.camera.pixels) = (Projection::Orthographic, 200);
    let of_maps = Limits::of(&mapped, &Prior::default()).unwrap().unwrap();
    assert_eq!((of_maps.distance, of_maps.doubt_of_distance(5.0)), (None, None));
    // What the prior draws the camera's height from is allowed for.
    let height = r#"[[parameter]]
        path = "camera.height"
        distribution = "uniform"
        low = 0.25
        high = 1.0"#;
    let prior = Prior::from_toml(height).unwrap();
    let (least, most) =
        Limits::of(&Scene::funnel(0.12), &prior).unwrap().unwrap().distance.unwrap();
    assert!((0.25..0.27).contains(&least) && (0.98..=1.0).contains(&most));
}

#[test]
fn a_formation_that_is_longer_than_wide_is_told_where_nothing_makes_it_so() {
    let limits = funnel();
    let told = |stretch| limits.doubts(&field(&[(0.0, 0.0)], HEAP, stretch, 0.0)).join("; ");
    assert_eq!((told(1.0), told(1.1)), (String::new(), String::new()));
    let long = told(1.7);
    assert!(
        long.starts_with("the formation is 1.7") && long.contains(" times as long as wide"),
        "{long}"
    );
    // Few grains lie anyhow.
    let few = [(0.1, 0.01), (-0.1, 0.0), (0.15, -0.01), (-0.12, 0.02), (0.05, 0.01)];
    let lone = field(&few, (4e-3, 4e-3), 1.0, 0.0);
    assert!(lone.elongation() > 0.8);
    assert_eq!(limits.doubts(&lone), Vec::<String>::new());
    let mut tilted = Scene::funnel(0.12);
    tilted.set(&[("effects.tilt.x", 0.1)]).unwrap();
    let limits = Limits::of(&tilted, &Prior::default()).unwrap().unwrap();
    let long = field(&[(0.0, 0.0)], HEAP, 1.7, 0.0);
    assert_eq!(limits.doubts(&long), Vec::<String>::new());
}

#[test]
fn a_bent_ground_is_told() {
    let told = |bow| funnel().doubts(&field(&[(0.0, 0.0)], HEAP, 1.0, bow)).join("; ");
    assert_eq!(told(2e-4), "");
    assert!(told(-5e-4).starts_with("the ground is bent: its middle lies 0.5"), "{}", told(-5e-4));
}

#[test]
fn grains_are_missed_from_a_heap_and_from_one_side_and_not_from_those_that_roll_away() {
    let limits = funnel();
    let told = |formation: &Formation| {
        let all = limits.doubts(formation);
        all.iter().any(|doubt| doubt.contains("the scene's grains by themselves 67"))
    };
    // 2000 grains are 67 ml, and a heap of them takes 1.27 times that or more.
    let cone = |volume: f64| (volume / (std::f64::consts::PI / 3.0 * 0.06 * 0.06), 0.06);
    assert!(!told(&field(&[(0.0, 0.0)], cone(7.5e-5), 1.0, 0.0)));
    assert!(told(&field(&[(0.0, 0.0)], cone(5.5e-5), 1.0, 0.0)));
    // A lattice of lone grains that goes on out of view, and half of it.
    let lattice: Vec<_> = (-9..=9)
        .flat_map(|i| (-9..=9).map(move |j| (0.03 * f64::from(i), 0.03 * f64::from(j))))
        .collect();
    let grains = (6e-3, 4e-3);
    let whole = field(&lattice, grains, 1.0, 0.0);
    assert!(whole.volume > limits.least_volume * 0.2 && whole.volume < limits.least_volume);
    assert_eq!(limits.doubts(&whole), Vec::<String>::new());
    let right: Vec<_> = lattice.into_iter().filter(|(x, _)| *x > 0.0).collect();
    assert!(told(&field(&right, grains, 1.0, 0.0)));
}

#[test]
fn what_a_scenes_sensor_does_to_its_own_images_is_no_doubt() {
    let mut scene = Scene::funnel(0.12);
    let whole = Limits::of(&scene, &Prior::default()).unwrap().unwrap();
    assert_eq!((whole.bow, whole.shown), (0.0, 1.0));
    let noise = NoiseField { broad: 0.3, broad_x: 60.0, broad_y: 60.0, ..NoiseField::default() };
    let stereo = StereoSensor { left_margin: 11.0, noise, ..StereoSensor::new(390.0, 0.05) };
    scene.camera.sensor = Some(DepthSensor::Stereo(stereo));
    let limits = Limits::of(&scene, &Prior::default()).unwrap().unwrap();
    // The right imager misses a band of 67 + 11 of the 780 columns.
    assert!((limits.shown - 0.9).abs() < 0.02, "{}", limits.shown);
    assert!(limits.bow > 2e-4 && limits.bow < 4e-3, "{}", limits.bow);
}

/// Heights of grains, one to a patch of 3 × 3 pixels of 2 mm, of which `seed` says where they lie.
fn scattered(seed: u64, noise: f64) -> Recording {
    let side = 120;
    let at = |pixel: usize, salt: u64| {
        let number = (pixel as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(salt);
        let mixed = (number ^ (number >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        ((mixed ^ (mixed >> 32)) % 1000) as f64 / 1000.0
    };
    let height = |pixel: usize| {
        let patch = pixel / side / 3 * side + pixel % side / 3;
        let grain = if at(patch, seed) < 0.05 { 3.6e-3 } else { 0.0 };
        grain + noise * (at(pixel, seed + 1000 + (1e6 * noise) as u64) - 0.5)
    };
    let z = (0..side * side).map(height).collect();
    let map = HeightMap::new(side, side, 2e-3, 2e-3, z).unwrap();
    Recording::of_one("map.npz".into(), Source::Heights(map), Segmentation::default())
}

#[test]
fn frames_of_one_pour_are_told_from_pours() {
    let limits = Limits::of(&Scene::funnel(0.12), &Prior::default()).unwrap().unwrap();
    let told = |recordings: &[Recording]| {
        let names: Vec<_> = (0..recordings.len()).map(|i| format!("{i}.npz")).collect();
        let places: Vec<_> = recordings.iter().map(|each| limits.places_of(each)).collect();
        assert!(places.iter().all(Option::is_some));
        limits.doubts_of_frames(&names, &places)
    };
    assert_eq!(told(&[scattered(1, 1e-4), scattered(2, 1e-4)]), Vec::<String>::new());
    let frames = told(&[scattered(1, 1e-4), scattered(1, 2e-4)]);
    assert!(
        frames.len() == 1 && frames[0].starts_with("0.npz, 1.npz show the same grains"),
        "{frames:?}"
    );
    // Two pours, the first seen three times, the second twice.
    let of_both = [(1, 1e-4), (1, 2e-4), (1, 3e-4), (2, 1e-4), (2, 2e-4)];
    let both = told(&of_both.map(|(seed, noise)| scattered(seed, noise)));
    assert!(both.len() == 2, "{both:?}");
    assert!(
        both[0].starts_with("0.npz, 1.npz, 2.npz show") && both[1].starts_with("3.npz, 4.npz show")
    );
    // Pixels as wide as many grains tell nothing.
    let fine = Limits { diameter: 5e-4, ..limits };
    assert!(fine.places_of(&scattered(1, 1e-4)).is_none());
}

/// A number in `[-1/2, 1/2]` for each pixel or grain and each salt.
fn chance(number: usize, salt: u64) -> f64 {
    let mixed = granulcal_numbers::mix(number as u64, salt, 0);
    (mixed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
}

/// A heap of grains that lie at different heights, those of `pour`, with noise of a frame and a pattern of the camera,
/// both in each pixel by itself and as standard deviation `[m]`.
fn heap(pour: u64, (frame, noise): (u64, f64), pattern: f64) -> Recording {
    let (side, step) = (120, 2e-3);
    let height = |pixel: usize| {
        let (u, v) = (pixel % side, pixel / side);
        let off = step * (u as f64 - 60.0).hypot(v as f64 - 60.0);
        let top = 0.04 * (1.0 - off / 0.08);
        let grain = 4e-3 * chance(u / 2 + side * (v / 2), pour);
        let flat = 12_f64.sqrt();
        let seen = flat * (noise * chance(pixel, 100 + frame) + pattern * chance(pixel, 99));
        seen + if top > 0.0 { top + grain } else { 0.0 }
    };
    let z = (0..side * side).map(height).collect();
    let map = HeightMap::new(side, side, step, step, z).unwrap();
    Recording::of_one("map.npz".into(), Source::Heights(map), Segmentation::default())
}

#[test]
fn a_heaps_relief_is_known_under_noise() {
    let limits = funnel();
    let told = |recordings: [Recording; 2]| {
        let places = recordings.map(|each| limits.places_of(&each));
        !limits.doubts_of_frames(&["a".into(), "b".into()], &places).is_empty()
    };
    for noise in [1e-4, 3e-4, 6e-4] {
        assert!(told([heap(1, (1, noise), 0.0), heap(1, (2, noise), 0.0)]), "{noise}");
        assert!(!told([heap(1, (1, noise), 0.0), heap(2, (2, noise), 0.0)]), "{noise}");
    }
    // A pattern that is the same in all images of a camera is no relief of grains.
    assert!(!told([heap(1, (1, 2e-4), 2e-3), heap(2, (2, 2e-4), 2e-3)]));
}
