//! The prior's coordinates: a uniform range is [0, 1], a log-uniform one too in its logarithm, a normal z-scores.

use std::f64::consts::TAU;
use std::sync::OnceLock;

use granulcal_numbers::normal_cdf;
use granulcal_scene::{Distribution, Prior};
use nalgebra::DMatrix;

use crate::ModelError;
use crate::quasi::{QuasiUniform, quasi_normal};

/// Points of `normal_points`: enough for the mass of a mixture's component inside the bounds.
const NORMAL_POINTS: usize = 2048;

/// One free parameter.
#[derive(Clone, Debug)]
struct Coordinate {
    distribution: Distribution,
    origin: f64,
    scale: f64,
    is_log: bool,
    /// Coordinates that are possible.
    low: f64,
    high: f64,
    /// log of the share of a normal that the bounds leave.
    log_mass: f64,
}

/// The free parameters of a prior, mapped to where the inference lives.
#[derive(Clone, Debug)]
pub struct Coordinates {
    names: Vec<String>,
    each: Vec<Coordinate>,
    normal: OnceLock<DMatrix<f64>>,
}

impl Coordinates {
    /// Of a prior.
    pub fn of(prior: &Prior) -> Self {
        let free = prior.free();
        let names = free.iter().map(|&i| prior.names()[i].to_owned()).collect();
        let each = free.iter().map(|&i| coordinate(prior.parameters()[i].distribution)).collect();
        Self { names, each, normal: OnceLock::new() }
    }

    /// Paths of the parameters.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// How many.
    pub fn dimension(&self) -> usize {
        self.each.len()
    }

    /// Whether nothing bounds any of them.
    pub fn is_unbounded(&self) -> bool {
        self.each.iter().all(|c| c.low == f64::NEG_INFINITY && c.high == f64::INFINITY)
    }

    /// Whether a point lies within the bounds; one of another dimension does not, nor one that is not finite.
    pub fn is_inside(&self, u: &[f64]) -> bool {
        let is_within = |(c, &u): (&Coordinate, &f64)| c.low <= u && u <= c.high && u.is_finite();
        u.len() == self.each.len() && self.each.iter().zip(u).all(is_within)
    }

    /// Refuses another number of values than there are parameters, and a NaN: a point is nowhere then, and not outside.
    pub(crate) fn require_point(
        &self,
        what: &'static str,
        point: &[f64],
    ) -> Result<(), ModelError> {
        let wrong = |allowed: String, found| Err(ModelError::Argument { what, allowed, found });
        let count = self.dimension();
        if point.len() != count {
            return wrong(format!("{count} numbers, one a parameter"), point.len().to_string());
        }
        match self.names.iter().zip(point).find(|(_, value)| value.is_nan()) {
            Some((name, _)) => wrong("numbers".to_owned(), format!("{name} = NaN")),
            None => Ok(()),
        }
    }

    /// Log prior density of coordinates, minus infinity where they are not inside.
    pub fn log_density(&self, u: &[f64]) -> f64 {
        if !self.is_inside(u) {
            return f64::NEG_INFINITY;
        }
        let normal = |c: &Coordinate, u: f64| match c.distribution {
            Distribution::Normal { .. } => -0.5 * u * u - 0.5 * TAU.ln() - c.log_mass,
            _ => 0.0,
        };
        self.each.iter().zip(u).map(|(c, &u)| normal(c, u)).sum()
    }

    /// Values in own units.
    pub fn values(&self, u: &[f64]) -> Vec<f64> {
        self.each.iter().zip(u).map(|(c, &u)| c.value(u)).collect()
    }

    /// Coordinates of values in own units.
    pub fn of_values(&self, theta: &[f64]) -> Vec<f64> {
        self.each.iter().zip(theta).map(|(c, &value)| c.of_value(value)).collect()
    }

    /// log |du / dtheta|; NaN or infinite where theta has no coordinates: at 0 and below, under a logarithm.
    pub fn log_slope(&self, theta: &[f64]) -> f64 {
        let slope =
            |c: &Coordinate, value: f64| -c.scale.ln() - if c.is_log { value.ln() } else { 0.0 };
        self.each.iter().zip(theta).map(|(c, &value)| slope(c, value)).sum()
    }

    /// Means and variances of the prior along each coordinate, over evenly spread draws of it.
    pub fn moments(&self) -> (Vec<f64>, Vec<f64>) {
        let draws = self.quasi_prior(1000);
        let mean: Vec<_> = (0..self.dimension())
            .map(|i| draws.iter().map(|u| u[i]).sum::<f64>() / draws.len() as f64)
            .collect();
        let variance = (0..self.dimension())
            .map(|i| {
                draws.iter().map(|u| (u[i] - mean[i]).powi(2)).sum::<f64>() / draws.len() as f64
            })
            .collect();
        (mean, variance)
    }

