//! Pixels at the edge of an image that are taken for grains and are none.
//!
//! Depth cameras deliver a frame of pixels that see nothing well: the window in which a stereo or structured-light
//! camera looks for a match reaches over the edge there. A few of them stand out of the ground as far as a grain does,
//! and a formation that ends at 120 mm then has a largest radius of 220 mm.

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
    let height = mask.len().checked_div(width)?;
    let depth = |i: usize| {
        let (column, row) = (i % width, i / width);
        column.min(width - 1 - column).min(row).min(height - 1 - row)
    };
    let mut is_joined = vec![false; mask.len()];
    let mut joined: Vec<usize> = (0..mask.len()).filter(|&i| mask[i] && depth(i) == 0).collect();
    for &i in &joined {
        is_joined[i] = true;
    }
    let mut next = 0;
    while let Some(&i) = joined.get(next) {
        next += 1;
        let (column, row) = (i % width, i / width);
        for r in row.saturating_sub(1)..=(row + 1).min(height - 1) {
            for c in column.saturating_sub(1)..=(column + 1).min(width - 1) {
                let j = r * width + c;
                if mask[j] && !is_joined[j] {
                    is_joined[j] = true;
                    joined.push(j);
                }
            }
        }
    }
    let all = mask.iter().filter(|&&is_grain| is_grain).count();
    let count = joined.len();
    if 2 * count >= all {
        return None;
    }
    let deepest = joined.iter().map(|&i| depth(i)).max()?;
    Some(EdgePixels { count, frame: deepest + 1 })
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
