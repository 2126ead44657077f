//! Where two boxes of one size meet: the direction along which they are farthest apart, or least deep, eight pairs at a
//! time; and across it the corners of what their faces share.
//!
//! With the half extents h, the offset t from the first centre to the second and the axes A_k and B_j, the gap along a
//! unit direction d is
//!
//! ```text
//! g(d) = |t . d| - sum_k h_k |A_k . d| - sum_j h_j |B_j . d|
//! ```
//!
//! and the largest of all is along an axis of either box, or across an edge of each (Gottschalk, Lin and Manocha,
//! 1996). Boxes that are apart along several of a box's axes are so along a line between them: parry's rule, which is
//! followed here to the choice among equals. Every width of registers gives the same bits.

use nalgebra::Vector3;

use super::meeting::{Asked, Meeting, Spot};
use super::polygon::Corners;
use super::pose::Pose;
use crate::lanes::{LANES, Lanes, Reg, Reg3, Row, Width, each, widest};

/// Gives, for each pair that may be nearer than its range, its number and where it meets.
pub(super) fn meet<'p>(
    half: &Vector3<f64>,
    pose: impl Fn(usize) -> &'p Pose,
    asked: &[Asked],
    mut found: impl FnMut(usize, &Meeting),
) {
    let mut meeting = Meeting::default();
    for (first, some) in (0..).step_by(LANES).zip(asked.chunks(LANES)) {
        // Lanes that are not in use repeat the first.
        let of = |lane: usize| some[if lane < some.len() { lane } else { 0 }];
        let a: [_; LANES] = std::array::from_fn(|lane| pose(of(lane).i));
        let b: [_; LANES] = std::array::from_fn(|lane| pose(of(lane).j));
        let gaps = gaps(&a.map(rows), &b.map(rows), half);
        for lane in 0..some.len() {
            let asked = &some[lane];
            let boxes = Boxes::new(half, a[lane], b[lane]);
            if let Some(normal) = boxes.across(&gaps, lane, asked.range) {
                meeting.normal = normal;
                boxes.share(&normal, asked.range, &mut meeting.spots);
                found(first + lane, &meeting);
            }
        }
    }
}

/// A pose as registers take it: each axis with a coordinate of the centre.
fn rows(pose: &Pose) -> [Row; 3] {
    std::array::from_fn(|k| Row::new(&pose.axes.column(k).into_owned(), pose.centre[k]))
}

/// The gaps of eight pairs along the axes of either box, and the largest across an edge of each.
struct Gaps {
    faces: [[Lanes; 3]; 2],
    edges: Lanes,
    /// Of which: 3 j + k across A_k and B_j.
    of_edges: Lanes,
}

widest! {
    fn gaps<W>(a: &[[Row; 3]; LANES], b: &[[Row; 3]; LANES], half: &Vector3<f64>) -> Gaps {
        let h = [Reg::<W>::splat(half.x), Reg::splat(half.y), Reg::splat(half.z)];
        let (a, b) = (eight::<W>(a), eight::<W>(b));
        let offset = b.centre - a.centre;
        let mut gaps = Gaps {
            faces: [[Lanes::ZERO; 3]; 2],
            edges: Lanes::ZERO,
            of_edges: Lanes::ZERO,
        };
        let zero = Reg::splat(0.0);
        let t = [offset.dot(a.axes[0]), offset.dot(a.axes[1]), offset.dot(a.axes[2])];
        // r[k][j] = A_k . B_j, and its size.
        let (mut r, mut size) = ([[zero; 3]; 3], [[zero; 3]; 3]);
        for k in 0..3 {
            for j in 0..3 {
                r[k][j] = a.axes[k].dot(b.axes[j]);
                size[k][j] = abs(r[k][j]);
            }
        }
        for k in 0..3 {
            let of_b = h[0].times_plus(size[k][0], h[1].times_plus(size[k][1], h[2] * size[k][2]));
            (abs(t[k]) - (h[k] + of_b)).store(&mut gaps.faces[0][k]);
        }
        for j in 0..3 {
            let of_a = h[0].times_plus(size[0][j], h[1].times_plus(size[1][j], h[2] * size[2][j]));
            (abs(offset.dot(b.axes[j])) - (h[j] + of_a)).store(&mut gaps.faces[1][j]);
        }
        // Along A_k x B_j, of the length sqrt(1 - r_kj^2), neither A_k nor B_j is reached.
        let (mut best, mut of_best) = (Reg::splat(f64::MIN), zero);
        for j in 0..3 {
            let [j1, j2] = [(j + 1) % 3, (j + 2) % 3];
            for k in 0..3 {
                let [k1, k2] = [(k + 1) % 3, (k + 2) % 3];
                let square = r[k1][j].times_plus(r[k1][j], r[k2][j] * r[k2][j]);
                let apart = abs((t[k2] * r[k1][j]).minus(t[k1], r[k2][j]));
                let of_a = h[k1].times_plus(size[k2][j], h[k2] * size[k1][j]);
                let of_b = h[j1].times_plus(size[k][j2], h[j2] * size[k][j1]);
                // Edges that are parallel have no direction across both.
                let gap = Reg::splat(PARALLEL).if_less(
                    square,
                    (apart - of_a - of_b).over(square.sqrt()),
                    Reg::splat(f64::MIN),
                );
                of_best = best.if_less(gap, Reg::splat((3 * j + k) as f64), of_best);
                best = best.if_less(gap, gap, best);
            }
        }
        best.store(&mut gaps.edges);
        of_best.store(&mut gaps.of_edges);
        gaps
    }
}

