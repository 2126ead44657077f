//! The grains of a scene at time zero.

use granulcal_scene::{Scene, Start};

use crate::clumps::Clumps;
use crate::lanes::Row;
use crate::law::is_parted;
use crate::particles::Particles;
use crate::parting::part;
use crate::period::Period;
use crate::wall::Walls;

/// The grains where they start, as large and as heavy as the scene says: the spheres of `clumps` if they are not round.
/// A bed's come after them, an intruder is the last.
pub(crate) fn particles(scene: &Scene, clumps: Option<&Clumps>, seed: u64) -> Particles {
    let radius = scene.grains.radius();
    let (mut spheres, inverse): (Vec<Row>, f64) = if let Some(clumps) = clumps {
        (clumps.spheres(), clumps.members() as f64)
    } else {
        let centres = scene.starting_positions(seed);
        (centres.iter().map(|at| Row::new(at, radius)).collect(), 1.0)
    };
    let mut inverse_mass = vec![inverse; spheres.len()];
    if let Some(radii) = scene.effects.polydispersity.radii(spheres.len(), radius, seed) {
        for ((sphere, inverse), own) in spheres.iter_mut().zip(&mut inverse_mass).zip(radii) {
            sphere.0[3] = own;
            *inverse = (radius / own).powi(3);
        }
        if is_parted(scene) {
            let (walls, period) = (Walls::of(scene), scene.periodic.as_ref().map(Period::of));
            part(&mut spheres, &walls, period, matches!(scene.start, Start::Ball { .. }));
        }
    }
    if let Some(bed) = &scene.bed {
        let places = bed.positions(&scene.grains, seed);
        inverse_mass.resize(spheres.len() + places.len(), 1.0);
        spheres.extend(places.iter().map(|at| Row::new(at, radius)));
    }
    if let Some(intruder) = &scene.intruder {
        spheres.push(Row::new(&intruder.centre(), intruder.radius()));
        inverse_mass.push(1.0 / intruder.relative_mass(&scene.grains));
    }
    let mut particles =
        Particles::new(spheres, inverse_mass, scene.periodic.as_ref().map(Period::of));
    if scene.bed.is_some() {
        // The ball is to be let go, `simulation/bed.rs`.
        (0..scene.grains.count).for_each(|grain| particles.take_out(grain));
    }
    if scene.intruder.is_some() {
        // It is to enter, `simulation/intruder.rs`.
        particles.take_out(particles.count() - 1);
    }
    particles
}
