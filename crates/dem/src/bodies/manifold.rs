//! Where two bodies are nearest, as parry sees them. The only file of this room that asks it.
//!
//! The normal comes from the nearest points of the bodies' cores, which are the bodies scaled by 1 - [`SHRUNK`] about
//! their centres: bodies that rest on each other overlap by a little, and the way out of an overlap takes parry's EPA
//! several times as long as the way between what is apart takes GJK. Points of contact are those of the whole bodies.
//! Cores that meet leave it to parry. Of boxes the separating axes are tried here (`boxes.rs`), as parry does, in
//! less time.

use nalgebra::{UnitQuaternion, Vector3};
use parry3d_f64::math::{Pose as ParryPose, Rotation, Vector};
use parry3d_f64::query::gjk::{CsoPoint, VoronoiSimplex};
use parry3d_f64::query::{
    ContactManifold, DefaultQueryDispatcher, PersistentQueryDispatcher as _, TrackedContact,
};
use parry3d_f64::shape::{PackedFeatureId, PolygonalFeature, PolygonalFeatureMap, SupportMap};

use super::meeting::{Meeting, Spot};
use super::pose::Pose;
use granulcal_scene::{Solid, parry};

/// What a body's core lacks of it `[-]`: overlaps up to twice this share of a body's thickness are found by the cores.
const SHRUNK: f64 = 0.02;

/// Distances are found to this, in the bodies' reach `[-]`, in so many steps at most.
const NEAR: f64 = 1e-5;
const STEPS: usize = 100;

/// Points at which two bodies are near each other, in units of their reach and in the first body's axes.
type Manifold = ContactManifold<(), ()>;

/// The points at which the second body is nearer to the first than `range`, or a little more; returns whether it may be
/// so near.
pub(super) fn manifold(
    solid: &Solid,
    [a, b]: [&Pose; 2],
    range: f64,
    meeting: &mut Meeting,
) -> bool {
    let Some(found) = found(solid, [a, b], range) else { return false };
    let of = |v: Vector| Vector3::new(v.x, v.y, v.z);
    meeting.normal = a.axes * of(found.local_n1);
    let spot = |contact: &TrackedContact<()>| {
        let mark = solid.reach * of(contact.local_p1);
        let on_b = b.axes * (solid.reach * of(contact.local_p2));
        Spot { mark, on_a: a.axes * mark, on_b, gap: solid.reach * contact.dist }
    };
    meeting.spots.clear();
    meeting.spots.extend(found.points.iter().map(spot));
    true
}

/// What a manifold remembers of the substep before would make the next depend on more than the state: it is made anew.
fn found(solid: &Solid, [a, b]: [&Pose; 2], range: f64) -> Option<Manifold> {
    let offset = parry(&(a.seen(&(b.centre - a.centre)) / solid.reach));
    let turned = a.turned.inverse() * b.turned;
    let pose = ParryPose::from_parts(offset, rotation(&turned));
    let (shape, range) = (solid.unit.as_ref(), range / solid.reach);
    if let Some((whole, _)) = shape.as_polygonal_feature_map() {
        match by_cores(&pose, whole, range) {
            Cores::Near(found) => return Some(found),
            Cores::Apart => return None,
            Cores::Meet => {}
        }
    }
    let mut found = Manifold::new();
    DefaultQueryDispatcher
        .contact_manifold_convex_convex(&pose, shape, shape, None, None, range, &mut found)
        .ok()?;
    Some(found)
}

/// What the cores of two bodies say.
enum Cores {
    Apart,
    Near(Manifold),
    Meet,
}

fn by_cores(pose: &ParryPose, whole: &dyn PolygonalFeatureMap, range: f64) -> Cores {
    let (on_1, on_2, normal) = match nearest(pose, &Core(whole), range + 2.0 * SHRUNK) {
        Nearest::Points(on_1, on_2, normal) => (on_1, on_2, normal),
        Nearest::Farther => return Cores::Apart,
        Nearest::Touching => return Cores::Meet,
    };
    // A point on a core's surface, scaled, is one of the body's.
    let on_1 = on_1 / (1.0 - SHRUNK);
    let on_2 = pose.inverse_transform_point(on_2) / (1.0 - SHRUNK);
    let normals = [normal, pose.rotation.inverse() * -normal];
    let mut found = between_faces(pose, whole, normals, [on_1, on_2]);
    let gap = (pose.transform_point(on_2) - on_1).dot(normal);
    let unknown = PackedFeatureId::UNKNOWN;
    found.points.push(TrackedContact::new(on_1, on_2, unknown, unknown, gap));
    Cores::Near(found)
}

/// The points at which the features of two bodies meet that face each other: outward normals of both, and what each is
/// to be near, in its own axes.
fn between_faces(
    pose: &ParryPose,
    whole: &dyn PolygonalFeatureMap,
    normals: [Vector; 2],
    near: [Vector; 2],
) -> Manifold {
    let feature = |side: usize| {
        let mut feature = PolygonalFeature::default();
        whole.local_support_feature_toward(normals[side], near[side], &mut feature);
        feature
    };
    let (one, other, [normal, against]) = (feature(0), feature(1), normals);
    let mut found = Manifold::new();
    let back = pose.inverse();
    PolygonalFeature::contacts(pose, &back, normal, against, &one, &other, &mut found, false);
    (found.local_n1, found.local_n2) = (normal, against);
    found
}

