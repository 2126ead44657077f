//! One sphere in the frame of a camera: the bounds of its silhouette and its depth along a ray.

use nalgebra::Vector3;

/// A sphere that the camera may see.
pub(super) struct SphereInView {
    /// Centre in the camera frame `[m]`.
    centre: Vector3<f64>,
    /// |c|² - R² `[m²]`: squared length of the tangent from the camera, > 0 as it is outside.
    tangent_sq: f64,
    /// Smallest and largest x/z of a ray that touches the sphere.
    pub(super) slopes_x: (f64, f64),
    /// Smallest and largest y/z of a ray that touches the sphere.
    pub(super) slopes_y: (f64, f64),
}

impl SphereInView {
    /// `None` for a sphere wholly behind the camera and for one that contains its centre.
    pub(super) fn new(centre: Vector3<f64>, radius: f64) -> Option<Self> {
        let tangent_sq = centre.norm_squared() - radius * radius;
        if centre.z <= -radius || tangent_sq <= 0.0 {
            return None;
        }
        Some(Self {
            centre,
            tangent_sq,
            slopes_x: silhouette(centre.x, centre.z, radius),
            slopes_y: silhouette(centre.y, centre.z, radius),
        })
    }

    /// Lowers `pixels` to the sphere's depth where a ray (x, `y`, 1) of the row meets it nearer.
    ///
    /// t² d·d - 2 t d·c + (c·c - R²) = 0, whose smaller root is written with the sum of two
    /// positive numbers in the denominator, so that nothing cancels. A ray that misses has the
    /// root of a negative number, NaN, which is not less than anything: no branch is needed and
    /// the loop vectorises.
    #[inline(always)]
    pub(super) fn draw_row(&self, y: f64, columns: &[f64], pixels: &mut [f32]) {
        let c = &self.centre;
        let (along_row, square_row) = (y * c.y + c.z, y * y + 1.0);
        for (pixel, &x) in pixels.iter_mut().zip(columns) {
            let along = x * c.x + along_row;
            let square = x * x + square_row;
            let root = (along * along - square * self.tangent_sq).sqrt();
            let depth = (self.tangent_sq / (along + root)) as f32;
            // A sphere behind the camera has along < -root and so a negative depth.
            *pixel = if depth > 0.0 && depth < *pixel { depth } else { *pixel };
        }
    }
}

/// Slopes a/z of the two tangents from the origin to the circle of radius R about (a, z), which
/// are the exact bounds of the sphere's silhouette, a conic, along that axis.
///
/// A sphere that reaches the camera's own plane z = 0 has an unbounded silhouette there.
fn silhouette(a: f64, z: f64, radius: f64) -> (f64, f64) {
    if z <= radius {
        return (f64::NEG_INFINITY, f64::INFINITY);
    }
    let denominator = (z - radius) * (z + radius);
    let spread = radius * (a * a + denominator).sqrt();
    ((a * z - spread) / denominator, (a * z + spread) / denominator)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tangents_touch_the_circle() {
        for (a, z, radius) in [(0.0, 1.0, 0.5), (3.0, 1.0, 0.9), (-0.2, 0.29, 0.002)] {
            let (low, high) = silhouette(a, z, radius);
            for slope in [low, high] {
                // Distance of the circle's centre from the line a = slope z.
                let distance = (a - slope * z).abs() / (1.0 + slope * slope).sqrt();
                assert!((distance - radius).abs() < 1e-12, "{distance} {radius}");
            }
            assert!(low < a / z && a / z < high);
        }
    }

    #[test]
    fn a_sphere_around_or_behind_the_camera_is_not_seen() {
        assert!(SphereInView::new(Vector3::new(0.0, 0.0, 0.1), 0.2).is_none());
        assert!(SphereInView::new(Vector3::new(0.0, 0.0, -1.0), 0.5).is_none());
        assert!(SphereInView::new(Vector3::new(1.0, 0.0, -0.1), 0.5).is_some());
    }

    #[test]
    fn depth_on_the_axis_is_the_front_of_the_sphere() {
        let sphere = SphereInView::new(Vector3::new(0.0, 0.0, 1.0), 0.25).unwrap();
        let mut pixels = [f32::INFINITY, 0.5];
        sphere.draw_row(0.0, &[0.0, 0.0], &mut pixels);
        assert_eq!(pixels, [0.75, 0.5]);
    }
}
