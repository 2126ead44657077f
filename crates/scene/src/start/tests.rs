use super::*;
use crate::scene::Scene;

fn nearest_pair(points: &[Vector3<f64>]) -> f64 {
    let mut nearest = f64::INFINITY;
    for (i, a) in points.iter().enumerate() {
        for b in &points[..i] {
            nearest = nearest.min((a - b).norm());
        }
    }
    nearest
}

#[test]
fn no_grains_overlap_at_the_start() {
    for mut scene in [Scene::funnel(0.12), Scene::drop(0.1)] {
        scene.grains.count = 700;
        let points = scene.starting_positions(3);
        assert_eq!(points.len(), 700);
        assert!(nearest_pair(&points) >= scene.grains.diameter);
    }
}

#[test]
fn limits_of_a_lattice_are_told_and_hold() {
    let mut scene = Scene::funnel(0.12);
    scene.grains.shape = Some(crate::GrainShape::Box { aspect: [1.0, 1.0, 1.7] });
    scene.effects = crate::Effects::default();
    let Start::Grid { jitter, .. } = scene.start else { panic!() };
    let error = scene.with("start.spacing", 8e-3).unwrap_err();
    let SceneError::Lattice { name, bound, limit, needs, .. } = &error else { panic!("{error}") };
    assert_eq!((name.as_str(), *bound), ("start.spacing", "at least"));
    assert!((needs - scene.held_grains().diameter).abs() < 1e-15 && jitter > 0.0);
    assert!(error.to_string().contains("got 0.008: a grain needs 0.0088"), "{error}");
    let wide = scene.with("start.spacing", *limit).unwrap();
    let error = wide.with("start.jitter", 2e-4).unwrap_err();
    let SceneError::Lattice { name, bound, limit, .. } = &error else { panic!("{error}") };
    assert_eq!((name.as_str(), *bound), ("start.jitter", "at most"));
    assert!((limit - jitter).abs() < 1e-6 * jitter, "{limit}");
    wide.with("start.jitter", *limit).unwrap();
}

#[test]
fn grains_hang_with_the_funnel_however_they_are_placed() {
    let (from, to) = ([0.0, 0.0, 0.3], [0.0, 0.0, 0.5]);
    let starts = [
        Start::Cylinder { from, to, radius: 0.03, spacing: 5e-3, jitter: 0.0 },
        Start::Ball { height: 0.3, solid_fraction: 0.5, jitter: 0.0, turned: false },
        Start::Positions { positions: vec![[0.0, 0.0, 0.3]] },
    ];
    for start in starts {
        let mut scene = Scene { start, ..Scene::funnel(0.12) };
        if let Start::Positions { positions } = &scene.start {
            scene.grains.count = positions.len();
        }
        let there = scene.starting_positions(1);
        scene.effects.funnel.x = 0.03;
        for (moved, place) in scene.starting_positions(1).iter().zip(&there) {
            assert!((moved - place - Vector3::new(0.03, 0.0, 0.0)).norm() < 1e-12);
        }
    }
}

#[test]
fn ball_hangs_at_its_height_and_is_round() {
    let scene = Scene::drop(0.1);
    let points = scene.starting_positions(1);
    let lowest = points.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
    assert!((lowest - 0.002 - 0.1).abs() < 2.1e-4, "{lowest}");
    // Radius of a ball of 2000 grains at 60 % solid: (2000 / 0.6)^(1/3) * R.
    let extent = points.iter().map(|p| p.x.abs()).fold(0.0, f64::max);
    let expected = (2000.0f64 / 0.6).cbrt() * 0.002;
    assert!((extent + 0.002 - expected).abs() < 0.1 * expected, "{extent} {expected}");
}

#[test]
fn a_turned_ball_is_the_same_ball_in_another_orientation() {
    let mut scene = Scene::drop(0.1);
    scene.grains.count = 300;
    let turned = |scene: &Scene, is_turned: bool, seed: u64| {
        let mut scene = scene.clone();
        scene.start =
            Start::Ball { height: 0.1, solid_fraction: 0.6, jitter: 0.0, turned: is_turned };
        scene.starting_positions(seed)
    };
    let (straight, once, again, other) = (
        turned(&scene, false, 1),
        turned(&scene, true, 1),
        turned(&scene, true, 1),
        turned(&scene, true, 2),
    );
    assert_eq!(once, again);
    let between = |points: &[Vector3<f64>]| (points[0] - points[299]).norm();
    for points in [&once, &other] {
        assert!((between(points) - between(&straight)).abs() < 1e-12);
        assert!((nearest_pair(points) - nearest_pair(&straight)).abs() < 1e-12);
        let lowest = points.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
        assert!((lowest - 0.002 - 0.1).abs() < 1e-12, "{lowest}");
        assert!((points[0] - points[299] - (straight[0] - straight[299])).norm() > 1e-3);
    }
    assert!((once[0] - once[299] - (other[0] - other[299])).norm() > 1e-3);
    // What is not turned says nothing of it in TOML.
    assert!(!scene.to_toml().unwrap().contains("turned"));
}

