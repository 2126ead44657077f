//! Any machine: plain arrays and loops.

use super::{LANES, Lanes, Row, Width};

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
    type Quad = [f64; 4];

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
    fn mul_add(a: [f64; LANES], b: [f64; LANES], c: [f64; LANES]) -> [f64; LANES] {
        let mut out = c;
        for lane in 0..LANES {
            out[lane] = a[lane].mul_add(b[lane], c[lane]);
        }
        out
    }
    #[inline(always)]
    fn mul_sub_from(a: [f64; LANES], b: [f64; LANES], c: [f64; LANES]) -> [f64; LANES] {
        Self::mul_add(a.map(|a| -a), b, c)
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
    fn max(a: [f64; LANES], b: [f64; LANES]) -> [f64; LANES] {
        zip(a, b, |a, b| if a < b { b } else { a })
    }
    #[inline(always)]
    fn min(a: [f64; LANES], b: [f64; LANES]) -> [f64; LANES] {
        zip(a, b, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn less_bits(a: [f64; LANES], b: [f64; LANES]) -> u32 {
        (0..LANES).fold(0, |bits, lane| bits | u32::from(a[lane] < b[lane]) << lane)
    }
    #[inline(always)]
    fn load_row(from: &Row) -> [f64; 4] {
        from.0
    }
    #[inline(always)]
    fn store_row(value: [f64; 4], to: &mut Row) {
        to.0 = value;
    }
    #[inline(always)]
    fn columns(rows: [[f64; 4]; LANES]) -> [[f64; LANES]; 4] {
        let mut columns = [[0.0; LANES]; 4];
        for (lane, row) in rows.iter().enumerate() {
            for (column, value) in columns.iter_mut().zip(row) {
                column[lane] = *value;
            }
        }
        columns
    }
    #[inline(always)]
    fn rows(columns: [[f64; LANES]; 4]) -> [[f64; 4]; LANES] {
        let mut rows = [[0.0; 4]; LANES];
        for (number, column) in columns.iter().enumerate() {
            for (row, value) in rows.iter_mut().zip(column) {
                row[number] = *value;
            }
        }
        rows
    }
}
