//! Measured frames and simulated ones under one estimator.

use granulcal_numbers::scatter;
use granulcal_scene::round_to;

use super::bump::{self, Bump};
use super::comparison::Comparison;
use super::components::Estimator;
use super::covariance::{self, Split};
use super::flat::{Patch, SD_PER_MAD, detrend, median};
use super::flatness::Flatness;
use super::frames::{FlatFrames, Optics};
use super::settings::FitSettings;
use crate::error::FeatureError;
use crate::region::Region;
use crate::sensor::DepthSensor;
use crate::sensor::field::SensorGrid;
use crate::sensor::field::sample;

/// How flat a region of a frame is.
fn flatness(optics: &Optics, values: &[f64], patch: &Patch, bump: Option<&Bump>) -> Flatness {
    let valid = values.iter().filter(|value| value.is_finite()).count().max(1);
    let on_surface = patch.count() as f64 / valid as f64;
    let relative = |residual: f64, trend: f64| match *optics {
        Optics::Stereo { .. } => residual / trend,
        // The trend is one over the distance.
        Optics::TimeOfFlight { inverse: true, .. } => residual * trend,
        Optics::TimeOfFlight { resolution, .. } => {
            residual / (resolution * patch.width.max(patch.height) as f64)
        }
    };
    let pixels = patch.residual.iter().zip(&patch.trend).zip(&patch.mask);
    let mut off: Vec<f64> = pixels
        .filter(|(_, mask)| **mask > 0.0)
        .map(|((residual, trend), _)| relative(*residual, *trend).abs())
        .collect();
    let deviation = SD_PER_MAD * median(&mut off);
    Flatness { on_surface, deviation, bump: bump.map(|bump| bump.ratio) }
}

/// Frames of one sensor, their trends and residuals.
pub(super) struct Session<'a> {
    frames: &'a FlatFrames,
    regions: Vec<Region>,
    /// Region r of frame k.
    patches: Vec<Vec<Patch>>,
    shifts: Vec<(isize, isize)>,
    flatness: Flatness,
    trend_degree: usize,
    max_lag: usize,
}

/// Covariances of simulated sessions.
pub(super) struct Simulated {
    pub(super) mean: Split,
    pub(super) spread: Split,
}

impl<'a> Session<'a> {
    pub(super) fn new(
        frames: &'a FlatFrames,
        settings: &FitSettings,
    ) -> Result<Self, FeatureError> {
        settings.require_valid()?;
        let regions = frames.regions(&settings.regions)?;
        let degree = settings.trend_degree;
        let mut patches = Vec::with_capacity(frames.values.len());
        let mut worst = Flatness::BEST;
        for frame in 0..frames.values.len() {
            let mut of = |region: &Region| {
                let values = frames.cut(frame, region);
                let error = |v, t| frames.optics.error(v, t);
                let patch = detrend(&values, region.width, degree, error)?;
                let optics = &frames.optics;
                let bump = bump::largest(optics, &values, &patch.trend, region.width, degree);
                let found = flatness(optics, &values, &patch, bump.as_ref());
                // Of something else altogether nobody needs to know where it stands off.
                if let Some(bump) = bump.filter(|_| found.is_near()) {
                    bump.require_chance(frame, region)?;
                }
                worst = worst.worst(found.require(optics.scale())?);
                Ok::<_, FeatureError>(patch)
            };
            patches.push(regions.iter().map(&mut of).collect::<Result<Vec<_>, FeatureError>>()?);
        }
        let shifts = covariance::shifts(&patches, settings.max_shift);
        let max_lag = settings.max_lag;
        Ok(Self {
            frames,
            regions,
            patches,
            shifts,
            flatness: worst,
            trend_degree: degree,
            max_lag,
        })
    }

    /// How flat the least flat region of all frames is.
    pub(super) fn flatness(&self) -> Flatness {
        self.flatness
    }

    /// Covariances of the measured frames.
    pub(super) fn measured(&self) -> Split {
        covariance::split(&self.patches, &self.shifts, self.max_lag)
    }

    /// How the covariances were estimated.
    pub(super) fn estimator(&self) -> Estimator {
        let sizes = self.regions.iter().map(|region| (region.width, region.height)).collect();
        Estimator::new(sizes, self.trend_degree, self.max_lag)
    }