/// The square of the sine between two edges that are parallel, at most.
const PARALLEL: f64 = f64::EPSILON * f64::EPSILON;

/// The numbers of the lanes.
const LANE: [u32; LANES] = [0, 1, 2, 3, 4, 5, 6, 7];

/// Eight poses in registers.
struct Eight<W: Width> {
    axes: [Reg3<W>; 3],
    centre: Reg3<W>,
}

#[inline(always)]
fn eight<W: Width>(rows: &[[Row; 3]; LANES]) -> Eight<W> {
    let column = |k: usize| W::columns(each(&LANE, |lane| W::load_row(&rows[lane as usize][k])));
    let ([ax, ay, az, x], [bx, by, bz, y], [cx, cy, cz, z]) = (column(0), column(1), column(2));
    let vector = |x, y, z| Reg3 { x: Reg(x), y: Reg(y), z: Reg(z) };
    Eight {
        axes: [vector(ax, ay, az), vector(bx, by, bz), vector(cx, cy, cz)],
        centre: vector(x, y, z),
    }
}

#[inline(always)]
fn abs<W: Width>(value: Reg<W>) -> Reg<W> {
    value.max(Reg::splat(0.0) - value)
}

/// Two boxes of one size.
struct Boxes<'a> {
    half: &'a Vector3<f64>,
    a: &'a Pose,
    b: &'a Pose,
    /// From the centre of the first to the second's.
    offset: Vector3<f64>,
}

impl<'a> Boxes<'a> {
    fn new(half: &'a Vector3<f64>, a: &'a Pose, b: &'a Pose) -> Self {
        Self { half, a, b, offset: b.centre - a.centre }
    }

    /// The direction of the largest gap, from the first box to the second, if that is no more than `range`.
    fn across(&self, gaps: &Gaps, lane: usize, range: f64) -> Option<Vector3<f64>> {
        let edges = gaps.edges.0[lane];
        let faces = |side: usize| gaps.faces[side].each_ref().map(|lanes| lanes.0[lane]);
        let largest = |gaps: [f64; 3]| gaps.into_iter().fold(edges, f64::max);
        if largest(faces(0)).max(largest(faces(1))) > range {
            return None;
        }
        let (of_a, of_b) = (self.by_faces(self.a, faces(0)), self.by_faces(self.b, faces(1)));
        if of_a.gap() > range || of_b.gap() > range {
            return None;
        }
        Some(if of_b.gap() > of_a.gap() && of_b.gap() > edges {
            self.along(self.b, &of_b)
        } else if edges > of_a.gap() {
            let number = gaps.of_edges.0[lane] as usize;
            let along = self.a.axes.column(number % 3).cross(&self.b.axes.column(number / 3));
            self.towards(along.normalize())
        } else {
            self.along(self.a, &of_a)
        })
    }

    /// The largest gap along the axes of a box, and its direction; across a corner or an edge if there are gaps along
    /// more than one.
    fn by_faces(&self, of: &Pose, gaps: [f64; 3]) -> ByFaces {
        let positive = gaps.iter().filter(|gap| **gap >= 0.0).count();
        if positive < 2 {
            let best = (1..3).fold(0, |best, k| if gaps[k] > gaps[best] { k } else { best });
            return ByFaces::Axis(gaps[best], best);
        }
        let along = |k: usize| self.towards(of.axes.column(k).into_owned());
        let part = |k: usize| if gaps[k] >= 0.0 { gaps[k].max(f64::EPSILON) } else { 0.0 };
        let sum = part(0) * along(0) + part(1) * along(1) + part(2) * along(2);
        let along = sum.normalize();
        ByFaces::Between(self.gap(&along), along)
    }

