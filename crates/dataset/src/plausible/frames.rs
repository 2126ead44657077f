//! Whether recordings that are given as pours of their own are frames of one pour: then its grains lie at the same
//! places in all of them.

use granulcal_features::Segmentation;

use super::Limits;
use super::relief::Relief;
use crate::Recording;

/// Median difference of height over the diameter of a grain, where either image has grains, below which both show the
/// same ones. Single frames of a stereo camera at 40 cm differ by 0.12, means of five by 0.03; two pours by 0.6 to
/// 0.8, and by 0.28 if each pixel is the mean of its square of ground.
const SAME: f64 = 0.15;
/// The same over what the noise of the ground alone makes of it, for a scene's grains may be larger than those that
/// were poured: frames have 0.6 to 1.6, 40 pairs of measured mounds from 3.7 on, pours of a scene 16.
const OF_NOISE: f64 = 2.0;
/// Correlation of the relief of both images, less that of their ground, from which on they show the same grains in
/// spite of noise: frames of a heap have 0.8 at 0.14 diameters of noise in every pixel, two pours at most 0.2, 39 pairs
/// of measured mounds and craters at most 0.25 (`a_heaps_relief_is_known_under_noise`).
const IN_COMMON: f64 = 0.4;
/// Grains that a heap's surface must have for that: chance makes 0.1 of 100.
const LEAST_SURFACE: f64 = 100.0;
/// Side over the diameter of a grain of the square from whose mean relief is counted.
const SQUARE: f64 = 3.0;
/// Median of the absolute value of a normal number of variance 1.
const NORMAL_MEDIAN: f64 = 0.6745;
/// Widest pixel on the ground over the diameter of a grain: wider ones, as means of many grains, differ too little.
const WIDEST: f64 = 2.0;
/// Pixels of grains that it takes to tell.
const LEAST_PIXELS: usize = 20;

/// Where grains lie in an image, in all its pixels.
#[derive(Clone, Debug)]
pub struct Places {
    width: usize,
    /// Height above the ground `[m]`, NaN for no data, and whether it is of grains.
    pixels: Vec<(f32, bool)>,
    /// Width of a pixel on the ground `[m]`.
    resolution: f64,
    /// Standard deviation of the ground about its plane `[m]`.
    ground_sd: f64,
}

impl Limits {
    /// Where the grains of a recording lie; `None` where pixels are too wide to tell, or there are no grains.
    pub fn places_of(&self, recording: &Recording) -> Option<Places> {
        let whole = Segmentation {
            downsample: Some(1),
            ground_resolution: None,
            field_width: None,
            ..recording.segmentation.clone()
        };
        let formation = recording.formation_with(&whole).ok()?;
        let (along_x, along_y) = formation.resolution;
        let resolution = along_x.max(along_y);
        if resolution > WIDEST * self.diameter {
            return None;
        }
        let height = |height: &Option<f64>| height.map_or(f32::NAN, |height| height as f32);
        let pixels = formation.heights.iter().map(height).zip(formation.mask).collect();
        Some(Places { width: formation.width, pixels, resolution, ground_sd: formation.ground_sd })
    }

    /// What is said of recordings whose neighbours in the list are frames of one pour; nothing where none are.
    pub fn doubts_of_frames(&self, names: &[String], places: &[Option<Places>]) -> Vec<String> {
        let is_next =
            |pair: &[Option<Places>]| matches!(pair, [Some(a), Some(b)] if self.is_one_pour(a, b));
        let mut found = Vec::new();
        let mut from = 0;
        for last in 0..names.len() {
            if last + 1 < names.len() && is_next(&places[last..last + 2]) {
                continue;
            }
            if last > from {
                found.push(format!(
                    "{} show the same grains at the same places, as frames of one pour do, and each counts as a pour of its \
                     own: put frames of one pour into a folder, and give that",
                    names[from..=last].join(", ")
                ));
            }
            from = last + 1;
        }
        found
    }

    fn is_one_pour(&self, first: &Places, second: &Places) -> bool {
        (first.width, first.pixels.len()) == (second.width, second.pixels.len())
            && (self.differ_little(first, second) || self.share_relief(first, second))
    }

    /// Whether heights differ by less than those of two pours can, and by no more than noise.
    fn differ_little(&self, first: &Places, second: &Places) -> bool {
        let both = first.pixels.iter().zip(&second.pixels);
        let mut differences: Vec<_> = both
            .filter(|((_, a), (_, b))| *a || *b)
            .map(|((a, _), (b, _))| f64::from((a - b).abs()))
            .filter(|difference| !difference.is_nan())
            .collect();
        if differences.len() < LEAST_PIXELS {
            return false;
        }
        let middle = differences.len() / 2;
        let (_, median, _) = differences.select_nth_unstable_by(middle, f64::total_cmp);
        let of_noise = NORMAL_MEDIAN * first.ground_sd.hypot(second.ground_sd);
        *median <= (SAME * self.diameter).min(OF_NOISE * of_noise)
    }

    /// Whether the surfaces of both heaps go up and down at the same places, more so than the ground does: a camera's
    /// fixed pattern is the same in all its images.
    fn share_relief(&self, first: &Places, second: &Places) -> bool {
        let of_both = |are_grains: bool| -> Vec<bool> {
            let seen =
                |&(height, is_grain): &(f32, bool)| !height.is_nan() && is_grain == are_grains;
            first.pixels.iter().zip(&second.pixels).map(|(a, b)| seen(a) && seen(b)).collect()
        };
        let grains = of_both(true);
        let resolution = first.resolution.max(second.resolution);
        let area = grains.iter().filter(|&&is_grain| is_grain).count() as f64 * resolution.powi(2);
        if area < LEAST_SURFACE * self.diameter.powi(2) {
            return false;
        }
        let reach = (0.5 * SQUARE * self.diameter / resolution).round().max(1.0) as usize;
        let in_common = |within: &[bool]| {
            let relief = |of: &Places| Relief::of(&of.pixels, of.width, within, reach);
            relief(first).correlation(&relief(second))
        };
        in_common(&grains) - in_common(&of_both(false)).max(0.0) > IN_COMMON
    }
}
