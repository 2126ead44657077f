//! What of a recording is read.

use std::path::Path;

use clap::Args;
use granulcal_dataset::ReadOptions;

use super::numbers::whole;
use super::paths::Reads;

/// What of a recording is read.
#[derive(Clone, Debug, Args)]
pub struct ReadArgs {
    /// TOML of the camera: lens, depth unit and segmentation. Images as PNG or .npy take that under their own name,
    /// or camera.toml in their folder or the one above, if none is given; for .bag and .mcap it replaces
    /// what they say, key by key
    #[arg(long, value_name = "CAMERA.toml")]
    pub camera: Option<Reads>,
    /// Topic of the depth images, where several fit
    #[arg(long)]
    pub topic: Option<String>,
    /// Topic of the lens, where several fit
    #[arg(long, value_name = "TOPIC")]
    pub camera_topic: Option<String>,
    /// Topic of the colour images, where several fit; read when the camera's TOML marks grains by colour
    #[arg(long, value_name = "TOPIC")]
    pub colour_topic: Option<String>,
    /// Average so many frames, or `all`
    #[arg(long, value_name = "N", default_value = "10", value_parser = parse_frames)]
    pub frames: usize,
    /// Index of the first frame that is averaged, from 0 [default: so that the last are]
    #[arg(long, value_name = "INDEX", value_parser = whole::<u64>, allow_negative_numbers = true)]
    pub first_frame: Option<u64>,
}

impl ReadArgs {
    /// The options of the library.
    pub fn options(&self) -> ReadOptions {
        ReadOptions {
            camera: self.camera.as_deref().map(Path::to_owned),
            topic: self.topic.clone(),
            colour_topic: self.colour_topic.clone(),
            camera_topic: self.camera_topic.clone(),
            frames: self.frames,
            first_frame: self.first_frame,
        }
    }
}

fn parse_frames(text: &str) -> Result<usize, String> {
    let refuse = || format!("must be `all` or a number from 1, got {text:?}");
    match text {
        "all" => Ok(usize::MAX),
        number => number.parse().ok().filter(|&n| n > 0).ok_or_else(refuse),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_a_number_or_all() {
        assert_eq!((parse_frames("30"), parse_frames("all")), (Ok(30), Ok(usize::MAX)));
        assert!(parse_frames("0").is_err() && parse_frames("ten").is_err());
    }
}
