//! Arguments that several commands share: clap types and nothing else. A command's own stand in its file.

mod global;
pub mod numbers;
pub mod paths;
mod read;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use granulcal_scene::Preset;

pub use global::Global;
use paths::Reads;
pub use read::ReadArgs;

/// Which scene, with which changes.
#[derive(Clone, Debug, Args)]
pub struct SceneArgs {
    /// Scene as TOML, or one of the words `funnel` and `drop` for the scenes that are built in
    pub scene: Reads,
    #[command(flatten)]
    pub with: SceneChanges,
}

/// Changes of a scene.
#[derive(Clone, Debug, Args)]
pub struct SceneChanges {
    /// Set a number of the scene by its path, for example material.sliding_friction=0.5; repeat as needed
    #[arg(long = "set", value_name = "PATH=VALUE", value_parser = parse_change)]
    pub changes: Vec<(String, f64)>,
    /// Sensor of the camera as `fit-sensor` wrote it, instead of the scene's
    #[arg(long, value_name = "SENSOR.toml")]
    pub sensor: Option<Reads>,
    /// Solver preset instead of the scene's
    #[arg(long, value_parser = PossibleValuesParser::new(Preset::ALL.map(Preset::name))
        .try_map(|word| word.parse::<Preset>()))]
    pub preset: Option<Preset>,
}

fn parse_change(text: &str) -> Result<(String, f64), String> {
    let (path, value) = text.split_once('=').ok_or("must be PATH=VALUE")?;
    let value =
        value.trim().parse().map_err(|_| format!("value must be a number, got {value:?}"))?;
    Ok((path.trim().to_owned(), value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_are_read_from_text() {
        assert_eq!(parse_change("a.b = 0.5"), Ok(("a.b".to_owned(), 0.5)));
        assert!(parse_change("a.b").is_err() && parse_change("a=b").is_err());
    }
}
