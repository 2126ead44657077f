//! The ball that falls on a bed which has come to rest. Until then its grains are held as grains that have left are: at
//! rest, touched by nothing.

use nalgebra::Vector3;

use super::Simulation;
use crate::lanes::Row;
use crate::pour::BedAtRest;

impl Simulation {
    /// Lets the ball go when the bed has had its time: at the scene's height above the bed as it is then, at rest. The
    /// energy that it brings does not count as created.
    pub(super) fn let_ball_go(&mut self) {
        let Some(bed) = &self.origin.scene.bed else { return };
        if self.bed_at_rest.is_some() || self.time() < bed.settle {
            return;
        }
        let ball = 0..self.origin.scene.grains.count;
        let width =
            ball.clone().map(|i| self.particles.position(i).xy().norm()).fold(0.0, f64::max);
        let (positions, radii) = (self.positions(), self.radii());
        let below = positions.iter().zip(&radii).filter(|(place, _)| place.xy().norm() <= width);
        let surface = below.map(|(place, radius)| place.z + radius).fold(0.0, f64::max);
        // Velocities live at the middle of substeps.
        let back = -0.5 * self.around.settings.dt * self.around.gravity;
        let lift = surface * Vector3::z();
        for grain in ball {
            self.particles.raise(grain, &lift);
            self.particles.let_in(grain, &back);
            let work = -self.around.effects.gravity.dot(&lift) * self.particles.mass(grain);
            self.watch.see_work(work);
        }
        self.contacts.forget_list();
        self.bed_at_rest = Some(
            positions.iter().zip(radii).map(|(place, radius)| Row::new(place, radius)).collect(),
        );
    }

    /// The bed before the ball fell on it.
    pub(super) fn bed_before(&self) -> Option<BedAtRest> {
        let spheres = self.bed_at_rest.as_ref()?;
        Some(BedAtRest {
            positions: spheres.iter().map(Row::vector).collect(),
            radii: spheres.iter().map(|sphere| sphere.0[3]).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use granulcal_scene::{Bed, Ends, Projection, Scene, Shape, Wall, WallMaterial};

    use crate::{Simulation, Status};

    /// A ball of 60 grains, 3 cm above a tray of grains, friction as stated.
    fn scene(spacing: f64, friction: f64) -> Scene {
        let mut scene = Scene::drop(0.03);
        scene.grains.count = 60;
        scene.camera.projection = Projection::Orthographic;
        (scene.camera.pixels, scene.camera.downsample) = (200, 1);
        scene.material.sliding_friction = friction;
        scene.material.rolling_friction = 0.1;
        scene.bed = Some(Bed { radius: 0.04, height: 0.03, spacing, jitter: 2e-4, settle: 0.3 });
        let (from, to) = ([0.0, 0.0, -0.01], [0.0, 0.0, 0.06]);
        let shape = Shape::Cylinder { from, to, radius: 0.04, closed: Ends::None };
        scene.walls.push(Wall::fixed(shape, WallMaterial::default()));
        scene
    }

    #[test]
    fn the_ball_falls_from_its_height_above_the_bed_at_rest() {
        let scene = scene(5e-3, 0.5);
        let mut simulation = Simulation::new(&scene, 1).unwrap();
        let grains = scene.bed.unwrap().positions(&scene.grains, 1).len();
        simulation.advance(0.2995);
        assert_eq!(simulation.positions().len(), grains);
        let top = |places: &[nalgebra::Vector3<f64>]| {
            places.iter().filter(|p| p.xy().norm() < 0.011).map(|p| p.z).fold(0.0, f64::max)
        };
        let surface = top(&simulation.positions()) + 2e-3;
        simulation.advance(0.0505);
        let places = simulation.positions();
        assert_eq!(places.len(), 60 + grains);
        let lowest = places[..60].iter().map(|p| p.z).fold(f64::INFINITY, f64::min) - 2e-3;
        let fallen = 0.03 - 0.5 * 9.81 * 0.05 * 0.05;
        // The ball's lattice may move by its jitter; the bed still trembles.
        assert!((lowest - surface - fallen).abs() < 5e-4, "{lowest} {surface} {fallen}");
    }

    #[test]
    fn the_pour_keeps_the_bed_as_it_was_and_creates_no_energy() {
        let simulation = Simulation::new(&scene(5e-3, 0.5), 1).unwrap();
        let pour = simulation.run();
        let bed = pour.bed.as_ref().unwrap();
        assert_eq!(bed.positions.len() + 60, pour.positions.len());
        assert!(matches!(pour.status, Status::AtRest | Status::OutOfView), "{}", pour.status);
        assert!(pour.health.energy_created < 1e-9, "{}", pour.health.energy_created);
        // The ball is in the bed: grains of the bed have gone from under it.
        let moved = |a: &nalgebra::Vector3<f64>, b: &nalgebra::Vector3<f64>| (a - b).norm() > 1e-3;
        let dug = bed.positions.iter().zip(&pour.positions[60..]).filter(|(a, b)| moved(a, b));
        assert!(dug.count() > 20);
    }

    #[test]
    fn a_wider_lattice_of_rougher_grains_is_a_looser_bed() {
        let solid = |spacing, friction| {
            let mut simulation = Simulation::new(&scene(spacing, friction), 1).unwrap();
            simulation.advance(0.2995);
            let places = simulation.positions();
            let mean = places.iter().map(|p| p.z).sum::<f64>() / places.len() as f64;
            // The mean height of grains is half of the bed's.
            let volume = std::f64::consts::PI * 0.04_f64.powi(2) * 2.0 * mean;
            places.len() as f64 * 4.0 / 3.0 * std::f64::consts::PI * 2e-3_f64.powi(3) / volume
        };
        let (dense, loose) = (solid(4.8e-3, 0.1), solid(5.6e-3, 1.0));
        assert!(loose < dense - 0.02, "{loose} {dense}");
    }

    #[test]
    fn it_goes_on_from_a_checkpoint_before_and_after_the_ball_is_let_go() {
        let scene = scene(5e-3, 0.5);
        let whole = Simulation::new(&scene, 1).unwrap().run();
        for at in [0.2, 0.35] {
            let mut first = Simulation::new(&scene, 1).unwrap();
            first.advance(at);
            let second = Simulation::new(&scene, 1).unwrap().resume(&first.checkpoint()).unwrap();
            assert_eq!(second.run(), whole);
        }
    }
    #[test]
    fn its_bits_are_those_of_any_number_of_threads() {
        let scene = scene(5e-3, 0.5);
        let run = |threads| {
            let mut simulation = Simulation::new(&scene, 1).unwrap().with_threads(threads).unwrap();
            simulation.advance(0.4);
            simulation.state_hash()
        };
        assert_eq!(run(1), run(3));
    }
}
