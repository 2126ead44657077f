//! `scene`: a scene as TOML, whole.

use crate::args::SceneArgs;
use crate::context::print_line;
use crate::outcome::Outcome;
use crate::scene;

pub fn run(args: &SceneArgs) -> anyhow::Result<Outcome> {
    let text = scene::load(args)?.to_toml()?;
    print_line(text.trim_end())?;
    Ok(Outcome::Done)
}
