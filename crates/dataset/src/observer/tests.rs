//! The observer against pours whose answers are known.

use granulcal_scene::{
    Observe, ObserveDischarge, ObserveFront, ObserveImages, ObserveRadius, ObserveSpill,
    ObserveSurface, Outflow, Start,
};

use super::*;

/// One grain let go 5 cm above the ground, and all that can be observed of it.
fn scene() -> Scene {
    let mut scene = Scene::drop(0.1);
    scene.grains.count = 1;
    scene.start = Start::Positions { positions: vec![[0.03, 0.0, 0.052]] };
    scene.end.horizon = 0.4;
    scene.material.restitution = 0.0;
    scene.observe = Some(Observe {
        rate: 500.0,
        begin: 0.02,
        surface: Some(ObserveSurface {
            centre: [0.03, 0.0],
            x: vec![0.0],
            slope_within: 0.01,
            level: 0.5,
        }),
        front: Some(ObserveFront {
            axis: [0.03, 0.0],
            times: vec![0.05],
            level: 0.5,
            link: 0.0,
            end: true,
        }),
        liquid: None,
        clock: None,
        discharge: Some(ObserveDischarge {
            below: 0.027,
            times: vec![0.03, 0.1, 0.3],
            jammed_below: 0.0,
        }),
        radius: Some(ObserveRadius { axis: [0.0; 2], percentiles: vec![50.0] }),
        spill: Some(ObserveSpill { axis: [0.0; 2], radius: 0.02 }),
        images: None,
    });
    scene
}

fn run(scene: &Scene) -> (Pour, Observer) {
    let mut observer = Observer::new(scene);
    let simulation = Simulation::new(scene, 1).unwrap();
    let pour = observer.run_while(simulation, &|| true).unwrap();
    (pour, observer)
}

fn value(scene: &Scene, observed: &Observed, name: &str) -> f64 {
    let names = observed_statistics(scene);
    assert_eq!(names.len(), observed.statistics.len());
    observed.statistics[names.iter().position(|s| s.name == name).expect(name)]
}

#[test]
fn a_falling_grain_is_seen_where_it_is() {
    let scene = scene();
    let (pour, observer) = run(&scene);
    assert_eq!(pour.status, Status::AtRest);
    let observed = observer.observed(&pour);
    // It passes 27 mm after sqrt(2 25 mm / g) = 71.4 ms, 51.4 ms after the begin.
    for (name, expected) in [
        ("discharged[0.03]", 0.0),
        ("discharged[0.1]", 100.0),
        ("discharged[0.3]", 100.0), // after the end: at rest it stays out
        ("spilled", 1.0),
    ] {
        assert_eq!(value(&scene, &observed, name), expected, "{name}");
    }
    assert!((value(&scene, &observed, "radius[50]") - 0.03).abs() < 1e-6);
    // A grain on the axis covers every circle up to its own radius; circles are a quarter of it apart.
    assert!((value(&scene, &observed, "front_radius[0.05]") - 0.002).abs() < 5.1e-4);
    assert!(value(&scene, &observed, "surface_slope").is_nan());
    let series = |name: &str| observed.series.iter().find(|s| s.name == name).expect(name);
    let surface = series("surface_z[0]");
    // It falls into the picture, and at the end its top is seen to a sixteenth of its radius.
    assert!(surface.values[0].is_nan());
    assert!((surface.values.last().unwrap() - 4e-3).abs() < 2e-4, "{:?}", surface.values.last());
    let series = series("discharged");
    assert_eq!((series.unit, series.times[0]), ("%", 0.0));
    let gaps: Vec<_> = series.times.windows(2).map(|t| t[1] - t[0]).collect();
    let (dt, inner) = (scene.settings().dt, &gaps[..gaps.len() - 1]);
    assert!(inner.iter().all(|gap| (gap - 0.002).abs() <= dt), "{gaps:?}");
    let fell = series.values.iter().position(|&share| share > 0.0).unwrap();
    assert!((series.times[fell] - 0.0514).abs() < 0.0025, "{}", series.times[fell]);
}

