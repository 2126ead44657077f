//! Distance correlation of radius and height.
//!
//! With \\( a_{ij} = |r_i - r_j| \\), \\( b_{ij} = |z_i - z_j| \\) and a dot for a sum over an index,
//!
//! \\[ \mathrm{dCov}^2 = \frac{1}{n^2} \sum_{ij} a_{ij} b_{ij} - \frac{2}{n^3} \sum_i a_{i\cdot} b_{i\cdot} +
//! \frac{1}{n^4} a_{\cdot\cdot} b_{\cdot\cdot}, \qquad
//! \mathrm{dCor} = \sqrt{\frac{\mathrm{dCov}^2(r,z)}{\sqrt{\mathrm{dCov}^2(r,r) \mathrm{dCov}^2(z,z)}}} \\]
//!
//! In [0, 1], the biased form (a V-statistic), as `dcor.distance_correlation`. 0 when r or z is
//! constant, as in `dcor`. Computed in O(n log n): the row sums from sorted values, the double sum
//! by a merge sort that keeps the sums of what it has already emitted.
//!
//! Source: the paper, Summary Statistic Extraction; Székely, Rizzo & Bakirov 2007,
//! doi:10.1214/009053607000000505; fast form: Chaudhuri & Hu 2019, doi:10.1016/j.csda.2019.01.016.

use super::prepared::{is_constant, mean};
use super::{Behaviour, Statistic};

/// Distance correlation between the distance from the centroid and the height.
pub const DCOR_R_Z: Statistic = Statistic {
    name: "dcor_r_z",
    unit: "-",
    doc: "distance correlation of horizontal distance from the centroid and height",
    behaviour: Behaviour::NUMBER,
    value: |points| distance_correlation(points.r(), points.z()),
};

/// One pair of values and the sum of the distances of its x from all others.
#[derive(Debug, Clone, Copy, Default)]
struct Pair {
    x: f64,
    y: f64,
    x_row: f64,
}

/// Distance correlation of paired values; 0 when either is constant.
fn distance_correlation(x: &[f64], y: &[f64]) -> f64 {
    if is_constant(x) || is_constant(y) {
        return 0.0;
    }
    let mut pairs: Vec<Pair> =
        normalised(x).zip(normalised(y)).map(|(x, y)| Pair { x, y, x_row: 0.0 }).collect();
    pairs.sort_unstable_by(|a, b| a.x.total_cmp(&b.x));
    let x_rows = row_sums(&pairs, |pair| pair.x);
    for (pair, row) in pairs.iter_mut().zip(&x_rows) {
        pair.x_row = *row;
    }
    let xy_products = sum_of_products(&mut pairs);
    let y_rows = row_sums(&pairs, |pair| pair.y);
    let x_rows: Vec<f64> = pairs.iter().map(|pair| pair.x_row).collect();

    let covariance = distance_covariance_sq(xy_products, &x_rows, &y_rows);
    let x_variance = distance_covariance_sq(sum_of_squares(&pairs, |p| p.x), &x_rows, &x_rows);
    let y_variance = distance_covariance_sq(sum_of_squares(&pairs, |p| p.y), &y_rows, &y_rows);
    let scale = (x_variance * y_variance).sqrt();
    // Rounding can leave a covariance of 0 slightly negative, or a correlation of 1 slightly above.
    if scale > 0.0 { (covariance.max(0.0) / scale).sqrt().min(1.0) } else { 0.0 }
}

/// Values from their mean, in units of the largest deviation: sums then neither cancel nor overflow.
fn normalised(values: &[f64]) -> impl Iterator<Item = f64> {
    let middle = mean(values);
    let reach = values.iter().map(|v| (v - middle).abs()).fold(0.0, f64::max);
    values.iter().map(move |v| (v - middle) / reach)
}

/// dCov² from \\( \sum_{ij} a_{ij} b_{ij} \\) and the row sums of both distance matrices.
fn distance_covariance_sq(products: f64, a_rows: &[f64], b_rows: &[f64]) -> f64 {
    let n = a_rows.len() as f64;
    let (a_mean, b_mean) = (mean(a_rows), mean(b_rows));
    // The row sums' own covariance, so that the large parts of the last two terms cancel on paper.
    let rows: f64 = a_rows.iter().zip(b_rows).map(|(a, b)| (a - a_mean) * (b - b_mean)).sum();
    (products - 2.0 / n * rows - a_mean * b_mean) / (n * n)
}

/// \\( \sum_j |v_i - v_j| \\) for pairs sorted by v.
fn row_sums(sorted: &[Pair], value: fn(&Pair) -> f64) -> Vec<f64> {
    let n = sorted.len() as f64;
    let total: f64 = sorted.iter().map(value).sum();
    let mut before = 0.0;
    let mut rows = Vec::with_capacity(sorted.len());
    for (rank, pair) in sorted.iter().enumerate() {
        let v = value(pair);
        rows.push(v * (2.0 * rank as f64 - n) + total - 2.0 * before);
        before += v;
    }
    rows
}

/// \\( \sum_{ij} (v_i - v_j)^2 = 2 n \sum v^2 - 2 (\sum v)^2 \\).
fn sum_of_squares(pairs: &[Pair], value: fn(&Pair) -> f64) -> f64 {
    let (mut sum, mut squares) = (0.0, 0.0);
    for v in pairs.iter().map(value) {
        sum += v;
        squares += v * v;
    }
    2.0 * (pairs.len() as f64 * squares - sum * sum)
}

/// \\( \sum_{ij} |x_i - x_j| |y_i - y_j| \\) for pairs sorted by x; leaves them sorted by y.
///
/// Over i before j in x, the product with the sign of y_j - y_i differs from the one without sign
/// only where y falls: the sum is twice that over rising pairs, less the signed sum over all.
fn sum_of_products(pairs: &mut Vec<Pair>) -> f64 {
    let n = pairs.len();
    let (mut x_sum, mut y_sum, mut xy_sum) = (0.0, 0.0, 0.0);
    for pair in pairs.iter() {
        x_sum += pair.x;
        y_sum += pair.y;
        xy_sum += pair.x * pair.y;
    }
    let signed = n as f64 * xy_sum - x_sum * y_sum;

    let mut rising = 0.0;
    let mut merged = vec![Pair::default(); n];
    let mut width = 1;
    while width < n {
        for (from, to) in pairs.chunks(2 * width).zip(merged.chunks_mut(2 * width)) {
            let (left, right) = from.split_at(width.min(from.len()));
            rising += merge(left, right, to);
        }
        std::mem::swap(pairs, &mut merged);
        width *= 2;
    }
    2.0 * (2.0 * rising - signed)
}

/// Merges two runs sorted by y and returns \\( \sum (x_j - x_i)(y_j - y_i) \\) over i in the left
/// run, j in the right one, with y_i ≤ y_j.
fn merge(left: &[Pair], right: &[Pair], to: &mut [Pair]) -> f64 {
    let (mut x_sum, mut y_sum, mut xy_sum) = (0.0, 0.0, 0.0);
    let mut rising = 0.0;
    let (mut i, mut j) = (0, 0);
    for slot in to {
        let take_left = j == right.len() || (i < left.len() && left[i].y <= right[j].y);
        if take_left {
            let pair = left[i];
            x_sum += pair.x;
            y_sum += pair.y;
            xy_sum += pair.x * pair.y;
            i += 1;
            *slot = pair;
        } else {
            let pair = right[j];
            rising += pair.x * (i as f64 * pair.y - y_sum) - (pair.y * x_sum - xy_sum);
            j += 1;
            *slot = pair;
        }
    }
    rising
}

#[cfg(test)]
mod tests;
