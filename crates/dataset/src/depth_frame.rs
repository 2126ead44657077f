//! One depth image in the numbers of its file, whatever the file.

/// The count that is no data, as 0 is: cameras write it where they saturate.
pub(crate) const SATURATED: u16 = u16::MAX;

/// One depth image, in the numbers of its file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct DepthFrame {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) values: Values,
}

/// Depth row by row; 0, [`SATURATED`], and what is not finite are no data.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Values {
    /// Counts of a unit.
    Counts(Vec<u16>),
    /// Metres.
    Metres(Vec<f32>),
}
