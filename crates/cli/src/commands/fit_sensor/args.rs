//! Arguments of `fit-sensor`.

use clap::Args;
use granulcal_dataset::{Form, Product};
use granulcal_features::Region;

use crate::args::ReadArgs;
use crate::args::numbers::{number, seed, whole};
use crate::args::paths::{Reads, Writes, recording, writes};

/// Fit a depth camera's noise, fixed pattern, rounding and holes to frames of a flat surface
#[derive(Debug, Args)]
#[command(long_about = "\
Fits the sensor of a scene's camera to frames of something flat: a wall, a
board, the empty bed.

Record some ten frames of it without moving anything, from the distance at
which you pour. One camera stands still: what the frames share is its fixed
pattern, what differs is its noise.

RECORDING is what `features` reads: a .bag or .mcap of one or more frames,
16-bit depth PNGs, a folder of them or .npy, with --camera, or .npz height maps.
Each frame is taken by itself. With --baseline the camera is stereo: errors are
px of disparity, and depth errors grow with the square of the depth. Without,
errors are metres, whatever the depth.

Where the frames show more than the flat surface, --region says where it is;
repeat it for several. --check are recordings that the fit does not see, to
compare it with; --check-region is another part of the surface.

What is printed: the parameters; then standard deviation and autocorrelation of
the measured frames beside those of frames simulated with the fit, after the
same trend removal. -o writes the TOML that stands in a scene, [camera.sensor],
or goes to `render --sensor`.

Example:
  granulcal-cli fit-sensor wall.bag --baseline 0.05 -o sensor.toml
  granulcal-cli fit-sensor wall/ --camera d435.toml --baseline 0.05 -o s.toml
  granulcal-cli fit-sensor d0.png d1.png --camera d435.toml --baseline 0.05 \\
      --region 30,10,100,290 --check-region 130,10,100,290
  granulcal-cli fit-sensor bed_1.npz bed_2.npz --check bed_3.npz bed_4.npz")]
// Frames are averaged by the other commands that read recordings, not here.
#[command(mut_arg("frames", |frames| frames.help("Read so many frames, or `all`")))]
#[command(mut_arg("first_frame", |first| {
    first.help("Index of the first frame that is read, from 0 [default: so that the last are]")
}))]
pub struct FitSensorArgs {
    /// Recordings of a flat surface
    #[arg(required = true, value_name = "RECORDING", value_parser = recording())]
    pub recordings: Vec<Reads>,
    #[command(flatten)]
    pub read: ReadArgs,
    /// Distance of the two imagers of a stereo camera [m]
    #[arg(long, value_name = "METRES", value_parser = number, allow_negative_numbers = true)]
    pub baseline: Option<f64>,
    /// Part of the frames that is flat; repeat as needed [default: the whole frame]
    #[arg(long = "region", value_name = "X,Y,WIDTH,HEIGHT")]
    pub regions: Vec<Region>,
    /// Degree of the polynomial that is removed from the surface; 1 is a plane
    #[arg(long, default_value_t = 2, value_name = "DEGREE", value_parser = whole::<usize>, allow_negative_numbers = true)]
    pub trend: usize,
    /// Longest distance of the autocorrelation [px]
    #[arg(long, default_value_t = 24, value_name = "PIXELS", value_parser = whole::<usize>, allow_negative_numbers = true)]
    pub max_lag: usize,
    /// Maps were cut from the sensor's image up to so many pixels apart
    #[arg(long, default_value_t = 0, value_name = "PIXELS", value_parser = whole::<usize>, allow_negative_numbers = true)]
    pub max_shift: usize,
    /// Sessions that are simulated to correct and judge the fit
    #[arg(long, default_value_t = 24, value_name = "N", value_parser = whole::<usize>, allow_negative_numbers = true)]
    pub sessions: usize,
    /// Seed of the simulated sessions
    #[arg(long, default_value_t = 0, value_parser = seed, allow_negative_numbers = true)]
    pub seed: u64,
    /// Recordings to compare with that the fit does not see [default: those of the fit]
    #[arg(long, value_name = "RECORDING", num_args = 1.., value_parser = recording())]
    pub check: Vec<Reads>,
    /// Part of the frames to compare with; repeat as needed [default: as --region]
    #[arg(long = "check-region", value_name = "X,Y,WIDTH,HEIGHT")]
    pub check_regions: Vec<Region>,
    /// Write the sensor as TOML
    #[arg(long = "out", short = 'o', value_name = "SENSOR.toml",
        value_parser = writes(Product::File(Form::SensorToml)))]
    pub out: Option<Writes>,
    /// Write sensor and all covariances as JSON
    #[arg(long, value_name = "REPORT.json", value_parser = writes(Product::File(Form::Json)))]
    pub report: Option<Writes>,
    /// Print that JSON instead of the table
    #[arg(long)]
    pub json: bool,
}