#[test]
fn a_spilled_grain_of_several_spheres_is_one() {
    let mut scene = scene();
    scene.grains.count = 2;
    (scene.effects.clump.spheres, scene.effects.clump.aspect) = (3, 2.0);
    // The one is out, the other is not, though it may reach beyond.
    scene.start = Start::Positions { positions: vec![[0.03, 0.0, 0.01], [0.019, 0.0, 0.01]] };
    scene.observe.as_mut().unwrap().surface = None;
    let (pour, observer) = run(&scene);
    assert_eq!(pour.positions.len(), 6);
    assert_eq!(value(&scene, &observer.observed(&pour), "spilled"), 1.0);
}

#[test]
fn a_front_that_is_not_seen_to_its_end_has_none() {
    let mut scene = scene();
    scene.observe.as_mut().unwrap().front.as_mut().unwrap().end = false;
    let (pour, observer) = run(&scene);
    let names: Vec<_> = observed_statistics(&scene).into_iter().map(|s| s.name).collect();
    assert!(names.contains(&"front_radius[0.05]".to_owned()), "{names:?}");
    assert!(!names.contains(&"front_radius[end]".to_owned()), "{names:?}");
    let found = observer.observed(&pour);
    assert!((value(&scene, &found, "front_radius[0.05]") - 0.002).abs() < 5.1e-4);
    assert_eq!(value(&scene, &found, "spilled"), 1.0);
}

#[test]
fn to_be_observed_changes_no_bit() {
    let scene = scene();
    let blind = Scene { observe: None, ..scene.clone() };
    assert_eq!(run(&scene).0.state_hash, run(&blind).0.state_hash);
    assert!(Observer::new(&blind).is_idle() && observed_statistics(&blind).is_empty());
}

#[test]
fn a_pour_in_pieces_is_the_same_and_stops_where_it_is_told_to() {
    let scene = scene();
    let (whole, seen) = run(&scene);
    for piece in [3e-4, 7e-3, f64::INFINITY] {
        let mut observer = Observer::new(&scene);
        let mut simulation = Simulation::new(&scene, 1).unwrap();
        for frame in 1.. {
            let time = f64::from(frame) * piece;
            assert!(observer.advance_while(&mut simulation, time, &|| true));
            let dt = simulation.settings().dt;
            assert!(simulation.ended().is_some() || (simulation.time() - time).abs() <= 0.501 * dt);
            if simulation.ended().is_some() {
                break;
            }
        }
        let pour = simulation.into_pour();
        assert_eq!(pour, whole);
        // NaN, what has not been seen, is not equal to itself.
        let told = |observer: &Observer| format!("{:?}", observer.observed(&pour));
        assert_eq!(told(&observer), told(&seen));
    }
    let mut simulation = Simulation::new(&scene, 1).unwrap();
    assert!(!Observer::new(&scene).advance_while(&mut simulation, 1.0, &|| false));
    assert_eq!(simulation.time(), 0.0);
    assert!(Observer::new(&scene).advance_while(&mut simulation, f64::NAN, &|| true));
    assert_eq!(simulation.time(), 0.0);
}

#[test]
fn no_time_is_refused_and_simulates_nothing() {
    let watched = scene();
    let blind = Scene { observe: None, ..watched.clone() };
    for scene in [watched, blind] {
        let mut simulation = Simulation::new(&scene, 1).unwrap();
        let mut observer = Observer::new(&scene);
        let error = observer.advance(&mut simulation, f64::NAN).unwrap_err().to_string();
        assert!(error.contains("the time to simulate [s]") && error.contains("NaN"), "{error}");
        observer.advance(&mut simulation, -1.0).unwrap();
        assert_eq!(simulation.time(), 0.0);
        observer.advance(&mut simulation, f64::INFINITY).unwrap();
        assert_eq!(simulation.ended(), Some(Status::AtRest));
    }
}

