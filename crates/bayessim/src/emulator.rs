//! Means and scales of the leading signal axes, linear in random features of the coordinates.

use pulp::{Arch, NullaryFnOnce};

use crate::ModelError;
use crate::matrix::{Matrix, dot};
use crate::tensors::Tensors;
use crate::waves::Waves;

/// Prior standard deviation of constant and slopes over that of the random features' sum.
const POLYNOMIAL: f64 = 3.0;

/// Polynomial and random Fourier features of coordinates that are standardised already.
#[derive(Clone, Debug)]
struct Basis {
    inputs: usize,
    waves: Waves,
    wave_size: f64,
    is_quadratic: bool,
}

impl Basis {
    fn of(frequencies: &Matrix, is_quadratic: bool) -> Self {
        let wave_size = (frequencies.rows() as f64).powf(-0.5);
        Self { inputs: frequencies.columns, waves: Waves::of(frequencies), wave_size, is_quadratic }
    }

    fn size(&self) -> usize {
        let p = self.inputs;
        let quadratic = if self.is_quadratic { p * (p + 1) / 2 } else { 0 };
        1 + p + quadratic + self.waves.size()
    }

    #[inline(always)]
    fn fill(&self, v: &[f64], features: &mut Vec<f64>) {
        features.clear();
        features.push(POLYNOMIAL);
        features.extend(v.iter().map(|v| POLYNOMIAL * v));
        if self.is_quadratic {
            for i in 0..v.len() {
                features.extend(v[i..].iter().map(|other| POLYNOMIAL * v[i] * other));
            }
        }
        let polynomial = features.len();
        features.resize(polynomial + self.waves.size(), 0.0);
        self.waves.fill(v, self.wave_size, &mut features[polynomial..]);
    }
}

/// What is expected at one point, axis by axis.
#[derive(Clone, Copy, Debug)]
pub struct Prediction<'a> {
    pub means: &'a [f64],
    /// Variance of what the emulator leaves of one pour.
    pub noise: &'a [f64],
    /// Variance of the means themselves.
    pub unknown: &'a [f64],
}

impl<'a> Prediction<'a> {
    /// Of the three one after the other.
    pub fn of(row: &'a [f64]) -> Self {
        let axes = row.len() / 3;
        let (means, variances) = row.split_at(axes);
        let (noise, unknown) = variances.split_at(axes);
        Self { means, noise, unknown }
    }
}

/// Room for the numbers on the way to a prediction, used again for the next.
#[derive(Default)]
pub struct Workings {
    coordinates: Vec<f64>,
    features: Vec<f64>,
}

/// Emulator of r axes.
#[derive(Clone, Debug)]
pub struct Emulator {
    centre: Vec<f64>,
    scale: Vec<f64>,
    basis: Basis,
    coefficients: Matrix,
    scale_basis: Basis,
    scale_coefficients: Matrix,
    unknown_coefficients: Matrix,
    shift: Vec<f64>,
    spread: Vec<f64>,
}

impl Emulator {
    /// The first `axes` of `s` axes over `p` coordinates.
    pub fn read(
        tensors: &Tensors<'_>,
        p: usize,
        s: usize,
        features: Option<usize>,
        axes: usize,
    ) -> Result<Self, ModelError> {
        let centre = tensors.take("emulator_centre", &[p])?;
        let scale = tensors.take("emulator_scale", &[p])?;
        let basis = Basis::of(&tensors.rows("emulator_frequencies", features, Some(p))?, false);
        let frequencies = tensors.rows("emulator_scale_frequencies", None, Some(p))?;
        let scale_basis = Basis::of(&frequencies, true);
        let first = |name: &str, columns: usize| -> Result<Matrix, ModelError> {
            Ok(tensors.matrix(name, s, columns)?.first(axes))
        };
        let leading = |name: &str| -> Result<Vec<f64>, ModelError> {
            let mut all = tensors.take(name, &[s])?;
            all.truncate(axes);
            Ok(all)
        };
        Ok(Self {
            centre,
            scale,
            coefficients: first("emulator_coefficients", basis.size())?,
            scale_coefficients: first("emulator_scale_coefficients", scale_basis.size())?,
            unknown_coefficients: first("emulator_unknown_coefficients", scale_basis.size())?,
            shift: leading("emulator_y_shift")?,
            spread: leading("emulator_y_spread")?,
            basis,
            scale_basis,
        })
    }

    pub fn axis_count(&self) -> usize {
        self.shift.len()
    }

    /// What is expected at coordinates: means, noise, unknown, which fill `row`.
    pub fn predict(&self, u: &[f64], workings: &mut Workings, row: &mut [f64]) {
        Arch::new().dispatch(Predict { emulator: self, u, workings, row });
    }
}

/// A closure would not be compiled for wide registers.
struct Predict<'a> {
    emulator: &'a Emulator,
    u: &'a [f64],
    workings: &'a mut Workings,
    row: &'a mut [f64],
}

impl NullaryFnOnce for Predict<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { emulator, u, workings, row } = self;
        let Workings { coordinates: v, features } = workings;
        v.clear();
        v.extend(
            u.iter().zip(&emulator.centre).zip(&emulator.scale).map(|((u, c), s)| (u - c) / s),
        );
        let (means, variances) = row.split_at_mut(emulator.axis_count());
        let (noise, unknown) = variances.split_at_mut(emulator.axis_count());
        emulator.basis.fill(v, features);
        for (j, mean) in means.iter_mut().enumerate() {
            let sum = dot(emulator.coefficients.row(j), features);
            *mean = emulator.shift[j] + emulator.spread[j] * sum;
        }
        emulator.scale_basis.fill(v, features);
        let tables = [&emulator.scale_coefficients, &emulator.unknown_coefficients];
        for (coefficients, variances) in tables.into_iter().zip([noise, unknown]) {
            for (j, variance) in variances.iter_mut().enumerate() {
                let scale = emulator.spread[j] * dot(coefficients.row(j), features).exp();
                *variance = scale * scale;
            }
        }
    }
}
