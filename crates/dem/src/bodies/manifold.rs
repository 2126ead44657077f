//! Where two bodies are nearest, as parry sees them. The only file of this room that asks it.
//!
//! The normal comes from the nearest points of the bodies' cores, which are the bodies scaled by 1 - [`SHRUNK`] about
//! their centres: bodies that rest on each other overlap by a little, and the way out of an overlap takes parry's EPA
//! several times as long as the way between what is apart takes GJK. Points of contact are those of the whole bodies.
//! Cores that meet leave it to parry. Cylinders' nearest points are looked for among their features first
//! (`cylinders.rs`), and of boxes the separating axes are tried (`boxes.rs`), as parry does, in less time.

use nalgebra::{UnitQuaternion, Vector3};
use parry3d_f64::math::{Pose as ParryPose, Rotation, Vector};
use parry3d_f64::query::gjk::{CsoPoint, VoronoiSimplex};
use parry3d_f64::query::{
    ContactManifold, DefaultQueryDispatcher, PersistentQueryDispatcher as _, TrackedContact,
};
use parry3d_f64::shape::{PackedFeatureId, PolygonalFeature, PolygonalFeatureMap, SupportMap};

use super::around::Around;
use super::corners::Corners;
use super::cylinders::{self, Cylinder};
use super::meeting::{Meeting, Nearest, Spot};
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
    around: &Around<'_>,
    [a, b]: [&Pose; 2],
    range: f64,
    meeting: &mut Meeting,
) -> bool {
    let solid = around.solid;
    let Some(found) = found(around, [a, b], range) else { return false };
    meeting.normal = a.axes * vector(found.local_n1);
    let spot = |contact: &TrackedContact<()>| {
        let mark = solid.reach * vector(contact.local_p1);
        let on_b = b.axes * (solid.reach * vector(contact.local_p2));
        Spot { mark, on_a: a.axes * mark, on_b, gap: solid.reach * contact.dist }
    };
    meeting.spots.clear();
    meeting.spots.extend(found.points.iter().map(spot));
    true
}

/// What a manifold remembers of the substep before would make the next depend on more than the state: it is made anew.
fn found(around: &Around<'_>, [a, b]: [&Pose; 2], range: f64) -> Option<Manifold> {
    let solid = around.solid;
    let offset = parry(&(a.seen(&(b.centre - a.centre)) / solid.reach));
    let turned = a.turned.inverse() * b.turned;
    let pose = ParryPose::from_parts(offset, rotation(&turned));
    let (shape, range) = (solid.unit.as_ref(), range / solid.reach);
    if let Some((whole, _)) = shape.as_polygonal_feature_map() {
        let core = Core { whole, corners: around.corners };
        match by_cores(&pose, solid, &core, range) {
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

fn by_cores(pose: &ParryPose, solid: &Solid, core: &Core<'_>, range: f64) -> Cores {
    let farthest = range + 2.0 * SHRUNK;
    let of_features = solid.round.and_then(|round| {
        cylinders::nearest(&round_cores(pose, round, solid.reach), farthest, NEAR)
    });
    let nearest = of_features.or_else(|| by_gjk(pose, core, farthest));
    let (on_1, on_2, normal) = match nearest {
        Some(Nearest::Points([on_1, on_2], normal)) => (parry(&on_1), parry(&on_2), parry(&normal)),
        Some(Nearest::Farther) => return Cores::Apart,
        None => return Cores::Meet,
    };
    // A point on a core's surface, scaled, is one of the body's.
    let on_1 = on_1 / (1.0 - SHRUNK);
    let on_2 = pose.inverse_transform_point(on_2) / (1.0 - SHRUNK);
    let normals = [normal, pose.rotation.inverse() * -normal];
    let mut found = between_faces(pose, core.whole, normals, [on_1, on_2]);
    let gap = (pose.transform_point(on_2) - on_1).dot(normal);
    let unknown = PackedFeatureId::UNKNOWN;
    found.points.push(TrackedContact::new(on_1, on_2, unknown, unknown, gap));
    Cores::Near(found)
}

/// The cores of two cylinders, in the first's axes.
fn round_cores(pose: &ParryPose, (radius, half): (f64, f64), reach: f64) -> [Cylinder; 2] {
    let scale = (1.0 - SHRUNK) / reach;
    let core = |centre, axis| Cylinder { centre, axis, radius: scale * radius, half: scale * half };
    [
        core(Vector3::zeros(), Vector3::y()),
        core(vector(pose.translation), vector(pose.rotation * Vector::Y)),
    ]
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

/// GJK on two bodies of one shape, with parry's simplex: parry's own loop goes on to 5e-8 of the distance, which takes
/// curved bodies some 25 steps. The distance between the simplex and the origin is too long, by no more than it is
/// longer than the way to the plane across it that no body crosses. None where the bodies touch.
fn by_gjk(pose: &ParryPose, body: &Core<'_>, farthest: f64) -> Option<Nearest> {
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
            return Some(Nearest::Farther);
        }
        if distance - least < NEAR || !simplex.add_point(ahead) {
            let (mut on_1, mut on_2) = (Vector::ZERO, Vector::ZERO);
            for number in 0..=simplex.dimension() {
                let (share, point) = (simplex.proj_coord(number), simplex.point(number));
                on_1 += point.orig1 * share;
                on_2 += point.orig2 * share;
            }
            return Some(Nearest::Points([vector(on_1), vector(on_2)], vector(towards)));
        }
    }
    None
}

/// A body without its rind.
struct Core<'a> {
    whole: &'a dyn PolygonalFeatureMap,
    /// Of a polyhedron.
    corners: Option<&'a Corners>,
}

impl SupportMap for Core<'_> {
    fn local_support_point(&self, towards: Vector) -> Vector {
        let farthest = match self.corners {
            Some(corners) => parry(&corners.farthest(&vector(towards))),
            None => self.whole.local_support_point(towards),
        };
        farthest * (1.0 - SHRUNK)
    }
}

