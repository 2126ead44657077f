//! What every kind of register must do.

use super::memory::{LANES, Lanes, Row};

/// The operations that the contact kernels are written in, on one kind of machine.
///
/// Implementations for wide registers may only be used behind `widest!`, which tests for them.
pub(crate) trait Width: Copy {
    /// Eight numbers in registers.
    type Value: Copy;
    /// One [`Row`] in registers.
    type Quad: Copy;

    fn load(from: &Lanes) -> Self::Value;
    fn store(value: Self::Value, to: &mut Lanes);
    fn splat(value: f64) -> Self::Value;
    fn add(a: Self::Value, b: Self::Value) -> Self::Value;
    fn sub(a: Self::Value, b: Self::Value) -> Self::Value;
    fn mul(a: Self::Value, b: Self::Value) -> Self::Value;
    /// `a * b + c`, rounded once.
    fn mul_add(a: Self::Value, b: Self::Value, c: Self::Value) -> Self::Value;
    /// `c - a * b`, rounded once.
    fn mul_sub_from(a: Self::Value, b: Self::Value, c: Self::Value) -> Self::Value;
    fn div(a: Self::Value, b: Self::Value) -> Self::Value;
    fn sqrt(a: Self::Value) -> Self::Value;
    /// `yes` where `a < b`, `no` elsewhere (also where either is NaN).
    fn select_less(
        a: Self::Value,
        b: Self::Value,
        yes: Self::Value,
        no: Self::Value,
    ) -> Self::Value;
    /// `b` where `a < b`, `a` elsewhere (also where either is NaN).
    fn max(a: Self::Value, b: Self::Value) -> Self::Value;
    /// `a` where `a < b`, `b` elsewhere (also where either is NaN).
    fn min(a: Self::Value, b: Self::Value) -> Self::Value;
    /// One bit for each lane in which `a < b`.
    fn less_bits(a: Self::Value, b: Self::Value) -> u32;
    fn load_row(from: &Row) -> Self::Quad;
    fn store_row(value: Self::Quad, to: &mut Row);
    /// Eight rows as their four columns.
    fn columns(rows: [Self::Quad; LANES]) -> [Self::Value; 4];
    /// Four columns as their eight rows.
    fn rows(columns: [Self::Value; 4]) -> [Self::Quad; LANES];
}
