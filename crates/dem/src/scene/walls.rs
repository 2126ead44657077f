//! Walls as a scene states them: the ground, the funnel and further shapes, each with a material of its own.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::{finite, positive};
use crate::{DemError, Material, WallMaterial};

/// The plane z = 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ground {
    /// Where the ground's coefficients differ from the grains'.
    #[serde(default, skip_serializing_if = "WallMaterial::is_empty")]
    pub material: WallMaterial,
}

impl Ground {
    /// True when the ground is like the grains.
    pub fn is_plain(&self) -> bool {
        self.material.is_empty()
    }

    pub(super) fn check(&self, grains: &Material) -> Result<(), DemError> {
        self.material.over(grains).check("ground.material")
    }
}

/// A thin funnel about the z axis: a cone that narrows downwards and a cylindrical stem below it.
///
/// The defaults are those of the pours in other engines: radius 60 mm at the rim, 16 mm in the stem,
/// a cone 70 mm high above a stem of 10 mm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Funnel {
    /// Height of the tip (the lower end of the stem) above the ground `[m]`.
    pub height: f64,
    /// Inner radius at the rim `[m]`.
    pub rim_radius: f64,
    /// Inner radius of the stem `[m]`.
    pub stem_radius: f64,
    /// Height of the cone `[m]`.
    pub cone_length: f64,
    /// Length of the stem `[m]`.
    pub stem_length: f64,
    /// Where the funnel's coefficients differ from the grains'.
    #[serde(skip_serializing_if = "WallMaterial::is_empty")]
    pub material: WallMaterial,
}

impl Default for Funnel {
    fn default() -> Self {
        Self {
            height: 0.12,
            rim_radius: 0.06,
            stem_radius: 0.016,
            cone_length: 0.07,
            stem_length: 0.01,
            material: WallMaterial::default(),
        }
    }
}

impl Funnel {
    /// Height of the rim above the ground `[m]`.
    pub fn rim_height(&self) -> f64 {
        self.height + self.stem_length + self.cone_length
    }

    /// The two shells of the funnel.
    pub fn walls(&self) -> [Wall; 2] {
        let neck = self.height + self.stem_length;
        [
            Wall {
                shape: Shape::Cone {
                    from: [0.0, 0.0, neck],
                    to: [0.0, 0.0, self.rim_height()],
                    radius_from: self.stem_radius,
                    radius_to: self.rim_radius,
                },
                material: self.material,
            },
            Wall {
                shape: Shape::Cylinder {
                    from: [0.0, 0.0, self.height],
                    to: [0.0, 0.0, neck],
                    radius: self.stem_radius,
                },
                material: self.material,
            },
        ]
    }

    /// Whether a grain's centre `[m]` is in the funnel: above its tip and within the stem, the cone or, above the rim,
    /// the rim's circle.
    pub fn holds(&self, centre: &Vector3<f64>) -> bool {
        let rise = centre.z - self.height;
        let share = ((rise - self.stem_length) / self.cone_length).clamp(0.0, 1.0);
        let radius = self.stem_radius + share * (self.rim_radius - self.stem_radius);
        rise > 0.0 && centre.xy().norm() < radius
    }

    pub(super) fn check(&self, grains: &Material, radius: f64) -> Result<(), DemError> {
        positive("funnel.height", self.height)?;
        positive("funnel.cone_length", self.cone_length)?;
        positive("funnel.stem_length", self.stem_length)?;
        if !(self.stem_radius > radius && self.stem_radius.is_finite()) {
            let allowed = "larger than a grain's radius";
            return Err(DemError::range("funnel.stem_radius", self.stem_radius, allowed));
        }
        if !(self.rim_radius >= self.stem_radius && self.rim_radius.is_finite()) {
            let allowed = "at least funnel.stem_radius";
            return Err(DemError::range("funnel.rim_radius", self.rim_radius, allowed));
        }
        self.material.over(grains).check("funnel.material")
    }
}

/// A wall of any shape.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wall {
    /// Where it is.
    pub shape: Shape,
    /// Where its coefficients differ from the grains'.
    #[serde(default, skip_serializing_if = "WallMaterial::is_empty")]
    pub material: WallMaterial,
}

/// Shapes of walls. Cones and cylinders are open, thin and touch grains on both sides.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Shape {
    /// The half space below a plane.
    Plane {
        /// A point of the plane `[m]`.
        point: [f64; 3],
        /// The direction that points to the grains; any length but zero.
        normal: [f64; 3],
    },
    /// The shell of a truncated cone.
    Cone {
        /// Centre of one end `[m]`.
        from: [f64; 3],
        /// Centre of the other end `[m]`.
        to: [f64; 3],
        /// Radius at `from` `[m]`.
        radius_from: f64,
        /// Radius at `to` `[m]`.
        radius_to: f64,
    },
    /// The shell of a cylinder.
    Cylinder {
        /// Centre of one end `[m]`.
        from: [f64; 3],
        /// Centre of the other end `[m]`.
        to: [f64; 3],
        /// Radius `[m]`.
        radius: f64,
    },
}

impl Wall {
    fn check_numbers(name: &str, field: &str, values: [f64; 3]) -> Result<(), DemError> {
        values.iter().try_for_each(|&value| finite(&format!("{name}.shape.{field}"), value))
    }

    pub(super) fn check(&self, name: &str, grains: &Material) -> Result<(), DemError> {
        match self.shape {
            Shape::Plane { point, normal } => {
                Self::check_numbers(name, "point", point)?;
                Self::check_numbers(name, "normal", normal)?;
                let length = normal.iter().map(|c| c * c).sum::<f64>().sqrt();
                positive(&format!("{name}.shape.normal (length)"), length)?;
            }
            Shape::Cone { from, to, radius_from, radius_to } => {
                Self::check_axis(name, from, to)?;
                positive(&format!("{name}.shape.radius_from"), radius_from)?;
                positive(&format!("{name}.shape.radius_to"), radius_to)?;
            }
            Shape::Cylinder { from, to, radius } => {
                Self::check_axis(name, from, to)?;
                positive(&format!("{name}.shape.radius"), radius)?;
            }
        }
        self.material.over(grains).check(&format!("{name}.material"))
    }

    fn check_axis(name: &str, from: [f64; 3], to: [f64; 3]) -> Result<(), DemError> {
        Self::check_numbers(name, "from", from)?;
        Self::check_numbers(name, "to", to)?;
        let length = from.iter().zip(to).map(|(a, b)| (b - a) * (b - a)).sum::<f64>().sqrt();
        positive(&format!("{name}.shape (distance of from and to)"), length)
    }
}
