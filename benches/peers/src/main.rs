//! Pours one scene in granulcal and in Rapier, one row each; `table.py` adds LAMMPS.

mod pile;
mod rapier;

use anyhow::Result;
use clap::Parser;
use granulcal_dem::{Material, Preset, Scene, Simulation};

use crate::pile::{Engine, HEAD, Pile};
use crate::rapier::Rapier;

/// Pours a funnel of 2000 grains in granulcal's presets and in Rapier, on one thread, until
/// 99.5 % of the grains are slower than 1 cm/s. The defaults are set P of docs/results/peers.md.
#[derive(Parser)]
struct Args {
    /// Coulomb's coefficient.
    #[arg(long, default_value_t = 0.5)]
    sliding_friction: f64,
    /// Rolling friction between grains, relative to the effective radius.
    #[arg(long, default_value_t = 0.6)]
    rolling_friction: f64,
    /// Rolling friction at the ground and the funnel, relative to the radius.
    #[arg(long, default_value_t = 0.3)]
    wall_rolling_friction: f64,
    /// Newton's coefficient of restitution.
    #[arg(long, default_value_t = 0.3)]
    restitution: f64,
    /// Seed of the start's jitter.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Grains, at most 2000.
    #[arg(long, default_value_t = 2000)]
    count: usize,
    /// Rapier's steps a second; none leaves Rapier out.
    #[arg(long, num_args = 0.., default_values_t = [600.0, 4800.0])]
    rapier: Vec<f64>,
}

impl Args {
    fn scene(&self) -> Scene {
        let mut scene = Scene::funnel(0.12);
        scene.material = Material {
            sliding_friction: self.sliding_friction,
            rolling_friction: self.rolling_friction,
            restitution: self.restitution,
            ..Material::default()
        };
        scene.grains.count = self.count;
        scene.ground.material.rolling_friction = Some(self.wall_rolling_friction);
        if let Some(funnel) = &mut scene.funnel {
            funnel.material.rolling_friction = Some(self.wall_rolling_friction);
        }
        scene
    }
}

impl Engine for Simulation {
    fn advance(&mut self, seconds: f64) {
        Simulation::advance(self, seconds);
    }

    fn positions(&self) -> Vec<[f64; 3]> {
        Simulation::positions(self).iter().map(|x| [x.x, x.y, x.z]).collect()
    }

    fn speeds(&self) -> Vec<f64> {
        self.velocities().iter().map(|v| v.x.hypot(v.y).hypot(v.z)).collect()
    }

    /// At grains and walls, the worst of every substep so far.
    fn overlap(&self) -> f64 {
        0.5 * self.health().worst_penetration
    }
}

fn main() -> Result<()> {
    let args = Args::parse();
    let scene = args.scene();
    println!("| engine | step s | {HEAD} |");
    println!("|{}", "---|".repeat(9));
    for preset in Preset::ALL {
        let scene = Scene { preset, ..scene.clone() };
        let mut simulation = Simulation::new(&scene, args.seed)?;
        let pile = Pile::pour(&mut simulation, &scene);
        println!("| granulcal `{preset}` | 1/{:.0} | {pile} |", 1.0 / preset.settings().dt);
    }
    for &rate in &args.rapier {
        let start = Simulation::new(&scene, args.seed)?;
        let pile = Pile::pour(&mut Rapier::new(&scene, &start, 1.0 / rate), &scene);
        println!("| Rapier, rolling resistance by hand | 1/{rate:.0} | {pile} |");
    }
    Ok(())
}
