//! Machines with 512-bit registers: one register holds a batch.
#![allow(unsafe_code)] // intrinsics; `widest` tests for the registers before it comes here

use std::arch::x86_64::{
    __m512d, _CMP_LT_OQ, _mm512_add_pd, _mm512_cmp_pd_mask, _mm512_div_pd, _mm512_load_pd,
    _mm512_mask_blend_pd, _mm512_mul_pd, _mm512_set1_pd, _mm512_shuffle_f64x2, _mm512_sqrt_pd,
    _mm512_store_pd, _mm512_sub_pd, _mm512_unpackhi_pd, _mm512_unpacklo_pd,
};

use super::{LANES, Lanes, Width};

/// 512-bit registers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Avx512;

// SAFETY of every block below: the registers are there, and `Lanes` is aligned to the 64 bytes that it is long.
impl Width for Avx512 {
    type Value = __m512d;

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

    /// Three rounds of eight shuffles: pairs of rows, then 128-bit quarters of four rows, then of eight.
    #[inline(always)]
    fn transpose(rows: [__m512d; LANES]) -> [__m512d; LANES] {
        let [r0, r1, r2, r3, r4, r5, r6, r7] = rows;
        let [c0, c2, c4, c6] = unsafe {
            quarters(
                _mm512_unpacklo_pd(r0, r1),
                _mm512_unpacklo_pd(r2, r3),
                _mm512_unpacklo_pd(r4, r5),
                _mm512_unpacklo_pd(r6, r7),
            )
        };
        let [c1, c3, c5, c7] = unsafe {
            quarters(
                _mm512_unpackhi_pd(r0, r1),
                _mm512_unpackhi_pd(r2, r3),
                _mm512_unpackhi_pd(r4, r5),
                _mm512_unpackhi_pd(r6, r7),
            )
        };
        [c0, c1, c2, c3, c4, c5, c6, c7]
    }
}

/// Each argument holds, in its quarters, every other column of two rows: puts the quarters together.
#[inline(always)]
fn quarters(p: __m512d, q: __m512d, r: __m512d, s: __m512d) -> [__m512d; 4] {
    /// First and third quarters of two registers; second and fourth.
    const EVEN: i32 = 0b10_00_10_00;
    const ODD: i32 = 0b11_01_11_01;
    unsafe {
        let a = _mm512_shuffle_f64x2::<EVEN>(p, q);
        let b = _mm512_shuffle_f64x2::<ODD>(p, q);
        let c = _mm512_shuffle_f64x2::<EVEN>(r, s);
        let d = _mm512_shuffle_f64x2::<ODD>(r, s);
        [
            _mm512_shuffle_f64x2::<EVEN>(a, c),
            _mm512_shuffle_f64x2::<EVEN>(b, d),
            _mm512_shuffle_f64x2::<ODD>(a, c),
            _mm512_shuffle_f64x2::<ODD>(b, d),
        ]
    }
}
