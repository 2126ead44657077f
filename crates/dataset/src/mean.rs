//! The mean of depth images, pixel by pixel over those that have data there.

mod blocks;

use granulcal_features::DepthImage;

use crate::depth_frame::{DepthFrame, SATURATED, Values};
use crate::fault::Fault;
use blocks::{Block, count_off};

/// Depth images of one size and kind, summed. Counts are summed as whole numbers, so that the mean
/// of counts is rounded once.
pub(crate) struct Mean {
    width: usize,
    height: usize,
    /// Metres per count.
    unit: f64,
    state: State,
    frames: usize,
    /// The image that was the least like the mean of those before it, if one was unlike it.
    unlike: Option<Unlike>,
}

/// An image that is not of what the others are of.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Unlike {
    /// Its number among those added.
    frame: usize,
    /// How many blocks of it differ.
    blocks: usize,
}

/// Blocks along the shorter side of an image: noise averages out in one, a heap of another height does not.
const ALONG: usize = 30;
/// Least side of a block `[px]`.
const LEAST_SIDE: usize = 4;
/// So many blocks of an image of the same view may differ.
const FEW: usize = 4;

enum State {
    /// Up to one image, as it came: most recordings of one image never need the sums.
    One(Values),
    Counts(Sums<u32>),
    Metres(Sums<f64>),
}

/// Sum and number of valid values of each pixel.
struct Sums<T> {
    sums: Vec<T>,
    valid: Vec<u16>,
}

/// Most images that whole numbers of 32 bits can sum.
pub(crate) const MAX_FRAMES: usize = u16::MAX as usize;

impl Mean {
    /// The mean of one image; counts are `unit` metres each.
    pub(crate) fn new(frame: DepthFrame, unit: f64) -> Self {
        let DepthFrame { width, height, values } = frame;
        Self { width, height, unit, state: State::One(values), frames: 1, unlike: None }
    }

    /// Images that were added.
    pub(crate) fn frames(&self) -> usize {
        self.frames
    }

    /// Adds an image.
    ///
    /// # Errors
    /// Another size, another kind of numbers, or more than [`MAX_FRAMES`] images.
    pub(crate) fn add(&mut self, frame: &DepthFrame) -> Result<(), Fault> {
        let size = |width: usize, height: usize| format!("{width}x{height}");
        if (frame.width, frame.height) != (self.width, self.height) {
            let allowed = format!("{} as before", size(self.width, self.height));
            return Err(Fault::new("the size", size(frame.width, frame.height), allowed));
        }
        if self.frames >= MAX_FRAMES {
            let found = (self.frames + 1).to_string();
            return Err(Fault::new("the number of frames", found, format!("at most {MAX_FRAMES}")));
        }
        if let State::One(first) = &self.state {
            self.state = match first {
                Values::Counts(counts) => {
                    let mut sums = Sums::new(counts.len());
                    sums.add(counts.iter().copied().map(valid_count));
                    State::Counts(sums)
                }
                Values::Metres(metres) => {
                    let mut sums = Sums::new(metres.len());
                    sums.add(metres.iter().copied().map(valid_metres));
                    State::Metres(sums)
                }
            };
        }
        let blocks = self.blocks_off(&frame.values);
        if blocks > self.unlike.map_or(FEW, |unlike| unlike.blocks) {
            self.unlike = Some(Unlike { frame: self.frames, blocks });
        }
        match (&mut self.state, &frame.values) {
            (State::Counts(sums), Values::Counts(counts)) => {
                sums.add(counts.iter().copied().map(valid_count));
            }
            (State::Metres(sums), Values::Metres(metres)) => {
                sums.add(metres.iter().copied().map(valid_metres));
            }
            _ => {
                return Err(Fault::new("the pixels", "another type", "of one type in all frames"));
            }
        }
        self.frames += 1;
        Ok(())
    }

