//! Planes, shells of revolution and discs: the nearest point to a grain's centre.

use granulcal_scene::{Ends, Shape};
use nalgebra::Vector3;

use super::frustum::Frustum;
use super::nearest::{Nearest, Passage};

/// The surfaces that the solver knows.
#[derive(Clone, Debug)]
pub(crate) enum Surface {
    /// The half space below a plane.
    Plane { point: Vector3<f64>, normal: Vector3<f64> },
    /// The shell of a truncated cone or cylinder.
    Frustum(Frustum),
    /// A flat disc that touches grains on both sides.
    Disc { centre: Vector3<f64>, normal: Vector3<f64>, radius: f64 },
}

impl Surface {
    /// The way from one place to another, if it goes through a shell or a disc.
    pub fn passed(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> Option<Passage> {
        match self {
            Self::Plane { .. } => None,
            Self::Frustum(shell) => shell.passed(from, to),
            Self::Disc { centre, normal, radius } => {
                let crossing = crossing_of_plane(centre, normal, from, to)?;
                let is_beyond = |x: &Vector3<f64>| (x - centre).norm() > *radius;
                let [begin, end] = [from, to].map(|x| (x - centre).dot(normal));
                let beyond = is_beyond(&(to - end * normal)).then_some((*centre, *radius));
                (!is_beyond(&crossing)).then(|| Passage {
                    depth: end.abs(),
                    normal: begin.signum() * normal,
                    beyond,
                })
            }
        }
    }

    /// The nearest point to `centre`.
    pub fn nearest(&self, centre: &Vector3<f64>) -> Nearest {
        match self {
            Self::Plane { point, normal } => {
                let distance = (centre - point).dot(normal);
                let side = if distance < 0.0 { -1 } else { 1 };
                Nearest { distance, normal: *normal, side, bends: false }
            }
            Self::Frustum(shell) => shell.nearest(centre),
            Self::Disc { centre: middle, normal, radius } => {
                nearest_of_disc(middle, normal, *radius, centre)
            }
        }
    }

    /// The circle at the end of the surface round which the way from one place to another leads, if both are on
    /// different sides of it and of what would go on beyond its end: its centre and radius `[m]`.
    pub fn leads_round(
        &self,
        from: &Vector3<f64>,
        to: &Vector3<f64>,
    ) -> Option<(Vector3<f64>, f64)> {
        match self {
            Self::Plane { .. } => None,
            Self::Frustum(shell) => shell.leads_round(from, to),
            Self::Disc { centre, normal, radius } => {
                let crossing = crossing_of_plane(centre, normal, from, to)?;
                ((crossing - centre).norm() > *radius).then_some((*centre, *radius))
            }
        }
    }

    /// Whether the surface may be nearer than `range` `[m]`; false only when it surely is not.
    pub fn may_reach(&self, centre: &Vector3<f64>, range: f64) -> bool {
        match self {
            Self::Plane { point, normal } => (centre - point).dot(normal) < range,
            Self::Frustum(shell) => shell.may_reach(centre, range),
            Self::Disc { .. } => self.nearest(centre).distance < range,
        }
    }
}

/// Where the way from one place to another crosses a plane, if it does.
pub(super) fn crossing_of_plane(
    point: &Vector3<f64>,
    normal: &Vector3<f64>,
    from: &Vector3<f64>,
    to: &Vector3<f64>,
) -> Option<Vector3<f64>> {
    let [begin, end] = [from, to].map(|x| (x - point).dot(normal));
    (begin * end < 0.0).then(|| from + (to - from) * (begin / (begin - end)))
}

fn nearest_of_disc(
    middle: &Vector3<f64>,
    normal: &Vector3<f64>,
    radius: f64,
    centre: &Vector3<f64>,
) -> Nearest {
    let offset = centre - middle;
    let height = offset.dot(normal);
    let outward = offset - height * normal;
    let beyond = outward.norm() - radius;
    if beyond <= 0.0 {
        let side = if height < 0.0 { -1 } else { 1 };
        let normal = f64::from(side) * normal;
        return Nearest { distance: height.abs(), normal, side, bends: false };
    }
    let gap = height * normal + outward * (beyond / outward.norm());
    let distance = gap.norm();
    Nearest { distance, normal: gap / distance, side: 0, bends: true }
}

/// Gives each rim that two shells share to the first of them: a grain that slides off one onto the rim would else be
/// hit by the other's, which juts out by as much as the first contact overlaps.
pub(super) fn join_rims<'a>(surfaces: impl Iterator<Item = &'a mut Surface>) {
    let mut known: Vec<(Vector3<f64>, f64)> = Vec::new();
    for surface in surfaces {
        let Surface::Frustum(shell) = surface else { continue };
        for (end, rim) in shell.ends().into_iter().enumerate() {
            shell.owns[end] = !known.iter().any(|other| is_same_circle(other, &rim));
            known.push(rim);
        }
    }
}

