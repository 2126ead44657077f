//! Random fields over the pixels of a sensor: sums of separable Gaussian components.
//!
//! Equations (3) and (5) of `docs/theory/sensor.md`.

use granulcal_numbers::scatter;
use granulcal_scene::{MAX_SENSOR_PIXELS, NoiseField};

use crate::error::{FeatureError, require_in};
use crate::rng::Stream;

/// Half width of the kernel in standard deviations of the kernel.
const TRUNCATE: f64 = 4.0;
/// Lengths below this `[px]` correlate neighbours by less than 1e-5: the pixels are independent.
const SHORTEST: f64 = 0.2;

/// How a component is correlated along one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Along {
    /// Gaussian of this length `[px]`; 0 is independent.
    Length(f64),
    /// The same everywhere.
    Constant,
    /// The same but for the sign, which changes from pixel to pixel.
    Alternating,
}

impl Along {
    /// The correlations at distances of 0 to `max_lag` pixels `[-]`, those of the taps which draw
    /// the field.
    pub(crate) fn correlations(self, max_lag: usize) -> Vec<f64> {
        match self {
            Self::Constant => vec![1.0; max_lag + 1],
            Self::Alternating => {
                (0..=max_lag).map(|lag| if lag % 2 == 0 { 1.0 } else { -1.0 }).collect()
            }
            Self::Length(length) => {
                let taps = taps(length);
                let at = |lag| taps.iter().zip(taps.iter().skip(lag)).map(|(a, b)| a * b).sum();
                (0..=max_lag).map(at).collect()
            }
        }
    }

    /// The correlation at a distance of `lag` pixels `[-]`.
    pub(crate) fn correlation(self, lag: usize) -> f64 {
        self.correlations(lag)[lag]
    }
}

/// One component: its standard deviation and its correlation along x and y.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Component {
    pub(crate) sd: f64,
    pub(crate) x: Along,
    pub(crate) y: Along,
}

/// Where a field is wanted: the columns and rows of the sensor that the pixels of an image show.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SensorGrid {
    /// Columns of the sensor `[px]`.
    width: usize,
    /// Rows of the sensor `[px]`.
    height: usize,
    /// The column of the sensor under each column of the image.
    pub(crate) columns: Vec<usize>,
    /// The row of the sensor under each row of the image.
    pub(crate) rows: Vec<usize>,
}

impl SensorGrid {
    /// The sensor's pixels under the middles of the pixels of an image, `scale` of them wide each.
    pub(crate) fn under(width: usize, height: usize, scale: f64) -> Result<Self, FeatureError> {
        require_in("sensor pixels per image pixel [-]", scale, 1e-6, 1e6)?;
        let size = [width, height].map(|count| (count as f64 * scale).ceil());
        require_in("pixels of the sensor", size[0] * size[1], 1.0, MAX_SENSOR_PIXELS)?;
        let along = |count: usize| (0..count).map(|i| ((i as f64 + 0.5) * scale) as usize);
        Ok(Self {
            width: size[0] as usize,
            height: size[1] as usize,
            columns: along(width).collect(),
            rows: along(height).collect(),
        })
    }
}

/// Moments of a field.
pub trait Moments {
    /// The standard deviation of the whole field.
    fn sd(&self) -> f64;

    /// The covariance of two pixels that are `x` columns and `y` rows apart.
    fn covariance(&self, x: usize, y: usize) -> f64;
}

impl Moments for NoiseField {
    fn sd(&self) -> f64 {
        self.covariance(0, 0).sqrt()
    }

    fn covariance(&self, x: usize, y: usize) -> f64 {
        components(self)
            .iter()
            .filter(|c| c.sd > 0.0)
            .map(|c| c.sd * c.sd * c.x.correlation(x) * c.y.correlation(y))
            .fold(0.0, |sum, part| sum + part)
    }
}

/// The components of a field in their order; theirs is also the order of the streams.
pub(crate) fn components(field: &NoiseField) -> [Component; 6] {
    use Along::{Alternating, Constant, Length};
    let component = |sd, x, y| Component { sd, x, y };
    [
        component(field.white, Length(0.0), Length(0.0)),
        component(field.correlated, Length(field.correlation_x), Length(field.correlation_y)),
        component(field.broad, Length(field.broad_x), Length(field.broad_y)),
        component(field.columns, Length(field.column_correlation), Constant),
        component(field.rows, Constant, Length(field.row_correlation)),
        component(field.row_alternation, Constant, Alternating),
    ]
}