fn vector(of: Vector) -> Vector3<f64> {
    Vector3::new(of.x, of.y, of.z)
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

    /// What cylinders are asked for, in their reach.
    const FARTHEST: f64 = 1.0;

    /// What the features of two cylinders say, and GJK, of one pose.
    fn cylinders_at(aspect: f64, other: [f64; 4], offset: &Vector3<f64>) -> [Option<Nearest>; 2] {
        let solid = Solid::new(&GrainShape::Cylinder { aspect }, 2.0).unwrap();
        let round = solid.round.unwrap();
        let pose = ParryPose::from_parts(parry(offset), rotation(&turned(other)));
        let whole = solid.unit.as_polygonal_feature_map().unwrap().0;
        let of_features =
            cylinders::nearest(&round_cores(&pose, round, solid.reach), FARTHEST, NEAR);
        [of_features, by_gjk(&pose, &Core { whole, corners: None }, FARTHEST)]
    }

    /// The shares are those of the numbers of a lattice (Weyl), not of chance.
    #[test]
    fn features_of_cylinders_answer_nearly_always() {
        let steps = [0.8191725, 0.6710436, 0.5497005, 0.4503006, 0.3688740, 0.3021716, 0.2475306];
        let (mut answered, mut apart) = (0, 0);
        for number in 0..4000 {
            let at = steps.map(|step| 2.0 * (step * f64::from(number)).fract() - 1.0);
            let offset = 1.7 * Vector3::new(at[0], at[1], at[2]);
            let [of_features, by_gjk] = cylinders_at(1.0, [at[3], at[4], at[5], at[6]], &offset);
            if matches!(by_gjk, Some(Nearest::Points(..))) {
                apart += 1;
                answered += usize::from(of_features.is_some());
            }
        }
        assert!(apart > 1000, "{apart}");
        assert!(f64::from(answered as u32) > 0.97 * f64::from(apart), "{answered} of {apart}");
    }

    proptest! {
        /// Discs, cylinders and rods: the features' points are as far apart as GJK's, and so is the plane between them.
        #[test]
        fn features_of_cylinders_are_as_far_apart_as_gjk_says(
            aspect in 0.1..10.0_f64,
            other in prop::array::uniform4(-1.0..1.0),
            offset in prop::array::uniform3(-2.0..2.0_f64),
        ) {
            let [of_features, by_gjk] = cylinders_at(aspect, other, &Vector3::from(offset));
            if of_features.is_none() {
                return Ok(()); // Most of those meet: how rarely others do is the test above.
            }
            let far = |of: Option<Nearest>| match of {
                Some(Nearest::Points([on_1, on_2], _)) => (on_2 - on_1).norm().min(FARTHEST),
                Some(Nearest::Farther) => FARTHEST,
                None => 0.0,
            };
            let (ours, theirs) = (far(of_features), far(by_gjk));
            prop_assert!((ours - theirs).abs() < 2.0 * NEAR, "{ours} {theirs}");
            if let [Some(Nearest::Points(_, n)), Some(Nearest::Points(_, m))] = [of_features, by_gjk] {
                // Two planes that prove the distance to NEAR differ by no more than its root.
                prop_assert!((n - m).norm() < 4.0 * (NEAR / theirs).sqrt(), "{n} {m}");
            }
        }

        /// Of bodies that overlap by little the deepest point is as deep as they are along the cores' way out n. It is
        /// longer than another, EPA's m, by no more than k / (1 - k) (n - m) . t, k what the cores lack and t the
        /// offset: along n the cores are farthest apart.
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
            let corners = Corners::of(&solid);
            let core = Core { whole, corners: corners.as_ref() };
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
            let Cores::Near(found) = by_cores(&pose, &solid, &core, 0.1) else {
                return Err(TestCaseError::fail("the cores meet, or are out of reach"));
            };
            let deepest = found.points.iter().map(|p| p.dist).fold(f64::MAX, f64::min);
            // How far they are apart along a direction.
            let apart = |n: Vector| {
                let shape = shape.as_support_map().unwrap();
                -n.dot(CsoPoint::from_shapes(&pose, shape, shape, n).point)
            };
            let lean = pose.translation.dot(found.local_n1 - truth.normal1);
            let least = apart(truth.normal1) - SHRUNK / (1.0 - SHRUNK) * lean;
            prop_assert!((deepest - apart(found.local_n1)).abs() < 10.0 * NEAR, "{deepest} {}", apart(found.local_n1));
            prop_assert!(deepest > least - 10.0 * NEAR, "{deepest} {least}");
        }
    }
}
