//! The shape of every grain as a scene states it, `[grains.shape]`, in diameters of the scene's grains; as a body it is
//! in `grain_shape/solid.rs`.

mod solid;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::error::SceneError;
pub use solid::{Solid, parry};

/// Largest ratio of the longest to the shortest extent `[-]`.
const MOST_ASPECT: f64 = 10.0;
/// Most points of a hull: contact with more costs too much.
const MOST_POINTS: usize = 200;
/// Exponents of a superquadric: below the least it is hardly convex, above the most it is a box to rounding.
const EXPONENTS: (f64, f64) = (1.2, 20.0);
/// Circles of latitude between the poles of a superquadric, and points on each.
const LATITUDES: usize = 9;
const LONGITUDES: usize = 16;

/// A convex body; lengths are in units of `grains.diameter`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum GrainShape {
    /// A box of these edges.
    Box {
        /// Edges over the diameter `[-]`.
        aspect: [f64; 3],
    },
    /// A cylinder as wide as the diameter.
    Cylinder {
        /// Length over diameter `[-]`.
        aspect: f64,
    },
    /// The hull of points on `(|x/a|^q + |y/b|^q)^(p/q) + |z/c|^p = 1`.
    Superquadric {
        /// Widths 2a, 2b, 2c over the diameter `[-]`.
        aspect: [f64; 3],
        /// p along z and q across it `[-]`; 2 and 2 are an ellipsoid, large ones a box.
        exponents: [f64; 2],
    },
    /// The convex hull of points, scaled so that their longest extent along an axis is the diameter.
    Hull {
        /// The points, in any unit.
        points: Vec<[f64; 3]>,
    },
}

impl GrainShape {
    /// Refuses what is no body, by name.
    ///
    /// # Errors
    /// [`SceneError::OutOfRange`] for a number, [`SceneError::BadShape`] for points without a volume.
    pub fn check(&self) -> Result<(), SceneError> {
        match self {
            Self::Box { aspect } => aspects("grains.shape.aspect", aspect),
            Self::Cylinder { aspect } => aspects("grains.shape.aspect", &[*aspect, 1.0]),
            Self::Superquadric { aspect, exponents } => {
                aspects("grains.shape.aspect", aspect)?;
                let (least, most) = EXPONENTS;
                match exponents.iter().find(|e| !(least..=most).contains(*e)) {
                    Some(&got) => {
                        let name = "grains.shape.exponents";
                        Err(SceneError::range(name, got, "from 1.2 to 20"))
                    }
                    None => Ok(()),
                }
            }
            Self::Hull { points } => check_points(points),
        }
    }

    /// Points whose hull the body is `[m]`; of a superquadric or a hull.
    pub(super) fn points(&self, diameter: f64) -> Vec<Vector3<f64>> {
        match self {
            Self::Superquadric { aspect, exponents } => {
                superquadric(aspect, exponents).into_iter().map(|p| 0.5 * diameter * p).collect()
            }
            Self::Hull { points } => {
                let scale = diameter / longest(points);
                points.iter().map(|p| scale * Vector3::from(*p)).collect()
            }
            Self::Box { .. } | Self::Cylinder { .. } => Vec::new(),
        }
    }
}

fn aspects(name: &str, aspect: &[f64]) -> Result<(), SceneError> {
    let allowed = "positive, the longest at most 10 times the shortest, and at most 10 diameters";
    let (least, most) = aspect.iter().fold((f64::MAX, 0.0_f64), |(l, m), &a| (l.min(a), m.max(a)));
    match aspect.iter().find(|a| !(**a > 0.0 && a.is_finite())) {
        Some(&got) => Err(SceneError::range(name, got, allowed)),
        None if most > MOST_ASPECT * least || most > MOST_ASPECT => {
            Err(SceneError::range(name, most / least.min(1.0), allowed))
        }
        None => Ok(()),
    }
}

