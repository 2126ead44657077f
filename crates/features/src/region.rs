//! Rectangles of pixels, as people point at parts of an image.

use serde::{Deserialize, Serialize};

use crate::error::{FeatureError, require_in};

/// A rectangle of pixels; `[x, y, width, height]` in files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "[usize; 4]", into = "[usize; 4]")]
pub struct Region {
    /// First column `[px]`.
    pub x: usize,
    /// First row `[px]`.
    pub y: usize,
    /// Columns `[px]`.
    pub width: usize,
    /// Rows `[px]`.
    pub height: usize,
}

impl From<[usize; 4]> for Region {
    fn from([x, y, width, height]: [usize; 4]) -> Self {
        Self { x, y, width, height }
    }
}

impl From<Region> for [usize; 4] {
    fn from(Region { x, y, width, height }: Region) -> Self {
        [x, y, width, height]
    }
}

impl std::str::FromStr for Region {
    type Err = String;

    /// Reads `X,Y,WIDTH,HEIGHT`.
    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Result<Vec<usize>, _> = text.split(',').map(|n| n.trim().parse()).collect();
        match numbers.as_deref() {
            Ok(&[x, y, width, height]) if width > 0 && height > 0 => {
                Ok(Self { x, y, width, height })
            }
            _ => Err(format!("must be X,Y,WIDTH,HEIGHT in whole pixels, got {text:?}")),
        }
    }
}

impl Region {
    /// The region that is the whole image.
    pub const fn whole(width: usize, height: usize) -> Self {
        Self { x: 0, y: 0, width, height }
    }

    /// Refuses a region that is empty or reaches beyond an image of this size.
    pub(crate) fn require_inside(&self, width: usize, height: usize) -> Result<(), FeatureError> {
        let right = self.x.saturating_add(self.width) as f64;
        let bottom = self.y.saturating_add(self.height) as f64;
        require_in("width of a region [px]", self.width as f64, 1.0, width as f64)?;
        require_in("height of a region [px]", self.height as f64, 1.0, height as f64)?;
        require_in("right edge of a region [px]", right, 1.0, width as f64)?;
        require_in("lower edge of a region [px]", bottom, 1.0, height as f64)
    }

    /// Whether a pixel (u, v) lies in the region.
    pub(crate) fn holds(&self, u: usize, v: usize) -> bool {
        let across = self.x..self.x.saturating_add(self.width);
        let down = self.y..self.y.saturating_add(self.height);
        across.contains(&u) && down.contains(&v)
    }

    /// The pixels (u, v) of the region, row by row.
    pub(crate) fn pixels(self) -> impl Iterator<Item = (usize, usize)> {
        let columns = self.x..self.x + self.width;
        (self.y..self.y + self.height).flat_map(move |v| columns.clone().map(move |u| (u, v)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_are_read_from_text() {
        assert_eq!("1,2, 3,4".parse(), Ok(Region { x: 1, y: 2, width: 3, height: 4 }));
        assert!("1,2,3".parse::<Region>().is_err() && "1,2,0,4".parse::<Region>().is_err());
    }

    #[test]
    fn regions_lie_inside() {
        let region = Region { x: 2, y: 1, width: 2, height: 2 };
        assert!(region.require_inside(4, 3).is_ok() && region.require_inside(3, 3).is_err());
        assert_eq!(region.pixels().collect::<Vec<_>>(), [(2, 1), (3, 1), (2, 2), (3, 2)]);
        assert!(Region { x: usize::MAX, ..region }.require_inside(4, 3).is_err());
        let held = |(u, v): &(usize, usize)| region.holds(*u, *v);
        assert_eq!(Region::whole(4, 3).pixels().filter(held).count(), 4);
    }
}
