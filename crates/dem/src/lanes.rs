//! Eight numbers side by side: the arithmetic of one batch of contacts.
//!
//! [`Lanes`] is how they lie in memory, [`Reg`] how they are computed with, on whatever registers a
//! [`Width`] has. Every operation is correctly rounded, the fused multiply-add too, and none is an approximate
//! reciprocal: every width gives the same bits.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod memory;
mod portable;
mod reg;
mod width;

#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::Avx2;
#[cfg(target_arch = "x86_64")]
pub(crate) use avx512::Avx512;
pub(crate) use memory::{LANES, Lanes, Lanes3, Row, each};
pub(crate) use portable::Portable;
pub(crate) use reg::{Reg, Reg3, vectors};
pub(crate) use width::Width;

/// The widest registers that kernels may use `[bits]`. Only tests ask for less, to compare.
#[cfg(test)]
pub(crate) static WIDEST: std::sync::atomic::AtomicU32 = std::sync::atomic::AtomicU32::new(512);

/// Whether kernels may use registers of so many bits.
#[inline(always)]
pub(crate) fn may_use(bits: u32) -> bool {
    #[cfg(test)]
    return bits <= WIDEST.load(std::sync::atomic::Ordering::Relaxed);
    #[cfg(not(test))]
    return bits <= 512;
}

/// Compiles a function three times, for AVX-512, AVX2 and the target's baseline, and calls the widest
/// that this machine has. The body must be inlined for the wider registers to reach it; `$width` names
/// the [`Width`] that it is compiled for. It may have one more type, of a trait.
macro_rules! widest {
    ($(#[$doc:meta])* $vis:vis fn $name:ident<$width:ident $(, $more:ident: $bound:path)?>($($arg:ident: $kind:ty),* $(,)?) $(-> $out:ty)? $body:block) => {
        $(#[$doc])*
        #[allow(unsafe_code)] // calls of functions that need the vector width just tested for
        $vis fn $name$(<$more: $bound>)?($($arg: $kind),*) $(-> $out)? {
            #[inline(always)]
            fn with<$width: $crate::lanes::Width $(, $more: $bound)?>($($arg: $kind),*) $(-> $out)? $body

            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw")]
                fn avx512$(<$more: $bound>)?($($arg: $kind),*) $(-> $out)? {
                    with::<$crate::lanes::Avx512 $(, $more)?>($($arg),*)
                }
                #[target_feature(enable = "avx2,fma")]
                fn avx2$(<$more: $bound>)?($($arg: $kind),*) $(-> $out)? {
                    with::<$crate::lanes::Avx2 $(, $more)?>($($arg),*)
                }
                if $crate::lanes::may_use(512)
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512bw")
                {
                    // SAFETY: the features were detected on this machine.
                    return unsafe { avx512$(::<$more>)?($($arg),*) };
                }
                if $crate::lanes::may_use(256)
                    && is_x86_feature_detected!("avx2")
                    && is_x86_feature_detected!("fma")
                {
                    // SAFETY: the feature was detected on this machine.
                    return unsafe { avx2$(::<$more>)?($($arg),*) };
                }
            }
            with::<$crate::lanes::Portable $(, $more)?>($($arg),*)
        }
    };
}
pub(crate) use widest;

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(seed: f64) -> [Lanes; LANES] {
        std::array::from_fn(|r| Lanes(std::array::from_fn(|c| (seed * (10 * r + c) as f64).sin())))
    }

    /// Every operation once, on whatever width.
    #[inline(always)]
    fn exercise<W: Width>(a: &[Lanes; LANES], b: &[Lanes; LANES]) -> ([Lanes; LANES], u32) {
        let mut bits = 0;
        let values: [W::Value; LANES] = std::array::from_fn(|r| {
            let (a, b) = (W::load(&a[r]), W::load(&b[r]));
            let square = W::add(W::mul(a, a), W::splat(0.5));
            let root = W::mul_add(a, b, W::mul_sub_from(b, W::sqrt(square), W::div(b, square)));
            bits = bits << 4 ^ W::less_bits(a, b);
            W::min(W::select_less(a, b, root, W::mul(root, b)), W::max(a, b))
        });
        let [p, q, r, s, t, u, v, w] = values;
        let rows = [W::rows([p, q, r, s]), W::rows([t, u, v, w])];
        let mut out = [Lanes::ZERO; LANES];
        for (half, rows) in rows.into_iter().enumerate() {
            let mut memory = [Row::default(); LANES];
            for (row, memory) in rows.into_iter().zip(&mut memory) {
                W::store_row(row, memory);
            }
            let back = W::columns(memory.each_ref().map(W::load_row));
            for (column, value) in back.into_iter().enumerate() {
                W::store(value, &mut out[4 * half + column]);
            }
            for (lane, row) in memory.iter().enumerate() {
                for column in 0..4 {
                    assert_eq!(row.0[column], out[4 * half + column].0[lane]);
                }
            }
        }
        (out, bits)
    }

    widest! {
        fn exercise_widest<W>(a: &[Lanes; LANES], b: &[Lanes; LANES]) -> ([Lanes; LANES], u32) {
            exercise::<W>(a, b)
        }
    }

    #[test]
    fn every_width_gives_the_same_bits() {
        let (a, b) = (numbers(0.7), numbers(1.3));
        let expected = exercise::<Portable>(&a, &b);
        assert_eq!(exercise_widest(&a, &b), expected);
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            assert_eq!(exercise::<Avx2>(&a, &b), expected);
        }
    }
}