/// The field of `seed` on the grid, row by row; what a pixel of the sensor gets does not depend on which others the
/// grid has.
pub(crate) fn sample(field: &NoiseField, grid: &SensorGrid, seed: u64) -> Vec<f64> {
    let mut values = vec![0.0; grid.columns.len() * grid.rows.len()];
    for (index, component) in components(field).iter().enumerate() {
        if component.sd > 0.0 {
            let mut stream = Stream::new(scatter(seed ^ scatter(index as u64)));
            component.add_to(&mut values, grid, &mut stream);
        }
    }
    values
}

impl Component {
    /// Adds a draw of the component.
    fn add_to(&self, field: &mut [f64], grid: &SensorGrid, stream: &mut Stream) {
        let width = grid.columns.len();
        if let (Along::Constant, Along::Alternating) = (self.x, self.y) {
            // Which of the two kinds of row is up is the draw.
            let parity = usize::from(stream.uniform() < 0.5);
            for (row, &v) in field.chunks_exact_mut(width).zip(&grid.rows) {
                let sign = if (v + parity).is_multiple_of(2) { self.sd } else { -self.sd };
                for value in row {
                    *value += sign;
                }
            }
            return;
        }
        let x = Axis::new(self.x, &grid.columns, grid.width);
        let y = Axis::new(self.y, &grid.rows, grid.height);
        // Along the rows as they are drawn, so that the sensor's whole field is never held.
        let mut drawn = vec![0.0; x.length];
        let mut smooth = vec![0.0; y.length * x.at.len()];
        for out in smooth.chunks_exact_mut(x.at.len()) {
            for value in &mut drawn {
                *value = stream.normal();
            }
            for (value, &start) in out.iter_mut().zip(&x.at) {
                *value = x.taps.iter().zip(&drawn[start..]).map(|(w, n)| w * n).sum();
            }
        }
        let (from_width, mut sums) = (x.at.len(), vec![0.0; x.at.len()]);
        for (row, v) in field.chunks_exact_mut(width).zip(0..) {
            let start = y.at[if y.constant { 0 } else { v }];
            sums.fill(0.0);
            for (w, line) in y.taps.iter().zip(smooth[start * from_width..].chunks(from_width)) {
                sums.iter_mut().zip(line).for_each(|(sum, value)| *sum += w * value);
            }
            for (u, value) in row.iter_mut().enumerate() {
                *value += self.sd * sums[if x.constant { 0 } else { u }];
            }
        }
    }
}

/// The numbers to draw along an axis, and where the kernel of each wanted pixel starts among them.
struct Axis {
    taps: Vec<f64>,
    at: Vec<usize>,
    length: usize,
    constant: bool,
}

impl Axis {
    fn new(along: Along, wanted: &[usize], side: usize) -> Self {
        let Along::Length(length) = along else {
            return Self { taps: vec![1.0], at: vec![0], length: 1, constant: true };
        };
        let taps = taps(length);
        Self { length: side + taps.len() - 1, taps, at: wanted.to_vec(), constant: false }
    }
}

