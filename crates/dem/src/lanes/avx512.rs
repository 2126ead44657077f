//! Machines with 512-bit registers: one register holds a batch.
#![allow(unsafe_code)] // intrinsics; `widest` tests for the registers before it comes here

use std::arch::x86_64::{
    __m256d, __m512d, _CMP_LT_OQ, _mm256_load_pd, _mm256_store_pd, _mm512_add_pd,
    _mm512_castpd256_pd512, _mm512_castpd512_pd256, _mm512_cmp_pd_mask, _mm512_div_pd,
    _mm512_extractf64x4_pd, _mm512_fmadd_pd, _mm512_fnmadd_pd, _mm512_insertf64x4, _mm512_load_pd,
    _mm512_mask_blend_pd, _mm512_max_pd, _mm512_min_pd, _mm512_mul_pd, _mm512_permutex2var_pd,
    _mm512_set_epi64, _mm512_set1_pd, _mm512_shuffle_f64x2, _mm512_sqrt_pd, _mm512_store_pd,
    _mm512_sub_pd, _mm512_unpackhi_pd, _mm512_unpacklo_pd,
};

use super::{LANES, Lanes, Row, Width};

/// 512-bit registers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Avx512;

// SAFETY of every block below: the registers are there, and `Lanes` is aligned to the 64 bytes that it is long.
impl Width for Avx512 {
    type Value = __m512d;
    type Quad = __m256d;

    #[inline(always)]
    fn load(from: &Lanes) -> __m512d {
        unsafe { _mm512_load_pd(from.0.as_ptr()) }
    }
    #[inline(always)]
    fn store(value: __m512d, to: &mut Lanes) {
        unsafe { _mm512_store_pd(to.0.as_mut_ptr(), value) }
    }
    #[inline(always)]
    fn splat(value: f64) -> __m512d {
        unsafe { _mm512_set1_pd(value) }
    }
    #[inline(always)]
    fn add(a: __m512d, b: __m512d) -> __m512d {
        unsafe { _mm512_add_pd(a, b) }
    }
    #[inline(always)]
    fn sub(a: __m512d, b: __m512d) -> __m512d {
        unsafe { _mm512_sub_pd(a, b) }
    }
    #[inline(always)]
    fn mul(a: __m512d, b: __m512d) -> __m512d {
        unsafe { _mm512_mul_pd(a, b) }
    }
    #[inline(always)]
    fn mul_add(a: __m512d, b: __m512d, c: __m512d) -> __m512d {
        unsafe { _mm512_fmadd_pd(a, b, c) }
    }
    #[inline(always)]
    fn mul_sub_from(a: __m512d, b: __m512d, c: __m512d) -> __m512d {
        unsafe { _mm512_fnmadd_pd(a, b, c) }
    }
    #[inline(always)]
    fn div(a: __m512d, b: __m512d) -> __m512d {
        unsafe { _mm512_div_pd(a, b) }
    }
    #[inline(always)]
    fn sqrt(a: __m512d) -> __m512d {
        unsafe { _mm512_sqrt_pd(a) }
    }
    #[inline(always)]
    fn select_less(a: __m512d, b: __m512d, yes: __m512d, no: __m512d) -> __m512d {
        unsafe { _mm512_mask_blend_pd(_mm512_cmp_pd_mask::<_CMP_LT_OQ>(a, b), no, yes) }
    }

    // The machine's maximum takes its second operand where the first is not greater.
    #[inline(always)]
    fn max(a: __m512d, b: __m512d) -> __m512d {
        unsafe { _mm512_max_pd(b, a) }
    }
    #[inline(always)]
    fn min(a: __m512d, b: __m512d) -> __m512d {
        unsafe { _mm512_min_pd(a, b) }
    }
    #[inline(always)]
    fn less_bits(a: __m512d, b: __m512d) -> u32 {
        unsafe { u32::from(_mm512_cmp_pd_mask::<_CMP_LT_OQ>(a, b)) }
    }
    #[inline(always)]
    fn load_row(from: &Row) -> __m256d {
        unsafe { _mm256_load_pd(from.0.as_ptr()) }
    }
    #[inline(always)]
    fn store_row(value: __m256d, to: &mut Row) {
        unsafe { _mm256_store_pd(to.0.as_mut_ptr(), value) }
    }

    /// Two rows a register, so that the even and odd numbers of four rows are two rounds of shuffles away.
    #[inline(always)]
    fn columns(rows: [__m256d; LANES]) -> [__m512d; 4] {
        /// First and third quarters of two registers; second and fourth.
        const EVEN: i32 = 0b10_00_10_00;
        const ODD: i32 = 0b11_01_11_01;
        let [r0, r1, r2, r3, r4, r5, r6, r7] = rows;
        unsafe {
            let (a, b) = (both(r0, r2), both(r1, r3));
            let (c, d) = (both(r4, r6), both(r5, r7));
            let (ab, cd) = (_mm512_unpacklo_pd(a, b), _mm512_unpacklo_pd(c, d));
            let (ab1, cd1) = (_mm512_unpackhi_pd(a, b), _mm512_unpackhi_pd(c, d));
            [
                _mm512_shuffle_f64x2::<EVEN>(ab, cd),
                _mm512_shuffle_f64x2::<EVEN>(ab1, cd1),
                _mm512_shuffle_f64x2::<ODD>(ab, cd),
                _mm512_shuffle_f64x2::<ODD>(ab1, cd1),
            ]
        }
    }

    #[inline(always)]
    fn rows(columns: [__m512d; 4]) -> [__m256d; LANES] {
        let [x, y, z, w] = columns;
        unsafe {
            // The first quarters of two registers side by side, then the second ones; thirds and fourths.
            let front = _mm512_set_epi64(11, 10, 3, 2, 9, 8, 1, 0);
            let back = _mm512_set_epi64(15, 14, 7, 6, 13, 12, 5, 4);
            let (even, odd) = (_mm512_unpacklo_pd(x, y), _mm512_unpackhi_pd(x, y));
            let (even1, odd1) = (_mm512_unpacklo_pd(z, w), _mm512_unpackhi_pd(z, w));
            let [r0, r2] = halves(_mm512_permutex2var_pd(even, front, even1));
            let [r4, r6] = halves(_mm512_permutex2var_pd(even, back, even1));
            let [r1, r3] = halves(_mm512_permutex2var_pd(odd, front, odd1));
            let [r5, r7] = halves(_mm512_permutex2var_pd(odd, back, odd1));
            [r0, r1, r2, r3, r4, r5, r6, r7]
        }
    }
}

#[inline(always)]
fn both(low: __m256d, high: __m256d) -> __m512d {
    unsafe { _mm512_insertf64x4::<1>(_mm512_castpd256_pd512(low), high) }
}

#[inline(always)]
fn halves(value: __m512d) -> [__m256d; 2] {
    unsafe { [_mm512_castpd512_pd256(value), _mm512_extractf64x4_pd::<1>(value)] }
}