    /// How many blocks of an image are off the mean of those before by more than noise explains, at the pixels that
    /// both know.
    fn blocks_off(&self, values: &Values) -> usize {
        let side = (self.width.min(self.height) / ALONG).max(LEAST_SIDE);
        let across = self.width.div_ceil(side);
        // Of each block: pixels that both know, their means, and how far the image is from these.
        let mut blocks = vec![(0_usize, 0.0, 0.0); across * self.height.div_ceil(side)];
        let mut compare = |pixel: usize, sum: f64, valid: u16, value: f64| {
            if valid > 0 && value > 0.0 {
                let (column, row) = (pixel % self.width, pixel / self.width);
                let (known, means, off) = &mut blocks[row / side * across + column / side];
                let mean = sum / f64::from(valid);
                *known += 1;
                *means += mean;
                *off += value - mean;
            }
        };
        match (&self.state, values) {
            (State::Counts(sums), Values::Counts(counts)) => {
                for (pixel, (&sum, &valid)) in sums.sums.iter().zip(&sums.valid).enumerate() {
                    compare(pixel, f64::from(sum), valid, f64::from(valid_count(counts[pixel])));
                }
            }
            (State::Metres(sums), Values::Metres(metres)) => {
                for (pixel, (&sum, &valid)) in sums.sums.iter().zip(&sums.valid).enumerate() {
                    compare(pixel, sum, valid, valid_metres(metres[pixel]));
                }
            }
            _ => {}
        }
        let unit = if matches!(values, Values::Counts(_)) { self.unit } else { 1.0 };
        let (enough, metres) =
            (side * side / 2, |sum: f64, known: usize| unit * sum / known as f64);
        let down = self.height.div_ceil(side);
        let from_middle = |index: usize, count: usize| (index as f64 + 0.5) / count as f64 - 0.5;
        let known: Vec<Block> = blocks
            .into_iter()
            .enumerate()
            .filter(|&(_, (known, ..))| known >= enough)
            .map(|(index, (known, means, off))| {
                let (depth, off) = (metres(means, known), metres(off, known));
                let (x, y) =
                    (from_middle(index % across, across), from_middle(index / across, down));
                Block { x, y, depth, share: off / depth }
            })
            .collect();
        count_off(&known)
    }

    /// That the images are not of one view, if one is unlike the mean of those before it.
    pub(crate) fn doubt(&self) -> Option<String> {
        let Unlike { frame, blocks } = self.unlike?;
        Some(format!(
            "frame {frame} of those averaged, from 0, differs from those before it by more than noise does in {blocks} \
             places: frames are averaged as images of one formation at rest; give several pours as several recordings"
        ))
    }

    /// The mean `[m]`.
    ///
    /// # Errors
    /// A size that no image has.
    pub(crate) fn finish(self) -> Result<DepthImage, Fault> {
        let metres = |count: f64| (count * self.unit) as f32;
        let depth: Vec<f32> = match self.state {
            State::One(Values::Counts(counts)) => {
                counts.iter().map(|&count| metres(f64::from(valid_count(count)))).collect()
            }
            State::One(Values::Metres(values)) => {
                values.into_iter().map(|value| valid_metres(value) as f32).collect()
            }
            // In place: a sum and a depth have the same number of bytes.
            State::Counts(Sums { sums, valid }) => {
                let means = sums.into_iter().zip(&valid);
                means.map(|(sum, &n)| metres(f64::from(sum) / f64::from(n.max(1)))).collect()
            }
            State::Metres(Sums { sums, valid }) => {
                let means = sums.into_iter().zip(&valid);
                means.map(|(sum, &n)| (sum / f64::from(n.max(1))) as f32).collect()
            }
        };
        DepthImage::new(self.width, self.height, depth)
            .map_err(|error| Fault::new("the depth image", error.to_string(), "an image"))
    }
}

impl<T: Copy + Default + PartialEq + std::ops::AddAssign> Sums<T> {
    fn new(pixels: usize) -> Self {
        Self { sums: vec![T::default(); pixels], valid: vec![0; pixels] }
    }

