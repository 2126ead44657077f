//! The grains of a scene at time zero.

use granulcal_scene::Scene;

use crate::clumps::Clumps;
use crate::lanes::Row;
use crate::particles::Particles;
use crate::period::Period;

/// The grains where they start, as large and as heavy as the scene says: the spheres of `clumps` if they are not round.
pub(crate) fn particles(scene: &Scene, clumps: Option<&Clumps>, seed: u64) -> Particles {
    let radius = scene.grains.radius();
    let (mut places, inverse): (Vec<Row>, f64) = if let Some(clumps) = clumps {
        (clumps.places(), clumps.members() as f64)
    } else {
        let centres = scene.starting_positions(seed);
        (centres.iter().map(|at| Row::new(at, radius)).collect(), 1.0)
    };
    let mut inverse_mass = vec![inverse; places.len()];
    if let Some(radii) = scene.effects.polydispersity.radii(places.len(), radius, seed) {
        for ((place, inverse), own) in places.iter_mut().zip(&mut inverse_mass).zip(radii) {
            place.0[3] = own;
            *inverse = (radius / own).powi(3);
        }
    }
    Particles::new(places, inverse_mass, scene.periodic.as_ref().map(Period::of))
}
