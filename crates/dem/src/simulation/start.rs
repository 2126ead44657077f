//! Whether the grains of a start are clear of the walls and of the outflow.

use super::Simulation;
use crate::error::DemError;

/// How deep in a wall a grain may start, in its radii: as deep as the hastiest preset lets grains at rest be.
const MAX_DEPTH: f64 = 0.25;

impl Simulation {
    /// Refuses grains that would leave the scene before they move, and those that are deep in a wall now, which a pour
    /// could only answer by throwing them out of it. To ask before the first substep, of a start that somebody has
    /// written.
    ///
    /// # Errors
    /// [`DemError::StartBelowOutflow`]; [`DemError::StartInWall`] names the wall that most grains are in, how many they
    /// are and how deep the deepest is.
    pub fn check_start(&self) -> Result<(), DemError> {
        if let Some(outflow) = &self.origin.scene.outflow {
            let below = outflow.below;
            let is_out = |grain: &usize| self.particles.position(*grain).z < below;
            let grains = self.particles.present().filter(is_out).count();
            if grains > 0 {
                return Err(DemError::StartBelowOutflow { grains, below });
            }
        }
        let mut around = self.around.clone();
        around.move_walls(self.time());
        let walls = &around.walls;
        let mut found: Vec<(usize, f64)> = vec![(0, 0.0); walls.count()];
        for grain in 0..self.particles.count() {
            let (centre, radius) = (self.particles.position(grain), self.particles.radius(grain));
            let mut last = None;
            walls.reached(&centre, radius, |surface| {
                let (wall, near) = (walls.owner(surface), walls.nearest(surface, &centre, 0.0));
                let depth = 1.0 - near.distance / radius;
                if depth <= MAX_DEPTH {
                    return;
                }
                let (grains, deepest) = &mut found[wall];
                // The surfaces of a wall come one after the other: a grain counts once.
                *grains += usize::from(last.replace(wall) != Some(wall));
                *deepest = deepest.max(depth);
            });
        }
        let worst = found.into_iter().enumerate().max_by_key(|(_, (grains, _))| *grains);
        match worst {
            Some((wall, (grains, depth))) if grains > 0 => {
                let wall = self.wall_name(wall);
                Err(DemError::StartInWall { wall, grains, depth, allowed: MAX_DEPTH })
            }
            _ => Ok(()),
        }
    }

    /// The scene's word for a wall of the solver, the ground first.
    fn wall_name(&self, wall: usize) -> String {
        let shells = self.origin.scene.funnel.as_ref().map_or(0, |_| 2);
        match wall {
            0 => "the ground".to_owned(),
            wall if wall <= shells => "funnel".to_owned(),
            wall => format!("walls.{}", wall - 1 - shells),
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::{DemError, Motion, Scene, Simulation, WallMaterial};
    use granulcal_scene::{Ends, Outflow, Shape, Start, Wall};

    fn check(scene: &Scene) -> Result<(), DemError> {
        Simulation::new(scene, 1).unwrap().check_start()
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
}
