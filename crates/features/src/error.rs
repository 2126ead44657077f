//! The one error type of the crate.

use granulcal_numbers::General;
use thiserror::Error;

/// Why an image could not be rendered, segmented or described.
///
/// Every variant carries what was got and what would have been allowed.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum FeatureError {
    /// Too few points for the quantity to exist.
    #[error("{what} needs at least {min} points, got {got}")]
    TooFewPoints {
        /// The quantity asked for.
        what: &'static str,
        /// Points given.
        got: usize,
        /// Points needed.
        min: usize,
    },
    /// A NaN or an infinity where a finite number is needed.
    #[error("{what}[{index}] must be finite, got {}", General(*got))]
    NonFinite {
        /// The array.
        what: &'static str,
        /// Position in the array.
        index: usize,
        /// The value found.
        got: f64,
    },
    /// A number outside its range.
    #[error("{what} must be {}, got {}", range(*min, *max), General(*got))]
    OutOfRange {
        /// The quantity.
        what: &'static str,
        /// The value given.
        got: f64,
        /// Smallest value allowed.
        min: f64,
        /// Largest value allowed.
        max: f64,
    },
    /// A number of a sensor that none has.
    #[error(transparent)]
    Sensor(#[from] granulcal_scene::SceneError),
    /// Frames of a flat surface that show something else.
    #[error(
        "the frames must show something flat: {} % of the pixels lie on one smooth surface (at least {}), \
         {} % of the {scale} off it on average (at most 5); say with a region where the flat part is",
        General((on_surface * 10.0).floor() / 10.0),
        General(*least),
        General((deviation * 10.0).round() / 10.0)
    )]
    NotFlat {
        /// Pixels with data that lie on the surface [%].
        on_surface: f64,
        /// Least share of them that is allowed [%].
        least: f64,
        /// Robust standard deviation of those from the surface [%].
        deviation: f64,
        /// What the deviation is a share of.
        scale: &'static str,
    },
    /// A part of a frame of a flat surface that stands off the rest.
    #[error(
        "the frames must show something flat: in frame {frame} the {}x{} pixels at x {}, y {} stand {} m {} the smooth \
         surface of the rest, {} times as far as chance brings a part of it; say with a region where the flat part is",
        size.0, size.1, place.0, place.1,
        General((height.abs() * 1e4).round() / 1e4),
        if *height < 0.0 { "below" } else { "above" },
        General((ratio * 10.0).round() / 10.0)
    )]
    Bump {
        /// Number of the frame, from 1.
        frame: usize,
        /// First column and row of the part `[px]`.
        place: (usize, usize),
        /// Its columns and rows `[px]`.
        size: (usize, usize),
        /// Largest distance from the surface, towards the camera `[m]`.
        height: f64,
        /// The same over the largest that chance gives `[-]`.
        ratio: f64,
    },
    /// Two arrays that must be equally long are not.
    #[error("{what} must have length {expected}, got {got}")]
    LengthMismatch {
        /// The array.
        what: &'static str,
        /// Its length.
        got: usize,
        /// The length it must have.
        expected: usize,
    },
    /// Two images, or an image and a camera, differ in size.
    #[error("{what} must be {}x{} pixels, got {}x{}", expected.0, expected.1, got.0, got.1)]
    SizeMismatch {
        /// The image.
        what: &'static str,
        /// Its (width, height) `[px]`.
        got: (usize, usize),
        /// The (width, height) it must have `[px]`.
        expected: (usize, usize),
    },
    /// Down-sampling would leave no pixel.
    #[error("down-sampling factor must be in [1, {max}] for this image, got {got}")]
    DownsampleFactor {
        /// The factor given.
        got: usize,
        /// The largest factor that leaves a pixel.
        max: usize,
    },
    /// Too few pixels of the image carry depth.
    #[error("at least {min} of the {pixels} pixels must carry depth, got {got}")]
    NoValidDepth {
        /// Pixels of the image.
        pixels: usize,
        /// Valid pixels within the border.
        got: usize,
        /// Valid pixels needed.
        min: usize,
    },
    /// Pixels as wide as they are asked for leave next to none of the image.
    #[error(
        "the image shows {} m x {} m, of which pixels of {} m leave {got} that carry depth, and at least 3 must: are its \
         lengths in metres?",
        General(extent.0),
        General(extent.1),
        General(*wanted)
    )]
    TooSmall {
        /// Width and height of what it shows, on the ground `[m]`.
        extent: (f64, f64),
        /// Width of a pixel that is asked for `[m]`.
        wanted: f64,
        /// Valid pixels that are left.
        got: usize,
    },
    /// No pixel was taken for a grain.
    #[error("{}", no_grain(*valid, *highest, *threshold, *above, *cleaned, extent.as_deref().copied()))]
    EmptyMask {
        /// Valid pixels.
        valid: usize,
        /// Height of the highest valid pixel above the ground `[m]`.
        highest: f64,
        /// Height above which a pixel counts as grain `[m]`.
        threshold: f64,
        /// Pixels above `max_height`, which are none of them.
        above: usize,
        /// Why pixels above the threshold are none; `None` where there are none.
        cleaned: Option<Cleaned>,
        /// Width and height of the ground that a measured image shows `[m]`; `None` of a simulated one.
        extent: Option<Box<(f64, f64)>>,
    },
    /// Segmentation by colour was half asked for.
    #[error(
        "colour segmentation needs a colour image and a colour range, got image: {image}, range: {range}"
    )]
    IncompleteColour {
        /// Whether an image was given.
        image: bool,
        /// Whether a range was given.
        range: bool,
    },
    /// A stereo sensor was asked for a height map.
    #[error("a stereo sensor needs a pinhole camera, got a height map without one")]
    NeedsPinhole,
    /// The plane of the points is too steep to be the ground.
    #[error(
        "the ground must be tilted by at most {} deg (max_tilt_deg), got a plane of {} deg: is it a wall, or the \
         camera's pose?",
        General(*max_deg),
        General(*got_deg)
    )]
    TooSteep {
        /// Tilt of the plane that was found `[deg]`.
        got_deg: f64,
        /// Largest tilt of the ground `[deg]`.
        max_deg: f64,
    },
    /// The points do not span a plane.
    #[error(
        "points do not span a plane: their second largest spread is {} m, it must exceed {} m",
        General(*got),
        General(*min)
    )]
    DegeneratePlane {
        /// Root mean square extent along the second principal axis `[m]`.
        got: f64,
        /// The extent needed `[m]`.
        min: f64,
    },
}

