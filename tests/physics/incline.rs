//! A grain on an incline: gravity tilted by the angle a over the plane z = 0, or a tilted plane.
//!
//! Rolling: a = 5/7 g (sin a - mu_r cos a) while friction 2/7 g sin a + 5/7 mu_r g cos a <= mu_s g cos a,
//! slipping: a = g (sin a - mu_s cos a), r dw/dt = 5/2 (mu_s - mu_r) g cos a.

use granulcal::dem::{GRAVITY, Material, Scene, Shape, Wall, WallMaterial};

use crate::scenes::{Motion, RADIUS, material, motion, one_grain, start};

const TIME: f64 = 0.2;

fn scene(tangent: f64, material: Material) -> Scene {
    let angle = tangent.atan();
    let mut scene = one_grain(RADIUS, material);
    scene.gravity = [GRAVITY * angle.sin(), 0.0, -GRAVITY * angle.cos()];
    scene
}

/// The grain after [`TIME`] on a plane of slope `tangent`.
fn slide(tangent: f64, material: Material) -> Motion {
    let mut simulation = start(&scene(tangent, material));
    simulation.advance(TIME);
    motion(&simulation, 0)
}

fn assert_close(got: f64, expected: f64, relative: f64) {
    assert!((got - expected).abs() <= relative * expected.abs(), "{got}, expected {expected}");
}

#[test]
fn rolls_at_five_sevenths() {
    for (tangent, rolling_friction) in [(0.2, 0.0), (0.7, 0.0), (0.3, 0.1), (0.15, 0.1)] {
        let grain = slide(tangent, material(0.5, rolling_friction, 0.5));
        let (sin, cos) = tangent.atan().sin_cos();
        let expected = 5.0 / 7.0 * GRAVITY * (sin - rolling_friction * cos) * TIME;
        assert_close(grain.v.x, expected, 1e-9); // the law is linear in time: only rounding is left
        assert_close(grain.w.y, grain.v.x, 1e-9); // no slip
        assert!((grain.x.z - RADIUS).abs() < 1.1e-5); // stays on the plane, up to the slop
    }
}

#[test]
fn slips_on_a_steep_plane() {
    let grain = slide(1.5, material(0.3, 0.05, 0.5));
    let (sin, cos) = 1.5_f64.atan().sin_cos();
    assert_close(grain.v.x, GRAVITY * (sin - 0.3 * cos) * TIME, 1e-3);
    assert_close(grain.w.y, 2.5 * (0.3 - 0.05) * GRAVITY * cos * TIME, 1e-3);
}

#[test]
fn begins_to_slip_at_seven_halves_of_the_friction() {
    let slip = |tangent| {
        let grain = slide(tangent, material(0.3, 0.0, 0.5));
        (grain.v.x - grain.w.y) / grain.v.x
    };
    // tan a = 3.5 mu_s = 1.05, within 0.5 %.
    assert!(slip(0.995 * 1.05).abs() < 1e-6);
    assert!(slip(1.005 * 1.05) > 1e-3);
}

#[test]
fn begins_to_roll_at_the_rolling_friction() {
    for rolling_friction in [0.01, 0.1, 0.4] {
        let held = slide(0.995 * rolling_friction, material(0.9, rolling_friction, 0.5));
        assert!(held.v.norm() < 1e-9, "{held:?}");
        // From the second half alone: in its first substep the grain has no impulses to start from.
        let tangent: f64 = 1.005 * rolling_friction;
        let mut simulation = start(&scene(tangent, material(0.9, rolling_friction, 0.5)));
        simulation.advance(TIME);
        let begin = motion(&simulation, 0).v.x;
        simulation.advance(TIME);
        let gained = motion(&simulation, 0).v.x - begin;
        let (sin, cos) = tangent.atan().sin_cos();
        assert_close(gained, 5.0 / 7.0 * GRAVITY * (sin - rolling_friction * cos) * TIME, 1e-6);
    }
}

#[test]
fn locked_rolling_slides_like_a_block() {
    // tan a = mu_s, within 0.5 %.
    for sliding_friction in [0.1, 0.5, 1.0] {
        let grains = material(sliding_friction, 1e3, 0.5);
        let held = slide(0.995 * sliding_friction, grains);
        assert!(held.v.norm() < 1e-9, "{held:?}");
        // From the second half alone: in its first substep the grain has no impulses to start from.
        let tangent: f64 = 1.005 * sliding_friction;
        let mut simulation = start(&scene(tangent, grains));
        simulation.advance(TIME);
        let begin = motion(&simulation, 0).v.x;
        simulation.advance(TIME);
        let gained = motion(&simulation, 0).v.x - begin;
        let (sin, cos) = tangent.atan().sin_cos();
        assert_close(gained, GRAVITY * (sin - sliding_friction * cos) * TIME, 1e-6);
    }
}

#[test]
fn a_tilted_plane_is_tilted_gravity() {
    let (sin, cos) = 0.3_f64.atan().sin_cos();
    let grains = material(0.5, 0.1, 0.5);
    let mut tilted = one_grain(0.1 + RADIUS / cos, grains);
    let shape = Shape::Plane { point: [0.0, 0.0, 0.1], normal: [sin, 0.0, cos] };
    tilted.walls.push(Wall::fixed(shape, WallMaterial::default()));
    let mut simulation = start(&tilted);
    simulation.advance(TIME);
    let on_plane = motion(&simulation, 0);
    let along = cos * on_plane.v.x - sin * on_plane.v.z;
    assert_close(along, slide(0.3, grains).v.x, 1e-4);
    assert!((sin * on_plane.v.x + cos * on_plane.v.z).abs() < 1e-9);
}