fn check_points(points: &[[f64; 3]]) -> Result<(), SceneError> {
    let name = "grains.shape.points";
    if !(4..=MOST_POINTS).contains(&points.len()) {
        return Err(SceneError::range(name, points.len() as f64, "4 to 200 points"));
    }
    if let Some(&got) = points.iter().flatten().find(|c| !c.is_finite()) {
        return Err(SceneError::range(name, got, "finite"));
    }
    let extent = extents(points);
    let most = extent.max();
    if most.is_nan() || most <= 0.0 {
        return Err(SceneError::BadShape { what: "all its points are one" });
    }
    // A thin body that is turned against the axes is thin all the same: its inertia tells.
    let middle =
        points.iter().map(|p| Vector3::from(*p)).sum::<Vector3<f64>>() / points.len() as f64;
    let spread = points
        .iter()
        .map(|p| Vector3::from(*p) - middle)
        .map(|d| d * d.transpose())
        .sum::<nalgebra::Matrix3<f64>>();
    let eigen = spread.symmetric_eigenvalues();
    let ratio = (eigen.max() / eigen.min().max(0.0)).sqrt();
    if ratio.is_nan() || ratio > 2.0 * MOST_ASPECT {
        let what = if ratio.is_finite() && ratio < 1e6 {
            "more than 20 times as long as thick"
        } else {
            "no volume: its points lie in a plane"
        };
        return Err(SceneError::BadShape { what });
    }
    Ok(())
}

fn extents(points: &[[f64; 3]]) -> Vector3<f64> {
    let (mut low, mut high) = (Vector3::repeat(f64::MAX), Vector3::repeat(f64::MIN));
    for point in points {
        low = low.inf(&Vector3::from(*point));
        high = high.sup(&Vector3::from(*point));
    }
    high - low
}

fn longest(points: &[[f64; 3]]) -> f64 {
    extents(points).max()
}

/// Points on the surface whose semi-axes are the aspects.
fn superquadric(aspect: &[f64; 3], exponents: &[f64; 2]) -> Vec<Vector3<f64>> {
    let [p, q] = *exponents;
    let power = |value: f64, exponent: f64| value.signum() * value.abs().powf(exponent);
    let mut points = vec![Vector3::new(0.0, 0.0, aspect[2]), Vector3::new(0.0, 0.0, -aspect[2])];
    for latitude in 1..=LATITUDES {
        let v = std::f64::consts::PI * (latitude as f64 / (LATITUDES + 1) as f64 - 0.5);
        for longitude in 0..LONGITUDES {
            let u = std::f64::consts::TAU * longitude as f64 / LONGITUDES as f64;
            let across = power(v.cos(), 2.0 / p);
            points.push(Vector3::new(
                aspect[0] * across * power(u.cos(), 2.0 / q),
                aspect[1] * across * power(u.sin(), 2.0 / q),
                aspect[2] * power(v.sin(), 2.0 / p),
            ));
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_shapes_are_refused_by_name() {
        let square = vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let needle = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 0.01, 0.0], [0.0, 0.0, 0.01]];
        for (shape, told) in [
            (GrainShape::Box { aspect: [1.0, 0.0, 1.0] }, "grains.shape.aspect"),
            (GrainShape::Box { aspect: [1.0, 0.05, 1.0] }, "grains.shape.aspect"),
            (GrainShape::Cylinder { aspect: 11.0 }, "grains.shape.aspect"),
            (GrainShape::Cylinder { aspect: f64::NAN }, "grains.shape.aspect"),
            (
                GrainShape::Superquadric { aspect: [1.0; 3], exponents: [2.0, 0.5] },
                "grains.shape.exponents",
            ),
            (GrainShape::Hull { points: vec![[0.0; 3]; 3] }, "4 to 200 points"),
            (GrainShape::Hull { points: vec![[1.0; 3]; 5] }, "all its points are one"),
            (GrainShape::Hull { points: square }, "lie in a plane"),
            (GrainShape::Hull { points: needle }, "as long as thick"),
        ] {
            let error = shape.check().unwrap_err().to_string();
            assert!(error.contains(told), "{shape:?}: {error}");
        }
    }

    #[test]
    fn shapes_survive_toml() {
        for shape in [
            GrainShape::Box { aspect: [1.0, 1.0, 2.0] },
            GrainShape::Cylinder { aspect: 1.0 },
            GrainShape::Superquadric { aspect: [1.0, 1.0, 0.6], exponents: [2.0, 4.0] },
        ] {
            shape.check().unwrap();
            let text = toml::to_string(&shape).unwrap();
            assert_eq!(toml::from_str::<GrainShape>(&text).unwrap(), shape);
        }
    }
}
