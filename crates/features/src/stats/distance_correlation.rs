//! Distance correlation of radius and height.
//!
//! With \\( a_{ij} = |r_i - r_j| \\), \\( b_{ij} = |z_i - z_j| \\) and a dot for a sum over an index,
//!
//! \\[ \mathrm{dCov}^2 = \frac{1}{n^2} \sum_{ij} a_{ij} b_{ij} - \frac{2}{n^3} \sum_i a_{i\cdot} b_{i\cdot} +
//! \frac{1}{n^4} a_{\cdot\cdot} b_{\cdot\cdot}, \qquad
//! \mathrm{dCor} = \sqrt{\frac{\mathrm{dCov}^2(r,z)}{\sqrt{\mathrm{dCov}^2(r,r) \mathrm{dCov}^2(z,z)}}} \\]
//!
//! In [0, 1], the biased form (a V-statistic), as `dcor.distance_correlation`. 0 when r or z is
//! constant, as in `dcor`. Computed in O(n log n): the row sums from sorted values, the double sum by
//! `rising`. `docs/theory/statistics.md` derives it and counts what it costs.
//!
//! Source: the paper, Summary Statistic Extraction; Székely, Rizzo & Bakirov 2007,
//! doi:10.1214/009053607000000505; fast form after Chaudhuri & Hu 2019, doi:10.1016/j.csda.2019.01.016.

mod rising;

use super::prepared::{Ranked, ranking};
use super::sum::{is_constant, sum};
use super::{Behaviour, Prepared, Statistic};
use rising::rising;

/// Distance correlation between the distance from the centroid and the height.
pub const DCOR_R_Z: Statistic = Statistic {
    name: "dcor_r_z",
    unit: "-",
    doc: "distance correlation of horizontal distance from the centroid and height",
    behaviour: Behaviour::NUMBER,
    value: of_radius_and_height,
};

fn of_radius_and_height(points: &Prepared) -> f64 {
    if is_constant(points.r()) || is_constant(points.z()) {
        return 0.0;
    }
    distance_correlation(points.r_ranking(), &ranking(points.z()))
}

/// Distance correlation of two variables that are not constant, each given in ascending order.
fn distance_correlation(x: &[Ranked], y: &[Ranked]) -> f64 {
    let n = x.len() as f64;
    let mut rank_in_y = vec![0; y.len()];
    for (rank, of_y) in (0..).zip(y) {
        rank_in_y[of_y.point as usize] = rank;
    }
    let ranks: Vec<u32> = x.iter().map(|of_x| rank_in_y[of_x.point as usize]).collect();
    let (x, y) = (normalised(x), normalised(y));

    // Row sums, counted from their mean so that the large parts of the last two terms of dCov² cancel
    // on paper.
    let mut y_rows = Vec::with_capacity(y.len());
    let y_mean = for_each_row_sum(&y, |row| y_rows.push(row));
    let mut place = 0;
    let (mut xx, mut xy, mut signed) = (0.0, 0.0, 0.0);
    let x_mean = for_each_row_sum(&x, |x_row| {
        let rank = ranks[place] as usize;
        xx += x_row * x_row;
        xy += x_row * y_rows[rank];
        signed += x[place] * y[rank];
        place += 1;
    });
    let yy = sum(&y_rows, |row| row * row);
    // Σ_{i<j} (x_j - x_i)(y_j - y_i) = n Σ x y - Σ x Σ y.
    signed = n * signed - sum(&x, |v| *v) * sum(&y, |v| *v);
    let xy_products = 2.0 * (2.0 * rising(&x, &y, &ranks) - signed);

    let covariance = xy_products - 2.0 / n * xy - x_mean * y_mean;
    let x_variance = sum_of_squares(&x) - 2.0 / n * xx - x_mean * x_mean;
    let y_variance = sum_of_squares(&y) - 2.0 / n * yy - y_mean * y_mean;
    let scale = (x_variance * y_variance).sqrt();
    // Rounding can leave a covariance of 0 slightly negative, or a correlation of 1 slightly above.
    if scale > 0.0 { (covariance.max(0.0) / scale).sqrt().min(1.0) } else { 0.0 }
}

/// Values from their mean, in units of the largest deviation: sums then neither cancel nor overflow.
fn normalised(ranking: &[Ranked]) -> Vec<f64> {
    let (Some(first), Some(last)) = (ranking.first(), ranking.last()) else { return Vec::new() };
    let middle = first.value + sum(ranking, |v| v.value - first.value) / ranking.len() as f64;
    let reach = f64::max(last.value - middle, middle - first.value);
    ranking.iter().map(|v| (v.value - middle) / reach).collect()
}

/// Calls `with` for \\( \sum_j |v_i - v_j| \\) less its mean over i, i = 0, 1, ..., and returns the mean.
fn for_each_row_sum(sorted: &[f64], mut with: impl FnMut(f64)) -> f64 {
    let n = sorted.len() as f64;
    let total = sum(sorted, |v| *v);
    // Each v_i is the larger of i pairs and the smaller of n - 1 - i.
    let (mut mean, mut balance) = (0.0, 1.0 - n);
    for v in sorted {
        mean += balance * v;
        balance += 2.0;
    }
    mean *= 2.0 / n;
    let (mut before, mut below) = (0.0, -n);
    for v in sorted {
        with(v * below + total - 2.0 * before - mean);
        before += v;
        below += 2.0;
    }
    mean
}

/// \\( \sum_{ij} (v_i - v_j)^2 = 2 n \sum v^2 - 2 (\sum v)^2 \\).
fn sum_of_squares(values: &[f64]) -> f64 {
    let (total, squares) = (sum(values, |v| *v), sum(values, |v| v * v));
    2.0 * (values.len() as f64 * squares - total * total)
}

#[cfg(test)]
mod tests;
