//! Grains of one convex shape over the ground plane to a depth image, exact to the ray.
//!
//! A body is an intersection of half spaces `n . x <= d` and, if it is round, of the inside of a cylinder about its y
//! axis. The ray `o + t r` in the body's axes is inside the half space for `t <= (d - n . o) / (n . r)` where it leaves
//! it (`n . r > 0`), and from there on where it enters; inside the cylinder between the roots of
//! `(r_x^2 + r_z^2) t^2 + 2 (o_x r_x + o_z r_z) t + o_x^2 + o_z^2 - R^2`. The body begins at the last entry, if that
//! comes before the first exit.

use nalgebra::{UnitQuaternion, Vector3};

use super::sphere::SphereInView;
use super::{MAX_COORDINATE, SampledAxis, ground_depth, require_spheres};
use crate::camera::{Camera, downsampled_size};
use crate::depth::DepthImage;
use crate::error::{FeatureError, require_in, require_length};

/// A convex body in its own axes, the origin inside.
#[derive(Debug, Clone, PartialEq)]
pub struct ConvexShape {
    /// Outward unit normals and distances from the origin of its flat faces `[m]`.
    pub faces: Vec<(Vector3<f64>, f64)>,
    /// Radius of the cylinder about the y axis that bounds it, if one does `[m]`.
    pub round: Option<f64>,
    /// Radius of the ball about the origin that holds it `[m]`.
    pub reach: f64,
}

/// The depth image of equal convex bodies on the ground z = 0, every `step`-th pixel of it.
///
/// As [`super::render_grid`] draws spheres: 0.0 where the ray meets nothing; a body whose ball contains the camera's
/// centre or lies behind it is not seen.
///
/// # Errors
/// `LengthMismatch` when there is not one orientation per position, `OutOfRange` for a shape without a size, a
/// coordinate beyond 1000 km or not finite, or a camera with nonsense in its fields; `DownsampleFactor` when no pixel
/// would be left.
pub fn render_convex(
    camera: &Camera,
    shape: &ConvexShape,
    positions: &[Vector3<f64>],
    orientations: &[UnitQuaternion<f64>],
    step: usize,
) -> Result<DepthImage, FeatureError> {
    camera.require_valid()?;
    require_length("orientations", orientations.len(), positions.len())?;
    require_in("reach [m]", shape.reach, f64::MIN_POSITIVE, MAX_COORDINATE)?;
    require_spheres(positions, &vec![shape.reach; positions.len()])?;
    let k = &camera.intrinsics;
    let (width, height) = downsampled_size(k.width, k.height, step)?;
    let columns = SampledAxis::new(width, step, k.fx, k.cx);
    let rows = SampledAxis::new(height, step, k.fy, k.cy);
    let (mut depth, sees_horizon) = ground_depth(camera, &columns, &rows);
    let eye = camera.centre_in_world();
    let to_world = camera.camera_from_world.rotation.inverse();
    for (position, turned) in positions.iter().zip(orientations) {
        let centre = camera.camera_from_world * nalgebra::Point3::from(*position);
        let Some(ball) = SphereInView::new(centre.coords, shape.reach) else { continue };
        let back = turned.inverse();
        let origin = back * (eye - position);
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| back * (to_world * axis));
        let (first_row, end_row) = rows.covered(ball.slopes_y);
        let (first, end) = columns.covered(ball.slopes_x);
        for row in first_row..end_row {
            let along_row = rows.slopes[row] * axes[1] + axes[2];
            for column in first..end {
                let ray = columns.slopes[column] * axes[0] + along_row;
                // The ray's z in the camera is 1, so that its parameter is the depth.
                if let Some(found) = shape.first_hit(&origin, &ray) {
                    let pixel = &mut depth[row * width + column];
                    *pixel = pixel.min(found as f32);
                }
            }
        }
    }
    if sees_horizon {
        for value in &mut depth {
            *value = if value.is_finite() { *value } else { 0.0 };
        }
    }
    DepthImage::new(width, height, depth)
}

