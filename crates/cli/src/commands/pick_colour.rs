//! `pick-colour`: an image to the range of colours that marks its grains.

use anyhow::Context as _;
use granulcal_dataset::{png, write_mask};
use granulcal_features::pick_range;
use serde_json::json;

use crate::args::PickColourArgs;
use crate::context::{note, print_json, print_line};
use crate::outcome::Outcome;
use crate::sides::SideFiles;

/// Share of the ground's sample in the range from which the two cannot be told apart by colour.
const MUCH_GROUND: f64 = 0.05;

pub fn run(args: &PickColourArgs) -> anyhow::Result<Outcome> {
    let image = png::read_colour(&args.image)?;
    let picked = pick_range(&image, &args.grains, &args.ground)?;
    let mut sides = SideFiles::default();
    if let Some(path) = &args.mask {
        let mask = image.mask_of(&picked.range)?;
        sides.keep(write_mask(path, &image, &mask).context("writing --mask"));
    }
    let range = &picked.range;
    if args.json {
        print_json(&json!({
            "colour": range,
            "grains_inside": picked.grains_inside,
            "ground_inside": picked.ground_inside,
            "image_inside": picked.image_inside,
        }))?;
    } else {
        print_line("[segmentation.colour]")?;
        for (name, value) in [
            ("hue_min_deg", range.hue_min_deg),
            ("hue_max_deg", range.hue_max_deg),
            ("saturation_min", range.saturation_min),
            ("saturation_max", range.saturation_max),
            ("value_min", range.value_min),
            ("value_max", range.value_max),
        ] {
            print_line(&format!("{name} = {value:.3}"))?;
        }
        print_line(&format!("# takes {:.1} % of the image", 100.0 * picked.image_inside))?;
        if !args.grains.is_empty() {
            let (grains, ground) = (100.0 * picked.grains_inside, 100.0 * picked.ground_inside);
            print_line(&format!(
                "# and {grains:.1} % of the grains' sample, {ground:.1} % of the ground's"
            ))?;
        }
    }
    if picked.ground_inside > MUCH_GROUND {
        let share = 100.0 * picked.ground_inside;
        note(&format!(
            "warning: {share:.0} % of the ground's sample lie in the range; colour does not tell the two apart"
        ));
    }
    Ok(sides.finish(Outcome::Done))
}
