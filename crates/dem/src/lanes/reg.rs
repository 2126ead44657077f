//! A batch's numbers and vectors in registers, with the operators of arithmetic.

use std::ops::{Add, Mul, Sub};

use super::{LANES, Lanes, Lanes3, Width};

/// One number for each contact of a batch, in registers.
#[derive(Clone, Copy)]
pub(crate) struct Reg<W: Width>(pub W::Value);

/// One 3-vector for each contact of a batch, in registers.
#[derive(Clone, Copy)]
pub(crate) struct Reg3<W: Width> {
    pub x: Reg<W>,
    pub y: Reg<W>,
    pub z: Reg<W>,
}

impl<W: Width> Reg<W> {
    #[inline(always)]
    pub fn splat(value: f64) -> Self {
        Self(W::splat(value))
    }

    #[inline(always)]
    pub fn load(from: &Lanes) -> Self {
        Self(W::load(from))
    }

    #[inline(always)]
    pub fn store(self, to: &mut Lanes) {
        W::store(self.0, to);
    }

    #[inline(always)]
    pub fn sqrt(self) -> Self {
        Self(W::sqrt(self.0))
    }

    /// `self / other`.
    #[inline(always)]
    pub fn over(self, other: Self) -> Self {
        Self(W::div(self.0, other.0))
    }

    /// `yes` where `self < other`, `no` elsewhere.
    #[inline(always)]
    pub fn if_less(self, other: Self, yes: Self, no: Self) -> Self {
        Self(W::select_less(self.0, other.0, yes.0, no.0))
    }

    /// `self * factor + other`, rounded once.
    #[inline(always)]
    pub fn times_plus(self, factor: Self, other: Self) -> Self {
        Self(W::mul_add(self.0, factor.0, other.0))
    }

    /// `self - a * b`, rounded once.
    #[inline(always)]
    pub fn minus(self, a: Self, b: Self) -> Self {
        Self(W::mul_sub_from(a.0, b.0, self.0))
    }

    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        Self(W::max(self.0, other.0))
    }

    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        Self(W::min(self.0, other.0))
    }
}

impl<W: Width> Reg3<W> {
    #[inline(always)]
    pub fn load(from: &Lanes3) -> Self {
        Self { x: Reg::load(&from.x), y: Reg::load(&from.y), z: Reg::load(&from.z) }
    }

    #[inline(always)]
    pub fn store(self, to: &mut Lanes3) {
        self.x.store(&mut to.x);
        self.y.store(&mut to.y);
        self.z.store(&mut to.z);
    }

    #[inline(always)]
    pub fn dot(self, other: Self) -> Reg<W> {
        self.x.times_plus(other.x, self.y.times_plus(other.y, self.z * other.z))
    }

    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        Self {
            x: (self.y * other.z).minus(self.z, other.y),
            y: (self.z * other.x).minus(self.x, other.z),
            z: (self.x * other.y).minus(self.y, other.x),
        }
    }

    #[inline(always)]
    pub fn scale(self, factor: Reg<W>) -> Self {
        Self { x: self.x * factor, y: self.y * factor, z: self.z * factor }
    }

    /// `self + factor * other`.
    #[inline(always)]
    pub fn plus(self, factor: Reg<W>, other: Self) -> Self {
        Self {
            x: factor.times_plus(other.x, self.x),
            y: factor.times_plus(other.y, self.y),
            z: factor.times_plus(other.z, self.z),
        }
    }

    /// `self - factor * other`.
    #[inline(always)]
    pub fn minus(self, factor: Reg<W>, other: Self) -> Self {
        Self {
            x: self.x.minus(factor, other.x),
            y: self.y.minus(factor, other.y),
            z: self.z.minus(factor, other.z),
        }
    }

    #[inline(always)]
    pub fn norm(self) -> Reg<W> {
        self.dot(self).sqrt()
    }
}

impl<W: Width> Add for Reg<W> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(W::add(self.0, other.0))
    }
}

impl<W: Width> Sub for Reg<W> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(W::sub(self.0, other.0))
    }
}

impl<W: Width> Mul for Reg<W> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(W::mul(self.0, other.0))
    }
}

impl<W: Width> Add for Reg3<W> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

impl<W: Width> Sub for Reg3<W> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}

/// The vectors of eight rows, one for each lane.
#[inline(always)]
pub(crate) fn vectors<W: Width>(rows: [W::Quad; LANES]) -> Reg3<W> {
    let [x, y, z, _] = W::columns(rows);
    Reg3 { x: Reg(x), y: Reg(y), z: Reg(z) }
}
