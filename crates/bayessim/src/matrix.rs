//! A matrix as rows, which is how tensors lie in a file.

/// Row-major numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Matrix {
    /// Entries, row by row.
    pub data: Vec<f64>,
    /// Length of a row.
    pub columns: usize,
}

impl Matrix {
    pub fn rows(&self) -> usize {
        self.data.len().checked_div(self.columns).unwrap_or(0)
    }

    pub fn row(&self, i: usize) -> &[f64] {
        &self.data[i * self.columns..(i + 1) * self.columns]
    }

    /// The first rows only.
    pub fn first(&self, rows: usize) -> Self {
        Self { data: self.data[..rows * self.columns].to_vec(), columns: self.columns }
    }

    /// x M for a row vector x, one entry for each column.
    pub fn after(&self, x: &[f64]) -> Vec<f64> {
        let mut result = vec![0.0; self.columns];
        for (value, row) in x.iter().zip(self.data.chunks_exact(self.columns)) {
            for (sum, entry) in result.iter_mut().zip(row) {
                *sum += value * entry;
            }
        }
        result
    }
}

/// Sum of products; four sums side by side, so that the compiler may use wide registers.
#[inline(always)]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (fours, others) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = fours.remainder().iter().zip(others.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in fours.zip(others) {
        for lane in 0..4 {
            sums[lane] += x[lane] * y[lane];
        }
    }
    sums.iter().sum::<f64>() + rest
}

/// log of the sum of exponentials; minus infinity for nothing.
pub fn log_sum_exp(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let largest = values.clone().fold(f64::NEG_INFINITY, f64::max);
    if largest == f64::NEG_INFINITY {
        return largest;
    }
    largest + values.map(|value| (value - largest).exp()).sum::<f64>().ln()
}

/// Solves L x = b for a lower triangular L.
pub fn solve_lower(lower: &Matrix, b: &[f64]) -> Vec<f64> {
    let mut x = vec![0.0; b.len()];
    for i in 0..b.len() {
        let row = lower.row(i);
        x[i] = (b[i] - dot(&row[..i], &x[..i])) / row[i];
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_and_sums() {
        let lower = Matrix { data: vec![2.0, 0.0, 1.0, 4.0], columns: 2 };
        assert_eq!(solve_lower(&lower, &[4.0, 10.0]), [2.0, 2.0]);
        assert_eq!(lower.after(&[1.0, 2.0]), [4.0, 8.0]);
        let numbers: Vec<_> = (0..7).map(f64::from).collect();
        assert_eq!(dot(&numbers, &numbers), 91.0);
        let sum = log_sum_exp([1000.0, 1000.0].into_iter());
        assert!((sum - 1000.0 - 2f64.ln()).abs() < 1e-12);
        assert_eq!(log_sum_exp(std::iter::empty()), f64::NEG_INFINITY);
    }
}
