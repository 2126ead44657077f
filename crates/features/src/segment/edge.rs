//! Pixels at the edge of an image that are taken for grains and are none.
//!
//! Depth cameras deliver a frame of pixels that see nothing well: the window in which a stereo or structured-light
//! camera looks for a match reaches over the edge there. A few of them stand out of the ground as far as a grain does,
//! and a formation that ends at 120 mm then has a largest radius of 220 mm.

use super::component::patches;
use super::formation::Formation;

/// Pixels of grain that hang on the edge of an image, apart from the formation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EdgePixels {
    /// How many there are.
    pub count: usize,
    /// Width of the frame that holds them all `[px]`.
    pub frame: usize,
}

impl Formation {
    /// The pixels that hang on the edge of the image, apart from the formation, after down-sampling; `None` without
    /// any.
    pub fn edge(&self) -> Option<EdgePixels> {
        edge_pixels(&self.mask, self.width)
    }
}

/// The pixels of a mask of `width` columns that are joined to its edge by sides or diagonals; `None` without any, or
/// where they are not fewer than the rest: then the formation itself reaches the edge.
fn edge_pixels(mask: &[bool], width: usize) -> Option<EdgePixels> {
    let depth = depth_in(mask.len(), width)?;
    let all = patches(mask, width);
    let (joined, apart): (Vec<_>, Vec<_>) =
        all.iter().partition(|patch| patch.iter().any(|&pixel| depth(pixel) == 0));
    let pixels = |patches: &[&Vec<usize>]| patches.iter().map(|patch| patch.len()).sum::<usize>();
    let count = pixels(&joined);
    if count >= pixels(&apart) {
        return None;
    }
    let deepest = joined.into_iter().flatten().map(|&pixel| depth(pixel)).max()?;
    Some(EdgePixels { count, frame: deepest + 1 })
}

/// How far pixels of an image of `width` columns are from its edge `[px]`; `None` of an empty one.
pub(super) fn depth_in(pixels: usize, width: usize) -> Option<impl Fn(usize) -> usize> {
    let height = pixels.checked_div(width).filter(|&height| height > 0)?;
    Some(move |pixel: usize| {
        let (column, row) = (pixel % width, pixel / width);
        column.min(width - 1 - column).min(row).min(height - 1 - row)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A mask of 12 columns from a picture: `#` is grain.
    fn found(rows: [&str; 6]) -> Option<EdgePixels> {
        let mask: Vec<bool> = rows.iter().flat_map(|row| row.bytes().map(|b| b == b'#')).collect();
        edge_pixels(&mask, 12)
    }

    #[test]
    fn pixels_on_the_edge_are_counted_with_what_hangs_on_them() {
        let rows = [
            "#..........#",
            ".#....##....",
            "....######..",
            "....######..",
            ".....####...",
            "............",
        ];
        assert_eq!(found(rows), Some(EdgePixels { count: 3, frame: 2 }));
    }

    #[test]
    fn lone_grains_within_the_image_are_none() {
        let rows = [
            "............",
            ".#....##..#.",
            "....######..",
            "....######..",
            ".....####...",
            "............",
        ];
        assert_eq!(found(rows), None);
        assert_eq!(edge_pixels(&[], 0), None);
    }

    #[test]
    fn a_formation_that_reaches_the_edge_is_no_fault() {
        let rows = [
            "....####....",
            "....####....",
            "....####....",
            "............",
            "..#.........",
            "............",
        ];
        assert_eq!(found(rows), None);
    }
}
