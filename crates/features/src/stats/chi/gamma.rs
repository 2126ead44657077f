//! ln Γ, ψ and ψ' on the interval that the fit needs, and the shape of a gamma distribution.
//!
//! Stirling's series with the argument raised to at least 10 first (NIST DLMF 5.11.1, 5.11.2,
//! 5.15.8, 5.5.1): the first term left out is below 1e-15 there.

/// Argument from which the series are used.
const RAISED: f64 = 10.0;

/// ln Γ(x) for x > 0.
pub(super) fn ln_gamma(mut x: f64) -> f64 {
    let mut lowered = 1.0;
    while x < RAISED {
        lowered *= x;
        x += 1.0;
    }
    let w = 1.0 / (x * x);
    let series = 1.0 / 1188.0 - w * (691.0 / 360_360.0);
    let series =
        1.0 / 12.0 - w * (1.0 / 360.0 - w * (1.0 / 1260.0 - w * (1.0 / 1680.0 - w * series)));
    let half_ln_tau = 0.5 * std::f64::consts::TAU.ln();
    (x - 0.5) * x.ln() - x + half_ln_tau + series / x - lowered.ln()
}

/// ψ(x), the derivative of ln Γ, and its derivative ψ'(x), for x > 0.
pub(super) fn digamma_trigamma(mut x: f64) -> (f64, f64) {
    let (mut digamma, mut trigamma) = (0.0, 0.0);
    while x < RAISED {
        let inverse = 1.0 / x;
        digamma -= inverse;
        trigamma += inverse * inverse;
        x += 1.0;
    }
    let (inverse, w) = (1.0 / x, 1.0 / (x * x));
    let series = 1.0 / 132.0 - w * (691.0 / 32_760.0);
    let series =
        1.0 / 12.0 - w * (1.0 / 120.0 - w * (1.0 / 252.0 - w * (1.0 / 240.0 - w * series)));
    digamma += x.ln() - 0.5 * inverse - w * series;
    let series = 5.0 / 66.0 - w * (691.0 / 2730.0);
    let series = 1.0 / 6.0 - w * (1.0 / 30.0 - w * (1.0 / 42.0 - w * (1.0 / 30.0 - w * series)));
    trigamma += inverse * (1.0 + 0.5 * inverse + w * series);
    (digamma, trigamma)
}

/// The shape a in [`min`, `max`] that solves ln a - ψ(a) = `log_ratio`, the equation of the maximum
/// likelihood of a gamma distribution; `log_ratio` is ln of the mean less the mean of ln.
///
/// The left side falls from ∞ to 0, so a solution beyond a bound means that the bound is best.
///
/// # Reference
/// Start: Minka 2002, "Estimating a Gamma distribution", eq. 11 with its closed form.
pub(super) fn gamma_shape(log_ratio: f64, min: f64, max: f64) -> f64 {
    // Quadratic convergence from a start good to 1.5 %: four steps reach rounding, ten are safe.
    const STEPS: usize = 10;
    // Far beyond the equation's values at the bounds, and safe to square.
    let c = log_ratio.clamp(1e-100, 1e100);
    let mut shape =
        ((3.0 - c + ((c - 3.0).powi(2) + 24.0 * c).sqrt()) / (12.0 * c)).clamp(min, max);
    for _ in 0..STEPS {
        let (digamma, trigamma) = digamma_trigamma(shape);
        let next = (shape - (shape.ln() - digamma - c) / (1.0 / shape - trigamma)).clamp(min, max);
        if (next - shape).abs() <= 2.0 * f64::EPSILON * shape {
            return next;
        }
        shape = next;
    }
    shape
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values() {
        let pi = std::f64::consts::PI;
        assert!((ln_gamma(0.5) - 0.5 * pi.ln()).abs() < 1e-14);
        assert!((ln_gamma(5.0) - 24.0_f64.ln()).abs() < 1e-14);
        let fact_49: f64 = (1..50).map(|i| f64::from(i).ln()).sum();
        assert!((ln_gamma(50.0) - fact_49).abs() < 1e-12);
        let euler = 0.577_215_664_901_532_9;
        let (digamma, trigamma) = digamma_trigamma(1.0);
        assert!((digamma + euler).abs() < 1e-14 && (trigamma - pi * pi / 6.0).abs() < 1e-14);
        let (digamma, trigamma) = digamma_trigamma(0.5);
        assert!((digamma + euler + 2.0 * 2.0_f64.ln()).abs() < 1e-14);
        assert!((trigamma - pi * pi / 2.0).abs() < 1e-13);
    }

    #[test]
    fn shape_inverts_its_equation_and_stops_at_the_bounds() {
        for shape in [0.51, 0.7, 1.0, 3.3, 20.0, 49.0] {
            let log_ratio = f64::ln(shape) - digamma_trigamma(shape).0;
            let got = gamma_shape(log_ratio, 0.5, 50.0);
            assert!((got / shape - 1.0).abs() < 1e-11, "{got} {shape}");
        }
        assert_eq!(gamma_shape(5.0, 0.5, 50.0), 0.5);
        assert_eq!(gamma_shape(1e-5, 0.5, 50.0), 50.0);
        assert_eq!(gamma_shape(0.0, 0.5, 50.0), 50.0);
        assert_eq!(gamma_shape(f64::INFINITY, 0.5, 50.0), 0.5);
    }
}
