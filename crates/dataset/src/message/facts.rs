//! What is known of a picture and of a camera before any pixel is read.

/// What a picture is known to be before its pixels are read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct PictureFacts {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Encoding of the pixels, or the format of the compression.
    pub(crate) encoding: String,
    pub(crate) shows: Shows,
}

/// What the pixels of a picture mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shows {
    /// Counts of a unit, or metres.
    Depth,
    /// Red, green and blue.
    Colour,
    /// Neither.
    Other,
}

/// Size and lens of a camera, as ROS and Foxglove give them.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Lens {
    pub(crate) frame_id: String,
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// Coefficients of the distortion of the raw image.
    pub(crate) distortion: Vec<f64>,
    /// Lens of the raw image, 3 × 3 by rows.
    pub(crate) k: [f64; 9],
    /// Lens of the rectified image, 3 × 4 by rows.
    pub(crate) p: [f64; 12],
}
