//! What all statistics start from, computed once.

use std::cell::OnceCell;

use nalgebra::{Vector2, Vector3};

use super::chi::ChiFit;
use super::sum::{extremes, sum};
use crate::error::{FeatureError, require_finite, require_in};

/// Points below which no statistic is computed: two have no spread in a plane worth the name.
pub const MIN_POINTS: usize = 3;

/// Largest coordinate `[m]`: its square, summed over any number of points, is far from overflow.
pub const MAX_COORDINATE: f64 = 1e100;

/// Points in the form that the statistics need.
#[derive(Debug, Clone)]
pub struct Prepared {
    x: Vec<f64>,
    y: Vec<f64>,
    z: Vec<f64>,
    r: Vec<f64>,
    /// Two statistics read one order.
    r_ranking: OnceCell<Vec<Ranked>>,
    /// Three statistics read one fit.
    chi: OnceCell<ChiFit>,
}

/// A value and the point that it belongs to.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ranked {
    pub(super) value: f64,
    pub(super) point: u32,
}

impl Prepared {
    /// Counts x and y from the centroid and computes r.
    ///
    /// # Errors
    /// As [`super::paper16`].
    pub fn new(points: &[Vector3<f64>]) -> Result<Self, FeatureError> {
        require_points("statistics", points)?;
        let (origin, offset) = centroid(points);
        let x: Vec<_> = points.iter().map(|p| (p.x - origin.x) - offset.x).collect();
        let y: Vec<_> = points.iter().map(|p| (p.y - origin.y) - offset.y).collect();
        let z = points.iter().map(|p| p.z).collect();
        // The coordinates are bounded, so the square root is as safe as `hypot` and much faster.
        let r = x.iter().zip(&y).map(|(x, y)| (x * x + y * y).sqrt()).collect();
        Ok(Self { x, y, z, r, r_ranking: OnceCell::new(), chi: OnceCell::new() })
    }

    /// x from the centroid `[m]`.
    pub fn x(&self) -> &[f64] {
        &self.x
    }

    /// y from the centroid `[m]`.
    pub fn y(&self) -> &[f64] {
        &self.y
    }

    /// Height above the ground `[m]`.
    pub fn z(&self) -> &[f64] {
        &self.z
    }

    /// Horizontal distance from the centroid `[m]`.
    pub fn r(&self) -> &[f64] {
        &self.r
    }

    /// The chi distribution fitted to r.
    pub fn chi(&self) -> &ChiFit {
        self.chi.get_or_init(|| ChiFit::new(&self.r))
    }

    /// r in ascending order.
    pub(super) fn r_ranking(&self) -> &[Ranked] {
        self.r_ranking.get_or_init(|| ranking(&self.r))
    }
}

/// Refuses too few points, and points that are nowhere.
pub(super) fn require_points(
    what: &'static str,
    points: &[Vector3<f64>],
) -> Result<(), FeatureError> {
    if points.len() < MIN_POINTS {
        return Err(FeatureError::TooFewPoints { what, got: points.len(), min: MIN_POINTS });
    }
    // One comparison a coordinate tells the good from the bad; NaN fails it too.
    if points.iter().flatten().all(|coordinate| coordinate.abs() <= MAX_COORDINATE) {
        return Ok(());
    }
    require_finite("points", points.iter().flat_map(|p| [p.x, p.y, p.z]))?;
    let range = |&coordinate| require_in("point [m]", coordinate, -MAX_COORDINATE, MAX_COORDINATE);
    points.iter().flatten().try_for_each(range)
}

/// The centroid of x and y as a point and the rest of the way from it. Whoever counts from the point
/// first loses no digits to an offset of the whole formation.
pub(super) fn centroid(points: &[Vector3<f64>]) -> (Vector2<f64>, Vector2<f64>) {
    let origin = points.first().map_or_else(Vector2::zeros, Vector3::xy);
    let from_origin = sum(points, |p| p.xy() - origin);
    (origin, from_origin / points.len().max(1) as f64)
}

/// The values in ascending order, each with its index.
///
/// Into buckets of equal width first, then each bucket by comparisons: linear in the number of values
/// where they are spread out, and never worse than a sort.
pub(super) fn ranking(values: &[f64]) -> Vec<Ranked> {
    const VALUES_PER_BUCKET: usize = 4;
    let (low, high) = extremes(values);
    let last = values.len() / VALUES_PER_BUCKET;
    let scale = (last + 1) as f64 / (high - low);
    // Rounding keeps the order of the products; equal values, 0 · ∞, share the first bucket.
    let bucket_of = |value: f64| (((value - low) * scale) as usize).min(last);
    let mut ends = vec![0; last + 2];
    for &value in values {
        ends[bucket_of(value) + 1] += 1;
    }
    for bucket in 0..=last {
        ends[bucket + 1] += ends[bucket];
    }
    let mut ranking = vec![Ranked { value: 0.0, point: 0 }; values.len()];
    for (point, &value) in (0..).zip(values) {
        // Counts from the bucket's start to its end, which is the next one's start.
        let place = &mut ends[bucket_of(value)];
        ranking[*place] = Ranked { value, point };
        *place += 1;
    }
    let mut start = 0;
    for &end in &ends[..=last] {
        ranking[start..end].sort_unstable_by(|a, b| a.value.total_cmp(&b.value));
        start = end;
    }
    ranking
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Stream;

    #[test]
    fn ranking_is_a_permutation_in_ascending_order() {
        let mut stream = Stream::new(7);
        for count in [0, 1, 2, 3, 4, 5, 100, 1001] {
            for shape in 0..4 {
                let value = |stream: &mut Stream| match shape {
                    0 => stream.uniform(),
                    1 => stream.normal().powi(9),
                    2 => stream.index(3) as f64,
                    _ => 0.25,
                };
                let values: Vec<f64> = (0..count).map(|_| value(&mut stream)).collect();
                let ranking = ranking(&values);
                assert!(ranking.is_sorted_by(|a, b| a.value <= b.value));
                let mut points: Vec<_> = ranking.iter().map(|ranked| ranked.point).collect();
                points.sort_unstable();
                assert!(points.into_iter().eq(0..count as u32));
                assert!(ranking.iter().all(|r| r.value == values[r.point as usize]));
            }
        }
    }
}
