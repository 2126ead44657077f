//! Whether the grains of a start are clear of the walls, of each other and of the outflow.

use std::collections::{BTreeMap, BTreeSet};

use super::Simulation;
use crate::bodies::{Bodies, Within};
use crate::clumps::Clumps;
use crate::contact_context::ContactContext;
use crate::error::DemError;
use crate::law::is_parted;
use crate::neighbor::PairSearch;
use crate::parallel::Threads;
use crate::path::{Path, Reach};
use crate::wall::Walls;

/// How deep in a wall or in another a grain may start, in its radii: as deep as the hastiest preset lets grains at rest
/// be.
const MAX_DEPTH: f64 = 0.25;

/// What the grains of a start are too deep in.
#[derive(Default)]
struct TooDeep {
    /// Of each wall: how many grains, the number of the last, and how deep the deepest is.
    in_walls: BTreeMap<usize, (usize, usize, f64)>,
    /// The pairs of grains, each once: clumps meet in several spheres, bodies in several points.
    pairs: BTreeSet<(usize, usize)>,
    /// The deepest pair, and how deep.
    deepest: Option<((usize, usize), f64)>,
}

impl TooDeep {
    /// Sees a grain in a wall, in its radii; the walls of one grain come one after the other.
    fn in_wall(&mut self, wall: usize, grain: usize, depth: f64) {
        if depth <= MAX_DEPTH {
            return;
        }
        let (grains, last, deepest) = self.in_walls.entry(wall).or_insert((0, usize::MAX, 0.0));
        *grains += usize::from(*last != grain);
        (*last, *deepest) = (grain, deepest.max(depth));
    }

    /// Sees two grains in each other, in radii of the smaller.
    fn in_each_other(&mut self, i: usize, j: usize, depth: f64) {
        if depth <= MAX_DEPTH {
            return;
        }
        let pair = (i.min(j), i.max(j));
        self.pairs.insert(pair);
        if self.deepest.is_none_or(|(_, deepest)| depth > deepest) {
            self.deepest = Some((pair, depth));
        }
    }
}

impl Simulation {
    /// Refuses grains that would leave the scene before they move, and those that are deep in a wall now or, where the
    /// start states every place or space repeats, in each other, which a pour could only answer by throwing them apart.
    /// To ask before the first substep, of a start that somebody has written.
    ///
    /// # Errors
    /// [`DemError::StartBelowOutflow`]; [`DemError::StartInWall`] names the wall that most grains are in, how many they
    /// are and how deep the deepest is; [`DemError::StartInEachOther`] names the grains that are deepest in each other.
    pub fn check_start(&self) -> Result<(), DemError> {
        if let Some(outflow) = &self.origin.scene.outflow {
            let below = outflow.below;
            let is_out = |grain: &usize| self.particles.position(*grain).z < below;
            let grains = self.particles.present().filter(is_out).count();
            if grains > 0 {
                return Err(DemError::StartBelowOutflow { grains, below });
            }
        }
        // Elsewhere grains stand on a lattice that keeps them apart, unless it meets itself where space repeats, or are
        // parted.
        let scene = &self.origin.scene;
        let repeats = scene.periodic.is_some() && !is_parted(scene);
        let may_meet = scene.start.is_listed() || repeats;
        let mut around = self.around.clone();
        around.move_walls(self.time());
        let mut found = TooDeep::default();
        if let Some(bodies) = &self.bodies {
            bodies_too_deep(bodies, &around, &mut found);
        } else {
            self.balls_in_walls(&around.walls, &mut found);
            if may_meet {
                self.balls_in_each_other(&mut found);
            }
        }
        let worst = found.in_walls.into_iter().max_by_key(|(_, (grains, ..))| *grains);
        if let Some((wall, (grains, _, depth))) = worst {
            let wall = self.wall_name(wall);
            return Err(DemError::StartInWall { wall, grains, depth, allowed: MAX_DEPTH });
        }
        match found.deepest {
            Some((deepest, depth)) if may_meet => {
                let (pairs, allowed) = (found.pairs.len(), MAX_DEPTH);
                Err(DemError::StartInEachOther { pairs, deepest, depth, allowed })
            }
            _ => Ok(()),
        }
    }

    /// Spheres of a grain: one, unless it is several.
    pub(super) fn members(&self) -> usize {
        self.clumps.as_ref().map_or(1, Clumps::members)
    }

