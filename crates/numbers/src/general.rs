//! Numbers in messages.

use std::fmt;

/// Digits that are shown.
const DIGITS: usize = 10;
const SHORT: usize = 4;

/// A number as `%g` of C shows it, with ten digits: none that are idle, and an exponent where it is shorter.
///
/// ```
/// use granulcal_numbers::General;
///
/// assert_eq!(General(0.1 + 0.2).to_string(), "0.3");
/// assert_eq!(General(-1e300).to_string(), "-1e300");
/// assert_eq!(General(1234567.0).to_string(), "1234567");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct General(pub f64);

/// The same of four digits, for what is estimated or measured.
///
/// ```
/// assert_eq!(granulcal_numbers::short(2048.375).to_string(), "2048");
/// assert_eq!(granulcal_numbers::short(0.0123456).to_string(), "0.01235");
/// ```
pub fn short(value: f64) -> General {
    // What is no number has no digits.
    General(format!("{value:.*e}", SHORT - 1).parse().unwrap_or(value))
}

impl fmt::Display for General {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = self.0;
        if value == 0.0 || !value.is_finite() {
            // No sign of a zero.
            return write!(f, "{}", value + 0.0);
        }
        // Rounded first: 999 999 999 999 has the exponent of what is shown of it.
        let scientific = format!("{value:.*e}", DIGITS - 1);
        let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
        let power: i32 = exponent.parse().unwrap_or(0);
        if !(-4..DIGITS as i32).contains(&power) {
            return write!(f, "{}e{power}", without_idle_zeros(mantissa));
        }
        let decimals = DIGITS as i32 - 1 - power;
        f.write_str(without_idle_zeros(&format!("{value:.*}", decimals.unsigned_abs() as usize)))
    }
}

fn without_idle_zeros(text: &str) -> &str {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_as_printf_has_them() {
        // printf("%.10g"), but for the exponent, which has no plus and no idle zero here.
        for (value, text) in [
            (0.0, "0"),
            (-0.0, "0"),
            (1.0, "1"),
            (-2.5, "-2.5"),
            (100.0, "100"),
            (1e-4, "0.0001"),
            (1e-5, "1e-5"),
            (123456789.0, "123456789"),
            (9_999_999_999.0, "9999999999"),
            (9_999_999_999.9, "1e10"),
            (1e18, "1e18"),
            (1.0 / 3.0, "0.3333333333"),
            (f64::MAX, "1.797693135e308"),
            (5e-324, "4.940656458e-324"),
            (f64::NAN, "NaN"),
            (f64::NEG_INFINITY, "-inf"),
        ] {
            assert_eq!(General(value).to_string(), text);
        }
    }

    #[test]
    fn no_number_is_longer_than_its_digits() {
        for exponent in -340..=307 {
            for digits in ["1", "9.99999999999999", "-1.2345678901234567"] {
                let value: f64 = format!("{digits}e{exponent}").parse().unwrap();
                let shown = General(value).to_string();
                assert!(shown.len() <= DIGITS + 7, "{shown}");
                let back: f64 = shown.parse().unwrap();
                assert!((back - value).abs() <= 6e-10 * value.abs() + 5e-324, "{shown} {value:e}");
            }
        }
    }
}
