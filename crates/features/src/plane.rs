//! Robust plane fit: random sampling to find the plane, total least squares to place it.

use nalgebra::{Isometry3, Matrix3, SymmetricEigen, Translation3, UnitQuaternion, Vector3};

use crate::error::{FeatureError, require_finite, require_in};
use crate::rng::Stream;

/// Probability with which the search must have drawn three points of the plane at least once.
const CONFIDENCE: f64 = 0.9999;
/// Samples drawn at least, as the first good plane may still be a tilted one.
const MIN_SAMPLES: usize = 32;
/// Samples drawn at most: enough for 10 % of inliers at the confidence above.
const MAX_SAMPLES: usize = 10_000;
/// Points on which a candidate is scored; the share of inliers is then known to 1 %.
const SCORED_POINTS: usize = 2048;
/// Rounds of "least squares on the inliers, find the inliers again".
const MAX_REFINEMENTS: usize = 50;
/// Steps of the eigenvalue iteration at most; a finite 3 × 3 matrix takes fewer than ten.
const MAX_ROTATIONS: usize = 100;
/// Tilt beyond the largest that is rounding: a flat ground is found under a limit of 0 `[rad]`.
const TILT_ROUNDING: f64 = 1e-9;
/// Relative extent below which points count as a line or a point; far above f64 rounding.
const FLATNESS: f64 = 1e-7;

/// The plane {p : normal · p = offset}.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// Unit normal `[-]`.
    pub normal: Vector3<f64>,
    /// Distance of the plane from the origin along the normal `[m]`.
    pub offset: f64,
}

impl Plane {
    /// The ground of the world, z = 0.
    pub const GROUND: Self = Self { normal: Vector3::new(0.0, 0.0, 1.0), offset: 0.0 };

    /// Distance of a point from the plane, positive on the side of the normal `[m]`.
    pub fn signed_distance(&self, point: &Vector3<f64>) -> f64 {
        self.normal.dot(point) - self.offset
    }

    /// Angle between the normal and the world's z axis `[rad]`.
    pub fn tilt_rad(&self) -> f64 {
        // atan2 keeps its digits for small angles, where acos(n_z) loses half of them.
        self.normal.x.hypot(self.normal.y).atan2(self.normal.z)
    }

    /// The same plane with the normal on the other side.
    #[must_use]
    pub fn flipped(&self) -> Self {
        Self { normal: -self.normal, offset: -self.offset }
    }

    /// The shortest rotation and the shift along the normal that bring the plane to z = 0.
    pub fn ground_from_world(&self) -> Isometry3<f64> {
        let upright = UnitQuaternion::rotation_between(&self.normal, &Vector3::z())
            // Opposite vectors have no shortest rotation: any half turn about a level axis will do.
            .unwrap_or_else(|| {
                UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)
            });
        Isometry3::from_parts(Translation3::new(0.0, 0.0, -self.offset), upright)
    }
}

/// A fitted plane and how well it fits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneFit {
    /// The plane; its normal has z ≥ 0 unless the caller turned it.
    pub plane: Plane,
    /// Points within the inlier distance of the plane.
    pub inliers: usize,
    /// Root mean square distance of the inliers from the plane `[m]`.
    pub rms: f64,
    /// Angle between the normal and the world's z axis `[rad]`.
    pub tilt_rad: f64,
}

impl PlaneFit {
    /// The known ground of a simulated scene: nothing was fitted.
    pub const GROUND: Self = Self { plane: Plane::GROUND, inliers: 0, rms: 0.0, tilt_rad: 0.0 };
}

/// The plane that most points lie on.
///
/// RANSAC with the truncated squared distance as score, until a sample free of outliers has been
/// drawn with probability 0.9999, then total least squares on the inliers until they stay the same.
/// Points further than `inlier_distance` `[m]` have no say, however far they are.
///
/// # Errors
/// `TooFewPoints` below three, `NonFinite` for a point, `OutOfRange` for the distance,
/// `DegeneratePlane` when the inliers lie on a line.
///
/// # Reference
/// Fischler & Bolles 1981, doi:10.1145/358669.358692; score: Torr & Zisserman 2000 (MSAC),
/// doi:10.1006/cviu.1999.0832.
pub fn fit_plane(
    points: &[Vector3<f64>],
    inlier_distance: f64,
    seed: u64,
) -> Result<PlaneFit, FeatureError> {
    fit_plane_within(points, inlier_distance, std::f64::consts::FRAC_PI_2, seed)
}

/// As [`fit_plane`], of the planes that are tilted from the horizontal by at most `max_tilt_rad`: a
/// wall is no ground, however much of it there is.
///
/// # Errors
/// As [`fit_plane`]; `TooSteep` when the plane of the points near the best one within the limit, or of all points
/// where there is none, is beyond the limit.
pub fn fit_plane_within(
    points: &[Vector3<f64>],
    inlier_distance: f64,
    max_tilt_rad: f64,
    seed: u64,
) -> Result<PlaneFit, FeatureError> {
    require_in("inlier distance [m]", inlier_distance, f64::MIN_POSITIVE, 1e6)?;
    require_in("largest tilt [rad]", max_tilt_rad, 0.0, std::f64::consts::FRAC_PI_2)?;
    require_finite("points", points.iter().flat_map(|p| [p.x, p.y, p.z]))?;
    if points.len() < 3 {
        return Err(FeatureError::TooFewPoints { what: "plane fit", got: points.len(), min: 3 });
    }
    let start = match search(points, inlier_distance, max_tilt_rad.cos(), seed) {
        Some(plane) => plane,
        // Asked here, as it may have no point near it.
        None => upright(least_squares(points.iter())?.0, max_tilt_rad)?,
    };
    refine_plane(points, start, inlier_distance, max_tilt_rad)
}

