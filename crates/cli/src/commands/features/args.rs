//! Arguments of `features`.

use clap::Args;
use granulcal_dataset::{Form, Product};
use granulcal_features::Region;

use crate::args::ReadArgs;
use crate::args::numbers::{number, whole};
use crate::args::paths::{Reads, Writes, recording, writes};

/// Segment and describe a measured recording
#[derive(Debug, Args)]
#[command(long_about = "\
Finds the ground plane of a measured recording, levels it, takes the points
above it and prints the same 16 statistics that simulated pours have.

RECORDING is one of, as its content says:
  .bag    ROS 1, as the RealSense viewer saves it: depth, lens and depth unit
          are in the file
  .mcap   sensor_msgs/Image (16UC1, 32FC1), CompressedImage (PNG) and
          CameraInfo of ROS 2, or RawImage, CompressedImage and
          CameraCalibration of Foxglove
  .png    16-bit depth, or a folder of such frames; needs --camera, the TOML of
          lens and unit
  .npy    depth images (h, w) or (k, h, w), metres as floats or counts as
          whole numbers; needs --camera, too
  .npz    height map: arrays depthmap, xres, yres, zres, scale

Topics are found by type. Where several fit, the message lists them, and
--topic, --camera-topic or --colour-topic picks one; `inspect` shows them all.
Of the last ten frames (--frames, --first-frame) the mean of each pixel is
taken over those that have data there. A file that is cut off or damaged gives
the frames that are whole; the others are counted, exit code 3.

Example:
  granulcal-cli features pile.bag
  granulcal-cli features pile.bag --debug-images steps/
  granulcal-cli features pile.mcap --topic /camera/depth/image_rect_raw --json
  granulcal-cli features frames/ --camera camera.toml --threshold 0.002
  granulcal-cli features pile.npz --diagnostics --grain-diameter 0.002
  granulcal-cli features --list")]
pub struct FeaturesArgs {
    /// Recording to describe
    #[arg(required_unless_present = "list", value_parser = recording())]
    pub recording: Option<Reads>,
    #[command(flatten)]
    pub read: ReadArgs,
    /// Height above the ground from which a pixel counts as grain [m]
    #[arg(long, value_name = "METRES", value_parser = number, allow_negative_numbers = true)]
    pub threshold: Option<f64>,
    /// Ignore a frame of so many pixels
    #[arg(long, value_name = "PIXELS", value_parser = whole::<usize>, allow_negative_numbers = true)]
    pub border: Option<usize>,
    /// Look at this part of the image alone: the floor of a tray, without its rim and the table
    #[arg(long, value_name = "X,Y,WIDTH,HEIGHT")]
    pub region: Option<Region>,
    /// Keep the middle pixel of every n x n block
    #[arg(long, value_name = "N", value_parser = whole::<usize>, allow_negative_numbers = true)]
    pub downsample: Option<usize>,
    /// See it as this scene's images are seen, a pixel as wide on the ground and no more ground in view, and say what
    /// makes it doubtful as a formation of the scene: a TOML, or `funnel` or `drop`
    #[arg(long, value_name = "SCENE", conflicts_with = "downsample")]
    pub scene: Option<Reads>,
    /// Height above which a pixel is a fault and no data [m]
    #[arg(long, value_name = "METRES", value_parser = number, allow_negative_numbers = true)]
    pub max_height: Option<f64>,
    /// Grains must form patches of at least so many pixels
    #[arg(long, value_name = "PIXELS", value_parser = whole::<usize>, allow_negative_numbers = true)]
    pub min_component: Option<usize>,
    /// Write the points of the formation [m] as an array (n, 3)
    #[arg(long, value_name = "OUT.npy", value_parser = writes(Product::File(Form::Npy)))]
    pub points: Option<Writes>,
    /// Write pictures of the steps into this folder: residual.png (distance from the fitted plane),
    /// height.png, mask.png
    #[arg(long, value_name = "DIR", value_parser = writes(Product::PICTURES))]
    pub debug_images: Option<Writes>,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
    /// Print (or list) the diagnostic statistics too: profile, azimuthal modes, tail, bodies
    #[arg(long)]
    pub diagnostics: bool,
    /// Diameter of a grain [m], which the diagnostic statistics need
    #[arg(long, value_name = "METRES", requires = "diagnostics", value_parser = number, allow_negative_numbers = true)]
    pub grain_diameter: Option<f64>,
    /// Where the axis of the pour meets the levelled ground [m], in the frame of the centroid that is
    /// printed [default: the centroid]
    #[arg(long, num_args = 2, value_names = ["X", "Y"], requires = "diagnostics",
        allow_negative_numbers = true)]
    pub pour_axis: Option<Vec<f64>>,
    /// List the statistics with unit and meaning
    #[arg(long, conflicts_with_all = ["recording", "camera"])]
    pub list: bool,
}
