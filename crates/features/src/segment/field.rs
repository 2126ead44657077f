//! The square of ground that the images of a scene show, cut out of a recording that shows more.
//!
//! What rolls out of the scene's view is in none of its images. A recording of 848 x 480 pixels whose shorter side is
//! as long on the ground as theirs still has it, and radii and kurtosis of a formation with lone grains are others.

use std::ops::RangeInclusive;

use nalgebra::Vector3;

use super::component::patches;
use super::levelled::Levelled;
use super::outlook::HEAP_PIXELS;
use super::part::Part;
use crate::median::median;

impl Levelled {
    /// Leaves the pixels of a square of ground of `field` `[m]`, its sides along those of the image, whose columns go
    /// `along` in the frame of the input. Where the image goes on beyond it, its middle is that of the grains
    /// (medians), as far as it stays in the image. Without a grain, all is left.
    pub(super) fn within(mut self, field: f64, along: &Vector3<f64>) -> Self {
        let upright = self.plane.plane.ground_from_world().rotation;
        let mut x = upright * along;
        x.z = 0.0;
        let Some(x) = x.try_normalize(f64::EPSILON) else { return self };
        let axes = [(x, self.resolution.0), (Vector3::z().cross(&x), self.resolution.1)];
        let mut shown = 1.0;
        let mut kept = vec![true; self.points.len()];
        for (axis, pixel) in axes {
            let at: Vec<f64> = self.points.iter().map(|point| axis.dot(point)).collect();
            let grains = at.iter().zip(&self.pixels).filter(|(_, pixel)| self.mask[**pixel]);
            let mut of_grains: Vec<f64> = grains.map(|(at, _)| *at).collect();
            let Some(middle) = median(&mut of_grains) else { return self };
            let (low, high) = extent(&at);
            shown *= ((high - low + pixel) / field).min(1.0);
            // Half a pixel more or less is none.
            if high - low > field {
                let half = 0.5 * field;
                let middle = middle.clamp(low + half, high - half);
                let inside = (middle - half)..=(middle + half);
                kept.iter_mut().zip(&at).for_each(|(kept, at)| *kept &= inside.contains(at));
            }
        }
        self.shown = Some(shown);
        if kept.iter().all(|&kept| kept) {
            return self;
        }
        self.left_out = self.beyond(&kept);
        self.cut_to(&kept)
    }

    /// Leaves the rectangle of pixels that holds all with data.
    pub(super) fn trimmed(self) -> Self {
        let all = vec![true; self.points.len()];
        self.cut_to(&all)
    }

    /// The patches of grains that are cut off whole, or more than half; a heap has some pixels.
    fn beyond(&self, kept: &[bool]) -> Vec<Part> {
        let part = |patch: Vec<usize>| {
            let mut part = Part { volume: 0.0, height: 0.0 };
            let mut inside = 0.0;
            // The pixels of the points rise, and grains are among them.
            for point in patch.iter().filter_map(|pixel| self.pixels.binary_search(pixel).ok()) {
                let volume = if kept[point] { &mut inside } else { &mut part.volume };
                *volume += self.volumes[point];
                part.height = part.height.max(self.points[point].z);
            }
            (part.volume > inside).then_some(part)
        };
        let all = patches(&self.mask, self.width).into_iter();
        all.filter(|patch| patch.len() >= HEAP_PIXELS).filter_map(part).collect()
    }

    /// Leaves the points that are kept, and the rectangle of pixels that holds them.
    fn cut_to(self, kept: &[bool]) -> Self {
        let places = || self.pixels.iter().zip(kept).filter(|(_, kept)| **kept).map(|(&at, _)| at);
        let columns = span(places().map(|at| at % self.width));
        let rows = span(places().map(|at| at / self.width));
        let width = columns.clone().count();
        let moved = |at: usize| {
            (at / self.width - rows.start()) * width + at % self.width - columns.start()
        };
        let mut heights = vec![None; width * rows.clone().count()];
        let mut mask = vec![false; heights.len()];
        for at in places() {
            heights[moved(at)] = self.heights[at];
            mask[moved(at)] = self.mask[at];
        }
        Self {
            width,
            height: rows.clone().count(),
            heights,
            mask,
            valid_count: places().count(),
            is_cropped: true,
            volumes: of_kept(&self.volumes, kept),
            points: of_kept(&self.points, kept),
            pixels: places().map(moved).collect(),
            ..self
        }
    }
}

fn of_kept<T: Copy>(all: &[T], kept: &[bool]) -> Vec<T> {
    all.iter().zip(kept).filter(|(_, kept)| **kept).map(|(value, _)| *value).collect()
}

