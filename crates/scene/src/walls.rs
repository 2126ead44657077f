//! Walls as a scene states them: the ground, the funnel and further shapes, each with a material of its own.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::check::{finite, positive};
use crate::error::SceneError;
use crate::grains::Grains;
use crate::material::{Material, WallMaterial};
use crate::mesh::MeshFile;
use crate::motion::Motion;

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

    pub(crate) fn check(&self, grains: &Material) -> Result<(), SceneError> {
        self.material.over(grains).check("ground.material")
    }
}

/// A thin funnel about the z axis: a cone that narrows downwards and a cylindrical stem below it.
///
/// The defaults are those of the pours in other engines: radius 60 mm at the rim, 16 mm in the stem,
/// a cone 70 mm high above a stem of 10 mm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
    /// How the funnel moves.
    #[serde(skip_serializing_if = "Motion::is_still")]
    pub motion: Motion,
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
            motion: Motion::default(),
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
                    closed: Ends::None,
                },
                material: self.material,
                motion: self.motion.clone(),
            },
            Wall {
                shape: Shape::Cylinder {
                    from: [0.0, 0.0, self.height],
                    to: [0.0, 0.0, neck],
                    radius: self.stem_radius,
                    closed: Ends::None,
                },
                material: self.material,
                motion: self.motion.clone(),
            },
        ]
    }

    /// Whether a grain's centre `[m]` is in the funnel as it is stated: above its tip and within the stem, the cone or,
    /// above the rim, the rim's circle.
    pub(crate) fn holds(&self, centre: &Vector3<f64>) -> bool {
        let rise = centre.z - self.height;
        let share = ((rise - self.stem_length) / self.cone_length).clamp(0.0, 1.0);
        let radius = self.stem_radius + share * (self.rim_radius - self.stem_radius);
        rise > 0.0 && centre.x.hypot(centre.y) < radius
    }

    pub(crate) fn check(&self, grains: &Material, radius: f64) -> Result<(), SceneError> {
        positive("funnel.height", self.height)?;
        positive("funnel.cone_length", self.cone_length)?;
        positive("funnel.stem_length", self.stem_length)?;
        if !(self.stem_radius > radius && self.stem_radius.is_finite()) {
            let allowed = "larger than a grain's radius";
            return Err(SceneError::range("funnel.stem_radius", self.stem_radius, allowed));
        }
        if !(self.rim_radius >= self.stem_radius && self.rim_radius.is_finite()) {
            let allowed = "at least funnel.stem_radius";
            return Err(SceneError::range("funnel.rim_radius", self.rim_radius, allowed));
        }
        self.motion.check("funnel")?;
        self.material.over(grains).check("funnel.material")
    }
}

/// A wall of any shape.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wall {
    /// Where it is.
    pub shape: Shape,
    /// Where its coefficients differ from the grains'.
    #[serde(default, skip_serializing_if = "WallMaterial::is_empty")]
    pub material: WallMaterial,
    /// How it moves.
    #[serde(default, skip_serializing_if = "Motion::is_still")]
    pub motion: Motion,
}

/// Which ends of a cone or cylinder a disc closes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Ends {
    /// Both are open.
    #[default]
    None,
    /// The one at `from`.
    From,
    /// The one at `to`.
    To,
    /// Both.
    Both,
}

impl Ends {
    /// Whether both are open.
    pub fn is_none(&self) -> bool {
        *self == Self::None
    }

    /// Whether `from` is closed.
    pub fn at_from(self) -> bool {
        matches!(self, Self::From | Self::Both)
    }

    /// Whether `to` is closed.
    pub fn at_to(self) -> bool {
        matches!(self, Self::To | Self::Both)
    }
}

/// A side of a box.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BoxSide {
    /// At the least x.
    XMin,
    /// At the largest x.
    XMax,
    /// At the least y.
    YMin,
    /// At the largest y.
    YMax,
    /// The floor.
    ZMin,
    /// The lid.
    ZMax,
}

impl BoxSide {
    /// All six.
    pub const ALL: [Self; 6] =
        [Self::XMin, Self::XMax, Self::YMin, Self::YMax, Self::ZMin, Self::ZMax];