/// Total least squares on the points near `plane`, repeated until they stay the same. What is then beyond the largest
/// tilt is refused: it is the plane that these points lie on, and another would not be theirs.
pub(crate) fn refine_plane(
    points: &[Vector3<f64>],
    mut plane: Plane,
    inlier_distance: f64,
    max_tilt_rad: f64,
) -> Result<PlaneFit, FeatureError> {
    let near = |plane: Plane| {
        points.iter().filter(move |p| plane.signed_distance(p).abs() <= inlier_distance)
    };
    let (mut inliers, mut rms) = (0, 0.0);
    for _ in 0..MAX_REFINEMENTS {
        let before = (inliers, plane);
        inliers = near(plane).count();
        (plane, rms) = least_squares(near(plane))?;
        let moved = (plane.normal - before.1.normal).norm();
        if inliers == before.0 && moved < FLATNESS {
            break;
        }
    }
    let plane = upright(plane, max_tilt_rad)?;
    Ok(PlaneFit { plane, inliers, rms, tilt_rad: plane.tilt_rad() })
}

/// Refuses a plane, its normal up, that is tilted by more than `max_tilt_rad`.
fn upright(plane: Plane, max_tilt_rad: f64) -> Result<Plane, FeatureError> {
    let tilt = plane.tilt_rad();
    if tilt > max_tilt_rad + TILT_ROUNDING {
        let (got_deg, max_deg) = (tilt.to_degrees(), max_tilt_rad.to_degrees());
        return Err(FeatureError::TooSteep { got_deg, max_deg });
    }
    Ok(plane)
}

/// The best plane through three of the points whose normal is upright enough, `None` when every
/// sample was a line or too steep.
fn search(
    points: &[Vector3<f64>],
    inlier_distance: f64,
    least_upright: f64,
    seed: u64,
) -> Option<Plane> {
    let mut stream = Stream::new(seed);
    let scored: Vec<Vector3<f64>> = if points.len() <= SCORED_POINTS {
        points.to_vec()
    } else {
        (0..SCORED_POINTS).map(|_| points[stream.index(points.len())]).collect()
    };
    let mut best: Option<Plane> = None;
    let (mut best_cost, mut needed) = (f64::INFINITY, MAX_SAMPLES);
    let mut drawn = 0;
    while drawn < needed.max(MIN_SAMPLES) {
        drawn += 1;
        let [a, b, c] = [(); 3].map(|()| points[stream.index(points.len())]);
        let cross = (b - a).cross(&(c - a));
        if cross.norm() <= FLATNESS * (b - a).norm() * (c - a).norm() {
            continue;
        }
        let normal = cross.normalize();
        if normal.z.abs() < least_upright {
            continue;
        }
        let plane = Plane { normal, offset: normal.dot(&a) };
        let (mut cost, mut inliers) = (0.0, 0_usize);
        for point in &scored {
            let relative = plane.signed_distance(point) / inlier_distance;
            inliers += usize::from(relative.abs() <= 1.0);
            cost += (relative * relative).min(1.0);
        }
        if cost < best_cost {
            (best, best_cost) = (Some(plane), cost);
            needed = samples_needed(inliers as f64 / scored.len() as f64);
        }
    }
    best
}

/// Samples after which one free of outliers was drawn with probability [`CONFIDENCE`].
fn samples_needed(inlier_share: f64) -> usize {
    let clean = inlier_share.powi(3);
    if clean >= 1.0 {
        return MIN_SAMPLES;
    }
    // A share of 0 divides by -0: the cast of the infinity saturates and `min` caps it.
    (((1.0 - CONFIDENCE).ln() / (-clean).ln_1p()).abs().ceil() as usize).min(MAX_SAMPLES)
}

/// The plane with the least sum of squared distances, and their root mean square: it contains the
/// centroid, and its normal is the eigenvector of the smallest eigenvalue of the covariance.
fn least_squares<'a>(
    points: impl Iterator<Item = &'a Vector3<f64>> + Clone,
) -> Result<(Plane, f64), FeatureError> {
    let count = points.clone().count();
    if count < 3 {
        return Err(FeatureError::TooFewPoints { what: "plane fit", got: count, min: 3 });
    }
    let centroid = points.clone().sum::<Vector3<f64>>() / count as f64;
    let mut covariance = Matrix3::<f64>::zeros();
    for point in points {
        let d = point - centroid;
        covariance += d * d.transpose();
    }
    covariance /= count as f64;
    let (values, normal) = smallest_eigenvector(&covariance);
    let min = FLATNESS * values[2].max(0.0).sqrt();
    let got = values[1].clamp(0.0, f64::INFINITY).sqrt();
    // NaN is a decomposition that failed.
    if got.is_nan() || got <= min {
        return Err(FeatureError::DegeneratePlane { got, min });
    }
    let normal = if normal.z < 0.0 { -normal } else { normal };
    let plane = Plane { normal, offset: normal.dot(&centroid) };
    Ok((plane, values[0].max(0.0).sqrt()))
}

/// Eigenvalues in rising order and the unit eigenvector of the first; NaN of a matrix that is not finite, for which the
/// iteration does not converge.
fn smallest_eigenvector(symmetric: &Matrix3<f64>) -> ([f64; 3], Vector3<f64>) {
    let Some(eigen) = SymmetricEigen::try_new(*symmetric, f64::EPSILON, MAX_ROTATIONS) else {
        return ([f64::NAN; 3], Vector3::repeat(f64::NAN));
    };
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let vector = eigen.eigenvectors.column(order[0]).normalize();
    (order.map(|rank| eigen.eigenvalues[rank]), vector)
}

#[cfg(test)]
mod tests;
