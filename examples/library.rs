//! A program of one's own on these crates: pours, looks into the pour on the way, takes its image, describes it.
//!
//!     cargo run --release --example library
//!
//! In a crate of your own: `granulcal = { git = "https://github.com/granulcal/granulcal" }`, and `nalgebra` of the
//! version in its Cargo.toml for vectors.

use granulcal::dataset::{View, observe};
use granulcal::dem::{Partner, Scene, Simulation};
use granulcal::features::PAPER16;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Any number of a scene by its path, as in TOML; or `granulcal::dataset::load_scene(path)`.
    let scene =
        Scene::funnel(0.12).with("grains.count", 200.0)?.with("material.sliding_friction", 0.4)?;
    let seed = 1;
    let mut simulation = Simulation::new(&scene, seed)?;
    simulation.check_start()?;
    for frame in 1..=10 {
        simulation.advance_to(0.1 * f64::from(frame));
        let highest = simulation.positions().iter().map(|at| at.z).fold(0.0, f64::max);
        let energy = simulation.energy();
        println!(
            "{:.1} s: highest grain {:.1} mm, kinetic energy {:.3} and potential {:.3} m^2/s^2",
            simulation.time(),
            1e3 * highest,
            energy.kinetic,
            energy.potential
        );
    }
    let forces = simulation.contact_forces()?;
    let at_ground = forces.iter().filter(|contact| contact.partner == Partner::Wall(0)).count();
    println!("{} contacts carry something, {at_ground} of them at the ground", forces.len());

    let pour = simulation.run();
    println!("{} after {:.2} s; {:?}", pour.status, pour.simulated_s, pour.health);
    let seen = observe(&scene.camera, &pour, seed)?;
    if let View::Depth(_, image) = &seen.view {
        println!("depth image of {} x {} pixels", image.width, image.height);
    }
    for (statistic, value) in PAPER16.iter().zip(seen.statistics?) {
        println!("{:<12} {value:>10.6} {:<2} {}", statistic.name, statistic.unit, statistic.doc);
    }
    Ok(())
}
