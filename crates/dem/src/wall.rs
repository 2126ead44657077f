//! Walls as the solver sees them: distance and normal of the nearest point to a grain's centre. A wall has one or more
//! surfaces, and a grain may touch each of them once.
//!
//! A frustum (cone or cylinder) is a thin shell of revolution. In the half plane through its axis and
//! the grain it is a straight segment, so the nearest point is the nearest point of a segment.

mod facets;

use std::sync::Arc;

use nalgebra::Vector3;

use crate::placement::Placement;
use crate::scene::{self, BoxSide, Ends, Motion, Scene, Shape};
use crate::{Material, WallMaterial};
use facets::Facets;

/// A wall with its resolved material, and where it is if it moves.
#[derive(Clone, Debug)]
pub(crate) struct Wall {
    surfaces: Vec<Surface>,
    /// The triangles of a mesh, numbered after the surfaces.
    facets: Option<Arc<Facets>>,
    pub material: Material,
    pub placement: Option<Placement>,
}

impl Wall {
    /// Surfaces and facets, each of which a grain may touch once.
    fn count(&self) -> usize {
        self.surfaces.len() + self.facets.as_ref().map_or(0, |facets| facets.count())
    }

    fn nearest_there(&self, number: usize, centre: &Vector3<f64>) -> Nearest {
        match (self.surfaces.get(number), &self.facets) {
            (None, Some(facets)) => facets.nearest(number - self.surfaces.len(), centre),
            _ => self.surfaces[number].nearest(centre),
        }
    }

    /// The nearest point of a surface to a centre at `now` `[s]` into the substep.
    fn nearest(&self, number: usize, centre: &Vector3<f64>, now: f64) -> Nearest {
        let Some(placement) = &self.placement else { return self.nearest_there(number, centre) };
        let near = self.nearest_there(number, &placement.seen(centre, now));
        Nearest { normal: placement.turned(&near.normal), ..near }
    }

    /// Where a centre is in the wall's stated place, and how near a surface that comes nearer than `range` until the next list
    /// may be.
    fn seen(&self, centre: &Vector3<f64>, range: f64) -> (Vector3<f64>, f64) {
        match &self.placement {
            None => (*centre, range),
            Some(placement) => (placement.seen(centre, 0.0), range + placement.reach_at(centre)),
        }
    }

    /// Whether a surface may come nearer than `range` `[m]` until the next list; false only when it surely does not.
    fn may_reach(&self, number: usize, centre: &Vector3<f64>, range: f64) -> bool {
        let (centre, range) = self.seen(centre, range);
        match (self.surfaces.get(number), &self.facets) {
            (None, Some(facets)) => facets.may_reach(number - self.surfaces.len(), &centre, range),
            _ => self.surfaces[number].may_reach(&centre, range),
        }
    }

    /// Calls `found` for every surface that may come nearer than `range` `[m]` until the next list.
    fn reached(&self, centre: &Vector3<f64>, range: f64, mut found: impl FnMut(usize)) {
        let (centre, range) = self.seen(centre, range);
        for (number, surface) in self.surfaces.iter().enumerate() {
            if surface.may_reach(&centre, range) {
                found(number);
            }
        }
        if let Some(facets) = &self.facets {
            facets.reached(&centre, range, |facet| found(self.surfaces.len() + facet));
        }
    }

    /// Whether it may move.
    pub fn is_moving(&self) -> bool {
        self.placement.is_some()
    }

    /// Velocity and angular velocity in this substep of the wall's point at `x` `[m/s]`, `[rad/s]`.
    pub fn motion_at(&self, x: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let still = (Vector3::zeros(), Vector3::zeros());
        let moving = self.placement.as_ref().filter(|placement| placement.moves());
        moving.map_or(still, |p| (p.velocity_at(x), p.angular_velocity()))
    }
}

/// All walls of a scene, the ground first, with their surfaces numbered through.
#[derive(Clone, Debug)]
pub(crate) struct Walls {
    all: Vec<Wall>,
    /// The number of each wall's first surface.
    first: Vec<u32>,
    /// The wall of each surface.
    owner: Vec<u32>,
}

impl Walls {
    pub fn of(scene: &Scene) -> Self {
        let ground = Shape::Plane { point: [0.0; 3], normal: [0.0, 0.0, 1.0] };
        let resolve = |shape: &Shape, material: &WallMaterial, motion: &Motion| Wall {
            surfaces: surfaces(shape),
            facets: facets(shape).map(Arc::new),
            material: material.over(&scene.material),
            placement: Placement::new(motion),
        };
        let of = |wall: &scene::Wall| resolve(&wall.shape, &wall.material, &wall.motion);
        let mut all = vec![resolve(&ground, &scene.ground.material, &Motion::Still)];
        all[0].material = scene.effects.ground.of(all[0].material);
        all.extend(scene.funnel.iter().flat_map(scene::Funnel::walls).map(|wall| of(&wall)));
        all.extend(scene.walls.iter().map(of));
        let (mut first, mut owner) = (Vec::new(), Vec::new());
        for (number, wall) in all.iter().enumerate() {
            first.push(owner.len() as u32);
            owner.resize(owner.len() + wall.count(), number as u32);
        }
        Self { all, first, owner }
    }

