//! A bed of loose grains, on which a ball of grains falls.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::check::{non_negative, positive};
use crate::error::SceneError;
use crate::grains::Grains;
use crate::start;

/// A bed of the pour's grains, of which it has as many as fit: a cubic lattice in an upright cylinder on the ground,
/// that falls and comes to rest before the ball is there.
///
/// The wider the lattice the looser the bed: grains that fall a little stay where they are caught. What holds it
/// together is a wall of the scene; without one it runs out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bed {
    /// Radius of the cylinder `[m]`; no grain reaches beyond it.
    pub radius: f64,
    /// Height of the cylinder `[m]`, of which a bed at rest has the share that its solid fraction leaves.
    pub height: f64,
    /// Distance of neighbours `[m]`.
    pub spacing: f64,
    /// Half width of a uniform seeded displacement along each axis `[m]`.
    pub jitter: f64,
    /// When the ball is let go `[s]`. Until then nothing touches it and no camera sees it.
    pub settle: f64,
}

impl Bed {
    pub(crate) fn check(&self, grains: &Grains) -> Result<(), SceneError> {
        for (name, number) in
            [("radius", self.radius), ("height", self.height), ("spacing", self.spacing)]
        {
            positive(&format!("bed.{name}"), number)?;
        }
        non_negative("bed.settle", self.settle)?;
        start::jitter_fits("bed.jitter", self.jitter, self.spacing, grains.diameter)?;
        start::check_places("bed", self.radius, self.height, self.spacing)?;
        if self.lattice(grains).is_empty() {
            let allowed = "wide and high enough for a grain, which may move by bed.jitter";
            return Err(SceneError::range(
                "bed (smaller of radius and height)",
                self.radius.min(self.height),
                allowed,
            ));
        }
        Ok(())
    }

    /// Centres of its grains at time zero `[m]`.
    pub fn positions(&self, grains: &Grains, seed: u64) -> Vec<Vector3<f64>> {
        let mut points = self.lattice(grains);
        // Random numbers apart from those of the ball.
        start::displace(&mut points, self.jitter, &mut start::random(seed ^ STREAM));
        points
    }

    fn lattice(&self, grains: &Grains) -> Vec<Vector3<f64>> {
        let top = [0.0, 0.0, self.height];
        start::cylinder(grains, [0.0; 3], top, self.radius, self.spacing, self.jitter)
    }
}

/// Tells the bed's random numbers from the ball's.
const STREAM: u64 = 0x6265_6473;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;
    use crate::{Mask, Projection};

    fn scene() -> Scene {
        let mut scene = Scene::drop(0.1);
        scene.camera.projection = Projection::Orthographic;
        scene.bed =
            Some(Bed { radius: 0.05, height: 0.02, spacing: 5e-3, jitter: 2e-4, settle: 0.2 });
        scene
    }

    #[test]
    fn it_survives_toml_and_its_numbers_have_paths() {
        let scene = scene();
        scene.check().unwrap();
        assert_eq!(Scene::from_toml(&scene.to_toml().unwrap()).unwrap(), scene);
        assert_eq!(scene.with("bed.spacing", 6e-3).unwrap().bed.unwrap().spacing, 6e-3);
        assert_eq!(scene.moves_until(), 0.2);
        // What has no bed says nothing of it.
        assert!(!Scene::drop(0.1).to_toml().unwrap().contains("bed"));
    }

    #[test]
    fn its_grains_are_in_the_cylinder_and_apart() {
        let scene = scene();
        let (bed, grains) = (scene.bed.unwrap(), &scene.grains);
        let points = bed.positions(grains, 3);
        let radius = grains.radius();
        // As many as a cubic lattice of that spacing has in the cylinder, less the edges'.
        let lattice = std::f64::consts::PI * 0.05_f64.powi(2) * 0.02 / 5e-3_f64.powi(3);
        assert!((points.len() as f64) < lattice && points.len() as f64 > 0.7 * lattice);
        for (i, a) in points.iter().enumerate() {
            assert!(a.xy().norm() + radius <= 0.05 && a.z >= radius && a.z + radius <= 0.02);
            assert!(points[..i].iter().all(|b| (a - b).norm() >= grains.diameter));
        }
        assert_eq!(points, bed.positions(grains, 3));
        assert_ne!(points, bed.positions(grains, 4));
    }

    #[test]
    fn what_cannot_be_is_refused_by_name() {
        for (change, name) in [
            (
                (|s: &mut Scene| s.bed.as_mut().unwrap().radius = 0.0) as fn(&mut Scene),
                "bed.radius",
            ),
            (|s| s.bed.as_mut().unwrap().settle = -1.0, "bed.settle"),
            (|s| s.bed.as_mut().unwrap().settle = 5.0, "bed.settle must be less than end.horizon"),
            (|s| s.bed.as_mut().unwrap().jitter = 1e-3, "bed.jitter"),
            (|s| s.bed.as_mut().unwrap().height = 3e-3, "smaller of radius and height"),
            (|s| s.bed.as_mut().unwrap().spacing = 4.0e-6, "bed.spacing"),
            (|s| s.camera.projection = Projection::Pinhole, "a camera that is not orthographic"),
            (|s| s.camera.mask = Mask::Colour, "camera.mask"),
            (|s| s.start = Scene::funnel(0.1).start, "a start that is no ball"),
            (|s| s.outflow = Some(crate::Outflow { below: -1.0, until: None }), "outflow"),
        ] {
            let mut scene = scene();
            change(&mut scene);
            let text = scene.check().unwrap_err().to_string();
            assert!(text.contains(name), "{name}: {text}");
        }
    }
}
