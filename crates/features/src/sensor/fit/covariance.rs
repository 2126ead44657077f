//! Covariances of residuals along rows and columns: equations (7) and (8) of `docs/theory/sensor.md`.

use serde::Serialize;

use super::flat::Patch;

/// Frames further apart than this are not paired: pairs nearby already tell what frames share.
const PAIRED: usize = 4;
/// Correlation with the first frame below which a shift is not believed.
const LEAST_LIKENESS: f64 = 0.3;

/// Covariances at lags 0, 1, 2, … `[px]`, in squares of the sensor's unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Covariances {
    /// Along the rows.
    pub x: Vec<f64>,
    /// Along the columns.
    pub y: Vec<f64>,
}

/// What is new in every frame, and what all frames share.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Split {
    /// Of the noise.
    pub noise: Covariances,
    /// Of the fixed pattern.
    pub fixed_pattern: Covariances,
}

impl Covariances {
    pub(super) fn zeros(max_lag: usize) -> Self {
        Self { x: vec![0.0; max_lag + 1], y: vec![0.0; max_lag + 1] }
    }

    /// The variance: the covariance at lag 0.
    pub fn variance(&self) -> f64 {
        self.x.first().copied().unwrap_or(0.0)
    }

    /// Takes a white part off the variance.
    pub(super) fn reduce_variance(&mut self, white: f64) {
        for values in [&mut self.x, &mut self.y] {
            if let Some(variance) = values.first_mut() {
                *variance -= white;
            }
        }
    }

    /// Applies `change` to each value and its partner in `other`.
    pub(super) fn combine(&mut self, other: &Self, change: impl Fn(f64, f64) -> f64) {
        for (own, other) in [(&mut self.x, &other.x), (&mut self.y, &other.y)] {
            own.iter_mut().zip(other).for_each(|(a, &b)| *a = change(*a, b));
        }
    }
}

impl Split {
    pub(super) fn zeros(max_lag: usize) -> Self {
        let zeros = Covariances::zeros(max_lag);
        Self { noise: zeros.clone(), fixed_pattern: zeros }
    }

    /// Covariances of a single frame.
    pub fn total(&self) -> Covariances {
        let mut total = self.noise.clone();
        total.combine(&self.fixed_pattern, |a, b| a + b);
        total
    }

    pub(super) fn combine(&mut self, other: &Self, change: impl Fn(f64, f64) -> f64 + Copy) {
        self.noise.combine(&other.noise, change);
        self.fixed_pattern.combine(&other.fixed_pattern, change);
    }
}

/// Sum and number of the products of `a` at u and `b` at u + (x, y).
fn products(a: &Patch, b: &Patch, x: isize, y: isize) -> (f64, f64) {
    let first = |lag: isize| (-lag).max(0) as usize;
    let end = |side: usize, lag: isize| (side as isize - lag.max(0)).max(0) as usize;
    let (left, right) = (first(x), end(a.width, x));
    if left >= right {
        return (0.0, 0.0);
    }
    let (mut sum, mut count) = (0.0, 0.0);
    for row in first(y)..end(a.height, y) {
        let from = row * a.width;
        let to = (row as isize + y) as usize * b.width;
        let shifted = |u: usize| to + (u as isize + x) as usize;
        let (ra, ma) = (&a.residual[from + left..from + right], &a.mask[from + left..from + right]);
        let range = shifted(left)..shifted(left) + (right - left);
        let (rb, mb) = (&b.residual[range.clone()], &b.mask[range]);
        sum += dot(ra, rb);
        count += dot(ma, mb);
    }
    (sum, count)
}

