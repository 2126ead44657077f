//! The ball of another size that enters a scene at a time. Until then it is held as a grain that has left is: at rest,
//! touched by nothing.

use granulcal_scene::Intruder;
use nalgebra::Vector3;

use super::Simulation;

impl Simulation {
    /// Lets the intruder enter when its time has come; the energy that it brings does not count as created.
    pub(super) fn let_intruder_in(&mut self) {
        let Some(Intruder { enters, velocity, .. }) = &self.origin.scene.intruder else { return };
        let intruder = self.particles.count() - 1;
        if self.time() < *enters || !self.particles.has_left(intruder) {
            return;
        }
        // Velocities live at the middle of substeps.
        let half = 0.5 * self.around.settings.dt * self.around.gravity;
        let velocity = Vector3::from(*velocity);
        self.particles.let_in(intruder, &(velocity - half));
        self.watch.see_work(0.5 * self.particles.mass(intruder) * velocity.norm_squared());
        self.contacts.forget_list();
    }
}

#[cfg(test)]
mod tests {
    use granulcal_scene::{Intruder, Scene, Start};

    use crate::{Simulation, Status};

    /// A grain far aside, and a ball eight times as wide that enters 0.1 m above the ground with 1 m/s.
    fn scene() -> Scene {
        let mut scene = Scene::drop(0.0);
        scene.grains.count = 1;
        scene.start = Start::Positions { positions: vec![[0.2, 0.0, 2e-3]] };
        scene.material.restitution = 0.5;
        let (position, velocity) = ([0.0, 0.0, 0.1], [0.0, 0.0, -1.0]);
        let intruder =
            Intruder { diameter: 0.032, density: 2600.0, position, velocity, enters: 0.05 };
        scene.intruder = Some(intruder);
        scene
    }

    #[test]
    fn it_is_not_there_before_its_time_and_falls_from_then_on() {
        let mut simulation = Simulation::new(&scene(), 1).unwrap();
        simulation.advance(0.0495);
        assert_eq!(simulation.positions().len(), 1);
        assert!(simulation.radii_out().is_empty());
        // 0.084 m of free flight take (sqrt(1 + 2 g h) - 1) / g = 0.064 s: 0.03 s later it still falls.
        simulation.advance(0.0305);
        let [_, ball] = simulation.positions()[..] else { panic!("two grains") };
        let flown = 0.1 - 0.03 - 0.5 * 9.81 * 0.03 * 0.03;
        assert!((ball.z - flown).abs() < 1e-6, "{} against {flown}", ball.z);
        assert_eq!(simulation.radii()[1], 0.016);
    }

    #[test]
    fn it_bounces_by_the_law_and_creates_no_energy() {
        let mut simulation = Simulation::new(&scene(), 1).unwrap();
        let mut highest: f64 = 0.0;
        // It lands at 0.05 + 0.064 s with sqrt(1 + 2 g 0.084) m/s and rises to e^2 v^2 / 2 g over its radius.
        simulation.advance(0.12);
        while simulation.ended().is_none() && simulation.time() < 0.35 {
            simulation.advance(5e-4);
            highest = highest.max(simulation.positions()[1].z);
        }
        let rise = 0.25 * (1.0 + 2.0 * 9.81 * 0.084) / (2.0 * 9.81);
        assert!((highest - 0.016 - rise).abs() < 2e-4, "{highest}");
        let pour = simulation.run();
        assert!(pour.health.energy_created < 1e-12, "{}", pour.health.energy_created);
        assert!(matches!(pour.status, Status::AtRest | Status::OutOfView), "{}", pour.status);
    }
}