    fn balls_in_walls(&self, walls: &Walls, found: &mut TooDeep) {
        let (particles, members) = (&self.particles, self.members());
        for grain in 0..particles.count() {
            let (centre, radius) = (particles.position(grain), particles.radius(grain));
            walls.reached(&centre, radius, |surface| {
                let near = walls.nearest(surface, &centre, 0.0);
                let depth = 1.0 - near.distance / radius;
                found.in_wall(walls.owner(surface), grain / members, depth);
            });
        }
    }

    fn balls_in_each_other(&self, found: &mut TooDeep) {
        let (particles, members) = (&self.particles, self.members());
        let (paths, mut near) = (Path::all_of(particles), Vec::new());
        let reach = Reach { interval: 0.0, near: 0.0, far: 0.0 };
        PairSearch::default().pairs(particles, &paths, reach, &Threads::default(), &mut near);
        for pair in near {
            let (i, j) = (pair.i as usize, pair.j as usize);
            if i / members == j / members {
                continue;
            }
            let [r_i, r_j] = [i, j].map(|grain| particles.radius(grain));
            let apart = particles.nearest(particles.position(i) - particles.position(j)).norm();
            found.in_each_other(i / members, j / members, (r_i + r_j - apart) / r_i.min(r_j));
        }
    }

    /// The scene's words for the walls, in the order of [`Simulation::wall_loads`]: `ground`, `funnel` for its cone and
    /// for its stem, `walls.0` and so on.
    pub fn wall_names(&self) -> Vec<String> {
        let name = |wall| match wall {
            0 => "ground".to_owned(),
            wall => self.wall_name(wall),
        };
        (0..self.around.walls.count()).map(name).collect()
    }

    /// What a sentence calls a wall of the solver, the ground first.
    fn wall_name(&self, wall: usize) -> String {
        let shells = self.origin.scene.funnel.as_ref().map_or(0, |_| 2);
        match wall {
            0 => "the ground".to_owned(),
            wall if wall <= shells => "funnel".to_owned(),
            wall => format!("walls.{}", wall - 1 - shells),
        }
    }
}