#[test]
fn a_copy_has_seen_the_same_and_looks_on_by_itself() {
    let scene = scene();
    let mut simulation = Simulation::new(&scene, 1).unwrap();
    let mut observer = Observer::new(&scene);
    observer.advance(&mut simulation, 0.06).unwrap();
    let mut copy = observer.clone();
    let pour = copy.run_while(simulation.clone(), &|| true).unwrap();
    let begun = observer.observed(&pour).series[0].times.len();
    assert_eq!(observer.run_while(simulation, &|| true).unwrap(), pour);
    let [one, other] = [observer, copy].map(|observer| observer.observed(&pour).series);
    // NaN is equal to no NaN.
    assert_eq!(format!("{one:?}"), format!("{other:?}"));
    assert!(one[0].times.len() > begun);
}

#[test]
fn what_was_before_a_restart_is_not_made_up() {
    let scene = scene();
    let mut simulation = Simulation::new(&scene, 1).unwrap();
    simulation.advance(0.08);
    let mut observer = Observer::new(&scene);
    let pour = observer.run_while(simulation, &|| true).unwrap();
    let observed = observer.observed(&pour);
    assert!(value(&scene, &observed, "discharged[0.03]").is_nan());
    assert_eq!(value(&scene, &observed, "discharged[0.1]"), 100.0);
    assert!(observed.series.iter().all(|series| series.times[0] >= 0.06 - 1e-3));
}

#[test]
fn a_pour_at_rest_that_has_not_run_out_is_jammed() {
    let mut scene = scene();
    let jammed = |scene: &Scene| {
        let (pour, observer) = run(scene);
        observer.status(&pour).is_jammed()
    };
    assert!(!jammed(&scene));
    scene.observe.as_mut().unwrap().discharge.as_mut().unwrap().below = 0.001;
    assert!(!jammed(&scene));
    scene.observe.as_mut().unwrap().discharge.as_mut().unwrap().jammed_below = 50.0;
    assert!(jammed(&scene));
}

#[test]
fn what_has_left_the_scene_has_run_out_and_ends_the_pour() {
    let mut scene = scene();
    scene.outflow = Some(Outflow { below: 0.02, until: Some(100.0) });
    let (pour, observer) = run(&scene);
    assert_eq!((pour.status, pour.positions.len(), pour.radii_out.len()), (Status::RanOut, 0, 1));
    // It passes 20 mm after sqrt(2 32 mm / g) = 80.8 ms.
    let search = scene.settings().list_period as f64 * scene.settings().dt;
    assert!((0.0..=search).contains(&(pour.simulated_s - 0.0807)), "{}", pour.simulated_s);
    let observed = observer.observed(&pour);
    let (_, share) = observed
        .series
        .iter()
        .find(|s| s.name == "discharged")
        .map(|s| (&s.times, &s.values))
        .unwrap();
    assert_eq!((share[0], *share.last().unwrap()), (0.0, 100.0));
    assert_eq!(value(&scene, &observed, "spilled"), 0.0);
    scene.outflow = Some(Outflow { below: -1.0, until: Some(100.0) });
    assert_eq!(run(&scene).0.status, Status::AtRest);
}

#[test]
fn the_rate_is_that_of_a_steady_flow() {
    let times: Vec<_> = (0..100).map(f64::from).collect();
    // Nothing for ten seconds, then 2 %/s, then all is out.
    let percent: Vec<_> = times.iter().map(|t| (2.0 * (t - 10.0)).clamp(0.0, 100.0)).collect();
    assert!((discharge::rate(&times, &percent) - 2.0).abs() < 1e-12);
    assert!(discharge::rate(&times[..3], &percent[..3]).is_nan());
}