fn extent(values: &[f64]) -> (f64, f64) {
    let ends = (f64::INFINITY, f64::NEG_INFINITY);
    values.iter().fold(ends, |(low, high), &value| (low.min(value), high.max(value)))
}

fn span(values: impl Iterator<Item = usize>) -> RangeInclusive<usize> {
    let ends = values.fold(None, |ends: Option<(usize, usize)>, value| {
        Some(ends.map_or((value, value), |(low, high)| (low.min(value), high.max(value))))
    });
    let (low, high) = ends.unwrap_or((1, 0));
    low..=high
}

#[cfg(test)]
mod tests {
    use crate::{Formation, HeightMap, Segmentation, Threshold, segment_height_map};

    const STEP: f64 = 2e-3;

    /// A cone about a column, and a grain at each end of the middle row, on level ground; 80 rows.
    fn seen(columns: usize, cone: f64, field_width: Option<f64>) -> Formation {
        let mut z = vec![0.0; columns * 80];
        for (pixel, z) in z.iter_mut().enumerate() {
            let (u, v) = ((pixel % columns) as f64, (pixel / columns) as f64);
            *z = (0.02 * (1.0 - STEP * (u - cone).hypot(v - 39.5) / 0.03)).max(0.0);
        }
        (z[40 * columns + 2], z[41 * columns - 3]) = (4e-3, 4e-3);
        of(columns, z, field_width)
    }

    fn of(columns: usize, z: Vec<f64>, field_width: Option<f64>) -> Formation {
        let map = HeightMap::new(columns, 80, STEP, STEP, z).unwrap();
        let height_threshold = Threshold::Absolute(1e-3);
        let settings = Segmentation { height_threshold, field_width, ..Segmentation::default() };
        segment_height_map(&map, &settings).unwrap()
    }

    #[test]
    fn a_wide_image_is_cut_to_the_square_about_the_formation() {
        let square = Some(80.0 * STEP);
        let (own, wide) = (seen(80, 39.5, None), seen(140, 39.5, square));
        // A lone grain at the right end is out of the square, that at the left end in it.
        assert_eq!((wide.width, wide.height, wide.masked_count), (80, 80, own.masked_count - 1));
        assert_eq!((wide.shown, own.shown), (Some(1.0), None));
        assert!(wide.is_cropped && !own.is_cropped);
        assert!((wide.volume / own.volume - 1.0).abs() < 1e-3);
        // Wherever the formation lies, the square is about it.
        let aside = seen(140, 80.0, square);
        let farthest =
            |seen: &Formation| seen.points.iter().map(|p| p.xy().norm()).fold(0.0, f64::max);
        assert_eq!(aside.width, 80);
        assert!(farthest(&aside) < 0.031 && farthest(&seen(140, 80.0, None)) > 0.1);
    }

    #[test]
    fn a_heap_beyond_the_square_is_left_out_and_known() {
        let heaps = |cones: &[(f64, f64)]| {
            let height = |pixel: usize| {
                let (u, v) = ((pixel % 300) as f64, (pixel / 300) as f64);
                let of_cone =
                    |(at, high): &(f64, f64)| high * (1.0 - STEP * (u - at).hypot(v - 39.5) / 0.03);
                cones.iter().map(of_cone).fold(0.0, f64::max)
            };
            of(300, (0..300 * 80).map(height).collect(), Some(80.0 * STEP))
        };
        let diameter = 4e-3;
        let both = heaps(&[(60.0, 0.03), (240.0, 0.02)]);
        assert_eq!((both.width, both.other_heaps(diameter)), (80, Vec::new()));
        let [heap] = both.left_out_heaps(diameter)[..] else { panic!("{:?}", both.left_out) };
        let cone = std::f64::consts::PI / 3.0 * 0.03 * 0.03 * 0.02;
        assert!((heap.volume / cone - 1.0).abs() < 0.05 && heap.height > 0.019, "{heap:?}");
        assert!(heaps(&[(60.0, 0.03)]).left_out_heaps(diameter).is_empty());
        // Lone grains are no heap.
        assert!(seen(140, 39.5, Some(80.0 * STEP)).left_out_heaps(diameter).is_empty());
    }

    #[test]
    fn an_image_that_shows_no_more_is_left_as_it_is() {
        for field_width in [Some(80.0 * STEP), Some(100.0 * STEP)] {
            let got = seen(80, 45.0, field_width);
            assert_eq!((got.width, &got.mask), (80, &seen(80, 45.0, None).mask));
            let shown = (160.0 * STEP / 2.0 / field_width.unwrap()).powi(2);
            assert!((got.shown.unwrap() / shown - 1.0).abs() < 1e-9, "{:?}", got.shown);
        }
    }
}
