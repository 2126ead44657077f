//! The normal between two boxes of one size: the direction along which they are farthest apart, or least deep.
//!
//! With the half extents h, the offset t of the second box and its axes R_j in those of the first, the gap along a unit
//! direction d is
//!
//! ```text
//! g(d) = |t . d| - sum_k h_k |d_k| - sum_j h_j |R_j . d|
//! ```
//!
//! and the largest of all is along an axis of either box, or across an edge of each (Gottschalk, Lin and Manocha, 1996).
//! Boxes that are apart along several of a box's axes are so along a line between them: parry's rule, which is followed
//! here to the choice among equals.

use parry3d_f64::math::{Pose, Vector};

const AXES: [Vector; 3] = [Vector::X, Vector::Y, Vector::Z];

/// The outward normals of both boxes in their own axes, if they are no more than `range` apart along them.
pub(super) fn across(pose: &Pose, half: Vector, range: f64) -> Option<[Vector; 2]> {
    let axes = AXES.map(|axis| pose.rotation * axis);
    let boxes = Boxes { half, offset: pose.translation, axes };
    let turned = axes.map(|axis| half.dot(axis.abs()));
    let of_one = boxes.by_faces(&AXES, |i| {
        half[i] + axes.iter().zip(half.to_array()).map(|(axis, h)| h * axis[i].abs()).sum::<f64>()
    });
    if of_one.0 > range {
        return None;
    }
    let of_other = boxes.by_faces(&axes, |j| half[j] + turned[j]);
    if of_other.0 > range {
        return None;
    }
    let of_edges = boxes.by_edges();
    if of_edges.0 > range {
        return None;
    }
    let normal = if of_other.0 > of_one.0 && of_other.0 > of_edges.0 {
        of_other.1
    } else if of_edges.0 > of_one.0 {
        of_edges.1
    } else {
        of_one.1
    };
    Some([normal, pose.rotation.inverse() * -normal])
}

/// Two boxes in the axes of the first.
struct Boxes {
    half: Vector,
    offset: Vector,
    /// R_j
    axes: [Vector; 3],
}

impl Boxes {
    /// The gap along a unit direction.
    fn gap(&self, along: Vector) -> f64 {
        let [x, y, z] = self.axes.map(|axis| axis.dot(along).abs());
        let reach = self.half.dot(along.abs()) + self.half.dot(Vector::new(x, y, z));
        self.offset.dot(along).abs() - reach
    }

    /// `along`, or its opposite, from the first box to the second.
    fn towards(&self, along: Vector) -> Vector {
        if self.offset.dot(along) < 0.0 { -along } else { along }
    }

    /// The largest gap along the axes of a box, and its direction; across a corner or an edge if there are gaps along
    /// more than one. `reach` is how far both boxes reach along an axis.
    fn by_faces(&self, axes: &[Vector; 3], reach: impl Fn(usize) -> f64) -> (f64, Vector) {
        let mut best = (f64::MIN, Vector::ZERO);
        let (mut sum, mut positive) = (Vector::ZERO, 0);
        for (number, &axis) in axes.iter().enumerate() {
            let gap = self.offset.dot(axis).abs() - reach(number);
            if gap > best.0 {
                best = (gap, axis);
            }
            if gap >= 0.0 {
                sum += self.towards(axis) * gap.max(f64::EPSILON);
                positive += 1;
            }
        }
        if positive < 2 {
            return (best.0, self.towards(best.1));
        }
        let along = sum.normalize();
        (self.gap(along), along)
    }

    /// The largest gap across an edge of each, and its direction. Along e_i x R_j, of the length s = sqrt(1 - R_ij^2),
    /// neither e_i nor R_j is reached.
    fn by_edges(&self) -> (f64, Vector) {
        let (h, t) = (self.half.to_array(), self.offset.to_array());
        let r = self.axes.map(|axis| axis.to_array());
        let (mut best, mut of_best) = (f64::MIN, (0, 0));
        for j in 0..3 {
            let [j1, j2] = [(j + 1) % 3, (j + 2) % 3];
            for i in 0..3 {
                let [i1, i2] = [(i + 1) % 3, (i + 2) % 3];
                let square = r[j][i1] * r[j][i1] + r[j][i2] * r[j][i2];
                // Edges that are parallel have no direction across both.
                if square <= f64::EPSILON * f64::EPSILON {
                    continue;
                }
                let apart = (t[i2] * r[j][i1] - t[i1] * r[j][i2]).abs();
                let of_one = h[i1] * r[j][i2].abs() + h[i2] * r[j][i1].abs();
                let of_other = h[j1] * r[j2][i].abs() + h[j2] * r[j1][i].abs();
                let gap = (apart - of_one - of_other) / square.sqrt();
                if gap > best {
                    (best, of_best) = (gap, (i, j));
                }
            }
        }
        let (i, j) = of_best;
        let along = AXES[i].cross(self.axes[j]);
        (best, self.towards(along.normalize_or_zero()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use parry3d_f64::math::Rotation;
    use parry3d_f64::query::{
        ContactManifold, DefaultQueryDispatcher, PersistentQueryDispatcher as _,
    };
    use parry3d_f64::shape::Cuboid;
    use proptest::prelude::*;

    proptest! {
        /// The same normal as parry's, or one along which the boxes are as far apart.
        #[test]
        fn the_normal_is_parry_s(
            half in prop::array::uniform3(0.3..1.0_f64),
            offset in prop::array::uniform3(-2.0..2.0_f64),
            q in prop::array::uniform4(-1.0..1.0_f64),
            is_aligned in any::<bool>(),
        ) {
            let rotation = if is_aligned {
                Rotation::IDENTITY
            } else {
                Rotation::from_xyzw(q[0], q[1], q[2], q[3] + 1.5).normalize()
            };
            let half = Vector::new(half[0], half[1], half[2]);
            let pose = Pose::from_parts(Vector::new(offset[0], offset[1], offset[2]), rotation);
            let cuboid = Cuboid::new(half);
            let range = 0.05;
            let mut theirs = ContactManifold::<(), ()>::new();
            DefaultQueryDispatcher
                .contact_manifold_convex_convex(
                    &pose, &cuboid, &cuboid, None, None, range, &mut theirs,
                )
                .unwrap();
            let Some([normal, against]) = across(&pose, half, range) else {
                prop_assert!(theirs.points.is_empty());
                return Ok(());
            };
            prop_assert!((normal.length() - 1.0).abs() < 1e-12);
            prop_assert!((pose.rotation * against + normal).length() < 1e-12);
            if theirs.points.is_empty() {
                return Ok(());
            }
            let axes = AXES.map(|axis| rotation * axis);
            let boxes = Boxes { half, offset: pose.translation, axes };
            prop_assert!((boxes.gap(normal) - boxes.gap(theirs.local_n1)).abs() < 1e-12);
            prop_assert!(boxes.offset.dot(normal) >= 0.0);
        }
    }
}