/// Of convex bodies, as they are turned.
fn bodies_too_deep(bodies: &Bodies, around: &ContactContext, found: &mut TooDeep) {
    for (body, within, depth) in bodies.overlaps(&around.walls, &around.material) {
        let depth = depth / around.radius;
        match within {
            Within::Wall(surface) => found.in_wall(around.walls.owner(surface), body, depth),
            Within::Body(other) => found.in_each_other(body, other, depth),
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::{DemError, Motion, Scene, Simulation, WallMaterial};
    use granulcal_scene::{Ends, GrainShape, Outflow, Periodic, PeriodicAxis, Shape, Start, Wall};

    fn check(scene: &Scene) -> Result<(), DemError> {
        check_of(scene, 1)
    }

    fn check_of(scene: &Scene, seed: u64) -> Result<(), DemError> {
        Simulation::new(scene, seed).unwrap().check_start()
    }

    #[test]
    fn a_start_in_a_wall_is_refused_by_its_name() {
        let mut scene = Scene::funnel(0.12);
        check(&scene).unwrap();
        let closed = Ends::None;
        let (from, to) = ([0.0, 0.0, 0.2], [0.0, 0.0, 0.4]);
        let tube = |radius| Shape::Cylinder { from, to, radius, closed };
        scene.walls.push(Wall::fixed(tube(0.07), WallMaterial::default()));
        scene.walls.push(Wall::fixed(tube(0.036), WallMaterial::default()));
        let error = check(&scene).unwrap_err();
        assert!(
            matches!(&error, DemError::StartInWall { wall, .. } if wall == "walls.1"),
            "{error}"
        );
        let names = Simulation::new(&scene, 1).unwrap().wall_names();
        assert_eq!(names, ["ground", "funnel", "funnel", "walls.0", "walls.1"]);
        // One that has come by its motion is where it is at time 0.
        scene.walls[1].shape = tube(0.07);
        check(&scene).unwrap();
        let knots = vec![[0.5, 0.03, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]];
        scene.walls[1].motion = Motion::Trajectory { file: None, knots };
        assert!(check(&scene).is_err());
    }

    #[test]
    fn a_start_below_the_outflow_is_refused() {
        let mut scene = Scene::drop(0.1);
        scene.outflow = Some(Outflow { below: 0.09, until: None });
        check(&scene).unwrap();
        scene.outflow = Some(Outflow { below: 1.0, until: None });
        let error = check(&scene).unwrap_err();
        assert!(matches!(error, DemError::StartBelowOutflow { grains: 2000, .. }), "{error}");
    }

    #[test]
    fn grains_that_touch_and_grains_in_the_ground_are_told_apart() {
        let mut scene = Scene::drop(0.1);
        scene.grains.count = 2;
        let at = |z: f64| vec![[0.0, 0.0, 0.05], [0.01, 0.0, z]];
        scene.start = Start::Positions { positions: at(1.9e-3) };
        check(&scene).unwrap();
        scene.start = Start::Positions { positions: at(-1e-3) };
        let text = check(&scene).unwrap_err().to_string();
        assert!(text.contains("1 grain") && text.contains("the ground"), "{text}");
    }

    #[test]
    fn grains_in_each_other_are_named() {
        let mut scene = Scene::drop(0.1);
        scene.grains.count = 3;
        let at = |x: f64| Start::Positions {
            positions: vec![[0.0, 0.0, 0.05], [x, 0.0, 0.05], [0.01, 0.0, 0.05]],
        };
        scene.start = at(3.6e-3);
        check(&scene).unwrap();
        scene.start = at(0.01);
        let text = check(&scene).unwrap_err().to_string();
        assert!(text.starts_with("1 pair(s)") && text.contains("grains 1 and 2"), "{text}");
        assert!(text.contains("the deepest by 2 of a radius"), "{text}");
        // Spheres of one clump are in each other as they are meant to be.
        scene.effects.clump.aspect = 1.5;
        scene.start = at(0.05);
        check(&scene).unwrap();
    }

    #[test]
    fn a_pair_that_meets_in_several_places_counts_once() {
        let mut scene = Scene::drop(0.1);
        scene.grains.count = 2;
        let positions = vec![[0.0, 0.0, 0.05], [1e-3, 0.0, 0.05]];
        scene.start = Start::Positions { positions: positions.clone() };
        scene.effects.clump.aspect = 1.5;
        let text = check(&scene).unwrap_err().to_string();
        assert!(text.starts_with("1 pair(s)"), "{text}");
        scene.effects.clump.aspect = 1.0;
        scene.grains.shape = Some(GrainShape::Box { aspect: [1.0; 3] });
        scene.start = Start::Poses { positions, orientations: vec![[0.0, 0.0, 0.0, 1.0]; 2] };
        let text = check(&scene).unwrap_err().to_string();
        assert!(text.starts_with("1 pair(s)"), "{text}");
    }

    #[test]
    fn a_lattice_that_meets_itself_where_space_repeats_is_refused() {
        let mut scene = Scene::drop(0.1);
        scene.grains.count = 50;
        let start = |along| {
            let counts = [along, 5, 10];
            Start::Grid { counts, spacing: 4.2e-3, jitter: 0.0, base: 2.5e-3 }
        };
        scene.periodic = Some(Periodic { axis: PeriodicAxis::X, from: -0.02, to: 0.02 });
        scene.start = start(9);
        check(&scene).unwrap();
        // The tenth is 37.8 mm from the first, and 2.2 from where that comes again.
        scene.start = start(10);
        let text = check(&scene).unwrap_err().to_string();
        assert!(text.starts_with("5 pair(s)") && text.contains("0 and 9"), "{text}");
        // What is parted before it is let go needs room and no lattice.
        scene.effects.polydispersity.cv = 0.1;
        check(&scene).unwrap();
    }

    #[test]
    fn bodies_start_as_they_are_turned_and_not_as_balls() {
        let mut scene = Scene::drop(0.1);
        scene.grains.count = 1;
        let height = |z: f64| Start::Positions { positions: vec![[0.0, 0.0, z]] };
        // Thinner than a ball whichever way it is turned.
        scene.grains.shape = Some(GrainShape::Box { aspect: [1.0, 0.1, 0.1] });
        let depth = |scene: &Scene, seed| match check_of(scene, seed) {
            Ok(()) => 0.0,
            Err(DemError::StartInWall { depth, .. }) => depth,
            Err(error) => panic!("{error}"),
        };
        for seed in 0..8 {
            scene.start = height(0.0);
            let deepest = depth(&scene, seed);
            assert!(deepest < 1.01, "{deepest}");
            // Now its lowest corner is on the ground, where a ball would be deep in it.
            scene.start = height(scene.grains.radius() * deepest);
            check_of(&scene, seed).unwrap();
        }
    }
}
