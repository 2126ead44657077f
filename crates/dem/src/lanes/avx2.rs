//! Machines with 256-bit registers: two registers hold a batch.
#![allow(unsafe_code)] // intrinsics; `widest` tests for the registers before it comes here

use std::arch::x86_64::{
    __m256d, _CMP_LT_OQ, _mm256_add_pd, _mm256_blendv_pd, _mm256_cmp_pd, _mm256_div_pd,
    _mm256_fmadd_pd, _mm256_fnmadd_pd, _mm256_load_pd, _mm256_max_pd, _mm256_min_pd,
    _mm256_movemask_pd, _mm256_mul_pd, _mm256_permute2f128_pd, _mm256_set1_pd, _mm256_sqrt_pd,
    _mm256_store_pd, _mm256_sub_pd, _mm256_unpackhi_pd, _mm256_unpacklo_pd,
};

use super::{LANES, Lanes, Row, Width};

/// 256-bit registers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Avx2;

type Pair = [__m256d; 2];

// SAFETY of every block below: the registers are there, and `Lanes` is aligned to 64 bytes and 64 bytes long.
impl Width for Avx2 {
    type Value = Pair;
    type Quad = __m256d;

    #[inline(always)]
    fn load(from: &Lanes) -> Pair {
        let start = from.0.as_ptr();
        unsafe { [_mm256_load_pd(start), _mm256_load_pd(start.add(4))] }
    }
    #[inline(always)]
    fn store(value: Pair, to: &mut Lanes) {
        let start = to.0.as_mut_ptr();
        unsafe {
            _mm256_store_pd(start, value[0]);
            _mm256_store_pd(start.add(4), value[1]);
        }
    }
    #[inline(always)]
    fn splat(value: f64) -> Pair {
        unsafe { [_mm256_set1_pd(value); 2] }
    }
    #[inline(always)]
    fn add(a: Pair, b: Pair) -> Pair {
        unsafe { [_mm256_add_pd(a[0], b[0]), _mm256_add_pd(a[1], b[1])] }
    }
    #[inline(always)]
    fn sub(a: Pair, b: Pair) -> Pair {
        unsafe { [_mm256_sub_pd(a[0], b[0]), _mm256_sub_pd(a[1], b[1])] }
    }
    #[inline(always)]
    fn mul(a: Pair, b: Pair) -> Pair {
        unsafe { [_mm256_mul_pd(a[0], b[0]), _mm256_mul_pd(a[1], b[1])] }
    }
    #[inline(always)]
    fn mul_add(a: Pair, b: Pair, c: Pair) -> Pair {
        unsafe { [_mm256_fmadd_pd(a[0], b[0], c[0]), _mm256_fmadd_pd(a[1], b[1], c[1])] }
    }
    #[inline(always)]
    fn mul_sub_from(a: Pair, b: Pair, c: Pair) -> Pair {
        unsafe { [_mm256_fnmadd_pd(a[0], b[0], c[0]), _mm256_fnmadd_pd(a[1], b[1], c[1])] }
    }
    #[inline(always)]
    fn div(a: Pair, b: Pair) -> Pair {
        unsafe { [_mm256_div_pd(a[0], b[0]), _mm256_div_pd(a[1], b[1])] }
    }
    #[inline(always)]
    fn sqrt(a: Pair) -> Pair {
        unsafe { [_mm256_sqrt_pd(a[0]), _mm256_sqrt_pd(a[1])] }
    }
    #[inline(always)]
    fn select_less(a: Pair, b: Pair, yes: Pair, no: Pair) -> Pair {
        unsafe {
            [
                _mm256_blendv_pd(no[0], yes[0], _mm256_cmp_pd::<_CMP_LT_OQ>(a[0], b[0])),
                _mm256_blendv_pd(no[1], yes[1], _mm256_cmp_pd::<_CMP_LT_OQ>(a[1], b[1])),
            ]
        }
    }

    // The machine's maximum takes its second operand where the first is not greater.
    #[inline(always)]
    fn max(a: Pair, b: Pair) -> Pair {
        unsafe { [_mm256_max_pd(b[0], a[0]), _mm256_max_pd(b[1], a[1])] }
    }
    #[inline(always)]
    fn min(a: Pair, b: Pair) -> Pair {
        unsafe { [_mm256_min_pd(a[0], b[0]), _mm256_min_pd(a[1], b[1])] }
    }
    #[inline(always)]
    fn less_bits(a: Pair, b: Pair) -> u32 {
        unsafe {
            let low = _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LT_OQ>(a[0], b[0]));
            let high = _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LT_OQ>(a[1], b[1]));
            (low | high << 4) as u32
        }
    }
    #[inline(always)]
    fn load_row(from: &Row) -> __m256d {
        unsafe { _mm256_load_pd(from.0.as_ptr()) }
    }
    #[inline(always)]
    fn store_row(value: __m256d, to: &mut Row) {
        unsafe { _mm256_store_pd(to.0.as_mut_ptr(), value) }
    }
    #[inline(always)]
    fn columns(rows: [__m256d; LANES]) -> [Pair; 4] {
        let [r0, r1, r2, r3, r4, r5, r6, r7] = rows;
        let [a0, a1, a2, a3] = square(r0, r1, r2, r3);
        let [b0, b1, b2, b3] = square(r4, r5, r6, r7);
        [[a0, b0], [a1, b1], [a2, b2], [a3, b3]]
    }
    #[inline(always)]
    fn rows(columns: [Pair; 4]) -> [__m256d; LANES] {
        let [c0, c1, c2, c3] = columns;
        let [r0, r1, r2, r3] = square(c0[0], c1[0], c2[0], c3[0]);
        let [r4, r5, r6, r7] = square(c0[1], c1[1], c2[1], c3[1]);
        [r0, r1, r2, r3, r4, r5, r6, r7]
    }
}

/// The transpose of four rows of four.
#[inline(always)]
fn square(p: __m256d, q: __m256d, r: __m256d, s: __m256d) -> [__m256d; 4] {
    /// Lower halves of two registers; upper halves.
    const LOW: i32 = 0x20;
    const HIGH: i32 = 0x31;
    unsafe {
        let (a, b) = (_mm256_unpacklo_pd(p, q), _mm256_unpackhi_pd(p, q));
        let (c, d) = (_mm256_unpacklo_pd(r, s), _mm256_unpackhi_pd(r, s));
        [
            _mm256_permute2f128_pd::<LOW>(a, c),
            _mm256_permute2f128_pd::<LOW>(b, d),
            _mm256_permute2f128_pd::<HIGH>(a, c),
            _mm256_permute2f128_pd::<HIGH>(b, d),
        ]
    }
}
