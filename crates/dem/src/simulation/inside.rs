//! What goes on inside of a pour: its masses, its energy, and who presses on whom.

use super::{Simulation, energy};
use crate::contact_force::{self, ContactForce};
use crate::effect::inverse_inertia;
use crate::energy::Energy;
use crate::error::DemError;

impl Simulation {
    /// Mass over which energies and forces are told `[kg]`: that of a typical grain, and with `effects.fluid` what of
    /// the fluid moves with it.
    pub fn unit_mass(&self) -> f64 {
        self.scene().grains.mass() / inverse_inertia(self.scene())
    }

    /// Masses of the grains `[kg]`, of their spheres where they are several; as [`Simulation::positions`].
    pub fn masses(&self) -> Vec<f64> {
        let typical = self.scene().grains.mass();
        self.particles.present().map(|grain| typical * self.particles.mass(grain)).collect()
    }

    /// Masses of all grains of the scene by their number at the start `[kg]`; as [`Simulation::all_radii`].
    pub fn all_masses(&self) -> Vec<f64> {
        let typical = self.scene().grains.mass();
        (0..self.particles.count()).map(|grain| typical * self.particles.mass(grain)).collect()
    }

    /// Mechanical energy of all grains, over [`Simulation::unit_mass`]. Grains that have left the scene rest where they
    /// left.
    pub fn energy(&self) -> Energy {
        let grains = (self.clumps.as_ref(), self.bodies.as_ref());
        let held = self.bonds.as_ref().map_or(0.0, |bonds| bonds.energy(&self.particles));
        let all = energy(&self.particles, grains, &self.around);
        Energy { potential: all.potential + held, ..all }
    }

    /// The lasting contacts that carried something in the last substep, pairs before walls; none before the first. See
    /// [`ContactForce`].
    ///
    /// # Errors
    /// [`DemError::Untold`] for grains with a shape, whose impulses are not kept.
    pub fn contact_forces(&self) -> Result<Vec<ContactForce>, DemError> {
        self.require_balls("the force of a contact")?;
        let (dt, walls) = (self.around.settings.dt, &self.around.walls);
        let particles = &self.particles;
        let sets = [&self.contacts.pairs, &self.contacts.at_walls, &self.on_layer];
        Ok(sets.into_iter().flat_map(|set| contact_force::of(set, particles, walls, dt)).collect())
    }
}

#[cfg(test)]
mod tests {
    use granulcal_scene::{GRAVITY, GrainShape, Scene, Start};
    use nalgebra::Vector3;

    use crate::{Partner, Simulation};

    /// Grains one on the other, after half a second.
    fn tower(count: usize) -> Simulation {
        let mut scene = Scene::drop(0.1);
        scene.grains.count = count;
        scene.end.kinetic_energy = f64::MIN_POSITIVE;
        let positions = (0..count).map(|i| [0.0, 0.0, 0.002 + 0.004 * i as f64]).collect();
        scene.start = Start::Positions { positions };
        let mut simulation = Simulation::new(&scene, 1).unwrap();
        assert_eq!(simulation.contact_forces().unwrap(), []);
        simulation.advance(0.5);
        simulation
    }

    #[test]
    fn each_contact_of_a_tower_carries_what_is_above_it() {
        let simulation = tower(3);
        let forces = simulation.contact_forces().unwrap();
        let mut carried: Vec<_> = forces
            .iter()
            .map(|contact| {
                let up = contact.force.z * contact.normal.z.signum() / GRAVITY;
                (up.round() as usize, contact.partner)
            })
            .collect();
        carried.sort_by_key(|(grains, _)| *grains);
        assert_eq!(carried.iter().map(|(grains, _)| *grains).collect::<Vec<_>>(), [1, 2, 3]);
        assert_eq!(carried[2].1, Partner::Wall(0));
        // Where the surfaces meet, to the gap that the solver leaves.
        for contact in &forces {
            let height = contact.point.z / 0.004;
            assert!((height - height.round()).abs() < 1e-2, "{contact:?}");
        }
        // The walls feel the opposite of what they give.
        let given: Vector3<f64> = forces
            .iter()
            .filter(|contact| contact.partner == Partner::Wall(0))
            .map(|contact| contact.force)
            .sum();
        assert!((given + simulation.wall_loads().unwrap()[0].force).norm() < 1e-9, "{given}");
    }

    #[test]
    fn a_fall_keeps_the_energy_and_a_shape_tells_no_forces() {
        let mut scene = Scene::drop(0.5);
        scene.grains.count = 1;
        let mut simulation = Simulation::new(&scene, 1).unwrap();
        let before = simulation.energy();
        simulation.advance(0.1);
        let after = simulation.energy();
        assert!((after.total() - before.total()).abs() < 1e-9, "{before:?} {after:?}");
        // What starts at rest rests half a substep before.
        let speed = (simulation.time() + 0.5 * simulation.settings().dt) * GRAVITY;
        assert!((after.kinetic - 0.5 * speed * speed).abs() < 1e-9, "{after:?}");
        scene.grains.shape = Some(GrainShape::Cylinder { aspect: 1.0 });
        let error = Simulation::new(&scene, 1).unwrap().contact_forces().unwrap_err();
        assert!(error.to_string().contains("the force of a contact"), "{error}");
    }

    #[test]
    fn masses_are_the_grains_own_and_forces_told_over_what_moves_with_them() {
        let ball = |radius: f64| 1300.0 * 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
        let mut scene = Scene::drop(0.1);
        scene.grains.count = 20;
        scene.effects.polydispersity.cv = 0.3;
        let simulation = Simulation::new(&scene, 1).unwrap();
        assert!((simulation.unit_mass() / ball(0.002) - 1.0).abs() < 1e-12);
        assert_eq!(simulation.masses(), simulation.all_masses());
        for (mass, radius) in simulation.masses().into_iter().zip(simulation.radii()) {
            assert!((mass / ball(radius) - 1.0).abs() < 1e-12, "{mass} {radius}");
        }
        scene.effects.fluid.density = 1000.0;
        let wet = Simulation::new(&scene, 1).unwrap();
        assert_eq!(wet.masses(), simulation.masses());
        assert!((wet.unit_mass() / ball(0.002) - 1800.0 / 1300.0).abs() < 1e-12);
        scene = Scene::drop(0.1);
        scene.grains.shape = Some(GrainShape::Box { aspect: [1.0, 2.0, 0.5] });
        let boxes = Simulation::new(&scene, 1).unwrap();
        assert!((boxes.masses()[0] / (1300.0 * 64e-9) - 1.0).abs() < 1e-12);
    }
}
