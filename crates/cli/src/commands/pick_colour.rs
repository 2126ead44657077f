//! `pick-colour`: an image to the range of colours that marks its grains.

use anyhow::Context as _;
use clap::Args;
use granulcal_dataset::{Form, Product, png, write_mask};
use granulcal_features::{Region, pick_range};
use serde_json::json;

use crate::args::paths::{Reads, Writes, writes};
use crate::context::{note, print_json, print_line};
use crate::outcome::Outcome;
use crate::run::{Run, Setting};
use crate::sides::SideFiles;

/// Share of the ground's sample in the range from which the two cannot be distinguished by colour.
const MUCH_GROUND: f64 = 0.05;

/// Pick the range of colours that marks grains from an image
#[derive(Debug, Args)]
#[command(long_about = "\
Finds the range of hue, saturation and value that marks the grains of a colour
image, for the table [segmentation.colour] of a camera's TOML.

Point at some grains with --grains and, if you can, at some ground with
--ground: rectangles of the image. The range is that of the grains, its bounds
half way to the ground's where the two do not overlap. Without a rectangle the
image is cut in two by brightness or saturation, and the smaller part is taken
for grains.

Look at the result: --mask writes the image with the grains outlined.

Example:
  granulcal-cli pick-colour pile.png --mask mask.png
  granulcal-cli pick-colour pile.png --grains 300,220,40,40 \\
      --ground 20,20,80,80 --mask mask.png")]
pub struct PickColourArgs {
    /// 8-bit colour PNG
    pub image: Reads,
    /// Rectangle with grains only; repeat as needed
    #[arg(long, value_name = "X,Y,WIDTH,HEIGHT")]
    pub grains: Vec<Region>,
    /// Rectangle without grains; repeat as needed
    #[arg(long, value_name = "X,Y,WIDTH,HEIGHT", requires = "grains")]
    pub ground: Vec<Region>,
    /// Write the image with the grains outlined
    #[arg(long, value_name = "OUT.png", value_parser = writes(Product::File(Form::Png)))]
    pub mask: Option<Writes>,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
}

impl Run for PickColourArgs {
    fn run(&self, _: &Setting<'_>) -> anyhow::Result<Outcome> {
        run(self)
    }
}

fn run(args: &PickColourArgs) -> anyhow::Result<Outcome> {
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