    /// Number of surfaces.
    pub fn surfaces(&self) -> usize {
        self.owner.len()
    }

    /// Number of walls.
    pub fn count(&self) -> usize {
        self.all.len()
    }

    /// Whether any may move.
    pub fn any_moving(&self) -> bool {
        self.all.iter().any(Wall::is_moving)
    }

    /// Where the walls that may move are.
    pub fn placements(&mut self) -> impl Iterator<Item = &mut Placement> {
        self.all.iter_mut().filter_map(|wall| wall.placement.as_mut())
    }

    /// The number of a surface's wall.
    pub fn owner(&self, surface: usize) -> usize {
        self.owner[surface] as usize
    }

    /// A surface's wall.
    pub fn wall(&self, surface: usize) -> &Wall {
        &self.all[self.owner(surface)]
    }

    /// The nearest point of a surface to a centre at `now` `[s]` into the substep.
    pub fn nearest(&self, surface: usize, centre: &Vector3<f64>, now: f64) -> Nearest {
        let owner = self.owner(surface);
        self.all[owner].nearest(surface - self.first[owner] as usize, centre, now)
    }

    /// Whether a surface may come nearer than `range` `[m]` until the next list.
    pub fn may_reach(&self, surface: usize, centre: &Vector3<f64>, range: f64) -> bool {
        let owner = self.owner(surface);
        self.all[owner].may_reach(surface - self.first[owner] as usize, centre, range)
    }

    /// Calls `found` for every surface that may come nearer than `range` `[m]` until the next list, in their order.
    pub fn reached(&self, centre: &Vector3<f64>, range: f64, mut found: impl FnMut(usize)) {
        for (wall, &first) in self.all.iter().zip(&self.first) {
            wall.reached(centre, range, |number| found(first as usize + number));
        }
    }
}

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

/// A shell of revolution whose generator is a segment.
#[derive(Clone, Debug)]
pub(crate) struct Frustum {
    from: Vector3<f64>,
    axis: Vector3<f64>,
    radius_from: f64,
    /// The generator in the half plane (along the axis, away from it).
    generator: Vector2,
    /// Ball about the middle of the axis that holds the shell: a cheap first test.
    middle: Vector3<f64>,
    reach: f64,
}

type Vector2 = nalgebra::Vector2<f64>;

/// The nearest point of a wall.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Nearest {
    /// Distance from the grain's centre to the surface; negative below a plane `[m]`.
    pub distance: f64,
    /// Unit vector from the wall to the grain's centre.
    pub normal: Vector3<f64>,
    /// Which side of a shell's generator the centre is on, 0 beyond its ends; a change is a passage through the wall.
    pub side: i8,
}

impl Surface {
    /// The nearest point to `centre`.
    pub fn nearest(&self, centre: &Vector3<f64>) -> Nearest {
        match self {
            Self::Plane { point, normal } => {
                let distance = (centre - point).dot(normal);
                let side = if distance < 0.0 { -1 } else { 1 };
                Nearest { distance, normal: *normal, side }
            }
            Self::Frustum(shell) => shell.nearest(centre),
            Self::Disc { centre: middle, normal, radius } => {
                nearest_of_disc(middle, normal, *radius, centre)
            }
        }
    }

    /// Whether the surface may be nearer than `range` `[m]`; false only when it surely is not.
    pub fn may_reach(&self, centre: &Vector3<f64>, range: f64) -> bool {
        match self {
            Self::Plane { point, normal } => (centre - point).dot(normal) < range,
            Self::Frustum(shell) => {
                let reach = shell.reach + range;
                (centre - shell.middle).norm_squared() < reach * reach
                    && shell.nearest(centre).distance < range
            }
            Self::Disc { .. } => self.nearest(centre).distance < range,
        }
    }
}

impl Frustum {
    fn new(from: Vector3<f64>, to: Vector3<f64>, radius_from: f64, radius_to: f64) -> Self {
        let length = (to - from).norm();
        let generator = Vector2::new(length, radius_to - radius_from);
        let reach = (0.5 * length).hypot(radius_from.max(radius_to));
        let middle = 0.5 * (from + to);
        Self { from, axis: (to - from) / length, radius_from, generator, middle, reach }
    }

