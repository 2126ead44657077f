//! Walls as the solver sees them: distance and normal of the nearest point to a grain's centre. A wall has one or more
//! surfaces, and a grain may touch each of them once.
//! Planes and discs are in `wall/surface.rs`, shells in `wall/frustum.rs`, triangles in `wall/facets.rs`.

mod edge;
mod edges;
mod facets;
mod frustum;
mod nearest;
mod rim;
mod surface;

use std::sync::Arc;

use nalgebra::{UnitQuaternion, Vector3};

use crate::placement::Placement;
pub(crate) use edge::Edge;
pub(crate) use edges::Led;
use facets::Facets;
use granulcal_scene::{BoxSide, Material, Motion, Scene, Shape, WallMaterial};
pub(crate) use nearest::{Nearest, Passage, any_normal};
pub(crate) use rim::Rim;
use surface::{Surface, is_same_circle, surfaces};

/// A wall with its resolved material, and where it is if it moves.
#[derive(Clone, Debug)]
pub(crate) struct Wall {
    surfaces: Vec<Surface>,
    /// The triangles of a mesh, numbered after the surfaces.
    facets: Option<Arc<Facets>>,
    pub material: Material,
    pub placement: Option<Placement>,
}

/// One of a wall's surfaces, which a grain may touch once.
enum Part<'a> {
    Surface(&'a Surface),
    /// A triangle, by its number.
    Triangle(&'a Facets, usize),
}

impl Wall {
    /// Surfaces and facets, each of which a grain may touch once.
    fn count(&self) -> usize {
        self.surfaces.len() + self.facets.as_ref().map_or(0, |facets| facets.count())
    }

    fn part(&self, number: usize) -> Part<'_> {
        match (self.surfaces.get(number), &self.facets) {
            (None, Some(facets)) => Part::Triangle(facets, number - self.surfaces.len()),
            _ => Part::Surface(&self.surfaces[number]),
        }
    }

    fn nearest_there(&self, number: usize, centre: &Vector3<f64>) -> Nearest {
        match self.part(number) {
            Part::Triangle(facets, number) => facets.nearest(number, centre),
            Part::Surface(surface) => surface.nearest(centre),
        }
    }

    /// The nearest point of a surface to a centre at `now` `[s]` into the substep.
    fn nearest(&self, number: usize, centre: &Vector3<f64>, now: f64) -> Nearest {
        let Some(placement) = &self.placement else { return self.nearest_there(number, centre) };
        let near = self.nearest_there(number, &placement.seen(centre, now));
        Nearest { normal: placement.turned(&near.normal), ..near }
    }

    /// Where a centre is in the wall's stated place, and how near a surface that comes nearer than `range` until the
    /// next list may be.
    fn seen(&self, centre: &Vector3<f64>, range: f64) -> (Vector3<f64>, f64) {
        match &self.placement {
            None => (*centre, range),
            Some(placement) => (placement.seen(centre, 0.0), range + placement.reach_at(centre)),
        }
    }

    /// Whether a surface may come nearer than `range` `[m]` until the next list; false only when it surely does not.
    fn may_reach(&self, number: usize, centre: &Vector3<f64>, range: f64) -> bool {
        let (centre, range) = self.seen(centre, range);
        match self.part(number) {
            Part::Triangle(facets, number) => facets.may_reach(number, &centre, range),
            Part::Surface(surface) => surface.may_reach(&centre, range),
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

    /// Whether it has triangles.
    pub fn has_facets(&self) -> bool {
        self.facets.is_some()
    }

    /// Whether it may move.
    pub fn is_moving(&self) -> bool {
        self.placement.is_some()
    }

    /// A place in the scene at `now` `[s]` into the substep, seen from where the wall is stated.
    pub fn stated_place(&self, x: &Vector3<f64>, now: f64) -> Vector3<f64> {
        self.placement.as_ref().map_or(*x, |placement| placement.seen(x, now))
    }

    /// Directions of the scene, seen from where the wall is stated.
    pub fn stated(&self) -> UnitQuaternion<f64> {
        self.placement.as_ref().map_or_else(UnitQuaternion::identity, Placement::stated)
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
    /// Where surfaces end, each with its wall.
    rims: Vec<(usize, Rim)>,
}

impl Walls {
    pub fn of(scene: &Scene) -> Self {
        // A soft layer lies on the hard ground.
        let point = [0.0, 0.0, 0.0 - scene.effects.layer.thickness];
        let ground = Shape::Plane { point, normal: [0.0, 0.0, 1.0] };
        let resolve = |shape: &Shape, material: &WallMaterial, motion: &Motion| Wall {
            surfaces: surfaces(shape),
            facets: facets(shape).map(Arc::new),
            material: material.over(&scene.material),
            placement: Placement::new(motion),
        };
        let of = |wall: &granulcal_scene::Wall| resolve(&wall.shape, &wall.material, &wall.motion);
        let mut all = vec![resolve(&ground, &scene.ground.material, &Motion::default())];
        all[0].material = scene.effects.ground.of(all[0].material);
        if let Some(funnel) = &scene.funnel {
            let mut walls = scene.effects.funnel.walls(funnel).map(|wall| of(&wall));
            for wall in &mut walls {
                wall.material = scene.effects.funnel.rubbed(wall.material);
            }
            let pose = scene.effects.funnel.of(funnel);
            if let Some(mesh) = scene.effects.outlet.mesh(funnel, pose.as_ref()) {
                // One mesh, so that its parts share their edges: the first wall has all of it, the second nothing.
                for wall in &mut walls {
                    wall.surfaces.clear();
                }
                walls[0].facets = Some(Arc::new(Facets::new(&mesh.vertices, &mesh.triangles)));
            }
            all.extend(walls);
        }
        all.extend(scene.walls.iter().map(of));
        // Walls that move part from those that they join.
        let still = all.iter_mut().filter(|wall| wall.placement.is_none());
        surface::join_rims(still.flat_map(|wall| &mut wall.surfaces));
        let (mut first, mut owner) = (Vec::new(), Vec::new());
        for (number, wall) in all.iter().enumerate() {
            first.push(owner.len() as u32);
            owner.resize(owner.len() + wall.count(), number as u32);
        }
        let rims = rims(&all);
        Self { all, first, owner, rims }
    }

    /// Number of surfaces.
    pub fn surfaces(&self) -> usize {
        self.owner.len()
    }

    /// Number of walls.
    pub fn count(&self) -> usize {
        self.all.len()
    }

    /// The walls' rims, each with its wall, where the walls are stated.
    pub fn rims(&self) -> impl Iterator<Item = (&Wall, &Rim)> {
        self.rims.iter().map(|(owner, rim)| (&self.all[*owner], rim))
    }

    /// How fast points of walls no farther from a place than `reach` go at most, as far as they move with the place
    /// `[m/s]`.
    pub fn fastest_near(&self, x: &Vector3<f64>, reach: f64) -> f64 {
        let of = |wall: &Wall| {
            let (velocity, omega) = wall.motion_at(x);
            velocity.norm() + reach * omega.norm()
        };
        self.all.iter().map(of).fold(0.0, f64::max)
    }

    /// Whether the way from one place to another, at `now` `[s]` into a substep, changes the side of a surface round an
    /// end at which nothing goes on. Of triangles [`Self::way`] tells it.
    pub fn leads_round(
        &self,
        surface: usize,
        from: &Vector3<f64>,
        to: &Vector3<f64>,
        now: f64,
    ) -> bool {
        let (owner, wall, number) = self.found(surface);
        let Part::Surface(surface) = wall.part(number) else { return false };
        let [from, to] = [from, to].map(|x| wall.stated_place(x, now));
        let end = surface.leads_round(&from, &to);
        end.is_some_and(|end| self.rims_at(owner, &end).any(Rim::is_free))
    }

    /// Whether what joined a grain to a triangle of a wall is gone on with by another of the same wall, towards whose
    /// `normal` the grain's centre lies at the begin of the substep: the nearest point has passed from the one to the
    /// other.
    pub fn is_left_to(
        &self,
        left: usize,
        surface: usize,
        normal: &Vector3<f64>,
        centre: &Vector3<f64>,
    ) -> bool {
        let ((owner, wall, number), (other, ..)) = (self.found(left), self.found(surface));
        let Part::Triangle(facets, number) = wall.part(number) else { return false };
        let stated = wall.stated() * normal;
        left != surface
            && owner == other
            && facets.is_left_to(number, &stated, &wall.stated_place(centre, 0.0))
    }

    /// The rims on the circle at which a surface of a wall ends.
    fn rims_at(&self, owner: usize, end: &(Vector3<f64>, f64)) -> impl Iterator<Item = &Rim> {
        // Walls that rest share their rims, one that moves has its own.
        let is_moving = self.all[owner].is_moving();
        let is_of_it = move |of: usize| of == owner || !(self.all[of].is_moving() || is_moving);
        let rims = self.rims.iter().filter(move |(of, _)| is_of_it(*of)).map(|(_, rim)| rim);
        rims.filter(move |rim| is_same_circle(&(rim.centre, rim.radius), end))
    }

    /// The way from one place to another, at `now` `[s]` into a substep, if it goes through a surface and ends behind
    /// the edge where that meets another, beyond the ends of both.
    pub fn passed_at_end(
        &self,
        surface: usize,
        from: &Vector3<f64>,
        to: &Vector3<f64>,
        now: f64,
    ) -> Option<Passage> {
        let (owner, wall, number) = self.found(surface);
        let [from, to] = [from, to].map(|x| wall.stated_place(x, now));
        let passage = match wall.part(number) {
            Part::Triangle(facets, number) => facets.passed_at_edge(number, &from, &to),
            Part::Surface(surface) => surface.passed(&from, &to).filter(|passage| {
                let is_behind = |end| {
                    self.rims_at(owner, end).any(|rim| !rim.is_free() && rim.ends_before(&to))
                };
                passage.beyond.as_ref().is_some_and(is_behind)
            }),
        }?;
        let turned = |normal| match &wall.placement {
            Some(placement) => placement.turned(&normal),
            None => normal,
        };
        Some(Passage { normal: turned(passage.normal), ..passage })
    }

    /// Whether the way from one place at the begin of a substep to another at its end `[s]` goes through a thin
    /// surface.
    pub fn is_passed(
        &self,
        surface: usize,
        from: &Vector3<f64>,
        to: &Vector3<f64>,
        end: f64,
    ) -> bool {
        let (_, wall, number) = self.found(surface);
        let (from, to) = (wall.stated_place(from, 0.0), wall.stated_place(to, end));
        let passage = match wall.part(number) {
            Part::Triangle(facets, number) => facets.passed(number, &from, &to),
            Part::Surface(surface) => surface.passed(&from, &to),
        };
        passage.is_some()
    }

    /// Whether any may move.
    pub fn any_moving(&self) -> bool {
        self.all.iter().any(Wall::is_moving)
    }

    /// Whether any has a dashpot on rolling.
    pub fn any_damps_rolling(&self) -> bool {
        self.all.iter().any(|wall| wall.material.rolling_dashpot > 0.0)
    }

    /// Where the walls that may move are.
    pub fn placements(&mut self) -> impl Iterator<Item = &mut Placement> {
        self.all.iter_mut().filter_map(|wall| wall.placement.as_mut())
    }

    /// The number of a surface's wall; of what is numbered after the surfaces, too: rims, and the edges of each wall.
    pub fn owner(&self, surface: usize) -> usize {
        let Some(&owner) = self.owner.get(surface) else {
            let after = surface - self.owner.len();
            return self
                .rims
                .get(after)
                .map_or_else(|| after - self.rims.len(), |(owner, _)| *owner);
        };
        owner as usize
    }

    /// The number of a surface's wall, that wall, and the number of the surface on it.
    fn found(&self, surface: usize) -> (usize, &Wall, usize) {
        let owner = self.owner(surface);
        (owner, &self.all[owner], surface - self.first[owner] as usize)
    }

    /// A surface's wall.
    pub fn wall(&self, surface: usize) -> &Wall {
        &self.all[self.owner(surface)]
    }

    /// The nearest point of a surface to a centre at `now` `[s]` into the substep.
    pub fn nearest(&self, surface: usize, centre: &Vector3<f64>, now: f64) -> Nearest {
        let (_, wall, number) = self.found(surface);
        wall.nearest(number, centre, now)
    }

    /// Whether a surface may come nearer than `range` `[m]` until the next list.
    pub fn may_reach(&self, surface: usize, centre: &Vector3<f64>, range: f64) -> bool {
        let (_, wall, number) = self.found(surface);
        wall.may_reach(number, centre, range)
    }

    /// Calls `found` for every surface that may come nearer than `range` `[m]` until the next list, in their order.
    pub fn reached(&self, centre: &Vector3<f64>, range: f64, mut found: impl FnMut(usize)) {
        for (wall, &first) in self.all.iter().zip(&self.first) {
            wall.reached(centre, range, |number| found(first as usize + number));
        }
    }
}

/// The rims of all walls: those that rest share what they have in common, one that moves has its own.
fn rims(all: &[Wall]) -> Vec<(usize, Rim)> {
    let (mut of_still, mut owners) = (Vec::new(), Vec::new());
    let mut of_moving = Vec::new();
    for (number, wall) in all.iter().enumerate() {
        let mut own = Vec::new();
        let known = if wall.is_moving() { &mut own } else { &mut of_still };
        wall.surfaces.iter().for_each(|surface| Rim::gather(surface, known));
        owners.resize(of_still.len(), number);
        of_moving.extend(own.into_iter().map(|rim| (number, rim)));
    }
    owners.into_iter().zip(of_still).chain(of_moving).collect()
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
    use super::*;

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

    #[test]
    fn ground_comes_first_and_materials_resolve() {
        let mut scene = Scene::funnel(0.12);
        scene.ground.material.restitution = Some(0.1);
        let open = Vec::new();
        let shape = Shape::Box { min: [0.0; 3], max: [1.0; 3], open };
        scene.walls.push(granulcal_scene::Wall::fixed(shape, WallMaterial::default()));
        let walls = Walls::of(&scene);
        assert_eq!((walls.count(), walls.surfaces()), (4, 3 + 12));
        assert!(matches!(walls.all[0].surfaces[..], [Surface::Plane { .. }]));
        assert_eq!(walls.wall(0).material, Material { restitution: 0.1, ..scene.material });
        assert_eq!(walls.wall(1).material, scene.material);
        assert_eq!((walls.owner(2), walls.owner(3), walls.owner(14)), (2, 3, 3));
    }

    fn of_shapes(shapes: &[Shape]) -> Walls {
        let wall =
            |shape: &Shape| granulcal_scene::Wall::fixed(shape.clone(), WallMaterial::default());
        Walls::of(&Scene { walls: shapes.iter().map(wall).collect(), ..Scene::drop(0.1) })
    }

    /// The ways that end behind an edge, of all surfaces but the ground's.
    fn behind_edges(walls: &Walls, from: [f64; 3], to: [f64; 3]) -> Vec<(f64, Vector3<f64>)> {
        let found = |surface| walls.passed_at_end(surface, &from.into(), &to.into(), 0.0);
        (1..walls.surfaces()).filter_map(found).map(|p| (p.depth, p.normal)).collect()
    }

    #[test]
    fn a_corner_behind_the_edge_of_a_closed_wall_has_come_through_one_side_of_it() {
        let (min, max) = ([-0.05, -0.05, 0.04], [0.05, 0.05, 0.3]);
        let closed = Shape::Box { min, max, open: Vec::new() };
        let tube = Shape::Cylinder {
            from: [0.0, 0.0, 0.04],
            to: [0.0, 0.0, 0.3],
            radius: 0.05,
            closed: granulcal_scene::Ends::From,
        };
        for shape in [closed, tube] {
            let walls = of_shapes(&[shape]);
            let (inside, behind) = ([0.047, 0.0005, 0.0425], [0.0505, 0.0, 0.039]);
            let [(depth, normal)] = behind_edges(&walls, inside, behind)[..] else { panic!() };
            assert!((depth - 0.001).abs() < 1e-6 && (normal - Vector3::z()).norm() < 1e-12);
            // Behind one of them alone it is nearest to that one, and needs no edge.
            for to in [[0.0505, 0.0, 0.041], [0.049, 0.0, 0.039], [0.049, 0.0, 0.041]] {
                assert_eq!(behind_edges(&walls, inside, to), []);
            }
            let is_passed = |from: [f64; 3], to: [f64; 3]| {
                let through = |at| walls.is_passed(at, &from.into(), &to.into(), 0.0);
                (1..walls.surfaces()).any(through)
            };
            assert!(is_passed(inside, behind) && is_passed(behind, inside));
            assert!(
                !is_passed(inside, [0.049, 0.0, 0.041]) && !is_passed(behind, [0.06, 0.0, 0.03])
            );
        }
    }

    #[test]
    fn round_an_open_end_and_behind_a_bend_towards_the_grains_no_corner_has_come_through() {
        let open = Shape::Box {
            min: [-0.05, -0.05, 0.0],
            max: [0.05, 0.05, 0.03],
            open: vec![BoxSide::ZMax],
        };
        // Its lower edges and corners are shared.
        let (inside, behind) = ([0.048, 0.047, 0.003], [0.0505, 0.0506, -0.0007]);
        let [(depth, _)] =
            behind_edges(&of_shapes(std::slice::from_ref(&open)), inside, behind)[..]
        else {
            panic!()
        };
        assert!(depth > 4e-4);
        let over_the_edge = ([0.045, 0.0005, 0.028], [0.051, 0.0, 0.031]);
        assert_eq!(behind_edges(&of_shapes(&[open]), over_the_edge.0, over_the_edge.1), []);
        let walls = Walls::of(&Scene::funnel(0.12));
        let funnel = Scene::funnel(0.12).funnel.unwrap();
        let edge = Vector3::new(funnel.stem_radius, 0.0, funnel.height + funnel.stem_length);
        let (above, behind) =
            (edge + Vector3::new(-1e-3, 0.0, 3e-3), edge + Vector3::new(1e-3, 0.0, -1e-3));
        assert_eq!(behind_edges(&walls, above.into(), behind.into()), []);
    }
}
