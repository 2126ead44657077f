//! Whether recordings that are given as pours of their own are frames of one pour: then its grains lie at the same
//! places in all of them.

use granulcal_features::Segmentation;

use super::Limits;
use crate::Recording;

/// Median difference of height over the diameter of a grain, where either image has grains, below which both show the
/// same ones. Single frames of a stereo camera at 40 cm differ by 0.12, means of five by 0.03; two pours by 0.6 to
/// 0.8, and by 0.28 if each pixel is the mean of its square of ground.
const SAME: f64 = 0.15;
/// The same over what the noise of the ground alone makes of it, for a scene's grains may be larger than those that
/// were poured: frames have 0.6 to 1.6, 40 pairs of measured mounds from 3.7 on, pours of a scene 16.
const OF_NOISE: f64 = 2.0;
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
        if along_x.max(along_y) > WIDEST * self.diameter {
            return None;
        }
        let height = |height: &Option<f64>| height.map_or(f32::NAN, |height| height as f32);
        let pixels = formation.heights.iter().map(height).zip(formation.mask).collect();
        Some(Places { width: formation.width, pixels, ground_sd: formation.ground_sd })
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
        if (first.width, first.pixels.len()) != (second.width, second.pixels.len()) {
            return false;
        }
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
}
