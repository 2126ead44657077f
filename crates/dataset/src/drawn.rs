//! Grains that a camera looks at: spheres, or convex bodies of one shape.

use granulcal_dem::{BedAtRest, ConvexGrains, Pour};
use granulcal_features::{
    Camera, ConvexShape, DepthImage, FeatureError, render_convex, render_grid,
};
use nalgebra::Vector3;

/// Where the grains are and what they are.
#[derive(Clone, Copy, Debug)]
pub struct Drawn<'a> {
    /// Centres `[m]`.
    pub positions: &'a [Vector3<f64>],
    /// Radii `[m]`; of convex bodies half of the scene's diameter.
    pub radii: &'a [f64],
    /// Shape and orientations, if they are not round.
    pub convex: Option<&'a ConvexGrains>,
    /// The bed before they fell on it, if there was one: a map of heights shows what has become of it since.
    pub bed: Option<&'a BedAtRest>,
}

impl<'a> Drawn<'a> {
    /// The grains of a pour.
    pub fn of(pour: &'a Pour) -> Self {
        Self {
            positions: &pour.positions,
            radii: &pour.radii,
            convex: pour.convex.as_ref(),
            bed: pour.bed.as_ref(),
        }
    }

    /// Round grains.
    pub fn spheres(positions: &'a [Vector3<f64>], radii: &'a [f64]) -> Self {
        Self { positions, radii, convex: None, bed: None }
    }

    /// Every `step`-th pixel of their depth image.
    pub(crate) fn render(&self, camera: &Camera, step: usize) -> Result<DepthImage, FeatureError> {
        let Some(convex) = self.convex else {
            return render_grid(camera, self.positions, self.radii, step);
        };
        let shape =
            ConvexShape { faces: convex.faces.clone(), round: convex.round, reach: convex.reach };
        render_convex(camera, &shape, self.positions, &convex.orientations, step)
    }
}