/// The sum of products in four lanes, in an order that does not depend on the machine.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0; 4];
    let (a4, a_rest) = a.as_chunks::<4>();
    let (b4, b_rest) = b.as_chunks::<4>();
    for (a, b) in a4.iter().zip(b4) {
        for i in 0..4 {
            lanes[i] += a[i] * b[i];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    (lanes[0] + lanes[2]) + (lanes[1] + lanes[3]) + rest
}

/// Covariances of frames. `frames[k][r]` is region r of frame k, `shifts[k]` where frame k was cut.
pub(super) fn split(frames: &[Vec<Patch>], shifts: &[(isize, isize)], max_lag: usize) -> Split {
    let mean = |pairs: &[(usize, usize)], x: usize, y: usize| {
        let (mut sum, mut count) = (0.0, 0.0);
        for &(k, l) in pairs {
            let x = x as isize + shifts[l].0 - shifts[k].0;
            let y = y as isize + shifts[l].1 - shifts[k].1;
            for (a, b) in frames[k].iter().zip(&frames[l]) {
                let (s, n) = products(a, b, x, y);
                sum += s;
                count += n;
            }
        }
        if count > 0.0 { sum / count } else { 0.0 }
    };
    let covariances = |pairs: &[(usize, usize)]| Covariances {
        x: (0..=max_lag).map(|lag| mean(pairs, lag, 0)).collect(),
        y: (0..=max_lag).map(|lag| mean(pairs, 0, lag)).collect(),
    };
    let count = frames.len();
    let own: Vec<_> = (0..count).map(|k| (k, k)).collect();
    let pairs: Vec<_> = (0..count)
        .flat_map(|k| (k + 1..count.min(k + 1 + PAIRED)).flat_map(move |l| [(k, l), (l, k)]))
        .collect();
    let mut noise = covariances(&own);
    let fixed_pattern =
        if pairs.is_empty() { Covariances::zeros(max_lag) } else { covariances(&pairs) };
    noise.combine(&fixed_pattern, |total, fixed| total - fixed);
    Split { noise, fixed_pattern }
}

/// Where each frame was cut relative to the first: the shift, at most `max_shift` pixels, at which it
/// is most like the first.
pub(super) fn shifts(frames: &[Vec<Patch>], max_shift: usize) -> Vec<(isize, isize)> {
    let reach = max_shift as isize;
    let alike = |k: usize, x: isize, y: isize| {
        let pool = |other: usize, x: isize, y: isize| {
            let pairs = frames[0].iter().zip(&frames[other]);
            let (sum, count) = pairs
                .map(|(a, b)| products(a, b, x, y))
                .fold((0.0, 0.0), |(s, n), (a, b)| (s + a, n + b));
            sum / f64::max(count, 1.0)
        };
        pool(k, x, y)
    };
    let variance = |k: usize| {
        let own = frames[k].iter().map(|patch| products(patch, patch, 0, 0));
        let (sum, count) = own.fold((0.0, 0.0), |(s, n), (a, b)| (s + a, n + b));
        sum / f64::max(count, 1.0)
    };
    (0..frames.len())
        .map(|k| {
            if k == 0 || reach == 0 {
                return (0, 0);
            }
            let scale = (variance(0) * variance(k)).sqrt();
            let (mut best, mut likeness) = ((0, 0), LEAST_LIKENESS * scale);
            for y in -reach..=reach {
                for x in -reach..=reach {
                    let got = alike(k, x, y);
                    if got > likeness {
                        (best, likeness) = ((x, y), got);
                    }
                }
            }
            best
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::flat::detrend;
    use super::*;

    fn patch(values: &[f64], width: usize) -> Patch {
        let mut patch = detrend(values, width, 0, |v, t| v - t).unwrap();
        // The bare values, so that the sums are exact.
        patch.residual = values.iter().map(|v| if v.is_nan() { 0.0 } else { *v }).collect();
        patch.mask = values.iter().map(|v| f64::from(u8::from(!v.is_nan()))).collect();
        patch
    }

    #[test]
    fn products_are_those_of_the_double_sum() {
        let value = |i: usize| if i % 7 == 3 { f64::NAN } else { ((i * i) % 11) as f64 };
        let a = patch(&(0..60).map(value).collect::<Vec<_>>(), 10);
        let b = patch(&(0..60).map(|i| value(i + 5)).collect::<Vec<_>>(), 10);
        for (x, y) in [(0, 0), (2, 0), (0, 3), (-3, 1), (4, -2), (-9, -5), (10, 0)] {
            let (mut sum, mut count) = (0.0, 0.0);
            for v in 0..6_isize {
                for u in 0..10_isize {
                    let (p, q) = (u + x, v + y);
                    if (0..10).contains(&p) && (0..6).contains(&q) {
                        let (i, j) = ((v * 10 + u) as usize, (q * 10 + p) as usize);
                        sum += a.residual[i] * b.residual[j];
                        count += a.mask[i] * b.mask[j];
                    }
                }
            }
            assert_eq!(products(&a, &b, x, y), (sum, count), "({x}, {y})");
        }
    }

    #[test]
    fn shifts_are_found() {
        let pattern = |u: usize, v: usize| f64::sin((u * u + 3 * u * v + 7 * v) as f64);
        let cut = |x: usize, y: usize| {
            let values: Vec<_> = (0..900).map(|i| pattern(i % 30 + x, i / 30 + y)).collect();
            vec![patch(&values, 30)]
        };
        let frames = [cut(5, 5), cut(3, 5), cut(5, 8), cut(5, 5)];
        assert_eq!(shifts(&frames, 4), [(0, 0), (2, 0), (0, -3), (0, 0)]);
        assert_eq!(shifts(&frames, 0), [(0, 0); 4]);
        // Shifted back onto each other the frames share everything.
        let found = split(&frames, &shifts(&frames, 4), 3);
        assert!(found.noise.variance().abs() < 0.05 * found.fixed_pattern.variance());
    }
}
