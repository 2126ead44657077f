//! Eight numbers side by side: the arithmetic of one batch of contacts.
//!
//! [`Lanes`] is how they lie in memory, [`Reg`] how they are computed with, on whatever registers a
//! [`Width`] has. Every operation is correctly rounded, the fused multiply-add too, and none is an approximate
//! reciprocal: every width gives the same bits.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod portable;
mod reg;

#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::Avx2;
#[cfg(target_arch = "x86_64")]
pub(crate) use avx512::Avx512;
use nalgebra::Vector3;
pub(crate) use portable::Portable;
pub(crate) use reg::{Reg, Reg3, vectors};
use serde::{Deserialize, Serialize};

/// Contacts in a batch.
pub(crate) const LANES: usize = 8;

/// One number for each contact of a batch, in memory.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[repr(C, align(64))]
pub(crate) struct Lanes(pub [f64; LANES]);

/// Four numbers of one grain, in memory: a vector and a fourth number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[repr(C, align(32))]
pub(crate) struct Row(pub [f64; 4]);

impl Row {
    /// The vector.
    #[inline(always)]
    pub fn vector(&self) -> Vector3<f64> {
        Vector3::new(self.0[0], self.0[1], self.0[2])
    }

    /// A vector and a fourth number.
    #[inline(always)]
    pub fn new(vector: &Vector3<f64>, fourth: f64) -> Self {
        Self([vector.x, vector.y, vector.z, fourth])
    }

    /// Adds `step` to the vector.
    #[inline(always)]
    pub fn add(&mut self, step: &Vector3<f64>) {
        self.0[0] += step.x;
        self.0[1] += step.y;
        self.0[2] += step.z;
    }

    /// Multiplies the vector by `factor`.
    #[inline(always)]
    pub fn scale(&mut self, factor: f64) {
        self.0[..3].iter_mut().for_each(|c| *c *= factor);
    }
}

/// One 3-vector for each contact of a batch, component by component, in memory.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Lanes3 {
    pub x: Lanes,
    pub y: Lanes,
    pub z: Lanes,
}

impl Lanes {
    pub const ZERO: Self = Self([0.0; LANES]);

    pub fn splat(value: f64) -> Self {
        Self([value; LANES])
    }
}

impl Lanes3 {
    pub const ZERO: Self = Self { x: Lanes::ZERO, y: Lanes::ZERO, z: Lanes::ZERO };

    /// Puts `value` into lane `lane`.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, value: [f64; 3]) {
        self.x.0[lane] = value[0];
        self.y.0[lane] = value[1];
        self.z.0[lane] = value[2];
    }

    /// The vector in lane `lane`.
    #[inline(always)]
    pub fn get(&self, lane: usize) -> [f64; 3] {
        [self.x.0[lane], self.y.0[lane], self.z.0[lane]]
    }
}

/// `f` of every lane's index; written out, for an array's own `map` is not inlined into the wide kernels.
#[inline(always)]
pub(crate) fn each<T>(index: &[u32; LANES], f: impl Fn(u32) -> T) -> [T; LANES] {
    let [a, b, c, d, e, g, h, i] = *index;
    [f(a), f(b), f(c), f(d), f(e), f(g), f(h), f(i)]
}

/// The operations that the contact kernels are written in, on one kind of machine.
///
/// Implementations for wide registers may only be used behind [`widest`], which tests for them.
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
/// the [`Width`] that it is compiled for.
macro_rules! widest {
    ($(#[$doc:meta])* $vis:vis fn $name:ident<$width:ident>($($arg:ident: $kind:ty),* $(,)?) $(-> $out:ty)? $body:block) => {
        $(#[$doc])*
        #[allow(unsafe_code)] // calls of functions that need the vector width just tested for
        $vis fn $name($($arg: $kind),*) $(-> $out)? {
            #[inline(always)]
            fn with<$width: $crate::lanes::Width>($($arg: $kind),*) $(-> $out)? $body

            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw")]
                fn avx512($($arg: $kind),*) $(-> $out)? {
                    with::<$crate::lanes::Avx512>($($arg),*)
                }
                #[target_feature(enable = "avx2,fma")]
                fn avx2($($arg: $kind),*) $(-> $out)? {
                    with::<$crate::lanes::Avx2>($($arg),*)
                }
                if $crate::lanes::may_use(512)
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512bw")
                {
                    // SAFETY: the features were detected on this machine.
                    return unsafe { avx512($($arg),*) };
                }
                if $crate::lanes::may_use(256)
                    && is_x86_feature_detected!("avx2")
                    && is_x86_feature_detected!("fma")
                {
                    // SAFETY: the feature was detected on this machine.
                    return unsafe { avx2($($arg),*) };
                }
            }
            with::<$crate::lanes::Portable>($($arg),*)
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
