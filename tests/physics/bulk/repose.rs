//! Angle of repose: the heap that a funnel pours on a round plate with a rim until it runs over.
//!
//! The plate fixes the heap's foot, so that every material has an angle, one that rolls freely as well.

use granulcal::dem::{Ends, Material, Shape, Wall, WallMaterial};
use nalgebra::Vector3;

use super::fit;
use super::packed::{
    DIAMETER, rain, ring, scene, settle, start, top_of, tube, wait_for_rest_above,
};

/// Height of the plate and of its rim, in diameters: what runs over falls out of the way, the lowest layer stays.
const PLATE: f64 = 15.0;
const RIM: f64 = 1.0;
/// Radius of the hole in the middle of the plate, which no grain notices, in diameters.
const PINHOLE: f64 = 1e-3;
/// Tip of the funnel above the plate over the plate's radius: well above the steepest heap.
const TIP: f64 = 1.0;
/// Hole and width of the funnel, in diameters; its cone falls at 60 deg.
const OUTLET: f64 = 9.0;
const FUNNEL: f64 = 18.0;
/// Part of the surface that the slope is fitted to, as shares of the plate's radius: neither tip nor foot.
const FITTED: (f64, f64) = (0.2, 0.8);

/// Grains poured on a plate, over what a cone of 30 deg holds on it: enough that the plate runs over.
const POURED: f64 = 2.0;

/// Number of grains that [`measure`] pours on a plate of `radius` diameters.
pub fn grains(radius: f64) -> usize {
    // A cone's volume pi R^3 tan / 3 at a solid fraction of 0.58, over a grain's pi / 6.
    (POURED * 2.0 * 0.58 * radius.powi(3) * 30f64.to_radians().tan()).round() as usize
}

/// A heap on a plate.
#[derive(Debug, Clone, Copy)]
pub struct Heap {
    /// Its slope `[deg]`.
    pub angle: f64,
    /// The root mean square speed of its grains, if they do not come to rest `[m/s]`.
    pub trembles: Option<f64>,
}

/// A heap on a plate of `radius` diameters.
pub fn measure(radius: f64, material: Material, seed: u64) -> Heap {
    let plate_height = PLATE * DIAMETER;
    let plate_radius = radius * DIAMETER;
    let tip = plate_height + TIP * plate_radius;
    let neck = 0.5 * FUNNEL * DIAMETER;
    let rim = tip + (neck - 0.5 * OUTLET * DIAMETER) * 60f64.to_radians().tan();
    // Grains fill the funnel from its tip in a column of their own width before they settle.
    let rained = rain(grains(radius), neck, rim, seed);
    let cone = Shape::Cone {
        from: [0.0, 0.0, tip],
        to: [0.0, 0.0, rim],
        radius_from: 0.5 * OUTLET * DIAMETER,
        radius_to: neck,
        closed: Ends::None,
    };
    let plain = WallMaterial::default();
    let funnel = vec![Wall::fixed(cone, plain), tube(neck, rim, top_of(&rained), plain)];
    let mut closed = funnel.clone();
    let lid = Shape::Plane { point: [0.0, 0.0, tip], normal: [0.0, 0.0, 1.0] };
    closed.push(Wall::fixed(lid, plain));
    let filled = settle(&scene(&rained, material, closed));

    let mut walls = funnel;
    walls.push(ring(PINHOLE * DIAMETER, plate_radius, plate_height));
    walls.push(tube(plate_radius, plate_height, plate_height + RIM * DIAMETER, plain));
    let mut poured = scene(&filled, material, walls);
    // What runs over must not roll away over half the room.
    poured.ground.material =
        WallMaterial { rolling_friction: Some(1.0), restitution: Some(0.0), ..plain };
    let mut simulation = start(&poured);
    // Only the heap must come to rest.
    simulation.advance(0.1);
    let trembles = wait_for_rest_above(&mut simulation, plate_height);
    let run_over = simulation.positions().iter().filter(|p| p.z < plate_height).count();
    assert!(run_over > 0, "{material:?}: the plate of {radius} d is not full");
    let heap: Vec<Vector3<f64>> = simulation
        .positions()
        .iter()
        .filter(|p| p.z > plate_height && p.z < tip && p.x.hypot(p.y) < plate_radius)
        .copied()
        .collect();
    Heap { angle: slope(&heap, plate_radius, plate_height).to_degrees(), trembles }
}

/// Angle of the line through the surface over the distance from the axis.
fn slope(heap: &[Vector3<f64>], radius: f64, plate: f64) -> f64 {
    // Highest grain top in cells a diameter wide.
    let reach = (radius / DIAMETER).ceil() as i64;
    let side = (2 * reach + 1) as usize;
    let mut tops = vec![0.0_f64; side * side];
    for p in heap {
        let cell = |x: f64| ((x / DIAMETER).round() as i64 + reach) as usize;
        let top = &mut tops[cell(p.y) * side + cell(p.x)];
        *top = top.max(p.z + 0.5 * DIAMETER - plate);
    }
    let surface: Vec<(f64, f64)> = tops
        .iter()
        .enumerate()
        .map(|(cell, &top)| {
            let away = |index: usize| index as f64 - reach as f64;
            (away(cell % side).hypot(away(cell / side)) * DIAMETER, top)
        })
        .filter(|(r, _)| (FITTED.0 * radius..FITTED.1 * radius).contains(r))
        .collect();
    -fit::line(&surface).0.atan()
}
