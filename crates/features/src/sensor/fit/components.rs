//! Covariances as a sum of a field's components: linear in the variances, searched in the lengths.

use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

use nalgebra::{SMatrix, SVector};

use super::covariance::Covariances;
use super::expected::{AxisResponse, axes, sums_along};
use crate::sensor::NoiseField;
use crate::sensor::field::Along;

/// Components of a field.
const COMPONENTS: usize = 6;
/// Lengths that are searched: of `correlated` along x and y, of `broad`, of `columns` and `rows`.
const LENGTHS: usize = 6;
/// Shortest length that is tried `[px]`; what is shorter is white.
const SHORTEST: f64 = 0.8;
/// First of the lengths of columns and rows, which may also be 0: each of its own.
const FIRST_STRIPE: usize = 4;
/// Lengths on the first grid.
const GRID: usize = 24;
/// Steps on either side in the refinement, and the ratio of neighbours.
const FINE_STEPS: i32 = 4;
const FINE_RATIO: f64 = 1.03;
/// Sweeps over all lengths.
const MAX_SWEEPS: usize = 8;
/// Relative improvement below which a sweep has not improved anything.
const SETTLED: f64 = 1e-4;
/// Lag `[px]` at which a covariance counts half as much as the first ones.
const HALF_WEIGHT_LAG: f64 = 4.0;
/// Weight of the variance.
const VARIANCE_WEIGHT: f64 = 4.0;
/// Keeps the normal equations solvable where two components are alike.
const RIDGE: f64 = 1e-9;
/// Misfit, relative to that of all components, by which fewer may be worse.
const PARSIMONY: f64 = 1.1;
/// Misfit that is no misfit: one percent, root mean square.
const GOOD_ENOUGH: f64 = 1e-4;
/// Where the search starts: lengths as shares of the longest lag.
const STARTS: [[f64; LENGTHS]; 3] = [
    [0.25, 0.25, 0.8, 0.8, 0.15, 0.15],
    [0.06, 0.06, 0.35, 0.35, 0.15, 0.15],
    [0.12, 0.12, 0.6, 0.6, 0.08, 0.08],
];

/// How covariances were estimated: sizes of the regions `[px]`, degree of the trend, longest lag.
pub(super) struct Estimator {
    sizes: Vec<(usize, usize)>,
    degree: usize,
    max_lag: usize,
    /// Responses of an axis, by its pixels and by the bits of a length.
    known: RefCell<HashMap<(usize, u64), Rc<AxisResponse>>>,
}

/// Keys of the correlations that are no length; no length is a NaN.
const CONSTANT: u64 = u64::MAX;
const ALTERNATING: u64 = u64::MAX - 1;

impl Estimator {
    pub(super) fn new(sizes: Vec<(usize, usize)>, degree: usize, max_lag: usize) -> Self {
        Self { sizes, degree, max_lag, known: RefCell::default() }
    }

    fn response(&self, along: Along, count: usize) -> Rc<AxisResponse> {
        let kind = match along {
            Along::Length(length) => length.to_bits(),
            Along::Constant => CONSTANT,
            Along::Alternating => ALTERNATING,
        };
        let new = || Rc::new(AxisResponse::new(along, count, self.degree, self.max_lag));
        Rc::clone(self.known.borrow_mut().entry((count, kind)).or_insert_with(new))
    }

    /// Expected covariances along x and y of a component of variance 1.
    fn expected(&self, [along_x, along_y]: [Along; 2]) -> (Vec<f64>, Vec<f64>) {
        let pooled = |along: Along, across: Along, turned: bool| {
            let mut sums = vec![(0.0, 0.0); self.max_lag + 1];
            for &(width, height) in &self.sizes {
                let (first, second) = if turned { (height, width) } else { (width, height) };
                let (first, second) = (self.response(along, first), self.response(across, second));
                let found = sums_along(&first, &second, self.degree, self.max_lag);
                for (pool, (pairs, sum)) in sums.iter_mut().zip(found) {
                    *pool = (pool.0 + pairs, pool.1 + sum);
                }
            }
            sums.iter().map(|(pairs, sum)| sum / f64::max(*pairs, 1.0)).collect()
        };
        (pooled(along_x, along_y, false), pooled(along_y, along_x, true))
    }
}

