//! The range of colours that marks grains, picked from an image.
//!
//! With a sample of the grains the range is that of the sample, without its outermost percents, and
//! where a sample of the ground lies beyond a bound, the bound moves half way towards it. Without a
//! sample the image is cut in two by the threshold of Otsu on value or on saturation, whichever
//! separates better; the smaller part is the grains.

use super::{ColourImage, HsvRange, hsv};
use crate::error::FeatureError;
use crate::region::Region;

/// Share of a sample that is left out at either end.
const OUTERMOST: f64 = 0.01;
/// Room beyond the sample where nothing is known of the ground: this share of the sample's width.
const ROOM: f64 = 0.25;
/// Saturation below which a hue means little.
const GREY: f64 = 0.15;
/// Share of greyish pixels from which the hue is left open.
const MANY_GREY: f64 = 0.1;
/// Levels of the histogram.
const LEVELS: usize = 256;

/// A range and what it takes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Picked {
    /// The range.
    pub range: HsvRange,
    /// Share of the grains' sample that lies in it `[-]`; 1 without a sample.
    pub grains_inside: f64,
    /// Share of the ground's sample that lies in it `[-]`; 0 without a sample.
    pub ground_inside: f64,
    /// Share of the image that lies in it `[-]`.
    pub image_inside: f64,
}

/// The range that marks the grains of an image.
///
/// # Errors
/// `OutOfRange` for a region that is not inside the image or an empty image, `LengthMismatch` for a broken one.
///
/// # Reference
/// Otsu 1979, doi:10.1109/TSMC.1979.4310076.
pub fn pick_range(
    image: &ColourImage,
    grains: &[Region],
    ground: &[Region],
) -> Result<Picked, FeatureError> {
    image.require_valid()?;
    for region in grains.iter().chain(ground) {
        region.require_inside(image.width, image.height)?;
    }
    let all = sample(image, &[Region::whole(image.width, image.height)]);
    let (grains, ground) = (sample(image, grains), sample(image, ground));
    let range = if grains.is_empty() { by_threshold(&all) } else { around(&grains, &ground) };
    let inside = |sample: &[[u8; 3]], empty: f64| match sample.len() {
        0 => empty,
        count => sample.iter().filter(|&&rgb| range.contains(rgb)).count() as f64 / count as f64,
    };
    Ok(Picked {
        range,
        grains_inside: inside(&grains, 1.0),
        ground_inside: inside(&ground, 0.0),
        image_inside: inside(&all, 0.0),
    })
}

fn sample(image: &ColourImage, regions: &[Region]) -> Vec<[u8; 3]> {
    regions.iter().flat_map(|region| region.pixels()).map(|(u, v)| image.at(u, v)).collect()
}

/// The range of the grains, its bounds half way to the ground where the two do not overlap.
fn around(grains: &[[u8; 3]], ground: &[[u8; 3]]) -> HsvRange {
    let of = |sample: &[[u8; 3]], channel: fn((Option<f64>, f64, f64)) -> f64| {
        bounds(sample.iter().map(|&rgb| channel(hsv(rgb))).collect())
    };
    let between = |channel: fn((Option<f64>, f64, f64)) -> f64| {
        let (low, high) = of(grains, channel);
        widened((low, high), (!ground.is_empty()).then(|| of(ground, channel)), (0.0, 1.0))
    };
    let (saturation_min, saturation_max) = between(|(_, saturation, _)| saturation);
    let (value_min, value_max) = between(|(_, _, value)| value);
    let (hue_min_deg, hue_max_deg) = hues(grains, ground);
    HsvRange { hue_min_deg, hue_max_deg, saturation_min, saturation_max, value_min, value_max }
}

