//! Scenes that break solvers: nothing, too much, too tight, without loss.

use granulcal::dem::{
    Funnel, Material, Motion, Pour, Scene, Shape, Simulation, SolverSettings, Start, Status, Wall,
    WallMaterial,
};

use crate::scenes::{RADIUS, block, drop_of, material, one_grain, start};

fn assert_finite(pour: &Pour) {
    let vectors = [&pour.positions, &pour.velocities, &pour.angular_velocities];
    assert!(vectors.into_iter().flatten().flat_map(|v| v.iter()).all(|c| c.is_finite()));
}

fn wall(shape: Shape) -> Wall {
    Wall::fixed(shape, WallMaterial::default())
}

#[test]
fn no_grain_is_at_rest() {
    let pour = start(&block([0, 0, 0], 8e-3, 0.1, Material::default())).run();
    assert_eq!(pour.status, Status::AtRest);
    assert!(pour.positions.is_empty());
    assert_eq!(start(&drop_of(0, 0.1, Material::default())).run().status, Status::AtRest);
}

#[test]
fn one_grain_comes_to_rest_where_it_fell() {
    let pour = drop_one(0.05);
    assert_eq!(pour.status, Status::AtRest);
    assert_eq!((pour.positions[0].x, pour.positions[0].y), (0.0, 0.0));
    assert!((pour.positions[0].z - RADIUS).abs() < 1.1e-5);
}

/// One grain let go at `height` `[m]` above the ground, straight down.
fn drop_one(height: f64) -> Pour {
    let mut scene = drop_of(1, height, Material::default());
    scene.start = Start::Ball { height, solid_fraction: 0.6, jitter: 0.0, turned: false };
    start(&scene).run()
}

#[test]
fn the_top_of_a_bounce_is_not_rest() {
    for height in [0.1, 0.2] {
        let pour = drop_one(height);
        assert!((pour.positions[0].z - RADIUS).abs() < 1.1e-5, "{pour:?}");
    }
}

#[test]
fn a_grain_finds_rest_among_walls_that_overlap() {
    // The same box twice, a little askew, and a corner in which three planes meet.
    let mut scene = drop_of(40, 0.03, material(0.5, 0.1, 0.5));
    for normal in [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]] {
        for skew in [0.0, 0.05] {
            let [x, y, _]: [f64; 3] = normal;
            let point = [-0.012 * x, -0.012 * y, 0.0];
            scene.walls.push(wall(Shape::Plane { point, normal: [x, y, skew] }));
        }
    }
    scene.walls.push(wall(Shape::Plane { point: [0.0, 0.0, 0.0], normal: [0.0, 0.0, 1.0] }));
    let pour = start(&scene).run();
    assert_finite(&pour);
    assert_eq!(pour.status, Status::AtRest);
    assert!(pour.positions.iter().all(|p| p.x.abs() < 0.012 && p.y.abs() < 0.012));
}

#[test]
fn a_grain_that_starts_in_a_wall_is_unhealthy_and_finite() {
    let mut scene = one_grain(0.1, Material::default());
    let normal = [0.0, 0.0, 1.0];
    scene.walls.push(wall(Shape::Plane { point: [0.0, 0.0, 0.11], normal }));
    scene.end = drop_of(1, 0.1, Material::default()).end;
    let pour = start(&scene).run();
    assert_finite(&pour);
    assert_eq!(pour.status, Status::Unhealthy);
    assert!(pour.health.worst_penetration > 1.0);
}

#[test]
fn grains_between_walls_that_leave_no_room_are_unhealthy_and_finite() {
    let mut scene = drop_of(30, 0.0, Material::default());
    scene.start = Start::Ball { height: 0.0, solid_fraction: 0.6, jitter: 5e-5, turned: false };
    let normal = [0.0, 0.0, -1.0];
    scene.walls.push(wall(Shape::Plane { point: [0.0, 0.0, 3e-3], normal }));
    scene.end.horizon = 0.2;
    let pour = start(&scene).run();
    assert_finite(&pour);
    assert_eq!(pour.status, Status::Unhealthy);
}