#[test]
fn a_cylinder_is_filled_from_below_and_holds_its_grains() {
    for (from, to) in [([0.1, 0.0, 0.05], [0.1, 0.02, 0.05]), ([0.0; 3], [0.01, 0.02, 0.05])] {
        let mut scene = Scene::drop(0.1);
        scene.grains.diameter = 2.4e-3;
        scene.grains.count = 300;
        let (radius, spacing, jitter) = (0.03, 2.8e-3, 1e-4);
        scene.start = Start::Cylinder { from, to, radius, spacing, jitter };
        scene.check().unwrap();
        let points = scene.starting_positions(2);
        assert!(nearest_pair(&points) >= scene.grains.diameter);
        let (from, to) = (Vector3::from(from), Vector3::from(to));
        let axis = (to - from).normalize();
        for point in &points {
            let along = (point - from).dot(&axis);
            let out = (point - from - along * axis).norm();
            assert!(out <= 0.03 - 1.2e-3 && along >= 1.2e-3);
            assert!(along <= (to - from).norm() - 1.2e-3);
        }
        let highest = points.iter().map(|p| p.z).fold(f64::MIN, f64::max);
        assert!(highest < 0.6 * (0.05 + 0.03), "{highest}");
        scene.grains.count = 10_000;
        let error = scene.check().unwrap_err();
        assert!(matches!(error, SceneError::StartTooSmall { kind: "cylinder", .. }), "{error}");
    }
}

#[test]
fn seeds_differ_and_repeat() {
    let scene = Scene::funnel(0.12);
    let at = |seed| scene.starting_positions(seed);
    assert_eq!(at(1), at(1));
    assert_ne!(at(1), at(2));
}

#[test]
fn listed_positions_are_the_start_whatever_the_seed() {
    let positions = vec![[0.0, 0.0, 0.002], [0.01, -0.02, 0.003]];
    let mut scene = Scene::drop(0.1);
    scene.grains.count = 2;
    scene.start = Start::Positions { positions: positions.clone() };
    scene.check().unwrap();
    assert_eq!(Scene::from_toml(&scene.to_toml().unwrap()).unwrap(), scene);
    let started = scene.starting_positions(5);
    assert_eq!(started, positions.iter().map(|p| Vector3::from(*p)).collect::<Vec<_>>());
    assert_eq!(started, scene.starting_positions(6));
}

#[test]
fn listed_positions_must_be_finite_and_one_for_each_grain() {
    let mut scene = Scene::drop(0.1);
    scene.grains.count = 2;
    scene.start = Start::Positions { positions: vec![[0.0; 3]] };
    let error = scene.check().unwrap_err();
    assert!(matches!(error, SceneError::Length { got: 1, expected: 2, .. }), "{error}");
    scene.start = Start::Positions { positions: vec![[0.0; 3], [0.0, f64::NAN, 0.0]] };
    assert!(scene.check().unwrap_err().to_string().contains("start.positions.1.y"));
}

#[test]
fn listed_turns_are_of_unit_length_and_of_grains_that_have_a_shape() {
    let mut scene = Scene::drop(0.1);
    scene.grains.count = 2;
    let (positions, half) = (vec![[0.0, 0.0, 0.01], [0.01, -0.02, 0.01]], 0.5_f64.sqrt());
    let turned = |orientations| Start::Poses { positions: positions.clone(), orientations };
    scene.start = turned(vec![[0.0, 0.0, 0.0, 1.0], [half, 0.0, 0.0, half]]);
    let refused = |scene: &Scene| scene.check().unwrap_err().to_string();
    assert!(refused(&scene).contains("start.orientations needs grains.shape"));
    scene.grains.shape = Some(crate::GrainShape::Box { aspect: [1.0, 1.0, 2.0] });
    scene.check().unwrap();
    assert_eq!(Scene::from_toml(&scene.to_toml().unwrap()).unwrap(), scene);
    assert!(scene.start.is_listed() && !scene.is_axisymmetric());
    let turns = scene.starting_orientations().unwrap();
    // x, y, z, w: a quarter turn about x takes y to z.
    assert!((turns[1] * Vector3::y() - Vector3::z()).norm() < 1e-15);
    assert_eq!(scene.starting_positions(1), scene.starting_positions(2));
    assert_eq!(Scene::drop(0.1).starting_orientations(), None);
    // What a file rounds is taken as it is meant, and nothing else.
    scene.start = turned(vec![[0.0, 0.0, 0.0, 1.0], [0.6, 0.0, 0.0, 0.8003]]);
    assert!((scene.starting_orientations().unwrap()[1].norm() - 1.0).abs() < 1e-15);
    for (wrong, told) in [
        (vec![[0.0, 0.0, 0.0, 1.0]], "start.orientations has 1 entries"),
        (vec![[0.0, 0.0, 0.0, 1.0], [0.0; 4]], "start.orientations.1 (norm"),
        (vec![[0.0, 0.0, 0.0, 1.0], [f64::NAN, 0.0, 0.0, 1.0]], "1 within a thousandth"),
        (vec![[0.0, 0.0, 0.0, 1.002], [0.0, 0.0, 0.0, 1.0]], "start.orientations.0"),
    ] {
        scene.start = turned(wrong);
        assert!(refused(&scene).contains(told), "{}", refused(&scene));
    }
}

#[test]
fn too_many_grains_or_too_much_jitter_is_refused() {
    let mut scene = Scene::funnel(0.12);
    scene.grains.count = 2001;
    assert!(matches!(scene.check(), Err(SceneError::StartTooSmall { capacity: 2000, .. })));
    let scene = Scene::drop(0.1).with("start.jitter", 1e-3);
    assert!(scene.unwrap_err().to_string().contains("start.jitter"));
}
