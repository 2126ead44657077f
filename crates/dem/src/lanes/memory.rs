//! Eight numbers side by side, and the four of a grain, as they lie in memory.

use nalgebra::Vector3;
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

    /// Replaces the vector.
    #[inline(always)]
    pub fn set(&mut self, vector: &Vector3<f64>) {
        self.0[..3].copy_from_slice(vector.as_slice());
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