#[test]
fn a_narrow_funnel_jams() {
    // A stem that lets a single grain through and no more.
    let mut scene = Scene::funnel(0.05);
    scene.grains.count = 200;
    scene.start = Start::Grid { counts: [5, 5, 8], spacing: 5e-3, jitter: 1e-4, base: -5e-3 };
    scene.funnel = Some(Funnel { height: 0.05, stem_radius: 2.2e-3, ..Funnel::default() });
    scene.material = material(0.8, 0.3, 0.2);
    let pour = start(&scene).run();
    assert_finite(&pour);
    let above = pour.positions.iter().filter(|p| p.z > 0.05).count();
    assert_eq!(pour.status, Status::Jammed);
    assert!(above > 150 && pour.grains_in_funnel > 150 && pour.health.grains_lost == 0);
}

#[test]
fn grains_that_miss_the_funnel_fall_past_it() {
    let mut scene = Scene::funnel(0.02);
    scene.grains.count = 200;
    scene.start = Start::Grid { counts: [10, 10, 2], spacing: 8e-3, jitter: 1e-4, base: 4e-3 };
    scene.funnel = Some(Funnel { height: 0.02, rim_radius: 0.02, ..Funnel::default() });
    scene.material = material(0.5, 0.3, 0.3);
    let pour = start(&scene).run();
    assert_finite(&pour);
    // The pile reaches the stem: a few may stay in it.
    assert_eq!(pour.status == Status::Jammed, pour.grains_in_funnel > 0);
    assert!(pour.grains_in_funnel < 10, "{}", pour.grains_in_funnel);
    let above = pour.positions.iter().filter(|p| p.z > 0.02).count();
    assert!(above < 100 && pour.health.grains_lost == 0);
}

#[test]
fn nothing_moves_without_gravity() {
    let mut scene = drop_of(100, 0.05, Material::default());
    scene.gravity = [0.0; 3];
    let from = start(&scene).positions();
    let pour = start(&scene).run();
    assert_eq!(pour.status, Status::AtRest);
    assert_eq!(pour.positions, from);
}

#[test]
fn grains_that_lose_nothing_reach_the_horizon() {
    let mut scene = drop_of(100, 0.05, material(0.0, 0.0, 1.0));
    scene.end.horizon = 0.3;
    // A margin of a radius lists every neighbour in time: no second impact within a substep.
    let settings = SolverSettings { margin: 1.0, ..scene.settings() };
    let pour = start(&scene).with_settings(settings).expect("valid settings").run();
    assert_finite(&pour);
    assert_eq!(pour.status, Status::Horizon, "{:?}", pour.health);
    assert!((pour.simulated_s - 0.3).abs() <= settings.list_period as f64 * settings.dt);
    assert!(pour.angular_velocities.iter().all(|w| w.norm() == 0.0));
}

#[test]
fn only_grains_in_view_must_come_to_rest() {
    let mut scene = drop_of(60, 0.02, material(0.5, 0.0, 0.5));
    scene.camera.field_width = 0.02;
    let pour = Simulation::new(&scene, 2).expect("a valid scene").run();
    assert_eq!(pour.status, Status::OutOfView);
}

#[test]
fn a_flat_box_that_sweeps_through_elastic_grains_ends_in_a_status() {
    // The sides of a box that is thinner than the grains are triangles, of which a grain at an edge touches one and
    // then another: an impact was foreseen with one that was not there to be met.
    let mut scene = drop_of(20, 0.0, material(0.0, 0.0, 1.0));
    scene.gravity = [0.0; 3];
    let (from, to) = (
        [0.03742328749565504, 0.01908861407194601, -0.02038328485676038],
        [0.03742328749565504, 0.01908861407194601, 0.012136265938003224],
    );
    scene.start = Start::Cylinder {
        from,
        to,
        radius: 0.013414273659252504,
        spacing: 0.00760951577150167,
        jitter: 0.0,
    };
    let (min, max) = (
        [0.0, 0.005683350498119819, 0.007969450686702],
        [0.035978068084414325, 0.02333280970890467, 0.008169450686701999],
    );
    let mut flat = wall(Shape::Box { min, max, open: Vec::new() });
    let velocity = [0.058548191498042745, 0.0550007629921266, -0.04225288039384166];
    flat.motion = Motion::Lift { velocity, begin: 0.007736541223090756, end: 0.07592316538059123 };
    scene.walls.push(flat);
    scene.end.horizon = 0.13595710978984502;
    let pour = start(&scene).run();
    assert_finite(&pour);
    assert_eq!(pour.status, Status::Unhealthy);
}