/// The field whose estimated covariances are these, nearly. Only a pattern has columns, rows and
/// alternation; components whose variance is below `least` are left out.
pub(super) fn decompose(
    target: &Covariances,
    estimator: &Estimator,
    is_pattern: bool,
    least: f64,
) -> NoiseField {
    if target.variance() <= least {
        return NoiseField::default();
    }
    let mut allowed = [true, true, true, is_pattern, is_pattern, is_pattern];
    let mut best = Problem { target, estimator, allowed }.solve();
    let enough = (PARSIMONY * best.misfit).max(GOOD_ENOUGH);
    loop {
        // The smallest component is tried first: the others may take over its share.
        let mut present: Vec<usize> =
            (0..COMPONENTS).filter(|&j| allowed[j] && best.variances[j] > 0.0).collect();
        present.sort_by(|&a, &b| best.variances[a].total_cmp(&best.variances[b]));
        let dropped = present.into_iter().find_map(|j| {
            let mut fewer = allowed;
            fewer[j] = false;
            let found = Problem { target, estimator, allowed: fewer }.solve();
            (found.misfit <= enough || best.variances[j] < least).then_some((fewer, found))
        });
        match dropped {
            Some(simpler) => (allowed, best) = simpler,
            None => return ordered(field(best.lengths, best.variances)),
        }
    }
}

struct Problem<'a> {
    target: &'a Covariances,
    estimator: &'a Estimator,
    allowed: [bool; COMPONENTS],
}

type Variances = SVector<f64, COMPONENTS>;

/// Lengths and variances, and the share of the weighted sum of squares that they leave.
struct Solution {
    lengths: [f64; LENGTHS],
    variances: Variances,
    misfit: f64,
}

