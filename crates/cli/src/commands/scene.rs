//! `scene`: a scene as TOML, whole.

use clap::Args;

use crate::args::SceneArgs;
use crate::context::{print_json, print_line};
use crate::outcome::Outcome;
use crate::run::{Run, Setting};
use crate::scene;

/// Print a scene as TOML, every number of it: a built-in one, or a file with changes
#[derive(Debug, Args)]
#[command(long_about = "\
Prints a scene as TOML with every number that it has, those that its file
leaves out too. The result is a scene file.

Example:
  granulcal-cli scene funnel > scene.toml
  granulcal-cli scene examples/drum.toml --set walls.0.motion.rate=4")]
pub struct PrintSceneArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Print it as one JSON object instead
    #[arg(long)]
    pub json: bool,
}

impl Run for PrintSceneArgs {
    fn run(&self, _: &Setting<'_>) -> anyhow::Result<Outcome> {
        let scene = scene::load(&self.scene)?;
        if self.json {
            print_json(&scene)?;
        } else {
            print_line(scene.to_toml()?.trim_end())?;
        }
        Ok(Outcome::Done)
    }
}