/// What GJK finds.
enum Nearest {
    /// The nearest points, in the first body's axes, and the direction from one to the other.
    Points(Vector, Vector, Vector),
    Farther,
    Touching,
}

/// GJK on two bodies of one shape, with parry's simplex: parry's own loop goes on to 5e-8 of the distance, which takes
/// curved bodies some 25 steps. The distance between the simplex and the origin is too long, by no more than it is longer
/// than the way to the plane across it that no body crosses.
fn nearest(pose: &ParryPose, body: &Core<'_>, farthest: f64) -> Nearest {
    let start = pose.translation.try_normalize().unwrap_or(Vector::X);
    let mut simplex = VoronoiSimplex::new();
    simplex.reset(CsoPoint::from_shapes(pose, body, body, start));
    for _ in 0..STEPS {
        let (towards, distance) = (-simplex.project_origin_and_reduce()).normalize_and_length();
        if simplex.dimension() == 3 || distance < NEAR {
            break;
        }
        let ahead = CsoPoint::from_shapes(pose, body, body, towards);
        let least = -towards.dot(ahead.point);
        if least > farthest {
            return Nearest::Farther;
        }
        if distance - least < NEAR || !simplex.add_point(ahead) {
            let (mut on_1, mut on_2) = (Vector::ZERO, Vector::ZERO);
            for number in 0..=simplex.dimension() {
                let (share, point) = (simplex.proj_coord(number), simplex.point(number));
                on_1 += point.orig1 * share;
                on_2 += point.orig2 * share;
            }
            return Nearest::Points(on_1, on_2, towards);
        }
    }
    Nearest::Touching
}

/// A body without its rind.
struct Core<'a>(&'a dyn PolygonalFeatureMap);

impl SupportMap for Core<'_> {
    fn local_support_point(&self, towards: Vector) -> Vector {
        self.0.local_support_point(towards) * (1.0 - SHRUNK)
    }
}

fn rotation(turned: &UnitQuaternion<f64>) -> Rotation {
    Rotation::from_xyzw(turned.i, turned.j, turned.k, turned.w)
}

#[cfg(test)]
mod tests {
    use super::*;
    use granulcal_scene::GrainShape;
    use proptest::prelude::*;

    fn turned(q: [f64; 4]) -> UnitQuaternion<f64> {
        UnitQuaternion::new_normalize(nalgebra::Quaternion::new(q[0] + 1.5, q[1], q[2], q[3]))
    }

    proptest! {
        /// Of bodies that overlap by little the cores' way out is as long as the shortest, which EPA finds: no shorter,
        /// and longer by less than half the rind.
        #[test]
        fn cores_find_the_way_out_of_an_overlap(
            cylinder in any::<bool>(),
            one in prop::array::uniform4(-1.0..1.0),
            other in prop::array::uniform4(-1.0..1.0),
            towards in prop::array::uniform3(-1.0..1.0_f64),
            depth in 0.001..0.02_f64,
        ) {
            let towards = Vector3::from(towards);
            prop_assume!(towards.norm() > 0.1);
            let shape = if cylinder {
                GrainShape::Cylinder { aspect: 1.3 }
            } else {
                GrainShape::Superquadric { aspect: [1.0, 0.8, 1.3], exponents: [4.0, 3.0] }
            };
            let solid = Solid::new(&shape, 2.0).unwrap();
            let shape = solid.unit.as_ref();
            let whole = shape.as_polygonal_feature_map().unwrap().0;
            let mut pose = ParryPose::from_parts(
                parry(&(towards.normalize() * 2.1)),
                rotation(&(turned(one).inverse() * turned(other))),
            );
            let parted = |pose: &ParryPose| {
                let at_origin = ParryPose::IDENTITY;
                parry3d_f64::query::contact(&at_origin, shape, pose, shape, 3.0).unwrap().unwrap()
            };
            // Pushed together along their line until they overlap by the depth.
            let apart = parted(&pose);
            pose.translation -= apart.normal1 * (apart.dist + depth);
            let truth = parted(&pose);
            prop_assume!(truth.dist < -0.0005 && truth.dist > -0.02);
            let Cores::Near(found) = by_cores(&pose, whole, 0.1) else {
                return Err(TestCaseError::fail("the cores meet, or are out of reach"));
            };
            let deepest = found.points.iter().map(|p| p.dist).fold(f64::MAX, f64::min);
            prop_assert!(deepest < truth.dist + 10.0 * NEAR, "{deepest} {}", truth.dist);
            prop_assert!(deepest > truth.dist - 0.5 * SHRUNK, "{deepest} {}", truth.dist);
        }
    }
}
