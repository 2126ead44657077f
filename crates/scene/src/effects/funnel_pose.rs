//! A funnel that hangs beside its place, leans, or has a friction of its own.
//!
//! The funnel, with the grains that wait in it, is turned about the middle of its outlet and then moved aside; the
//! ground and gravity stay. A pour lands beside the axis and, out of a funnel that leans, with a speed to the side.
//! Sliding friction at the funnel, as a ratio to what it would be, slows the flow (Beverloo's rate) and decides whether
//! a pour piles up or leaves a ring.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use super::effect::Effect;
use crate::check::{finite, non_negative};
use crate::error::SceneError;
use crate::material::Material;
use crate::walls::{Funnel, Shape, Wall};

/// Steepest lean `[rad]`.
const STEEPEST: f64 = 0.8;

/// Where the funnel hangs, beside where the scene says.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FunnelPose {
    /// Offset along x `[m]`.
    pub x: f64,
    /// Offset along y `[m]`.
    pub y: f64,
    /// Lean about x `[rad]`: a positive angle moves the rim to negative y.
    pub lean_x: f64,
    /// Lean about y `[rad]`: a positive angle moves the rim to positive x.
    pub lean_y: f64,
    /// Sliding friction at the funnel over what the scene states `[-]`; 1 is off.
    pub sliding_friction: f64,
}

impl Default for FunnelPose {
    fn default() -> Self {
        Self { x: 0.0, y: 0.0, lean_x: 0.0, lean_y: 0.0, sliding_friction: 1.0 }
    }
}

impl Effect for FunnelPose {
    fn path(&self) -> &'static str {
        "effects.funnel"
    }

    fn check(&self) -> Result<(), SceneError> {
        finite("effects.funnel.x", self.x)?;
        finite("effects.funnel.y", self.y)?;
        non_negative("effects.funnel.sliding_friction", self.sliding_friction)?;
        for (name, got) in
            [("effects.funnel.lean_x", self.lean_x), ("effects.funnel.lean_y", self.lean_y)]
        {
            if !(-STEEPEST..=STEEPEST).contains(&got) {
                return Err(SceneError::range(name, got, "in [-0.8, 0.8]"));
            }
        }
        Ok(())
    }

    fn is_on(&self) -> bool {
        *self != Self::default()
    }
}

impl FunnelPose {
    /// From the funnel's place to where it hangs; `None` if that is the same.
    pub fn of(&self, funnel: &Funnel) -> Option<Isometry3<f64>> {
        if [self.x, self.y, self.lean_x, self.lean_y] == [0.0; 4] {
            return None;
        }
        let turn = UnitQuaternion::new(Vector3::new(self.lean_x, self.lean_y, 0.0));
        let outlet = Translation3::new(0.0, 0.0, funnel.height);
        let aside = Translation3::new(self.x, self.y, 0.0);
        Some(aside * outlet * turn * outlet.inverse())
    }

    /// The funnel's material of what it would be without the effect.
    pub fn rubbed(&self, plain: Material) -> Material {
        Material { sliding_friction: self.sliding_friction * plain.sliding_friction, ..plain }
    }

    /// The funnel's walls where it hangs.
    pub fn walls(&self, funnel: &Funnel) -> [Wall; 2] {
        let mut walls = funnel.walls();
        if let Some(pose) = self.of(funnel) {
            for wall in &mut walls {
                if let Shape::Cone { from, to, .. } | Shape::Cylinder { from, to, .. } =
                    &mut wall.shape
                {
                    for end in [from, to] {
                        *end = (pose * Point3::from(*end)).coords.into();
                    }
                }
            }
        }
        walls
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_funnel_turns_about_its_outlet() {
        let funnel = Funnel::default();
        let pose = FunnelPose { x: 0.01, lean_y: 0.1, ..FunnelPose::default() };
        let [cone, stem] = pose.walls(&funnel);
        let Shape::Cylinder { from, to, .. } = stem.shape else { panic!("a stem") };
        assert!((Vector3::from(from) - Vector3::new(0.01, 0.0, funnel.height)).norm() < 1e-12);
        let axis = (Vector3::from(to) - Vector3::from(from)).normalize();
        assert!((axis - Vector3::new(0.1f64.sin(), 0.0, 0.1f64.cos())).norm() < 1e-12);
        let Shape::Cone { from, .. } = cone.shape else { panic!("a cone") };
        assert!((Vector3::from(from) - Vector3::from(to)).norm() < 1e-12);
        assert_eq!(FunnelPose::default().walls(&funnel), funnel.walls());
    }
}