impl Problem<'_> {
    /// The best lengths and variances.
    fn solve(&self) -> Solution {
        let longest = self.estimator.max_lag as f64;
        let mut best = (f64::INFINITY, [0.0; LENGTHS]);
        let ratio = (longest / SHORTEST).powf(1.0 / (GRID - 1) as f64);
        let coarse: Vec<f64> = (0..GRID as i32).map(|i| SHORTEST * ratio.powi(i)).collect();
        for start in STARTS {
            let start = start.map(|share| (share * longest).max(SHORTEST));
            let found = self.descend(start, |index, _| {
                let own = (index >= FIRST_STRIPE).then_some(0.0);
                own.into_iter().chain(coarse.iter().copied()).collect()
            });
            if found.0 < best.0 {
                best = found;
            }
        }
        let fine = |_, length: f64| {
            let tried = (-FINE_STEPS..=FINE_STEPS).map(|i| length * FINE_RATIO.powi(i));
            // A length of 0 stays.
            tried.map(|tried| tried.clamp(SHORTEST.min(length), longest)).collect()
        };
        let (cost, lengths) = self.descend(best.1, fine);
        let nothing = self.weighted_squares();
        Solution { lengths, variances: self.variances(&lengths).1, misfit: cost / nothing }
    }

    /// One length after the other to the best of those that `tried` names, until none improves.
    fn descend(
        &self,
        mut lengths: [f64; LENGTHS],
        tried: impl Fn(usize, f64) -> Vec<f64>,
    ) -> (f64, [f64; LENGTHS]) {
        let mut cost = self.variances(&lengths).0;
        for _ in 0..MAX_SWEEPS {
            let before = cost;
            for index in (0..LENGTHS).filter(|&i| self.allowed[COMPONENT_OF[i]]) {
                for length in tried(index, lengths[index]) {
                    let mut changed = lengths;
                    changed[index] = length;
                    let got = self.variances(&changed).0;
                    if got < cost {
                        (cost, lengths) = (got, changed);
                    }
                }
            }
            if cost >= (1.0 - SETTLED) * before {
                break;
            }
        }
        (cost, lengths)
    }

    /// The least weighted sum of squares over variances that are not negative, by trying every
    /// subset of the components, and the variances.
    fn variances(&self, lengths: &[f64; LENGTHS]) -> (f64, Variances) {
        let columns = self.columns(lengths);
        let mut normal = SMatrix::<f64, COMPONENTS, COMPONENTS>::zeros();
        let mut right = Variances::zeros();
        let mut total = 0.0;
        for (weight, value, row) in self.equations(&columns) {
            total += weight * value * value;
            right += weight * value * row;
            normal += weight * row * row.transpose();
        }
        let mut best = (total, Variances::zeros());
        for subset in 1_u32..1 << COMPONENTS {
            let has = |j: usize| subset >> j & 1 == 1;
            if (0..COMPONENTS).any(|j| has(j) && !self.allowed[j]) {
                continue;
            }
            let part = SMatrix::<f64, COMPONENTS, COMPONENTS>::from_fn(|a, b| {
                match (has(a) && has(b), a == b) {
                    (true, true) => normal[(a, b)] * (1.0 + RIDGE),
                    (true, false) => normal[(a, b)],
                    (false, same) => f64::from(u8::from(same)),
                }
            });
            let wanted = Variances::from_fn(|a, _| if has(a) { right[a] } else { 0.0 });
            let Some(factor) = part.cholesky() else { continue };
            let found = factor.solve(&wanted);
            if found.iter().any(|&variance| variance < 0.0) {
                continue;
            }
            let cost = total - 2.0 * right.dot(&found) + found.dot(&(normal * found));
            if cost < best.0 {
                best = (cost, found);
            }
        }
        best
    }

    /// Weighted sum of squares of the measured values.
    fn weighted_squares(&self) -> f64 {
        let columns = self.columns(&[0.0; LENGTHS]);
        self.equations(&columns).map(|(weight, value, _)| weight * value * value).sum()
    }

    /// (weight, measured value, what it is of unit components) of every lag along x, then along y.
    fn equations<'b>(
        &'b self,
        columns: &'b [(Vec<f64>, Vec<f64>); COMPONENTS],
    ) -> impl Iterator<Item = (f64, f64, Variances)> + 'b {
        let weight = |lag: usize| match lag {
            0 => VARIANCE_WEIGHT,
            lag => 1.0 / (1.0 + lag as f64 / HALF_WEIGHT_LAG),
        };
        let along_x = self.target.x.iter().enumerate().map(move |(lag, &value)| {
            (weight(lag), value, Variances::from_fn(|j, _| columns[j].0[lag]))
        });
        let along_y = self.target.y.iter().enumerate().skip(1).map(move |(lag, &value)| {
            (weight(lag), value, Variances::from_fn(|j, _| columns[j].1[lag]))
        });
        along_x.chain(along_y)
    }

    /// Expected covariances of each component at all lags along x and y.
    fn columns(&self, lengths: &[f64; LENGTHS]) -> [(Vec<f64>, Vec<f64>); COMPONENTS] {
        let unit = field(*lengths, Variances::repeat(1.0));
        let mut index = 0;
        super::super::field::components(&unit).map(|component| {
            index += 1;
            if self.allowed[index - 1] {
                self.estimator.expected(axes(&component))
            } else {
                let none = vec![0.0; self.estimator.max_lag + 1];
                (none.clone(), none)
            }
        })
    }
}

/// The component that each length belongs to.
const COMPONENT_OF: [usize; LENGTHS] = [1, 1, 2, 2, 3, 4];

/// The field of these lengths and variances; what has no variance has no length.
fn field(lengths: [f64; LENGTHS], variances: Variances) -> NoiseField {
    let sd = |j: usize| variances[j].max(0.0).sqrt();
    let length = |i: usize| if variances[COMPONENT_OF[i]] > 0.0 { lengths[i] } else { 0.0 };
    NoiseField {
        white: sd(0),
        correlated: sd(1),
        correlation_x: length(0),
        correlation_y: length(1),
        broad: sd(2),
        broad_x: length(2),
        broad_y: length(3),
        columns: sd(3),
        column_correlation: length(4),
        rows: sd(4),
        row_correlation: length(5),
        row_alternation: sd(5),
    }
}

/// The same field, `broad` the wider of the two blots.
fn ordered(mut found: NoiseField) -> NoiseField {
    let area = |sd: f64, x: f64, y: f64| if sd > 0.0 { x * y } else { f64::INFINITY };
    let narrow = area(found.correlated, found.correlation_x, found.correlation_y);
    if found.broad > 0.0 && area(found.broad, found.broad_x, found.broad_y) < narrow {
        std::mem::swap(&mut found.correlated, &mut found.broad);
        std::mem::swap(&mut found.correlation_x, &mut found.broad_x);
        std::mem::swap(&mut found.correlation_y, &mut found.broad_y);
    }
    found
}

#[cfg(test)]
mod tests;
