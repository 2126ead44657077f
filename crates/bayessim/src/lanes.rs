//! A mixture's components side by side, four in a register: a posterior asks them 100,000 times.

use pulp::{Arch, NullaryFnOnce};

use crate::component::Component;

const WIDTH: usize = 4;
/// Parts that much below the largest do not change the last bit of a sum of fewer than a thousand `[nat]`.
const NEGLIGIBLE: f64 = 44.0;

/// One number of four components.
type Four = [f64; WIDTH];

/// For each four components their constants, the means, and the factors column by column.
#[derive(Clone, Debug)]
pub struct Lanes {
    dimension: usize,
    table: Vec<Four>,
}

impl Lanes {
    /// Of components and the parts of their log densities that do not depend on where.
    pub fn of(components: &[Component], constants: &[f64]) -> Self {
        let dimension = components.first().map_or(0, |component| component.mean.len());
        let mut table = Vec::new();
        for (four, constants) in components.chunks(WIDTH).zip(constants.chunks(WIDTH)) {
            // What is missing of the last four weighs nothing.
            let gather = |of: &dyn Fn(&Component) -> f64| {
                let mut lanes = [0.0; WIDTH];
                lanes.iter_mut().zip(four).for_each(|(lane, component)| *lane = of(component));
                lanes
            };
            let mut first = [f64::NEG_INFINITY; WIDTH];
            first[..constants.len()].copy_from_slice(constants);
            table.push(first);
            table.extend((0..dimension).map(|i| gather(&|component| component.mean[i])));
            for j in 0..dimension {
                table.extend((j..dimension).map(|i| gather(&|component| component.factor[(i, j)])));
            }
        }
        Self { dimension, table }
    }

    /// Log of the sum of all densities at `u`.
    pub fn log_sum(&self, u: &[f64]) -> f64 {
        Arch::new().dispatch(LogSum { lanes: self, u })
    }
}

/// A closure would not be compiled for wide registers.
struct LogSum<'a> {
    lanes: &'a Lanes,
    u: &'a [f64],
}

impl NullaryFnOnce for LogSum<'_> {
    type Output = f64;

    #[inline(always)]
    fn call(self) -> f64 {
        let Self { lanes, u } = self;
        let p = lanes.dimension;
        let (mut largest, mut sum) = (f64::NEG_INFINITY, 0.0);
        for four in lanes.table.chunks_exact(1 + p + p * (p + 1) / 2) {
            let (means, factors) = four[1..].split_at(p);
            let squares = squares(u, means, factors);
            let mut values = four[0];
            for lane in 0..WIDTH {
                values[lane] -= 0.5 * squares[lane];
            }
            let top = values.into_iter().fold(f64::NEG_INFINITY, f64::max);
            if top > largest {
                sum *= (largest - top).exp();
                largest = top;
            }
            for value in values {
                if value > largest - NEGLIGIBLE {
                    sum += (value - largest).exp();
                }
            }
        }
        largest + sum.ln()
    }
}

/// Squared lengths of `F^T (u - m)`.
#[inline(always)]
fn squares(u: &[f64], means: &[Four], factors: &[Four]) -> Four {
    let (mut total, mut rest) = ([0.0; WIDTH], factors);
    for j in 0..u.len() {
        let (column, others) = rest.split_at(u.len() - j);
        let mut white = [0.0; WIDTH];
        for ((&u, mean), entry) in u[j..].iter().zip(&means[j..]).zip(column) {
            for lane in 0..WIDTH {
                white[lane] += (u - mean[lane]) * entry[lane];
            }
        }
        for lane in 0..WIDTH {
            total[lane] += white[lane] * white[lane];
        }
        rest = others;
    }
    total
}