    /// Adds what is not zero.
    fn add(&mut self, values: impl Iterator<Item = T>) {
        for ((sum, valid), value) in self.sums.iter_mut().zip(&mut self.valid).zip(values) {
            if value != T::default() {
                *sum += value;
                *valid += 1;
            }
        }
    }
}

/// The count if it is a measurement, else 0.
fn valid_count(count: u16) -> u32 {
    if count == SATURATED { 0 } else { u32::from(count) }
}

/// The value if it is a measurement, else 0.
fn valid_metres(value: f32) -> f64 {
    if value > 0.0 && value.is_finite() { f64::from(value) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn counts(values: Vec<u16>) -> DepthFrame {
        DepthFrame { width: values.len(), height: 1, values: Values::Counts(values) }
    }

    fn metres(values: Vec<f32>) -> DepthFrame {
        DepthFrame { width: values.len(), height: 1, values: Values::Metres(values) }
    }

    fn mean(frames: Vec<DepthFrame>, unit: f64) -> Vec<f32> {
        let mut frames = frames.into_iter();
        let mut mean = Mean::new(frames.next().unwrap(), unit);
        frames.for_each(|frame| mean.add(&frame).unwrap());
        mean.finish().unwrap().depth
    }

    #[test]
    fn pixels_without_data_do_not_count() {
        let frames = vec![counts(vec![100, 0, 0]), counts(vec![200, 0, 7]), counts(vec![0, 0, 8])];
        assert_eq!(mean(frames, 0.001), [0.15, 0.0, 0.0075]);
        let nan = f32::NAN;
        let frames = vec![metres(vec![1.0, nan, -1.0]), metres(vec![2.0, f32::INFINITY, 0.5])];
        assert_eq!(mean(frames, 9.0), [1.5, 0.0, 0.5]);
        assert_eq!(mean(vec![metres(vec![nan, -2.0, 1.0])], 1.0), [0.0, 0.0, 1.0]);
        assert_eq!(mean(vec![counts(vec![1, 0])], 0.25), [0.25, 0.0]);
    }

    #[test]
    fn the_largest_count_is_no_data() {
        let full = u16::MAX;
        assert_eq!(mean(vec![counts(vec![4, full, full - 1])], 0.25), [1.0, 0.0, 16383.5]);
        let frames = vec![counts(vec![100, full]), counts(vec![full, full]), counts(vec![200, 7])];
        assert_eq!(mean(frames, 1.0), [150.0, 7.0]);
    }

    #[test]
    fn other_images_are_refused() {
        let mut one = Mean::new(counts(vec![1, 2]), 1.0);
        assert!(
            one.add(&counts(vec![1])).unwrap_err().to_string().contains("2x1 as before, found 1x1")
        );
        assert!(one.add(&metres(vec![1.0, 2.0])).unwrap_err().to_string().contains("one type"));
        assert_eq!(one.frames(), 1);
    }

    proptest! {
        #[test]
        fn a_mean_lies_between_the_extremes(values in prop::collection::vec(1..u16::MAX, 1..40)) {
            let frames = values.iter().map(|&value| counts(vec![value])).collect();
            let mean = f64::from(mean(frames, 1.0)[0]);
            let exact = values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64;
            prop_assert!((mean - exact).abs() <= 1e-7 * exact);
        }
    }

    #[test]
    fn another_formation_among_the_frames_is_known_and_noise_is_none() {
        let (width, height) = (120, 90);
        // A floor at half a metre with 3 mm of noise, and a heap on it.
        let frame = |heap: f64, seed: usize| {
            let depth = (0..width * height).map(|pixel| {
                let (u, v) = ((pixel % width) as f64 - 60.0, (pixel / width) as f64 - 45.0);
                let noise = ((pixel * 7919 + seed * 104_729) % 61) as f64 / 10.0 - 3.0;
                (500.0 - (heap - u.hypot(v)).max(0.0) + noise).round() as u16
            });
            DepthFrame { width, height, values: Values::Counts(depth.collect()) }
        };
        let doubt = |last: f64| {
            let mut mean = Mean::new(frame(20.0, 0), 1e-3);
            (1..5).for_each(|seed| mean.add(&frame(20.0, seed)).unwrap());
            mean.add(&frame(last, 5)).unwrap();
            mean.doubt()
        };
        assert_eq!(doubt(20.0), None);
        assert!(doubt(32.0).is_some_and(|text| text.contains("frame 5")));
    }

    #[test]
    fn a_heap_of_another_height_is_known_from_afar_and_noise_that_grows_is_none() {
        let (width, height) = (320, 240);
        // A floor at `depth` mm in tenths of a millimetre, noise of blocks of 16 pixels that err together, a heap.
        let frame = |depth: f64, noise: f64, heap: f64, lift: f64, seed: usize| {
            let values = (0..width * height).map(|pixel| {
                let (column, row) = (pixel % width, pixel / width);
                let block = (row / 16) * 20 + column / 16;
                let random = (block * 7919 + block * block * (seed + 3)) % 211;
                let off = noise * (random as f64 / 105.0 - 1.0);
                let from_middle = (column as f64 - 160.0).hypot(row as f64 - 120.0);
                let height = heap * (1.0 - from_middle / 60.0).max(0.0);
                (10.0 * (depth - height - lift + off)).round() as u16
            });
            DepthFrame { width, height, values: Values::Counts(values.collect()) }
        };
        let doubt = |depth, noise, [before, last]: [f64; 2], lift| {
            let mut mean = Mean::new(frame(depth, noise, before, 0.0, 0), 1e-4);
            (1..4).for_each(|seed| {
                mean.add(&frame(depth, noise, before, 0.0, seed)).unwrap();
            });
            mean.add(&frame(depth, noise, last, lift, 9)).unwrap();
            mean.doubt()
        };
        // Three millimetres at a metre are 0.3 % of the depth.
        assert_eq!(doubt(1000.0, 0.2, [40.0, 40.0], 0.0), None);
        assert!(doubt(1000.0, 0.2, [40.0, 46.0], 0.0).is_some());
        // Noise of 2 % of the depth that whole blocks share.
        assert_eq!(doubt(1500.0, 30.0, [40.0, 40.0], 0.0), None);
        // A camera that was lowered by 20 mm.
        assert!(
            doubt(1000.0, 0.2, [40.0, 40.0], 20.0).is_some_and(|text| text.contains("frame 4"))
        );
    }

    #[test]
    fn a_camera_that_was_turned_is_known_and_hides_no_other_heap() {
        let (width, height) = (320, 240);
        // A floor at 350 mm that slopes by a share of that across the image, in tenths of a millimetre, and a heap.
        let frame = |slope: f64, heap: f64, seed: usize| {
            let values = (0..width * height).map(|pixel| {
                let (u, v) = ((pixel % width) as f64 - 160.0, (pixel / width) as f64 - 120.0);
                let noise = ((pixel * 7919 + seed * 104_729) % 61) as f64 / 30.0 - 1.0;
                let height = heap * (1.0 - u.hypot(v) / 60.0).max(0.0);
                (10.0 * (350.0 * (1.0 + slope * u / 320.0) - height + noise)).round() as u16
            });
            DepthFrame { width, height, values: Values::Counts(values.collect()) }
        };
        let doubt = |slope, heaps: [f64; 2]| {
            let mut mean = Mean::new(frame(0.0, heaps[0], 0), 1e-4);
            (1..4).for_each(|seed| mean.add(&frame(0.0, heaps[0], seed)).unwrap());
            mean.add(&frame(slope, heaps[1], 9)).unwrap();
            mean.doubt()
        };
        for still in [0.0, 0.005, 0.01] {
            assert_eq!(doubt(still, [26.0, 26.0]), None, "{still}");
        }
        for turned in [0.03, 0.05, 0.1] {
            assert!(doubt(turned, [26.0, 26.0]).is_some(), "{turned}");
            // It had been all noise, of which another heap is no more than a part.
            assert!(doubt(turned, [0.0, 26.0]).is_some(), "{turned}");
        }
        assert!(doubt(0.01, [20.0, 26.0]).is_some());
    }
}
