//! Pinhole camera: intrinsics, pose, projection.
//!
//! **Pixels.** Pixel (u, v) is column u from the left and row v from the top; its centre is the
//! image point (u + 0.5, v + 0.5), so an image of width w covers exactly [0, w]. Vendors (OpenCV,
//! RealSense) put the centre at the integer: [`Intrinsics::from_integer_centres`] converts.
//!
//! **Axes.** In the camera frame x points right, y down, z forward along the optical axis (OpenCV).
//! Depth is the z of that frame, not the length of the ray.

use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::error::{FeatureError, require_finite, require_in};

/// Largest image side `[px]` that is accepted; beyond it a size is a slip, not a camera.
pub const MAX_SIDE_PX: usize = 1 << 15;

/// Focal lengths beyond this `[px]` mean a field of view below a micro-radian.
const MAX_FOCAL_PX: f64 = 1e9;

/// Size, focal lengths and principal point of a pinhole camera, without distortion `[px]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "UncheckedIntrinsics")]
pub struct Intrinsics {
    /// Columns of the image `[px]`.
    pub width: usize,
    /// Rows of the image `[px]`.
    pub height: usize,
    /// Focal length along x `[px]`.
    pub fx: f64,
    /// Focal length along y `[px]`.
    pub fy: f64,
    /// Image point of the optical axis, x `[px]`; w/2 for a centred lens.
    pub cx: f64,
    /// Image point of the optical axis, y `[px]`.
    pub cy: f64,
}

/// What a file says before it is checked.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct UncheckedIntrinsics {
    width: usize,
    height: usize,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
}

impl TryFrom<UncheckedIntrinsics> for Intrinsics {
    type Error = FeatureError;

    fn try_from(raw: UncheckedIntrinsics) -> Result<Self, FeatureError> {
        Self::new(raw.width, raw.height, raw.fx, raw.fy, raw.cx, raw.cy)
    }
}

impl Intrinsics {
    /// Checked intrinsics.
    ///
    /// # Errors
    /// `OutOfRange` or `NonFinite` for an empty image, a focal length that is not positive or twice the other, or a
    /// principal point that is not finite, or farther from the image than that is wide.
    pub fn new(
        width: usize,
        height: usize,
        fx: f64,
        fy: f64,
        cx: f64,
        cy: f64,
    ) -> Result<Self, FeatureError> {
        Self::checked((width, height), (fx, fy), (cx, cy), 0.0)
    }

    /// As [`Intrinsics::new`] from a principal point that the caller counts from a place that lies `shift` beyond the
    /// corner, in whose numbers it is refused.
    fn checked(
        (width, height): (usize, usize),
        (fx, fy): (f64, f64),
        (stated_x, stated_y): (f64, f64),
        shift: f64,
    ) -> Result<Self, FeatureError> {
        require_in("image width [px]", width as f64, 1.0, MAX_SIDE_PX as f64)?;
        require_in("image height [px]", height as f64, 1.0, MAX_SIDE_PX as f64)?;
        require_in("focal length fx [px]", fx, f64::MIN_POSITIVE, MAX_FOCAL_PX)?;
        require_in("focal length fy [px]", fy, f64::MIN_POSITIVE, MAX_FOCAL_PX)?;
        require_finite("principal point [px]", [stated_x, stated_y].into_iter())?;
        // A part of an image may have it outside, but not far.
        for (name, at, side) in [
            ("principal point cx [px]", stated_x, width),
            ("principal point cy [px]", stated_y, height),
        ] {
            require_in(name, at, -(side as f64) - shift, 2.0 * side as f64 - shift)?;
        }
        require_in("focal lengths fy over fx", fy / fx, 0.5, 2.0)?;
        let (cx, cy) = (stated_x + shift, stated_y + shift);
        Ok(Self { width, height, fx, fy, cx, cy })
    }

    /// Intrinsics given in the convention of OpenCV and RealSense, where the centre of the first
    /// pixel is (0, 0): the principal point moves by half a pixel.
    ///
    /// # Errors
    /// As [`Intrinsics::new`].
    pub fn from_integer_centres(
        width: usize,
        height: usize,
        fx: f64,
        fy: f64,
        ppx: f64,
        ppy: f64,
    ) -> Result<Self, FeatureError> {
        Self::checked((width, height), (fx, fy), (ppx, ppy), 0.5)
    }

    /// Intrinsics of the image that keeps every `n`-th pixel (see [`sample_offset`]).
    ///
    /// The centre of pixel i of the small image is the centre of pixel n i + o of the large one:
    /// f' = f / n and c' = (c - o - 1/2) / n + 1/2.
    ///
    /// # Errors
    /// `DownsampleFactor` when no pixel would be left.
    pub fn downsampled(&self, n: usize) -> Result<Self, FeatureError> {
        let (width, height) = downsampled_size(self.width, self.height, n)?;
        let kept = sample_offset(n) as f64 + 0.5;
        let n = n as f64;
        Self::new(
            width,
            height,
            self.fx / n,
            self.fy / n,
            (self.cx - kept) / n + 0.5,
            (self.cy - kept) / n + 0.5,
        )
    }
}

