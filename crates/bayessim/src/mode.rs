//! The parameters of highest density in coordinates: climbed to from the best draws with random steps that shrink.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::coordinates::Coordinates;
use crate::random::Random;

const STARTS: usize = 4;
const ROUNDS: usize = 40;
const TRIES: usize = 32;
const FIRST_STEP: f64 = 0.5;
const SHRINK: f64 = 0.85;

/// The coordinates of the highest `log_density`, from draws of coordinates; always the same.
pub fn climb(
    coordinates: &Coordinates,
    log_density: impl Fn(&[f64]) -> f64 + Sync,
    draws: &[Vec<f64>],
) -> Vec<f64> {
    let p = coordinates.dimension();
    let height = |u: &Vec<f64>| log_density(u);
    let heights: Vec<f64> = draws.par_iter().map(height).collect();
    let mut order: Vec<_> = (0..draws.len()).collect();
    order.sort_by(|&a, &b| heights[b].total_cmp(&heights[a]));
    let mut points: Vec<_> =
        order[..STARTS.min(order.len())].iter().map(|&i| (draws[i].clone(), heights[i])).collect();
    let root = root(draws, p);
    let mut random = Random::new(0);
    let mut step = FIRST_STEP;
    for _ in 0..ROUNDS {
        for (point, best) in &mut points {
            let tries: Vec<_> = (0..TRIES)
                .map(|_| {
                    let normal = DVector::from_fn(p, |_, _| random.normal());
                    let along = &root * normal * step;
                    let moved = point.iter().zip(along.iter()).map(|(u, along)| u + along);
                    coordinates.clipped(moved)
                })
                .collect();
            let tried: Vec<f64> = tries.par_iter().map(height).collect();
            for (u, height) in tries.into_iter().zip(tried) {
                if height > *best {
                    (*point, *best) = (u, height);
                }
            }
        }
        step *= SHRINK;
    }
    let best = points.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
    best.map_or_else(|| draws[0].clone(), |(point, _)| point)
}

/// Lower triangular root of the draws' covariance.
fn root(draws: &[Vec<f64>], p: usize) -> DMatrix<f64> {
    let count = draws.len() as f64;
    let mean: Vec<_> = (0..p).map(|i| draws.iter().map(|u| u[i]).sum::<f64>() / count).collect();
    let mut covariance = DMatrix::from_fn(p, p, |i, j| {
        draws.iter().map(|u| (u[i] - mean[i]) * (u[j] - mean[j])).sum::<f64>() / count
    });
    for i in 0..p {
        covariance[(i, i)] += 1e-18;
    }
    let spread = DMatrix::from_diagonal(&covariance.diagonal().map(f64::sqrt));
    covariance.cholesky().map_or(spread, nalgebra::Cholesky::unpack)
}