    /// The direction of what [`Self::by_faces`] has found of a box.
    fn along(&self, of: &Pose, found: &ByFaces) -> Vector3<f64> {
        match found {
            ByFaces::Axis(_, k) => self.towards(of.axes.column(*k).into_owned()),
            ByFaces::Between(_, along) => *along,
        }
    }

    /// The gap along a unit direction.
    fn gap(&self, along: &Vector3<f64>) -> f64 {
        let reach = |pose: &Pose| pose.seen(along).abs().dot(self.half);
        self.offset.dot(along).abs() - reach(self.a) - reach(self.b)
    }

    /// `along`, or its opposite, from the first box to the second.
    fn towards(&self, along: Vector3<f64>) -> Vector3<f64> {
        if self.offset.dot(&along) < 0.0 { -along } else { along }
    }

    /// The corners of what the faces that look at each other share, seen along the normal, that are near enough.
    fn share(&self, normal: &Vector3<f64>, range: f64, spots: &mut Vec<Spot>) {
        spots.clear();
        let near = Face::towards(self.a, normal);
        let far = Face::towards(self.b, &-normal);
        // The second face over the first: its places in the first's plane along the normal, and its gap there.
        let local = self.a.seen(normal);
        let ahead = near.side * local[near.axis];
        let over = |v: Vector3<f64>, above: f64| {
            let gap = (near.side * v[near.axis] - above) / ahead;
            let place = v - gap * local;
            [place[near.across[0]], place[near.across[1]], gap]
        };
        let height = self.half[far.axis];
        let in_first = |v: Vector3<f64>| self.a.seen(&v);
        let out = far.side * height * self.b.axes.column(far.axis);
        let middle = over(in_first(self.offset + out), self.half[near.axis]);
        let edge = |k: usize| over(in_first(self.half[k] * self.b.axes.column(k)), 0.0);
        let [p, q] = far.across.map(edge);
        let shared = Corners::shared(middle, [p, q], near.across.map(|k| self.half[k]));
        let mut mark = Vector3::zeros();
        mark[near.axis] = near.side * self.half[near.axis];
        let face = mark[near.axis] * self.a.axes.column(near.axis);
        let sides = near.across.map(|k| self.a.axes.column(k));
        for &[s, t, gap] in shared.all().iter().filter(|corner| corner[2] <= range) {
            (mark[near.across[0]], mark[near.across[1]]) = (s, t);
            let on_a = face + s * sides[0] + t * sides[1];
            let on_b = on_a + gap * normal - self.offset;
            spots.push(Spot { mark, on_a, on_b, gap });
        }
    }
}

/// The largest gap along the axes of a box.
enum ByFaces {
    /// Along one of them.
    Axis(f64, usize),
    /// Along a direction between those with a gap.
    Between(f64, Vector3<f64>),
}

impl ByFaces {
    fn gap(&self) -> f64 {
        match self {
            Self::Axis(gap, _) | Self::Between(gap, _) => *gap,
        }
    }
}

/// A face of a box.
struct Face {
    axis: usize,
    /// 1 or -1.
    side: f64,
    /// The axes along it.
    across: [usize; 2],
}