    fn nearest(&self, centre: &Vector3<f64>) -> Nearest {
        let offset = centre - self.from;
        let along = offset.dot(&self.axis);
        let outward = offset - along * self.axis;
        let radius = outward.norm();
        // On the axis every direction is as near as any other: take one at right angles to it.
        let outward = if radius > 0.0 { outward / radius } else { any_normal(&self.axis) };

        let in_plane = Vector2::new(along, radius - self.radius_from);
        let share = in_plane.dot(&self.generator) / self.generator.norm_squared();
        let gap = in_plane - share.clamp(0.0, 1.0) * self.generator;
        let distance = gap.norm();
        let cross = self.generator.x * in_plane.y - self.generator.y * in_plane.x;
        let beyond_the_ends = share <= 0.0 || share >= 1.0;
        let side = if beyond_the_ends || cross == 0.0 { 0 } else { cross.signum() as i8 };
        // A centre on the shell itself is pushed inwards.
        let inwards = Vector2::new(self.generator.y, -self.generator.x);
        let direction = if distance > 0.0 { gap / distance } else { inwards.normalize() };
        let normal = direction.x * self.axis + direction.y * outward;
        Nearest { distance, normal, side }
    }
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
        return Nearest { distance: height.abs(), normal: f64::from(side) * normal, side };
    }
    let gap = height * normal + outward * (beyond / outward.norm());
    let distance = gap.norm();
    Nearest { distance, normal: gap / distance, side: 0 }
}

fn any_normal(axis: &Vector3<f64>) -> Vector3<f64> {
    let other = if axis.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    axis.cross(&other).normalize()
}

/// The surfaces of a shape, but for those of a mesh.
fn surfaces(shape: &Shape) -> Vec<Surface> {
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

/// The triangles of a box or a mesh.
fn facets(shape: &Shape) -> Option<Facets> {
    match shape {
        Shape::Box { min, max, open } => {
            let corner = |number: usize| {
                let side =
                    |axis: usize| if number >> axis & 1 == 1 { max[axis] } else { min[axis] };
                Vector3::new(side(0), side(1), side(2))
            };
            let corners: Vec<_> = (0..8).map(corner).collect();
            let sides = BoxSide::ALL.into_iter().filter(|side| !open.contains(side));
            let triangles: Vec<_> = sides.flat_map(BoxSide::triangles).collect();
            Some(Facets::new(&corners, &triangles))
        }
        Shape::Mesh(file) => {
            let mesh = file.mesh.as_ref().expect("a checked scene");
            let scaled = |v: &[f64; 3]| file.unit * Vector3::from(*v);
            let vertices: Vec<_> = mesh.vertices().iter().map(scaled).collect();
            Some(Facets::new(&vertices, mesh.triangles()))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use parry3d_f64::math::Vector as ParryVector;
    use parry3d_f64::query::PointQuery;
    use parry3d_f64::shape::TriMesh;
    use proptest::prelude::*;

    use super::*;

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

    #[test]
    fn a_box_has_the_sides_that_are_not_open() {
        let open = vec![BoxSide::ZMax];
        let tray = Shape::Box { min: [-0.1, -0.1, 0.0], max: [0.1, 0.1, 0.05], open };
        let tray = facets(&tray).expect("facets");
        assert_eq!(tray.count(), 10);
        let mut touched = Vec::new();
        let centre = Vector3::new(0.097, 0.02, 0.004);
        tray.reached(&centre, 0.01, |number| {
            let near = tray.nearest(number, &centre);
            if near.distance < 0.01 {
                touched.push((near.distance, near.normal));
            }
        });
        touched.sort_by(|a, b| a.0.total_cmp(&b.0));
        let [(side, out_of_side), (floor, up)] = touched[..] else { panic!("{touched:?}") };
        assert!((side - 0.003).abs() < 1e-12 && (floor - 0.004).abs() < 1e-12);
        assert!((out_of_side + Vector3::x()).norm() < 1e-12 && (up - Vector3::z()).norm() < 1e-12);
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
        let cone = one(&Shape::Cone {
            from: [0.0; 3],
            to: [0.0, 0.0, 0.1],
            radius_from: 0.02,
            radius_to: 0.06,
            closed: Ends::None,
        });
        let side = |x: f64, z: f64| cone.nearest(&Vector3::new(x, 0.0, z)).side;
        // At half the height the shell is at 0.04.
        assert_eq!((side(0.039, 0.05), side(0.041, 0.05)), (-1, 1));
        assert_eq!((side(-0.039, 0.05), side(-0.041, 0.05)), (-1, 1));
        // Beyond the ends a grain may go round the rim.
        assert_eq!((side(0.07, 0.2), side(0.01, -0.1)), (0, 0));
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

    #[test]
    fn ground_comes_first_and_materials_resolve() {
        let mut scene = Scene::funnel(0.12);
        scene.ground.material.restitution = Some(0.1);
        let open = Vec::new();
        let shape = Shape::Box { min: [0.0; 3], max: [1.0; 3], open };
        scene.walls.push(scene::Wall::fixed(shape, WallMaterial::default()));
        let walls = Walls::of(&scene);
        assert_eq!((walls.count(), walls.surfaces()), (4, 3 + 12));
        assert!(matches!(walls.all[0].surfaces[..], [Surface::Plane { .. }]));
        assert_eq!(walls.wall(0).material, Material { restitution: 0.1, ..scene.material });
        assert_eq!(walls.wall(1).material, scene.material);
        assert_eq!((walls.owner(2), walls.owner(3), walls.owner(14)), (2, 3, 3));
    }
}