/// Why pixels above the threshold are no grains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cleaned {
    /// None of their patches is high enough to be told from the ground's noise.
    Low {
        /// Pixels above the threshold.
        pixels: usize,
        /// Height that a patch must reach somewhere `[m]`.
        peak: f64,
    },
    /// None of their patches has as many pixels as are asked for.
    Small {
        /// Pixels of those that are high enough.
        pixels: usize,
        /// Pixels that a patch must have.
        min_px: usize,
    },
}

impl FeatureError {
    /// [`FeatureError::EmptyMask`] of a simulated image, whose pixels are grains by their height alone: of so many
    /// valid ones the highest is `highest` `[m]`, which is not above `threshold` `[m]`.
    pub fn no_grain_in_image(valid: usize, highest: f64, threshold: f64) -> Self {
        Self::EmptyMask { valid, highest, threshold, above: 0, cleaned: None, extent: None }
    }
}

/// What is said of an image without a grain, and of its pixels above the greatest height.
fn no_grain(
    valid: usize,
    highest: f64,
    threshold: f64,
    above: usize,
    cleaned: Option<Cleaned>,
    extent: Option<(f64, f64)>,
) -> String {
    if valid == 0 && above == 0 {
        return "no pixel has data on or above the ground: are lens and depths those of the camera?"
            .to_owned();
    }
    if valid == 0 {
        return format!(
            "all {above} pixels with data are above max_height: are the depths in metres?"
        );
    }
    let hidden = if above > 0 {
        format!(
            "; {above} more are above max_height: has another surface been taken for the ground?"
        )
    } else {
        String::new()
    };
    let why = match cleaned {
        None => {
            let shown = extent.map_or_else(String::new, |(width, height)| {
                format!(
                    "; the image shows {} m x {} m of the ground: if it does not, its unit or its lens is another",
                    three_digits(width),
                    three_digits(height)
                )
            });
            format!(
                " (highest is {} m, threshold {} m){shown}",
                General(highest),
                General(threshold)
            )
        }
        Some(Cleaned::Low { pixels, peak }) => format!(
            ": {pixels} are above the threshold of {} m, but no patch of them reaches {} m, above the ground's noise \
             (highest is {} m); average more frames, or state height_threshold",
            General(threshold),
            General(peak),
            General(highest)
        ),
        Some(Cleaned::Small { pixels, min_px }) => format!(
            ": {pixels} are above the threshold of {} m, but no patch of them has min_component_px = {min_px} pixels",
            General(threshold)
        ),
    };
    format!("none of {valid} valid pixels belongs to a grain{why}{hidden}")
}

/// A length as it is told where its order counts.
fn three_digits(length: f64) -> General {
    let step = 10f64.powf(length.abs().log10().floor() - 2.0);
    let rounded = (length / step).round() * step;
    General(if rounded.is_finite() { rounded } else { length })
}

/// Refuses the first value of `values` that is not finite.
pub(crate) fn require_finite(
    what: &'static str,
    values: impl Iterator<Item = f64>,
) -> Result<(), FeatureError> {
    for (index, got) in values.enumerate() {
        if !got.is_finite() {
            return Err(FeatureError::NonFinite { what, index, got });
        }
    }
    Ok(())
}

/// Refuses a value outside `[min, max]`; NaN is outside of everything.
pub(crate) fn require_in(
    what: &'static str,
    got: f64,
    min: f64,
    max: f64,
) -> Result<(), FeatureError> {
    if got >= min && got <= max {
        Ok(())
    } else {
        Err(FeatureError::OutOfRange { what, got, min, max })
    }
}

/// A range in words.
fn range(min: f64, max: f64) -> String {
    let max = General(max);
    // What is positive has no least number that means anything.
    if min == f64::MIN_POSITIVE {
        return format!("above 0 and at most {max}");
    }
    format!("in [{}, {max}]", General(min))
}

/// Refuses an array of the wrong length.
pub(crate) fn require_length(
    what: &'static str,
    got: usize,
    expected: usize,
) -> Result<(), FeatureError> {
    if got == expected { Ok(()) } else { Err(FeatureError::LengthMismatch { what, got, expected }) }
}