impl Face {
    /// That which looks most along a direction.
    fn towards(pose: &Pose, direction: &Vector3<f64>) -> Self {
        let local = pose.seen(direction);
        let axis = local.iamax();
        Self { axis, side: local[axis].signum(), across: [(axis + 1) % 3, (axis + 2) % 3] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Quaternion, UnitQuaternion};
    use parry3d_f64::math::{Pose as ParryPose, Rotation, Vector as ParryVector};
    use parry3d_f64::query::{
        ContactManifold, DefaultQueryDispatcher, PersistentQueryDispatcher as _,
    };
    use parry3d_f64::shape::Cuboid;
    use proptest::prelude::*;

    const RANGE: f64 = 0.05;

    /// What parry says: the outward normal, and where the first box is touched, with the gap there.
    fn theirs(half: Vector3<f64>, a: &Pose, b: &Pose) -> (Vector3<f64>, Vec<(Vector3<f64>, f64)>) {
        let vector = |v: Vector3<f64>| ParryVector::new(v.x, v.y, v.z);
        let of = |v: ParryVector| Vector3::new(v.x, v.y, v.z);
        let turned = a.turned.inverse() * b.turned;
        let pose = ParryPose::from_parts(
            vector(a.seen(&(b.centre - a.centre))),
            Rotation::from_xyzw(turned.i, turned.j, turned.k, turned.w),
        );
        let cuboid = Cuboid::new(vector(half));
        let mut found = ContactManifold::<(), ()>::new();
        DefaultQueryDispatcher
            .contact_manifold_convex_convex(&pose, &cuboid, &cuboid, None, None, RANGE, &mut found)
            .unwrap();
        let points = found.points.iter().map(|point| (of(point.local_p1), point.dist));
        (a.axes * of(found.local_n1), points.collect())
    }

    fn pose(centre: [f64; 3], q: [f64; 4]) -> Pose {
        let turned = UnitQuaternion::new_normalize(Quaternion::new(q[3] + 1.5, q[0], q[1], q[2]));
        Pose::new(centre.into(), turned)
    }

    proptest! {
        /// The normal is parry's, or one along which the boxes are as far apart; across parry's normal the points are
        /// those of its own that are in range, each once.
        #[test]
        fn boxes_meet_where_parry_says(
            half in prop::array::uniform3(0.3..1.0_f64),
            offset in prop::array::uniform3(-1.6..1.6_f64),
            one in prop::array::uniform4(-1.0..1.0_f64),
            other in prop::array::uniform4(-1.0..1.0_f64),
            is_aligned in any::<bool>(),
        ) {
            let half = Vector3::from(half);
            let poses = [pose([0.3, -0.2, 0.1], one), pose(offset, if is_aligned { one } else { other })];
            let [a, b] = &poses;
            let (their_normal, their_points) = theirs(half, a, b);
            let mut ours = None;
            meet(&half, |body| &poses[body], &[Asked { i: 0, j: 1, range: RANGE }], |_, found| {
                ours = Some(found.clone());
            });
            let Some(ours) = ours else {
                prop_assert!(their_points.is_empty());
                return Ok(());
            };
            prop_assert!((ours.normal.norm() - 1.0).abs() < 1e-12);
            let boxes = Boxes::new(&half, a, b);
            prop_assert!(boxes.offset.dot(&ours.normal) >= 0.0);
            for spot in &ours.spots {
                let apart = a.centre + spot.on_a + spot.gap * ours.normal - b.centre - spot.on_b;
                prop_assert!(apart.norm() < 1e-12);
                prop_assert!((a.axes * spot.mark - spot.on_a).norm() < 1e-12);
            }
            if their_points.is_empty() {
                return Ok(());
            }
            prop_assert!((boxes.gap(&ours.normal) - boxes.gap(&their_normal)).abs() < 1e-12);
            if (ours.normal - their_normal).norm() > 1e-9 || is_aligned {
                return Ok(());
            }
            let is_there = |mark: Vector3<f64>, gap: f64| {
                move |(place, of): (Vector3<f64>, f64)| {
                    (place - mark).norm() < 1e-6 && (of - gap).abs() < 1e-6
                }
            };
            for &(place, gap) in their_points.iter().filter(|point| point.1 < RANGE - 1e-9) {
                let mut spots = ours.spots.iter().map(|spot| (spot.mark, spot.gap));
                prop_assert!(spots.any(is_there(place, gap)), "ours lacks {place} {gap}");
            }
            for spot in &ours.spots {
                let mut points = their_points.iter().copied();
                prop_assert!(points.any(is_there(spot.mark, spot.gap)), "theirs lacks {spot:?}");
            }
        }

        /// Eight at a time or one by one, and beside whatever others.
        #[test]
        fn a_pair_meets_alike_in_any_lane(
            centres in prop::collection::vec(prop::array::uniform3(-1.5..1.5_f64), 12),
            turns in prop::collection::vec(prop::array::uniform4(-1.0..1.0_f64), 12),
        ) {
            let half = Vector3::new(0.4, 0.5, 0.7);
            let poses: Vec<_> = centres.into_iter().zip(turns).map(|(c, q)| pose(c, q)).collect();
            let pairs = (0..12).flat_map(|i| (i + 1..12).map(move |j| (i, j)));
            let asked: Vec<_> = pairs.map(|(i, j)| Asked { i, j, range: RANGE }).collect();
            let mut together = Vec::new();
            meet(&half, |body| &poses[body], &asked, |number, found| together.push((number, found.clone())));
            let mut alone = Vec::new();
            for (number, one) in asked.iter().enumerate() {
                meet(&half, |body| &poses[body], &[*one], |_, found| alone.push((number, found.clone())));
            }
            prop_assert_eq!(format!("{together:?}"), format!("{alone:?}"));
        }
    }
}