impl ConvexShape {
    /// Where a ray from outside first meets the body, in multiples of the ray.
    fn first_hit(&self, origin: &Vector3<f64>, ray: &Vector3<f64>) -> Option<f64> {
        let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
        for (normal, distance) in &self.faces {
            let (rate, room) = (normal.dot(ray), distance - normal.dot(origin));
            if rate > 0.0 {
                leave = leave.min(room / rate);
            } else if rate < 0.0 {
                enter = enter.max(room / rate);
            } else if room < 0.0 {
                return None;
            }
        }
        if let Some(radius) = self.round {
            let square = ray.x * ray.x + ray.z * ray.z;
            let half = origin.x * ray.x + origin.z * ray.z;
            let room = origin.x * origin.x + origin.z * origin.z - radius * radius;
            if square > 0.0 {
                let root = (half * half - square * room).sqrt();
                // A ray that misses has a root that is no number, which passes no comparison below.
                if root.is_nan() {
                    return None;
                }
                enter = enter.max((-half - root) / square);
                leave = leave.min((-half + root) / square);
            } else if room > 0.0 {
                return None;
            }
        }
        (enter > 0.0 && enter <= leave).then_some(enter)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render;

    fn block(half: Vector3<f64>) -> ConvexShape {
        let normals = (0..3).flat_map(|i| [Vector3::ith(i, 1.0), Vector3::ith(i, -1.0)]);
        let faces = normals.map(|n: Vector3<f64>| (n, half.dot(&n.abs()))).collect();
        ConvexShape { faces, round: None, reach: half.norm() }
    }

    fn camera() -> Camera {
        Camera::overhead(0.3, 0.1, 201).unwrap()
    }

    #[test]
    fn a_box_from_above_is_a_flat_square_with_its_sides() {
        let half = Vector3::new(0.01, 0.005, 0.002);
        let centre = Vector3::new(0.0, 0.0, 0.002);
        let level = UnitQuaternion::identity();
        let image = render_convex(&camera(), &block(half), &[centre], &[level], 1).unwrap();
        let at = |u: usize, v: usize| f64::from(image.depth[v * image.width + u]);
        // Its top lies 4 mm above the ground, and the middle pixel looks straight down.
        assert!((at(100, 100) - 0.296).abs() < 1e-7);
        let top = image.depth.iter().filter(|d| (f64::from(**d) - 0.296).abs() < 1e-7).count();
        // Pixels of the top are 0.1 / 201 * 0.296 / 0.3 m wide there.
        let pixel = 0.1 / 201.0 * 0.296 / 0.3;
        let expected = 4.0 * half.x * half.y / (pixel * pixel);
        assert!((top as f64 / expected - 1.0).abs() < 0.05, "{top} {expected}");
        assert!((at(0, 0) - 0.3).abs() < 1e-7);
    }

    #[test]
    fn every_depth_lies_on_the_surface_of_a_turned_body() {
        let half = Vector3::new(0.006, 0.004, 0.003);
        let turned = UnitQuaternion::from_euler_angles(0.4, -0.9, 1.3);
        let centre = Vector3::new(0.01, -0.02, 0.012);
        let can = ConvexShape {
            faces: vec![(Vector3::y(), half.y), (-Vector3::y(), half.y)],
            round: Some(half.x),
            reach: half.x.hypot(half.y),
        };
        for shape in [block(half), can] {
            let eye = camera();
            let image = render_convex(&eye, &shape, &[centre], &[turned], 1).unwrap();
            let mut seen = 0;
            for (i, &depth) in image.depth.iter().enumerate() {
                let (u, v) = ((i % image.width) as f64 + 0.5, (i / image.width) as f64 + 0.5);
                let point = eye.unproject(u, v, f64::from(depth));
                if point.z < 1e-6 {
                    continue;
                }
                seen += 1;
                let local = turned.inverse() * (point - centre);
                let faces = shape.faces.iter().map(|(n, d)| n.dot(&local) - d);
                let side = shape.round.map(|r| local.x.hypot(local.z) - r);
                let outside = faces.chain(side).fold(f64::MIN, f64::max);
                assert!(outside.abs() < 1e-7, "{outside}");
            }
            assert!(seen > 100, "{seen}");
        }
    }

    #[test]
    fn many_faces_are_a_ball() {
        let radius = 0.01;
        let faces = (0..4000).map(|i| {
            // Fibonacci's lattice.
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / 4000.0;
            let angle = 2.399_963_229_728_653 * f64::from(i);
            let across = (1.0 - z * z).sqrt();
            (Vector3::new(across * angle.cos(), across * angle.sin(), z), radius)
        });
        let shape = ConvexShape { faces: faces.collect(), round: None, reach: 1.01 * radius };
        let centre = Vector3::new(0.003, 0.004, 0.02);
        let eye = camera();
        let turned = [UnitQuaternion::identity()];
        let got = render_convex(&eye, &shape, &[centre], &turned, 1).unwrap();
        let ball = render(&eye, &[centre], &[radius]).unwrap();
        let wrong = got.depth.iter().zip(&ball.depth).filter(|(a, b)| (*a - *b).abs() > 1e-4);
        // But for the silhouette, where the lattice is coarser than a pixel.
        assert!(wrong.count() < 60);
    }
}
