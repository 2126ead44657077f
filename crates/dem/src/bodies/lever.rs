//! What a point's arm does in coordinates in which a body has the inertia 1.
//!
//! ```text
//! I^-1 = F F^T,   omega = F s,   B = -[r] F:   omega x r = B s,   an impulse adds B^T lambda to s
//! ```
//!
//! Any such F will do. Of a body that turns alike about all axes, a cube, F = 1 / sqrt(I), and with a = r / sqrt(I) B s
//! is s x a: a third of the numbers.

use nalgebra::{Matrix3, Vector3};

use super::body::Moving;
use crate::lanes::{Lanes3, Reg3, Width};
use granulcal_scene::Solid;

/// B of eight points.
pub(super) trait Lever: Clone + std::fmt::Debug {
    /// No arm.
    const NONE: Self;

    /// F of a body.
    fn frame(body: &Moving, solid: &Solid) -> Matrix3<f64>;

    /// Puts the arm of a point into a lane.
    fn set(&mut self, lane: usize, arm: &Vector3<f64>, frame: &Matrix3<f64>);

    /// `B s`: what turning adds to the velocity at the point.
    fn velocity<W: Width>(&self, s: Reg3<W>) -> Reg3<W>;

    /// `B^T impulse`: what an impulse at the point adds to s.
    fn turn<W: Width>(&self, impulse: Reg3<W>) -> Reg3<W>;
}

/// Of a body that turns alike about all axes: a.
#[derive(Clone, Debug)]
pub(super) struct Arm(Lanes3);

impl Lever for Arm {
    const NONE: Self = Self(Lanes3::ZERO);

    fn frame(_: &Moving, solid: &Solid) -> Matrix3<f64> {
        Matrix3::from_diagonal_element(1.0 / solid.inertia.x.sqrt())
    }

    #[inline(always)]
    fn set(&mut self, lane: usize, arm: &Vector3<f64>, frame: &Matrix3<f64>) {
        self.0.set(lane, (frame.m11 * arm).into());
    }

    #[inline(always)]
    fn velocity<W: Width>(&self, s: Reg3<W>) -> Reg3<W> {
        s.cross(Reg3::load(&self.0))
    }

    #[inline(always)]
    fn turn<W: Width>(&self, impulse: Reg3<W>) -> Reg3<W> {
        Reg3::load(&self.0).cross(impulse)
    }
}

/// Of any body: the rows of B.
#[derive(Clone, Debug)]
pub(super) struct Rows([Lanes3; 3]);

impl Lever for Rows {
    const NONE: Self = Self([Lanes3::ZERO; 3]);

    /// `F = R I^(-1/2)`.
    fn frame(body: &Moving, solid: &Solid) -> Matrix3<f64> {
        let roots = solid.inertia.map(|moment| 1.0 / moment.sqrt());
        body.pose.axes * Matrix3::from_diagonal(&roots)
    }

    #[inline(always)]
    fn set(&mut self, lane: usize, arm: &Vector3<f64>, frame: &Matrix3<f64>) {
        let turn = -arm.cross_matrix() * frame;
        for (row, lanes) in self.0.iter_mut().enumerate() {
            lanes.set(lane, [turn[(row, 0)], turn[(row, 1)], turn[(row, 2)]]);
        }
    }

    #[inline(always)]
    fn velocity<W: Width>(&self, s: Reg3<W>) -> Reg3<W> {
        let [x, y, z] = self.rows();
        Reg3 { x: x.dot(s), y: y.dot(s), z: z.dot(s) }
    }

    #[inline(always)]
    fn turn<W: Width>(&self, impulse: Reg3<W>) -> Reg3<W> {
        let [x, y, z] = self.rows();
        x.scale(impulse.x).plus(impulse.y, y).plus(impulse.z, z)
    }
}

impl Rows {
    /// Written out, for an array's own `map` is not inlined into the wide kernels.
    #[inline(always)]
    fn rows<W: Width>(&self) -> [Reg3<W>; 3] {
        let [x, y, z] = &self.0;
        [Reg3::load(x), Reg3::load(y), Reg3::load(z)]
    }
}