/// The range of hues, which may run through red; open for greyish grains.
fn hues(grains: &[[u8; 3]], ground: &[[u8; 3]]) -> (f64, f64) {
    let coloured = |sample: &[[u8; 3]]| -> Vec<f64> {
        let hue = |&rgb: &[u8; 3]| match hsv(rgb) {
            (Some(hue), saturation, _) if saturation >= GREY => Some(hue),
            _ => None,
        };
        sample.iter().filter_map(hue).collect()
    };
    let own = coloured(grains);
    if (own.len() as f64) < (1.0 - MANY_GREY) * grains.len() as f64 {
        return (0.0, 360.0);
    }
    // Hues are counted from their mean direction, so that red has no seam.
    let (sin, cos) = own.iter().fold((0.0, 0.0), |(s, c), hue| {
        let (sin, cos) = hue.to_radians().sin_cos();
        (s + sin, c + cos)
    });
    let middle = f64::atan2(sin, cos).to_degrees();
    let from_middle = |hues: Vec<f64>| {
        bounds(hues.iter().map(|hue| (hue - middle + 540.0).rem_euclid(360.0) - 180.0).collect())
    };
    let others = coloured(ground);
    // The ground's hues count where most of the ground has one.
    let others = (2 * others.len() > ground.len()).then(|| from_middle(others));
    let (low, high) = widened(from_middle(own), others, (-180.0, 180.0));
    if high - low >= 360.0 {
        return (0.0, 360.0);
    }
    ((middle + low).rem_euclid(360.0), (middle + high).rem_euclid(360.0))
}

/// The quantiles that leave the outermost values out.
fn bounds(mut values: Vec<f64>) -> (f64, f64) {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1) as f64;
    let at = |share: f64| values.get((share * last).round() as usize).copied().unwrap_or(0.0);
    (at(OUTERMOST), at(1.0 - OUTERMOST))
}

/// Bounds with room towards the ground, or towards the end of the scale.
fn widened(own: (f64, f64), other: Option<(f64, f64)>, scale: (f64, f64)) -> (f64, f64) {
    let room = ROOM * (own.1 - own.0).max(0.02 * (scale.1 - scale.0));
    let low = match other {
        Some((_, theirs)) if theirs < own.0 => 0.5 * (theirs + own.0),
        _ => own.0 - room,
    };
    let high = match other {
        Some((theirs, _)) if theirs > own.1 => 0.5 * (theirs + own.1),
        _ => own.1 + room,
    };
    (low.max(scale.0), high.min(scale.1))
}

/// The smaller part of an image cut in two on the channel that separates better.
fn by_threshold(all: &[[u8; 3]]) -> HsvRange {
    let open = HsvRange::default();
    let (value, value_cut) = otsu(all.iter().map(|&rgb| hsv(rgb).2));
    let (saturation, saturation_cut) = otsu(all.iter().map(|&rgb| hsv(rgb).1));
    if value >= saturation {
        let above = all.iter().filter(|&&rgb| hsv(rgb).2 >= value_cut).count();
        if 2 * above <= all.len() {
            HsvRange { value_min: value_cut, ..open }
        } else {
            HsvRange { value_max: value_cut, ..open }
        }
    } else {
        let above = all.iter().filter(|&&rgb| hsv(rgb).1 >= saturation_cut).count();
        if 2 * above <= all.len() {
            HsvRange { saturation_min: saturation_cut, ..open }
        } else {
            HsvRange { saturation_max: saturation_cut, ..open }
        }
    }
}