#[test]
fn an_image_is_that_of_a_pour_that_ends_then() {
    let mut scene = Scene::drop(0.03);
    scene.grains.count = 40;
    let images = ObserveImages { times: vec![0.1, 0.2, 3.5], below: None };
    let mut observe = self::scene().observe.unwrap();
    (observe.begin, observe.images) = (0.0, Some(images));
    (observe.surface, observe.front, observe.discharge) = (None, None, None);
    scene.observe = Some(observe);
    let (pour, observer) = run(&scene);
    assert_eq!(pour.status, Status::AtRest);
    let observed = observer.observed(&pour);
    let of = |pour: &Pour| crate::observe(&scene.camera, pour, 1).unwrap().statistics.unwrap();
    for (time, ended) in [(0.1, false), (0.2, false), (3.5, true)] {
        let mut cut = scene.clone();
        (cut.observe, cut.end.horizon) = (None, if ended { scene.end.horizon } else { time });
        let expected = of(&Simulation::new(&cut, 1).unwrap().run());
        for (statistic, expected) in granulcal_features::PAPER16.iter().zip(expected) {
            let got = value(&scene, &observed, &format!("{}[{time}]", statistic.name));
            assert_eq!(got.to_bits(), expected.to_bits(), "{} at {time}", statistic.name);
        }
    }
}

#[test]
fn grains_above_a_height_are_in_no_image() {
    let mut scene = scene();
    // Two carpets, one on the ground and one in the air, their grains not in step with the pixels.
    let carpet =
        |z: f64| (0..100).map(move |i| [0.0053 * f64::from(i % 10), 0.0053 * f64::from(i / 10), z]);
    let positions: Vec<_> = carpet(0.002).chain(carpet(0.09)).collect();
    scene.grains.count = positions.len();
    scene.start = Start::Positions { positions };
    let of = |below: Option<f64>| {
        let images = ObserveImages { times: vec![0.0], below };
        let mut scene = scene.clone();
        let observe = scene.observe.as_mut().unwrap();
        (observe.begin, observe.images) = (0.0, Some(images));
        let (pour, observer) = run(&scene);
        value(&scene, &observer.observed(&pour), "max_z[0]")
    };
    assert!((of(Some(0.05)) - 0.004).abs() < 3e-4, "{}", of(Some(0.05)));
    assert!((of(None) - 0.092).abs() < 3e-4, "{}", of(None));
}

#[test]
fn the_first_sample_stands_for_the_begin() {
    // Half way between two substeps of 0.5 ms, and little before or behind one.
    for begin in [0.02, 0.02025, 0.0203, 0.0201] {
        let mut scene = scene();
        let observe = scene.observe.as_mut().unwrap();
        observe.begin = begin;
        observe.front.as_mut().unwrap().times = vec![0.0, 0.05];
        let (pour, observer) = run(&scene);
        let found = value(&scene, &observer.observed(&pour), "front_radius[0]");
        assert!((found - 0.002).abs() < 5.1e-4, "{begin}: {found}");
    }
}

#[test]
fn an_image_is_of_the_sample_that_is_nearest_to_its_frame() {
    // A film of 30 frames a second: its third frame, 66.7 ms, falls between the substeps at 66.5 and 67 ms.
    let mut scene = scene();
    let observe = scene.observe.as_mut().unwrap();
    observe.begin = 0.0;
    observe.rate = 30.0;
    observe.images = Some(ObserveImages { times: vec![2.0 / 30.0], below: None });
    scene.start = Start::Positions {
        positions: [[0.0, 0.0], [0.02, 0.0], [0.0, 0.02]].map(|[x, y]| [x, y, 0.092]).into(),
    };
    (scene.grains.count, scene.camera.downsample) = (3, 2);
    let (pour, observer) = run(&scene);
    let found = value(&scene, &observer.observed(&pour), "max_z[0.06666666666666667]");
    let fallen = 0.094 - 0.5 * 9.81 * 0.0665_f64.powi(2);
    assert!((found - fallen).abs() < 5e-4, "{found} {fallen}");
}