    /// Evenly spread standard normal points of this dimension, one a column; made at the first call.
    pub fn normal_points(&self) -> &DMatrix<f64> {
        let points = || quasi_normal(NORMAL_POINTS, self.dimension()).concat();
        self.normal.get_or_init(|| DMatrix::from_vec(self.dimension(), NORMAL_POINTS, points()))
    }

    /// Share of the prior below a coordinate.
    pub fn prior_quantile(&self, parameter: usize, u: f64) -> f64 {
        let c = &self.each[parameter];
        match c.distribution {
            Distribution::Normal { .. } => {
                ((normal_cdf(u) - normal_cdf(c.low)) / c.log_mass.exp()).clamp(0.0, 1.0)
            }
            _ => u.clamp(0.0, 1.0),
        }
    }

    /// Coordinates moved inside the bounds.
    pub fn clipped(&self, u: impl Iterator<Item = f64>) -> Vec<f64> {
        self.each.iter().zip(u).map(|(c, u)| u.clamp(c.low, c.high)).collect()
    }

    /// Evenly spread draws of the prior.
    pub fn quasi_prior(&self, count: usize) -> Vec<Vec<f64>> {
        let uniform = QuasiUniform::new(self.dimension());
        let draw = |p: &[f64]| {
            let draws = self.each.iter().zip(p);
            draws.map(|(c, &p)| c.of_value(c.distribution.quantile(p))).collect()
        };
        (0..count).map(|index| draw(&uniform.point(index))).collect()
    }
}

impl Coordinate {
    fn value(&self, u: f64) -> f64 {
        let warped = self.origin + self.scale * u;
        if self.is_log { warped.exp() } else { warped }
    }

    fn of_value(&self, value: f64) -> f64 {
        let warped = if self.is_log { value.ln() } else { value };
        (warped - self.origin) / self.scale
    }
}

fn coordinate(distribution: Distribution) -> Coordinate {
    let flat = |origin, scale, is_log| Coordinate {
        distribution,
        origin,
        scale,
        is_log,
        low: 0.0,
        high: 1.0,
        log_mass: 0.0,
    };
    match distribution {
        Distribution::Uniform { low, high } => flat(low, high - low, false),
        Distribution::LogUniform { low, high } => flat(low.ln(), high.ln() - low.ln(), true),
        Distribution::Fixed { value } => flat(value, 1.0, false),
        Distribution::Normal { mean, sd, low, high } => {
            let low = low.map_or(f64::NEG_INFINITY, |low| (low - mean) / sd);
            let high = high.map_or(f64::INFINITY, |high| (high - mean) / sd);
            let log_mass = distribution.mass().ln();
            Coordinate { distribution, origin: mean, scale: sd, is_log: false, low, high, log_mass }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_point_is_not_inside() {
        let normal =
            "[[parameter]]\npath = \"a\"\ndistribution = \"normal\"\nmean = 1.0\nsd = 0.5\n";
        let coordinates = Coordinates::of(&Prior::from_toml(normal).unwrap());
        assert!(coordinates.is_unbounded() && coordinates.is_inside(&[9.0]));
        for u in [&[f64::NAN][..], &[f64::INFINITY], &[], &[0.0, 0.0]] {
            assert_eq!(coordinates.log_density(u), f64::NEG_INFINITY, "{u:?}");
        }
    }

    #[test]
    fn moments_are_means_and_variances() {
        let uniform = Coordinates::of(&Prior::default());
        let (means, variances) = uniform.moments();
        assert!(means.iter().all(|mean| (mean - 0.5).abs() < 5e-3), "{means:?}");
        assert!(variances.iter().all(|v| (v - 1.0 / 12.0).abs() < 1e-3), "{variances:?}");
    }

    #[test]
    fn values_come_back_and_densities_integrate_to_one() {
        let text = r#"
            [[parameter]]
            path = "a"
            distribution = "log_uniform"
            low = 0.001
            high = 2.0
            [[parameter]]
            path = "b"
            distribution = "normal"
            mean = 1.0
            sd = 0.5
            low = 0.2
        "#;
        let coordinates = Coordinates::of(&Prior::from_toml(text).unwrap());
        let theta = [0.05, 1.3];
        let back = coordinates.values(&coordinates.of_values(&theta));
        assert!(back.iter().zip(theta).all(|(a, b)| (a - b).abs() < 1e-14));
        let n = 400;
        let mut sum = 0.0;
        for i in 0..n {
            for j in 0..n {
                let u = [(i as f64 + 0.5) / n as f64, -3.0 + 9.0 * (j as f64 + 0.5) / n as f64];
                sum += coordinates.log_density(&u).exp();
            }
        }
        let integral = sum * 9.0 / (n * n) as f64;
        assert!((integral - 1.0).abs() < 2e-3, "{integral}");
    }
}