/// Share of the variance that the best cut explains, and the cut.
fn otsu(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let mut histogram = [0.0; LEVELS];
    let top = (LEVELS - 1) as f64;
    for value in values {
        histogram[(value * top).round() as usize] += 1.0;
    }
    let total: f64 = histogram.iter().sum();
    let moment = |power: i32| {
        histogram.iter().zip(0..).map(|(n, i)| n * f64::from(i).powi(power)).sum::<f64>() / total
    };
    let (mean, variance) = (moment(1), moment(2) - moment(1).powi(2));
    if variance.is_nan() || variance <= 0.0 {
        return (0.0, 0.0);
    }
    // Cuts within an empty stretch of the histogram are equally good: the middle one is taken.
    let (mut best, mut first, mut last) = (0.0, 0, 0);
    let (mut below, mut sum) = (0.0, 0.0);
    for (i, n) in histogram.iter().enumerate().take(LEVELS - 1) {
        below += n / total;
        sum += n / total * i as f64;
        if below <= 0.0 || below >= 1.0 {
            continue;
        }
        let between = (mean * below - sum).powi(2) / (below * (1.0 - below));
        if between > best * (1.0 + 1e-9) {
            (best, first) = (between, i);
        }
        if between >= best * (1.0 - 1e-9) {
            last = i;
        }
    }
    (best / variance, (0.5 * (first + last) as f64 + 0.5) / top)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An image of 40 x 20: grains on the right half, both with a spread.
    fn image(grain: [u8; 3], ground: [u8; 3], grain_from: usize) -> ColourImage {
        let rgb = (0..800).flat_map(|i| {
            let base = if i % 40 >= grain_from { grain } else { ground };
            base.map(|c| c.saturating_add((i * 7 % 11) as u8))
        });
        ColourImage::new(40, 20, rgb.collect()).unwrap()
    }

    const LEFT: Region = Region { x: 0, y: 0, width: 20, height: 20 };
    const RIGHT: Region = Region { x: 20, y: 0, width: 20, height: 20 };

    #[test]
    fn samples_are_told_apart() {
        for (grain, ground) in [
            ([220, 200, 150], [14, 12, 12]),
            ([200, 30, 40], [30, 60, 200]),
            ([230, 20, 10], [120, 20, 20]),
            ([120, 120, 118], [225, 224, 226]),
        ] {
            let got = pick_range(&image(grain, ground, 20), &[RIGHT], &[LEFT]).unwrap();
            assert!(got.grains_inside > 0.9, "{got:?}");
            assert!(got.ground_inside < 0.01, "{got:?}");
            assert!((got.image_inside - 0.5 * got.grains_inside).abs() < 0.01, "{got:?}");
        }
    }

    #[test]
    fn a_sample_of_grains_alone_is_enough() {
        let got = pick_range(&image([220, 200, 150], [14, 12, 12], 20), &[RIGHT], &[]).unwrap();
        assert!(got.grains_inside > 0.95 && got.image_inside < 0.55, "{got:?}");
    }

    #[test]
    fn hues_run_through_red() {
        let mut image = image([200, 30, 30], [90, 90, 90], 20);
        for (i, pixel) in image.rgb.chunks_exact_mut(3).enumerate().filter(|(i, _)| i % 40 >= 20) {
            // Hues from 340 to 20 degrees.
            pixel.copy_from_slice(if i % 2 == 0 { &[200, 30, 85] } else { &[200, 85, 30] });
        }
        let got = pick_range(&image, &[RIGHT], &[LEFT]).unwrap().range;
        assert!(got.hue_min_deg > 300.0 && got.hue_max_deg < 60.0, "{got:?}");
    }

    #[test]
    fn without_a_sample_the_smaller_part_is_the_grains() {
        let got = pick_range(&image([220, 200, 150], [14, 12, 12], 30), &[], &[]).unwrap();
        assert!((got.image_inside - 0.25).abs() < 0.01, "{got:?}");
        assert!(got.range.value_min > 0.1 && got.range.value_max == 1.0, "{got:?}");
        let dark = pick_range(&image([14, 12, 12], [220, 200, 150], 30), &[], &[]).unwrap();
        assert!((dark.image_inside - 0.25).abs() < 0.01, "{dark:?}");
        let vivid = pick_range(&image([180, 20, 20], [176, 174, 175], 30), &[], &[]).unwrap();
        assert!((vivid.image_inside - 0.25).abs() < 0.01, "{vivid:?}");
        let flat = ColourImage::new(4, 4, vec![7; 48]).unwrap();
        assert!(pick_range(&flat, &[], &[]).is_ok());
    }

    #[test]
    fn a_broken_image_is_refused() {
        let whole = image([220, 200, 150], [14, 12, 12], 20);
        let cut = ColourImage { rgb: whole.rgb[..2000].to_vec(), ..whole.clone() };
        let got = pick_range(&cut, &[LEFT], &[]);
        assert!(matches!(got, Err(FeatureError::LengthMismatch { got: 2000, expected: 2400, .. })));
        let empty = ColourImage { width: 0, height: 0, rgb: Vec::new() };
        assert!(matches!(pick_range(&empty, &[], &[]), Err(FeatureError::OutOfRange { .. })));
    }

    #[test]
    fn regions_must_be_inside() {
        let image = image([220, 200, 150], [14, 12, 12], 20);
        let outside = Region { x: 30, ..RIGHT };
        let got = pick_range(&image, &[outside], &[]);
        assert!(matches!(got, Err(FeatureError::OutOfRange { .. })));
    }
}
