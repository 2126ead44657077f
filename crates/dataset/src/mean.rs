//! The mean of depth images, pixel by pixel over those that have data there.

use granulcal_features::DepthImage;

use crate::depth_frame::{DepthFrame, Values};
use crate::fault::Fault;

/// Depth images of one size and kind, summed. Counts are summed as whole numbers, so that the mean
/// of counts is rounded once.
pub(crate) struct Mean {
    width: usize,
    height: usize,
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
    /// Of the pixels with data those that are off by more than [`OFF`] `[-]`.
    share: f64,
}

/// Pixels of one view differ by less than this in depth, but for a few at edges `[-]`.
const OFF: f64 = 0.02;
/// How few that is `[-]`.
const FEW: f64 = 0.03;

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
    /// The mean of one image.
    pub(crate) fn new(frame: DepthFrame) -> Self {
        let DepthFrame { width, height, values } = frame;
        Self { width, height, state: State::One(values), frames: 1, unlike: None }
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
                    sums.add(counts.iter().map(|&count| u32::from(count)));
                    State::Counts(sums)
                }
                Values::Metres(metres) => {
                    let mut sums = Sums::new(metres.len());
                    sums.add(metres.iter().copied().map(valid_metres));
                    State::Metres(sums)
                }
            };
        }
        let share = self.share_off(&frame.values);
        if share > self.unlike.map_or(FEW, |unlike| unlike.share) {
            self.unlike = Some(Unlike { frame: self.frames, share });
        }
        match (&mut self.state, &frame.values) {
            (State::Counts(sums), Values::Counts(counts)) => {
                sums.add(counts.iter().map(|&count| u32::from(count)));
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

    /// Of the pixels with data in an image and before those that are off by more than [`OFF`] `[-]`.
    fn share_off(&self, values: &Values) -> f64 {
        let (mut both, mut off) = (0.0, 0.0);
        let mut compare = |sum: f64, valid: u16, value: f64| {
            if valid > 0 && value > 0.0 {
                let mean = sum / f64::from(valid);
                both += 1.0;
                off += f64::from(u8::from((value - mean).abs() > OFF * mean));
            }
        };
        match (&self.state, values) {
            (State::Counts(sums), Values::Counts(counts)) => {
                for ((&sum, &valid), &count) in sums.sums.iter().zip(&sums.valid).zip(counts) {
                    compare(f64::from(sum), valid, f64::from(count));
                }
            }
            (State::Metres(sums), Values::Metres(metres)) => {
                for ((&sum, &valid), &value) in sums.sums.iter().zip(&sums.valid).zip(metres) {
                    compare(sum, valid, valid_metres(value));
                }
            }
            _ => {}
        }
        off / f64::max(both, 1.0)
    }

    /// That the images are not of one view, if one is unlike the mean of those before it.
    pub(crate) fn doubt(&self) -> Option<String> {
        let Unlike { frame, share } = self.unlike?;
        Some(format!(
            "frame {frame} of those averaged differs from those before it in {:.0} % of its pixels: frames are averaged as \
             images of one formation at rest; give several pours as several recordings",
            100.0 * share
        ))
    }

    /// The mean `[m]`; counts are `unit` metres each.
    ///
    /// # Errors
    /// A size that no image has.
    pub(crate) fn finish(self, unit: f64) -> Result<DepthImage, Fault> {
        let metres = |count: f64| (count * unit) as f32;
        let depth: Vec<f32> = match self.state {
            State::One(Values::Counts(counts)) => {
                counts.iter().map(|&count| metres(f64::from(count))).collect()
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
        let mut mean = Mean::new(frames.next().unwrap());
        frames.for_each(|frame| mean.add(&frame).unwrap());
        mean.finish(unit).unwrap().depth
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
    fn other_images_are_refused() {
        let mut one = Mean::new(counts(vec![1, 2]));
        assert!(
            one.add(&counts(vec![1])).unwrap_err().to_string().contains("2x1 as before, found 1x1")
        );
        assert!(one.add(&metres(vec![1.0, 2.0])).unwrap_err().to_string().contains("one type"));
        assert_eq!(one.frames(), 1);
    }

    proptest! {
        #[test]
        fn a_mean_lies_between_the_extremes(values in prop::collection::vec(1u16.., 1..40)) {
            let frames = values.iter().map(|&value| counts(vec![value])).collect();
            let mean = f64::from(mean(frames, 1.0)[0]);
            let exact = values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64;
            prop_assert!((mean - exact).abs() <= 1e-7 * exact);
        }
    }
}