/// How far apart two rims may be to be one, over their radius `[-]`.
pub(super) const SAME: f64 = 1e-9;

/// Whether two circles about one axis, by their centres and radii, are one.
pub(super) fn is_same_circle(known: &(Vector3<f64>, f64), other: &(Vector3<f64>, f64)) -> bool {
    (known.0 - other.0).norm() + (known.1 - other.1).abs() < SAME * other.1
}

/// The surfaces of a shape, but for those of a mesh.
pub(crate) fn surfaces(shape: &Shape) -> Vec<Surface> {
    let shell = |from: &[f64; 3], to: &[f64; 3], at_from: f64, at_to: f64, closed: Ends| {
        let (from, to) = (Vector3::from(*from), Vector3::from(*to));
        let axis = (to - from).normalize();
        let disc =
            |end: Vector3<f64>, radius: f64| Surface::Disc { centre: end, normal: axis, radius };
        let mut surfaces = vec![Surface::Frustum(Frustum::new(from, to, at_from, at_to))];
        surfaces.extend(closed.at_from().then(|| disc(from, at_from)));
        surfaces.extend(closed.at_to().then(|| disc(to, at_to)));
        surfaces
    };
    match shape {
        Shape::Plane { point, normal } => {
            let normal = Vector3::from(*normal).normalize();
            vec![Surface::Plane { point: (*point).into(), normal }]
        }
        Shape::Disc { centre, normal, radius } => {
            let normal = Vector3::from(*normal).normalize();
            vec![Surface::Disc { centre: (*centre).into(), normal, radius: *radius }]
        }
        Shape::Cone { from, to, radius_from, radius_to, closed } => {
            shell(from, to, *radius_from, *radius_to, *closed)
        }
        Shape::Cylinder { from, to, radius, closed } => shell(from, to, *radius, *radius, *closed),
        Shape::Box { .. } | Shape::Mesh(_) => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use parry3d_f64::math::Vector as ParryVector;
    use parry3d_f64::query::PointQuery;
    use parry3d_f64::shape::TriMesh;
    use proptest::prelude::*;

    use super::*;
    use crate::wall::any_normal;

    const FROM: [f64; 3] = [0.01, -0.02, 0.1];
    const SIDES: u32 = 720;

    fn one(shape: &Shape) -> Surface {
        surfaces(shape).remove(0)
    }

    /// A tube of radius 20 mm from the origin on.
    fn tube(to: [f64; 3], closed: Ends) -> Shape {
        Shape::Cylinder { from: [0.0; 3], to, radius: 0.02, closed }
    }

    #[test]
    fn closed_ends_are_discs() {
        let [_, floor, lid] = &surfaces(&tube([0.0, 0.0, 0.1], Ends::Both))[..] else {
            panic!("a shell and two discs")
        };
        let centre = Vector3::new(0.01, 0.0, 0.03);
        let near = floor.nearest(&centre);
        assert_eq!((near.distance, near.normal, near.side), (0.03, Vector3::z(), 1));
        assert!((lid.nearest(&centre).normal + Vector3::z()).norm() < 1e-15);
        // Beyond the rim the nearest point is on it.
        let near = floor.nearest(&Vector3::new(0.0, 0.023, -0.004));
        assert!((near.distance - 0.005).abs() < 1e-15 && near.side == 0);
        assert!((near.normal - Vector3::new(0.0, 0.6, -0.8)).norm() < 1e-12);
        assert_eq!(surfaces(&tube([0.0, 0.0, 0.1], Ends::From)).len(), 2);
    }

    /// A cone that opens upwards from the origin, at half the height 0.04 wide.
    fn cone() -> Surface {
        one(&Shape::Cone {
            from: [0.0; 3],
            to: [0.0, 0.0, 0.1],
            radius_from: 0.02,
            radius_to: 0.06,
            closed: Ends::None,
        })
    }

    /// A frustum from [`FROM`] to `to`.
    fn frustum(to: [f64; 3], radius_from: f64, radius_to: f64) -> Surface {
        one(&Shape::Cone { from: FROM, to, radius_from, radius_to, closed: Ends::None })
    }

    /// The same shell as triangles between two rings of [`SIDES`] points.
    fn mesh(to: [f64; 3], radius_from: f64, radius_to: f64) -> TriMesh {
        let (from, to) = (Vector3::from(FROM), Vector3::from(to));
        let axis = (to - from).normalize();
        let u = any_normal(&axis);
        let v = axis.cross(&u);
        let ring = |centre: Vector3<f64>, radius: f64| {
            (0..SIDES).map(move |side| {
                let (sin, cos) =
                    (std::f64::consts::TAU * f64::from(side) / f64::from(SIDES)).sin_cos();
                let point = centre + radius * (cos * u + sin * v);
                ParryVector::new(point.x, point.y, point.z)
            })
        };
        let vertices = ring(from, radius_from).chain(ring(to, radius_to)).collect();
        let triangles = (0..SIDES)
            .flat_map(|side| {
                let next = (side + 1) % SIDES;
                [[side, next, SIDES + side], [next, SIDES + next, SIDES + side]]
            })
            .collect();
        TriMesh::new(vertices, triangles).expect("a mesh")
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn nearest_point_is_the_nearest_of_a_mesh(
            to in prop::array::uniform3(-0.05f64..0.05),
            radius_from in 0.005f64..0.06,
            radius_to in 0.005f64..0.06,
            points in proptest::collection::vec(prop::array::uniform3(-0.15f64..0.15), 16),
        ) {
            let shell = frustum(to, radius_from, radius_to);
            let mesh = mesh(to, radius_from, radius_to);
            // The chords of a circle of 720 sides are r (1 - cos(pi / 720)) inside it.
            let resolution = 0.06 * (1.0 - (std::f64::consts::PI / f64::from(SIDES)).cos()) + 1e-12;
            for point in points {
                let centre = Vector3::from(FROM) + Vector3::from(point);
                let near = shell.nearest(&centre);
                let referee = mesh
                    .project_local_point(ParryVector::new(centre.x, centre.y, centre.z), false)
                    .point;
                let referee = Vector3::new(referee.x, referee.y, referee.z);
                let distance = (centre - referee).norm();
                prop_assert!((near.distance - distance).abs() < resolution, "{near:?} {distance}");
                prop_assert!((near.normal.norm() - 1.0).abs() < 1e-12);
                // The point that distance and normal speak of lies on the shell.
                let on_shell = shell.nearest(&(centre - near.distance * near.normal));
                prop_assert!(on_shell.distance < 1e-12, "{on_shell:?}");
            }
        }

        #[test]
        fn may_reach_never_misses(
            to in prop::array::uniform3(-0.05f64..0.05),
            point in prop::array::uniform3(-0.2f64..0.2),
            range in 0f64..0.1,
        ) {
            let shell = frustum(to, 0.03, 0.01);
            let near = shell.nearest(&Vector3::from(point)).distance < range;
            prop_assert_eq!(shell.may_reach(&Vector3::from(point), range), near);
        }
    }

    #[test]
    fn side_changes_when_the_shell_is_crossed() {
        let cone = cone();
        let side = |x: f64, z: f64| cone.nearest(&Vector3::new(x, 0.0, z)).side;
        // At half the height the shell is at 0.04.
        assert_eq!((side(0.039, 0.05), side(0.041, 0.05)), (-1, 1));
        assert_eq!((side(-0.039, 0.05), side(-0.041, 0.05)), (-1, 1));
        // Beyond the ends a grain may go round the rim.
        assert_eq!((side(0.07, 0.2), side(0.01, -0.1)), (0, 0));
    }

    #[test]
    fn a_way_leads_through_a_shell_or_round_its_end() {
        let cone = cone();
        let round = |surface: &Surface, from: [f64; 2], to: [f64; 2]| {
            let [from, to] = [from, to].map(|[x, z]| Vector3::new(x, 0.0, z));
            surface.leads_round(&from, &to)
        };
        // Through it, then above and below it, then without a crossing.
        assert_eq!(round(&cone, [0.03, 0.05], [0.045, 0.05]), None);
        let above = round(&cone, [0.064, 0.104], [0.054, 0.098]).expect("above");
        assert!((above.0 - Vector3::new(0.0, 0.0, 0.1)).norm() < 1e-15 && above.1 == 0.06);
        let below = round(&cone, [0.016, -0.006], [0.024, 0.002]).expect("below");
        assert!(below.0.norm() < 1e-15 && below.1 == 0.02);
        assert_eq!(round(&cone, [0.07, 0.104], [0.064, 0.098]), None);
        let shape = Shape::Disc { centre: [0.0; 3], normal: [0.0, 0.0, 1.0], radius: 0.02 };
        let disc = one(&shape);
        assert_eq!(round(&disc, [0.0, 0.01], [0.01, -0.01]), None);
        assert_eq!(round(&disc, [0.03, 0.01], [0.03, 0.02]), None);
        assert_eq!(round(&disc, [0.03, 0.01], [0.0195, -0.001]), Some((Vector3::zeros(), 0.02)));
    }

    #[test]
    fn normal_points_from_the_shell_to_the_centre() {
        let cylinder = one(&tube([0.0, 0.0, 0.1], Ends::None));
        let inside = cylinder.nearest(&Vector3::new(0.0, 0.015, 0.05));
        assert!((inside.normal + Vector3::y()).norm() < 1e-15);
        assert!((inside.distance - 0.005).abs() < 1e-15);
        let outside = cylinder.nearest(&Vector3::new(0.03, 0.0, 0.05));
        assert!((outside.normal - Vector3::x()).norm() < 1e-15);
        // Above the rim: straight up from it.
        let above = cylinder.nearest(&Vector3::new(0.02, 0.0, 0.13));
        assert!((above.normal - Vector3::z()).norm() < 1e-12);
        assert!((above.distance - 0.03).abs() < 1e-15);
    }

    #[test]
    fn a_centre_on_the_axis_or_on_the_shell_has_a_normal() {
        for axis in [[0.0, 0.0, 0.1], [0.1, 0.0, 0.0], [0.0, -0.1, 0.0]] {
            let (radius_from, radius_to, closed) = (0.01, 0.02, Ends::None);
            let shape = Shape::Cone { from: [0.0; 3], to: axis, radius_from, radius_to, closed };
            let near = one(&shape).nearest(&(0.5 * Vector3::from(axis)));
            assert!((near.normal.norm() - 1.0).abs() < 1e-12, "{near:?}");
            assert!(near.distance > 0.0 && near.distance < 0.015 && near.side == -1);
        }
        let near = one(&tube([0.0, 0.0, 0.1], Ends::None)).nearest(&Vector3::new(0.02, 0.0, 0.05));
        assert_eq!(near.distance, 0.0);
        assert!((near.normal + Vector3::x()).norm() < 1e-15); // inwards
    }

    #[test]
    fn plane_has_a_sign() {
        let plane = one(&Shape::Plane { point: [0.0, 0.0, 1.0], normal: [0.0, 3.0, 4.0] });
        let above = plane.nearest(&Vector3::new(7.0, 3.0, 5.0));
        assert!((above.distance - 5.0).abs() < 1e-15 && above.side == 1);
        assert!((above.normal - Vector3::new(0.0, 0.6, 0.8)).norm() < 1e-15);
        let below = plane.nearest(&Vector3::new(0.0, 0.0, 0.0));
        assert!((below.distance + 0.8).abs() < 1e-15 && below.side == -1);
        assert!(plane.may_reach(&Vector3::zeros(), 0.1)); // below the plane, at any depth
        assert!(!plane.may_reach(&Vector3::new(0.0, 0.0, 2.0), 0.7));
    }
}
