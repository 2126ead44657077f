//! Mixture density heads on random Fourier features, the members of an ensemble averaged.

use nalgebra::{DMatrix, DVector};

use crate::ModelError;
use crate::component::Component;
use crate::document::Config;
use crate::matrix::{Matrix, log_sum_exp};
use crate::mixture::Mixture;
use crate::tensors::Tensors;
use crate::waves::Waves;

/// Beyond this a logarithm of a factor's diagonal is cut.
const LARGEST_LOG_DIAGONAL: f64 = 12.0;

#[derive(Debug)]
struct Member {
    waves: Waves,
    linear: Matrix,
    fourier: Matrix,
    bias: Vec<f64>,
}

/// The ensemble with what comes before and after it.
#[derive(Debug)]
pub struct Network {
    axes: Matrix,
    members: Vec<Member>,
    components: usize,
    shift: Vec<f64>,
    scale: Vec<f64>,
}

impl Network {
    pub fn read(
        tensors: &Tensors,
        config: &Config,
        p: usize,
        s: usize,
    ) -> Result<Self, ModelError> {
        let axes = tensors.rows("axes_matrix", Some(s), None)?;
        let (d, m, e) = (axes.columns, config.features, config.ensemble);
        let size = config.components * (1 + p + p * (p + 1) / 2);
        let frequencies = tensors.take("frequencies", &[e, m, d])?;
        let linear = tensors.take("linear", &[e, d, size])?;
        let fourier = tensors.take("fourier", &[e, 2 * m, size])?;
        let bias = tensors.take("bias", &[e, 1, size])?;
        let part = |all: &[f64], i: usize, rows: usize, columns: usize| {
            let length = rows * columns;
            Matrix { data: all[i * length..(i + 1) * length].to_vec(), columns }
        };
        let member = |i: usize| Member {
            waves: Waves::of(&part(&frequencies, i, m, d)),
            linear: part(&linear, i, d, size),
            fourier: part(&fourier, i, 2 * m, size),
            bias: part(&bias, i, 1, size).data,
        };
        Ok(Self {
            axes,
            members: (0..e).map(member).collect(),
            components: config.components,
            shift: tensors.take("target_shift", &[p])?,
            scale: tensors.take("target_scale", &[p])?,
        })
    }

    /// The mixture over coordinates given standardised statistics.
    pub fn mixture(&self, z: &[f64]) -> Mixture {
        let x = self.axes.after(z);
        let log_members = (self.members.len() as f64).ln();
        let heads = self.members.iter().flat_map(|member| self.heads(&member.outputs(&x)));
        let components = heads
            .map(|mut component| {
                component.log_weight -= log_members;
                for i in 0..self.shift.len() {
                    component.mean[i] = self.shift[i] + self.scale[i] * component.mean[i];
                    component.factor.row_mut(i).unscale_mut(self.scale[i]);
                }
                component
            })
            .collect();
        Mixture::of(components)
    }

    fn heads(&self, outputs: &[f64]) -> Vec<Component> {
        let (k, p) = (self.components, self.shift.len());
        let entries = p * (p + 1) / 2;
        let total = log_sum_exp(outputs[..k].iter().copied());
        (0..k)
            .map(|i| {
                let mean = &outputs[k + i * p..][..p];
                let entry = &outputs[k + k * p + i * entries..][..entries];
                let mut factor = DMatrix::zeros(p, p);
                for j in 0..p {
                    factor[(j, j)] =
                        entry[j].clamp(-LARGEST_LOG_DIAGONAL, LARGEST_LOG_DIAGONAL).exp();
                }
                // Below the diagonal row by row.
                let below = (0..p).flat_map(|row| (0..row).map(move |column| (row, column)));
                for (place, value) in below.zip(&entry[p..]) {
                    factor[place] = *value;
                }
                Component {
                    log_weight: outputs[i] - total,
                    mean: DVector::from_column_slice(mean),
                    factor,
                }
            })
            .collect()
    }
}

impl Member {
    /// Weights multiply unit-size cosines and sines, in this order.
    fn outputs(&self, x: &[f64]) -> Vec<f64> {
        let mut features = vec![0.0; self.waves.size()];
        self.waves.fill(x, 1.0, &mut features);
        let (linear, fourier) = (self.linear.after(x), self.fourier.after(&features));
        (0..self.bias.len()).map(|i| linear[i] + fourier[i] + self.bias[i]).collect()
    }
}
