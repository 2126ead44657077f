//! Evenly spread points, the same as Python's: Niederreiter (1992), section 3.1, and Box and Muller (1958).

use granulcal_numbers::box_muller;

/// Point `index` of the additive recurrence on powers of the generalised golden ratio, in (0, 1)^p.
#[derive(Clone, Debug)]
pub struct QuasiUniform(Vec<f64>);

impl QuasiUniform {
    /// Points of so many dimensions.
    pub fn new(dimension: usize) -> Self {
        let mut ratio: f64 = 2.0;
        for _ in 0..60 {
            ratio = (1.0 + ratio).powf(1.0 / (dimension as f64 + 1.0));
        }
        Self((1..=dimension).map(|power| ratio.powf(-(power as f64))).collect())
    }

    /// One of them.
    pub fn point(&self, index: usize) -> Vec<f64> {
        self.0.iter().map(|step| (0.5 + (index + 1) as f64 * step).rem_euclid(1.0)).collect()
    }
}

/// The first `count` evenly spread standard normal points.
pub fn quasi_normal(count: usize, dimension: usize) -> Vec<Vec<f64>> {
    let pairs = dimension.div_ceil(2);
    let uniform = QuasiUniform::new(2 * pairs);
    (0..count)
        .map(|index| {
            let point = uniform.point(index);
            let normal = |i: usize| box_muller(1.0 - point[2 * i], point[2 * i + 1]);
            let found: Vec<_> = (0..pairs).map(normal).collect();
            // First all cosines, then all sines.
            let cosines = found.iter().map(|[cosine, _]| *cosine);
            cosines.chain(found.iter().map(|[_, sine]| *sine)).take(dimension).collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_points_have_their_moments() {
        for dimension in [1, 3] {
            let points = quasi_normal(4096, dimension);
            for axis in 0..dimension {
                let mean = points.iter().map(|p| p[axis]).sum::<f64>() / 4096.0;
                let square = points.iter().map(|p| p[axis] * p[axis]).sum::<f64>() / 4096.0;
                assert!(mean.abs() < 0.01 && (square - 1.0).abs() < 0.02, "{mean} {square}");
            }
        }
    }
}