    /// Mean variance of the errors of rounding: q²/12 of each step q.
    pub(super) fn rounding_variance(&self, sensor: &DepthSensor) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for patch in self.patches.iter().flatten() {
            for (trend, mask) in patch.trend.iter().zip(&patch.mask) {
                let square = match sensor {
                    DepthSensor::Stereo(sensor) => {
                        let focal_baseline = sensor.focal_length * sensor.baseline;
                        let unit = trend * trend / focal_baseline * sensor.depth_unit;
                        sensor.quantisation.powi(2) + unit * unit
                    }
                    DepthSensor::TimeOfFlight(sensor) => sensor.depth_unit.powi(2),
                };
                sum += mask * square / 12.0;
                count += mask;
            }
        }
        sum / f64::max(count, 1.0)
    }

    /// Share of the pixels of the regions that have no data.
    pub(super) fn dropout(&self) -> f64 {
        let (mut lost, mut all) = (0, 0);
        for frame in 0..self.frames.values.len() {
            for region in &self.regions {
                let values = self.frames.cut(frame, region);
                lost += values.iter().filter(|v| !v.is_finite()).count();
                all += values.len();
            }
        }
        lost as f64 / f64::max(f64::from(all as u32), 1.0)
    }

    /// Mean and spread of the covariances of `sessions` simulated sessions on the measured trends.
    pub(super) fn simulate(
        &self,
        sensor: &DepthSensor,
        sessions: usize,
        seed: u64,
    ) -> Result<Simulated, FeatureError> {
        let mut all = Vec::with_capacity(sessions);
        for session in 0..sessions {
            let patches = self.simulated_patches(sensor, scatter(seed ^ session as u64))?;
            all.push(covariance::split(&patches, &self.shifts, self.max_lag));
        }
        let count = sessions as f64;
        let mut mean = Split::zeros(self.max_lag);
        let mut spread = Split::zeros(self.max_lag);
        for split in &all {
            mean.combine(split, |sum, value| sum + value / count);
        }
        for split in &all {
            let mut off = split.clone();
            off.combine(&mean, |value, mean| value - mean);
            spread.combine(&off, |sum, off| sum + off * off / (count - 1.0));
        }
        let squares = spread.clone();
        spread.combine(&squares, |_, square| square.sqrt());
        Ok(Simulated { mean, spread })
    }

    /// One simulated session: the measured trends with new errors, after the same treatment.
    fn simulated_patches(
        &self,
        sensor: &DepthSensor,
        seed: u64,
    ) -> Result<Vec<Vec<Patch>>, FeatureError> {
        let reach = self.shifts.iter().map(|s| s.0.abs().max(s.1.abs())).max().unwrap_or(0);
        let margin = reach as usize;
        let mut simulated: Vec<Vec<Patch>> = vec![Vec::new(); self.patches.len()];
        for (r, region) in self.regions.iter().enumerate() {
            let (width, height) = (region.width, region.height);
            let wide = SensorGrid::under(width + 2 * margin, height + 2 * margin, 1.0)?;
            let seed_of = |what: u64| scatter(seed ^ scatter((r as u64) << 32 | what));
            let pattern = sample(sensor.fixed_pattern(), &wide, seed_of(0));
            let grid = SensorGrid::under(width, height, 1.0)?;
            for (k, simulated) in simulated.iter_mut().enumerate() {
                let noise = sample(sensor.noise(), &grid, seed_of(k as u64 + 1));
                let measured = &self.patches[k][r];
                let (x, y) = self.shifts[k];
                let at = |u: usize, v: usize| {
                    let column = (u + margin) as isize - x;
                    let row = (v + margin) as isize - y;
                    pattern[row as usize * wide.columns.len() + column as usize]
                };
                let values: Vec<f64> = (0..width * height)
                    .map(|i| {
                        if measured.mask[i] == 0.0 {
                            return f64::NAN;
                        }
                        let error = noise[i] + at(i % width, i / width);
                        self.frames.optics.disturbed(sensor, measured.trend[i], error)
                    })
                    .collect();
                let optics = &self.frames.optics;
                simulated
                    .push(detrend(&values, width, self.trend_degree, |v, t| optics.error(v, t))?);
            }
        }
        Ok(simulated)
    }

    /// Measured beside simulated.
    pub(super) fn compare(
        &self,
        sensor: &DepthSensor,
        settings: &FitSettings,
    ) -> Result<Comparison, FeatureError> {
        let simulated = self.simulate(sensor, settings.sessions, scatter(settings.seed))?;
        let frames = self.patches.len();
        let pixels: usize = self.patches.iter().flatten().map(Patch::count).sum();
        Ok(Comparison {
            unit: match sensor {
                DepthSensor::Stereo(_) => "px",
                DepthSensor::TimeOfFlight(_) => "m",
            },
            frames,
            pixels: pixels / frames,
            shifts: self.shifts.clone(),
            measured: self.measured(),
            model: simulated.mean,
            spread: simulated.spread,
        })
    }
}

impl Optics {
    /// The value that is delivered where the trend and an error meet.
    fn disturbed(&self, sensor: &DepthSensor, trend: f64, error: f64) -> f64 {
        match (self, sensor) {
            (Self::Stereo { .. }, DepthSensor::Stereo(sensor)) => {
                sensor.disparity(sensor.deliver(trend + error))
            }
            (Self::TimeOfFlight { inverse: true, .. }, DepthSensor::TimeOfFlight(sensor)) => {
                1.0 / round_to(1.0 / trend + error, sensor.depth_unit)
            }
            (_, DepthSensor::TimeOfFlight(sensor)) => round_to(trend + error, sensor.depth_unit),
            _ => trend + error,
        }
    }
}