/// Taps w_i ∝ exp(-i²/ℓ²), whose autocorrelation is exp(-h²/2ℓ²), with Σ w² = 1.
fn taps(length: f64) -> Vec<f64> {
    if length < SHORTEST {
        return vec![1.0];
    }
    let reach = (TRUNCATE * length * std::f64::consts::FRAC_1_SQRT_2).ceil();
    let weight = |i: f64| (-(i / length).powi(2)).exp();
    let taps: Vec<f64> = (0..=2 * reach as usize).map(|i| weight(i as f64 - reach)).collect();
    let norm = taps.iter().map(|w| w * w).sum::<f64>().sqrt();
    taps.into_iter().map(|w| w / norm).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const FULL: NoiseField = NoiseField {
        white: 0.3,
        correlated: 1.0,
        correlation_x: 3.0,
        correlation_y: 1.5,
        broad: 0.6,
        broad_x: 6.0,
        broad_y: 9.0,
        columns: 0.5,
        column_correlation: 2.0,
        rows: 0.4,
        row_correlation: 0.0,
        row_alternation: 0.7,
    };

    #[test]
    fn taps_have_the_gaussian_correlation() {
        // Taps at whole pixels are too coarse for a length of one.
        for (length, tolerance) in [(1.0, 0.02), (1.5, 2e-3), (8.5, 2e-3)] {
            for lag in 0..20 {
                let expected = (-0.5 * (lag as f64 / length).powi(2)).exp();
                let got = Along::Length(length).correlation(lag);
                assert!((got - expected).abs() < tolerance, "{length} {lag}: {got} {expected}");
            }
        }
        assert_eq!(Along::Length(0.0).correlation(0), 1.0);
        assert_eq!(Along::Length(0.0).correlation(1), 0.0);
    }

    /// Mean of products over many draws, against the closed form, at lags in both directions.
    #[test]
    fn draws_have_the_covariance() {
        let grid = SensorGrid::under(24, 20, 1.0).unwrap();
        let draws = 1500;
        let lags = [(0, 0), (1, 0), (0, 1), (3, 0), (0, 4), (2, 3), (7, 0), (0, 7)];
        let mut sums = [0.0; 8];
        for seed in 0..draws {
            let field = sample(&FULL, &grid, seed);
            for (sum, (x, y)) in sums.iter_mut().zip(lags) {
                *sum += field[5 * 24 + 6] * field[(5 + y) * 24 + 6 + x];
            }
        }
        let variance = FULL.covariance(0, 0);
        for (sum, (x, y)) in sums.iter().zip(lags) {
            let (got, expected) = (sum / draws as f64, FULL.covariance(x, y));
            // The sd of the mean of 1500 products is below sqrt(2/1500) of the variance: 4 of it.
            assert!((got - expected).abs() < 0.15 * variance, "({x}, {y}): {got} {expected}");
        }
        assert!((FULL.sd().powi(2) - variance).abs() < 1e-12);
    }

    #[test]
    fn what_a_pixel_gets_does_not_depend_on_the_others() {
        let full = SensorGrid::under(40, 32, 1.0).unwrap();
        let quarter = SensorGrid::under(10, 8, 4.0).unwrap();
        let (full, quarter) = (sample(&FULL, &full, 5), sample(&FULL, &quarter, 5));
        for (v, row) in quarter.chunks_exact(10).enumerate() {
            for (u, value) in row.iter().enumerate() {
                assert!((value - full[(4 * v + 2) * 40 + 4 * u + 2]).abs() < 1e-12);
            }
        }
        // A finer image than the sensor's shows each of its pixels several times.
        let fine = sample(&FULL, &SensorGrid::under(8, 4, 0.5).unwrap(), 5);
        assert_eq!(fine[0], fine[1]);
        assert_ne!(fine[1], fine[2]);
    }

    #[test]
    fn components_do_not_disturb_each_other() {
        let grid = SensorGrid::under(6, 5, 1.0).unwrap();
        let without = NoiseField { broad: 0.0, ..FULL };
        let alone = NoiseField { broad: 0.6, broad_x: 6.0, broad_y: 9.0, ..NoiseField::default() };
        let sum: Vec<f64> = sample(&without, &grid, 3)
            .iter()
            .zip(sample(&alone, &grid, 3))
            .map(|(a, b)| a + b)
            .collect();
        for (a, b) in sum.iter().zip(sample(&FULL, &grid, 3)) {
            assert!((a - b).abs() < 1e-12);
        }
        assert_ne!(sample(&FULL, &grid, 3), sample(&FULL, &grid, 4));
    }

    #[test]
    fn nonsense_is_refused() {
        assert!(NoiseField { white: -1.0, ..FULL }.check("noise").is_err());
        assert!(NoiseField { broad_x: f64::NAN, ..FULL }.check("noise").is_err());
        assert!(SensorGrid::under(1 << 15, 1 << 15, 8.0).is_err());
        assert!(NoiseField::default().is_none() && !FULL.is_none());
    }
}
