//! Straight lines through measured points.

/// Slope and intercept of the least-squares line through `points`.
pub fn line(points: &[(f64, f64)]) -> (f64, f64) {
    let count = points.len() as f64;
    let (x, y) = points.iter().fold((0.0, 0.0), |(x, y), p| (x + p.0 / count, y + p.1 / count));
    let covariance: f64 = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum();
    let variance: f64 = points.iter().map(|p| (p.0 - x) * (p.0 - x)).sum();
    let slope = covariance / variance;
    (slope, y - slope * x)
}

/// Exponent and factor of the power law through `points`, fitted to the logarithms.
pub fn power(points: &[(f64, f64)]) -> (f64, f64) {
    let logarithms: Vec<_> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let (exponent, logarithm) = line(&logarithms);
    (exponent, logarithm.exp())
}
