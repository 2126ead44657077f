//! Numbers of more than one command.

use std::str::FromStr;
use std::time::Duration;

pub fn seed(text: &str) -> Result<u64, String> {
    text.parse().map_err(|_| format!("must be a whole number from 0 to 2^64 - 1, got {text:?}"))
}

pub fn whole<T: FromStr>(text: &str) -> Result<T, String> {
    text.parse().map_err(|_| format!("must be a whole number, 0 or more, got {text:?}"))
}

pub fn number(text: &str) -> Result<f64, String> {
    text.parse().map_err(|_| format!("must be a number, got {text:?}"))
}

pub fn positive(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|&number: &f64| number > 0.0 && number.is_finite());
    number.ok_or_else(|| format!("must be a positive number, got {text:?}"))
}

pub fn period(text: &str) -> Result<Duration, String> {
    let period = text.parse().ok().and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    period.ok_or_else(|| format!("must be a number of seconds, 0 or more, got {text:?}"))
}