    /// Its two triangles; bit 0 of a corner's number says whether it is at the largest x, bit 1 y, bit 2 z.
    pub fn triangles(self) -> [[u32; 3]; 2] {
        let [a, b, c, d] = match self {
            Self::XMin => [0, 4, 6, 2],
            Self::XMax => [1, 3, 7, 5],
            Self::YMin => [0, 1, 5, 4],
            Self::YMax => [2, 6, 7, 3],
            Self::ZMin => [0, 2, 3, 1],
            Self::ZMax => [4, 5, 7, 6],
        };
        [[a, b, c], [a, c, d]]
    }
}

/// Shapes of walls. All but the plane are thin and touch grains on both sides.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
        /// Which ends are closed.
        #[serde(default, skip_serializing_if = "Ends::is_none")]
        closed: Ends,
    },
    /// The shell of a cylinder.
    Cylinder {
        /// Centre of one end `[m]`.
        from: [f64; 3],
        /// Centre of the other end `[m]`.
        to: [f64; 3],
        /// Radius `[m]`.
        radius: f64,
        /// Which ends are closed.
        #[serde(default, skip_serializing_if = "Ends::is_none")]
        closed: Ends,
    },
    /// A flat disc.
    Disc {
        /// Its middle `[m]`.
        centre: [f64; 3],
        /// At right angles to it; any length but zero.
        normal: [f64; 3],
        /// Radius `[m]`.
        radius: f64,
    },
    /// The sides of a box along the axes.
    Box {
        /// Corner with the least x, y and z `[m]`.
        min: [f64; 3],
        /// Corner with the largest x, y and z `[m]`.
        max: [f64; 3],
        /// The sides that are missing.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        open: Vec<BoxSide>,
    },
    /// A mesh from a file.
    Mesh(MeshFile),
}

impl Wall {
    /// A wall that stays where it is.
    pub fn fixed(shape: Shape, material: WallMaterial) -> Self {
        Self { shape, material, motion: Motion::default() }
    }

    fn check_numbers(name: &str, field: &str, values: [f64; 3]) -> Result<(), SceneError> {
        values.iter().try_for_each(|&value| finite(&format!("{name}.shape.{field}"), value))
    }

    pub(crate) fn check(
        &self,
        name: &str,
        material: &Material,
        grains: &Grains,
    ) -> Result<(), SceneError> {
        match self.shape.clone() {
            Shape::Plane { point, normal } => {
                Self::check_numbers(name, "point", point)?;
                Self::check_numbers(name, "normal", normal)?;
                let length = normal.iter().map(|c| c * c).sum::<f64>().sqrt();
                positive(&format!("{name}.shape.normal (length)"), length)?;
            }
            Shape::Cone { from, to, radius_from, radius_to, .. } => {
                Self::check_axis(name, from, to)?;
                positive(&format!("{name}.shape.radius_from"), radius_from)?;
                positive(&format!("{name}.shape.radius_to"), radius_to)?;
            }
            Shape::Cylinder { from, to, radius, .. } => {
                Self::check_axis(name, from, to)?;
                positive(&format!("{name}.shape.radius"), radius)?;
            }
            Shape::Disc { centre, normal, radius } => {
                Self::check_numbers(name, "centre", centre)?;
                Self::check_numbers(name, "normal", normal)?;
                let length = normal.iter().map(|c| c * c).sum::<f64>().sqrt();
                positive(&format!("{name}.shape.normal (length)"), length)?;
                positive(&format!("{name}.shape.radius"), radius)?;
            }
            Shape::Box { min, max, open } => {
                Self::check_numbers(name, "min", min)?;
                Self::check_numbers(name, "max", max)?;
                for (axis, (low, high)) in ["x", "y", "z"].iter().zip(min.iter().zip(max)) {
                    positive(&format!("{name}.shape.max - min along {axis}"), high - low)?;
                }
                let closed = BoxSide::ALL.iter().filter(|side| !open.contains(side)).count();
                positive(&format!("{name}.shape (sides that are not open)"), closed as f64)?;
            }
            Shape::Mesh(file) => file.check(name, grains.diameter)?,
        }
        self.motion.check(name)?;
        self.material.over(material).check(&format!("{name}.material"))
    }

    fn check_axis(name: &str, from: [f64; 3], to: [f64; 3]) -> Result<(), SceneError> {
        Self::check_numbers(name, "from", from)?;
        Self::check_numbers(name, "to", to)?;
        let length = from.iter().zip(to).map(|(a, b)| (b - a) * (b - a)).sum::<f64>().sqrt();
        positive(&format!("{name}.shape (distance of from and to)"), length)
    }
}
