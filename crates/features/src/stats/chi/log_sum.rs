//! Sums of logarithms and of reciprocals without taking either one by one.
//!
//! A sum of logarithms is the logarithm of a product; the product's exponent is moved aside before it
//! can overflow. With d' = d a + p, p' = p a the derivative of a product is carried along with it, and
//! d / p is the sum of the reciprocals. Every factor must be within [1e-15, 100].

/// Products side by side: a multiplication need not wait for the one before.
const LANES: usize = 16;
/// Factors multiplied before the exponent is moved aside: 1e-15 to this power is no subnormal number.
const FACTORS: usize = 16;

/// Products as their mantissas, in [1, 2), and the sum of their exponents.
struct Products {
    mantissas: [f64; LANES],
    exponents: [i64; LANES],
}

impl Products {
    const ONE: Self = Self { mantissas: [1.0; LANES], exponents: [0; LANES] };

    #[inline(always)]
    fn multiply(&mut self, factors: &[f64; LANES]) {
        const MANTISSA: u64 = (1 << 52) - 1;
        const BIAS: i64 = 1023;
        for (lane, factor) in factors.iter().enumerate() {
            let bits = (self.mantissas[lane] * factor).to_bits();
            self.exponents[lane] += (bits >> 52) as i64 - BIAS;
            self.mantissas[lane] = f64::from_bits(bits & MANTISSA | 1.0_f64.to_bits());
        }
    }

    fn ln(&self) -> f64 {
        let exponent = self.exponents.iter().sum::<i64>() as f64;
        exponent * std::f64::consts::LN_2 + self.mantissas.iter().map(|m| m.ln()).sum::<f64>()
    }
}

/// \\( \sum \ln(v + g) \\).
pub(super) fn ln_sum(values: &[f64], gap: f64) -> f64 {
    // The widest registers of the machine: no step is fused, so the bits are the same on all.
    pulp::Arch::new().dispatch(|| products(values, gap)).ln()
}

#[inline(always)]
fn products(values: &[f64], gap: f64) -> Products {
    let (rows, rest) = values.as_chunks::<LANES>();
    let mut products = Products::ONE;
    for rows in rows.chunks(FACTORS) {
        let mut product = [1.0; LANES];
        for row in rows {
            for lane in 0..LANES {
                product[lane] *= row[lane] + gap;
            }
        }
        products.multiply(&product);
    }
    products.multiply(&std::array::from_fn(|lane| rest.get(lane).map_or(1.0, |v| v + gap)));
    products
}

/// \\( \sum \ln(v + g) \\) and \\( \sum 1/(v + g) \\).
pub(super) fn ln_and_inverse_sums(values: &[f64], gap: f64) -> (f64, f64) {
    let (products, inverse) = pulp::Arch::new().dispatch(|| products_and_inverses(values, gap));
    (products.ln(), inverse)
}

#[inline(always)]
fn products_and_inverses(values: &[f64], gap: f64) -> (Products, f64) {
    let (rows, rest) = values.as_chunks::<LANES>();
    let mut products = Products::ONE;
    let mut inverses = [0.0; LANES];
    for rows in rows.chunks(FACTORS) {
        let (mut product, mut derivative) = ([1.0; LANES], [0.0; LANES]);
        for row in rows {
            for lane in 0..LANES {
                let factor = row[lane] + gap;
                derivative[lane] = derivative[lane] * factor + product[lane];
                product[lane] *= factor;
            }
        }
        for lane in 0..LANES {
            inverses[lane] += derivative[lane] / product[lane];
        }
        products.multiply(&product);
    }
    products.multiply(&std::array::from_fn(|lane| rest.get(lane).map_or(1.0, |v| v + gap)));
    let of_rest: f64 = rest.iter().map(|v| 1.0 / (v + gap)).sum();
    (products, inverses.iter().sum::<f64>() + of_rest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Stream;

    #[test]
    fn equal_the_plain_sums() {
        let mut stream = Stream::new(3);
        for (count, gap) in
            [(0, 0.5), (1, 1e-15), (15, 1e-15), (16, 99.0), (257, 1e-3), (999, 99.0)]
        {
            let values: Vec<f64> =
                (0..count).map(|i| stream.uniform() * f64::from(i % 3)).collect();
            let ln: f64 = values.iter().map(|v| (v + gap).ln()).sum();
            let inverse: f64 = values.iter().map(|v| 1.0 / (v + gap)).sum();
            let (got_ln, got_inverse) = ln_and_inverse_sums(&values, gap);
            assert_eq!(got_ln, ln_sum(&values, gap));
            assert!((got_ln - ln).abs() <= 1e-13 * ln.abs().max(1.0), "{count} {gap}");
            assert!((got_inverse - inverse).abs() <= 1e-13 * inverse, "{count} {gap}");
        }
        // 300 factors at either end of the range.
        for gap in [1e-15, 99.0] {
            let got = ln_sum(&[0.0; 300], gap);
            assert!((got / (300.0 * f64::ln(gap)) - 1.0).abs() < 1e-14);
        }
    }
}
