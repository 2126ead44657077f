//! Where a body is and how it is turned.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::turning::{inverse_inertia, turns_alike};

/// Where a body is and how it is turned.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pose {
    /// Centre of mass `[m]`.
    pub centre: Vector3<f64>,
    /// From the body's axes to the scene's.
    pub turned: UnitQuaternion<f64>,
    /// The same as a matrix R: its columns are the body's axes.
    pub axes: Matrix3<f64>,
}

impl Pose {
    pub fn new(centre: Vector3<f64>, turned: UnitQuaternion<f64>) -> Self {
        Self { centre, turned, axes: turned.to_rotation_matrix().into_inner() }
    }

    /// A vector of the scene in the body's axes.
    #[inline(always)]
    pub fn seen(&self, vector: &Vector3<f64>) -> Vector3<f64> {
        self.axes.tr_mul(vector)
    }

    /// The inverse of the tensor of inertia over the mass, in the scene's axes, from its moments about the body's.
    pub fn inverse_inertia(&self, moments: &Vector3<f64>) -> Matrix3<f64> {
        if turns_alike(moments) {
            return Matrix3::from_diagonal_element(1.0 / moments.x);
        }
        inverse_inertia(&self.axes, moments)
    }
}
