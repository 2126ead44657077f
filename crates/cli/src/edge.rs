//! What is said of pixels at the edge of an image that are taken for grains.
//!
//! A thin frame of them is the camera's. A wide one is of grains that roll out of view: the simulated images have
//! those, too, if they show as much of the ground.

use granulcal_dataset::LEAST_SHOWN;
use granulcal_features::Formation;

/// Widest frame that is the camera's and not the grains', over the image's shorter side `[-]`.
const FRAME: f64 = 0.05;

/// How many there are, and what leaves them out; none without any, or where they are grains as the simulated images
/// show them.
pub fn pixels_at_edge(formation: &Formation) -> Option<String> {
    let is_matched = formation.shown.is_some_and(|shown| shown > LEAST_SHOWN);
    if is_matched && formation.is_cropped {
        return None;
    }
    let edge = formation.edge()?;
    let (count, frame) = (edge.count, edge.frame * formation.downsample);
    let apart = "at the edge of the image, apart from the formation,";
    let what = match count {
        1 => format!("1 pixel {apart} is taken for a grain"),
        _ => format!("{count} pixels {apart} are taken for grains"),
    };
    let side = formation.width.min(formation.height) as f64;
    if edge.frame as f64 <= FRAME * side {
        return Some(format!("{what}{}", advice(frame, is_matched)));
    }
    (!is_matched).then(|| format!("{what}: others may have rolled out of view"))
}

/// What leaves out a thin frame of so many pixels. Images of a scene, as wide as these, have grains that rolled to
/// their edge, too, and a model has learnt from those.
fn advice(frame: usize, is_matched: bool) -> String {
    let leaves = format!("--border {frame} leaves them out");
    if is_matched {
        format!(
            ", as those are that rolled there in the scene's images; if these are the camera's, {leaves}"
        )
    } else {
        format!("; {leaves}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_that_the_scenes_images_have_too_are_left_out_only_if_they_are_the_cameras() {
        assert_eq!(advice(4, false), "; --border 4 leaves them out");
        let matched = advice(4, true);
        assert!(matched.contains("in the scene's images; if these are the camera's, --border 4"));
    }
}
