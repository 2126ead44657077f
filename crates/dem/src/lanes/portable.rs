//! Any machine: plain arrays and loops.

use super::{LANES, Lanes, Width};

/// Plain arrays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Portable;

#[inline(always)]
fn zip(a: [f64; LANES], b: [f64; LANES], f: impl Fn(f64, f64) -> f64) -> [f64; LANES] {
    let mut out = [0.0; LANES];
    for lane in 0..LANES {
        out[lane] = f(a[lane], b[lane]);
    }
    out
}

impl Width for Portable {
    type Value = [f64; LANES];

    #[inline(always)]
    fn load(from: &Lanes) -> [f64; LANES] {
        from.0
    }
    #[inline(always)]
    fn store(value: [f64; LANES], to: &mut Lanes) {
        to.0 = value;
    }
    #[inline(always)]
    fn splat(value: f64) -> [f64; LANES] {
        [value; LANES]
    }
    #[inline(always)]
    fn add(a: [f64; LANES], b: [f64; LANES]) -> [f64; LANES] {
        zip(a, b, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(a: [f64; LANES], b: [f64; LANES]) -> [f64; LANES] {
        zip(a, b, |a, b| a - b)
    }
    #[inline(always)]
    fn mul(a: [f64; LANES], b: [f64; LANES]) -> [f64; LANES] {
        zip(a, b, |a, b| a * b)
    }
    #[inline(always)]
    fn div(a: [f64; LANES], b: [f64; LANES]) -> [f64; LANES] {
        zip(a, b, |a, b| a / b)
    }
    #[inline(always)]
    fn sqrt(a: [f64; LANES]) -> [f64; LANES] {
        zip(a, a, |a, _| a.sqrt())
    }
    #[inline(always)]
    fn select_less(
        a: [f64; LANES],
        b: [f64; LANES],
        yes: [f64; LANES],
        no: [f64; LANES],
    ) -> [f64; LANES] {
        let mut out = no;
        for lane in 0..LANES {
            if a[lane] < b[lane] {
                out[lane] = yes[lane];
            }
        }
        out
    }
    #[inline(always)]
    fn transpose(rows: [[f64; LANES]; LANES]) -> [[f64; LANES]; LANES] {
        let mut columns = [[0.0; LANES]; LANES];
        for (r, row) in rows.iter().enumerate() {
            for (column, value) in columns.iter_mut().zip(row) {
                column[r] = *value;
            }
        }
        columns
    }
}