/// The pixel of an n-pixel block that survives down-sampling: the middle one, n/2 rounded down.
///
/// For odd n that is the exact centre of the block, for even n half a pixel beyond it;
/// [`Intrinsics::downsampled`] accounts for it, so no point moves.
pub const fn sample_offset(n: usize) -> usize {
    n / 2
}

/// Size of the down-sampled image; a last, incomplete block is dropped.
pub(crate) fn downsampled_size(
    width: usize,
    height: usize,
    n: usize,
) -> Result<(usize, usize), FeatureError> {
    let max = width.min(height);
    if n == 0 || n > max {
        return Err(FeatureError::DownsampleFactor { got: n, max });
    }
    Ok((width / n, height / n))
}

/// A pinhole camera in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// The lens and the image.
    pub intrinsics: Intrinsics,
    /// Pose: `point_in_camera = camera_from_world * point_in_world`.
    pub camera_from_world: Isometry3<f64>,
}

impl Camera {
    /// The bird's-eye camera of the paper: straight above the world's origin, looking down, square
    /// image. Image right is world +x, image up is world +y.
    ///
    /// `height_m` is the distance to the ground, `field_width_m` the side of the square of ground
    /// in view (0.29 m and 0.58 m in the paper), so f = pixels · height / field width.
    ///
    /// # Errors
    /// `OutOfRange` when a length is not positive and below 1 km, or `pixels` is 0 or too large.
    pub fn overhead(
        height_m: f64,
        field_width_m: f64,
        pixels: usize,
    ) -> Result<Self, FeatureError> {
        require_in("camera height [m]", height_m, 1e-6, 1e3)?;
        require_in("field width [m]", field_width_m, 1e-6, 1e3)?;
        let focal = pixels as f64 * height_m / field_width_m;
        let centre = 0.5 * pixels as f64;
        // A half turn about x makes image down world -y and the optical axis world -z.
        let half_turn =
            UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(0.0, 1.0, 0.0, 0.0));
        Ok(Self {
            intrinsics: Intrinsics::new(pixels, pixels, focal, focal, centre, centre)?,
            camera_from_world: Isometry3::from_parts(
                Translation3::new(0.0, 0.0, height_m),
                half_turn,
            ),
        })
    }

    /// A camera at `eye` that looks at `target`, its image upright: world +z is up in it, or +y where it looks
    /// straight down or up. `field_width_m` is the width in view at the distance of the target.
    ///
    /// # Errors
    /// `OutOfRange` when the field width or the way from eye to target is not positive and below 1 km, `pixels`
    /// (columns, rows) are 0 or too many, or a coordinate is not finite.
    pub fn looking_at(
        eye: Vector3<f64>,
        target: Vector3<f64>,
        field_width_m: f64,
        pixels: (usize, usize),
    ) -> Result<Self, FeatureError> {
        require_in("field width [m]", field_width_m, 1e-6, 1e3)?;
        let forward = target - eye;
        let distance = forward.norm();
        require_in("way from eye to target [m]", distance, 1e-6, 1e3)?;
        require_finite("eye of a camera [m]", eye.iter().copied())?;
        let forward = forward / distance;
        let across = forward.cross(&Vector3::z());
        // Within a thousandth of a degree of the vertical the horizon gives no direction.
        let right = if across.norm() > 1e-5 { across } else { forward.cross(&Vector3::y()) };
        let right = right.normalize();
        let world_from_camera =
            Rotation3::from_basis_unchecked(&[right, forward.cross(&right), forward]);
        let turn = UnitQuaternion::from_rotation_matrix(&world_from_camera.inverse());
        let (width, height) = pixels;
        let focal = width as f64 * distance / field_width_m;
        let centre = (0.5 * width as f64, 0.5 * height as f64);
        Ok(Self {
            intrinsics: Intrinsics::new(width, height, focal, focal, centre.0, centre.1)?,
            camera_from_world: Isometry3::from_parts((-(turn * eye)).into(), turn),
        })
    }

    /// The camera turned about its own centre: by `tilt_x_rad` about its x axis, then by
    /// `tilt_y_rad` about its new y axis.
    #[must_use]
    pub fn tilted(self, tilt_x_rad: f64, tilt_y_rad: f64) -> Self {
        let old_from_new = Rotation3::from_axis_angle(&Vector3::x_axis(), tilt_x_rad)
            * Rotation3::from_axis_angle(&Vector3::y_axis(), tilt_y_rad);
        let new_from_old = UnitQuaternion::from_rotation_matrix(&old_from_new.inverse());
        Self { camera_from_world: new_from_old * self.camera_from_world, ..self }
    }

    /// The camera of the image that [`crate::DepthImage::downsample`] makes; a pixel there
    /// unprojects to the same point as the pixel that it was.
    ///
    /// # Errors
    /// `DownsampleFactor` when no pixel would be left.
    pub fn downsampled(&self, n: usize) -> Result<Self, FeatureError> {
        Ok(Self { intrinsics: self.intrinsics.downsampled(n)?, ..*self })
    }

    /// Position of the camera's centre in the world `[m]`.
    pub fn centre_in_world(&self) -> Vector3<f64> {
        self.camera_from_world.inverse_transform_point(&nalgebra::Point3::origin()).coords
    }

    /// The point in the world at z-depth `depth` `[m]` behind the image point (u, v) `[px]`.
    /// For the centre of pixel (i, j) pass (i + 0.5, j + 0.5).
    pub fn unproject(&self, u: f64, v: f64, depth: f64) -> Vector3<f64> {
        let k = &self.intrinsics;
        let point_in_camera =
            nalgebra::Point3::new((u - k.cx) / k.fx * depth, (v - k.cy) / k.fy * depth, depth);
        self.camera_from_world.inverse_transform_point(&point_in_camera).coords
    }

    /// Image point and z-depth (u `[px]`, v `[px]`, depth `[m]`) of a point, `None` when it is not in
    /// front of the camera. The image point may lie outside the image.
    pub fn project(&self, point_in_world: &Vector3<f64>) -> Option<(f64, f64, f64)> {
        let k = &self.intrinsics;
        let p = self.camera_from_world * nalgebra::Point3::from(*point_in_world);
        (p.z > 0.0).then(|| (k.fx * p.x / p.z + k.cx, k.fy * p.y / p.z + k.cy, p.z))
    }

    /// Whether a point falls on the image; nothing is said about what may hide it.
    pub fn sees(&self, point_in_world: &Vector3<f64>) -> bool {
        let (width, height) = (self.intrinsics.width as f64, self.intrinsics.height as f64);
        self.project(point_in_world)
            .is_some_and(|(u, v, _)| (0.0..width).contains(&u) && (0.0..height).contains(&v))
    }

    /// Refuses an image that this camera cannot have taken.
    pub(crate) fn require_size(&self, width: usize, height: usize) -> Result<(), FeatureError> {
        let expected = (self.intrinsics.width, self.intrinsics.height);
        if (width, height) == expected {
            Ok(())
        } else {
            Err(FeatureError::SizeMismatch { what: "depth image", got: (width, height), expected })
        }
    }

    /// Refuses a camera whose public fields were set to nonsense.
    pub(crate) fn require_valid(&self) -> Result<(), FeatureError> {
        let k = &self.intrinsics;
        Intrinsics::new(k.width, k.height, k.fx, k.fy, k.cx, k.cy)?;
        let pose = self.camera_from_world.to_homogeneous();
        require_finite("camera pose", pose.iter().copied())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn looking_straight_down_is_overhead() {
        let overhead = Camera::overhead(0.29, 0.58, 64).unwrap();
        let eye = Vector3::new(0.0, 0.0, 0.29);
        let camera = Camera::looking_at(eye, Vector3::zeros(), 0.58, (64, 64)).unwrap();
        for point in [[0.1, -0.05, 0.02], [-0.2, 0.1, 0.0], [0.0, 0.0, 0.1]].map(Vector3::from) {
            let (a, b) = (overhead.project(&point).unwrap(), camera.project(&point).unwrap());
            assert!(
                (a.0 - b.0).abs() + (a.1 - b.1).abs() + (a.2 - b.2).abs() < 1e-9,
                "{a:?} {b:?}"
            );
        }
    }

    #[test]
    fn from_the_side_x_is_right_and_z_is_up() {
        let (eye, target) = (Vector3::new(0.0, -0.5, 0.1), Vector3::new(0.0, 0.0, 0.1));
        let camera = Camera::looking_at(eye, target, 0.2, (200, 100)).unwrap();
        // 1 px is 1 mm at the distance of the target.
        let (u, v, depth) = camera.project(&Vector3::new(0.03, 0.0, 0.12)).unwrap();
        assert!((u - 130.0).abs() < 1e-9 && (v - 30.0).abs() < 1e-9, "{u} {v}");
        assert!((depth - 0.5).abs() < 1e-12, "{depth}");
        assert!(camera.project(&Vector3::new(0.0, -0.6, 0.1)).is_none());
    }

    #[test]
    fn a_camera_that_looks_at_itself_is_refused() {
        let here = Vector3::new(0.1, 0.2, 0.3);
        assert!(Camera::looking_at(here, here, 0.2, (8, 8)).is_err());
        assert!(Camera::looking_at(here, Vector3::zeros(), -1.0, (8, 8)).is_err());
        assert!(Camera::looking_at(here, Vector3::zeros(), 0.1, (0, 8)).is_err());
    }
}
