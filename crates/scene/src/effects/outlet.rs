//! A funnel whose outlet is not round.
//!
//! The stem is an elliptic cylinder of the round one's area, its long axis along x: half axes `r sqrt(aspect)` and
//! `r / sqrt(aspect)`. The cone goes over from that ellipse to the round rim. Both are made of flat facets. What leaves
//! has the outlet's shape, so that a pour has a mode of order two about its axis.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Point3, Vector3};
use serde::{Deserialize, Serialize};

use super::effect::Effect;
use crate::error::SceneError;
use crate::walls::Funnel;

/// Facets around the axis. A chord of 48 is 0.2 % of the radius off the circle.
const AROUND: u32 = 48;

/// Longest outlet for its width `[-]`.
const LONGEST: f64 = 3.0;

/// The shape of the funnel's outlet.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Outlet {
    /// Length along x over width along y `[-]`; 1 is round.
    pub aspect: f64,
}

/// A funnel of flat facets.
#[derive(Clone, Debug, PartialEq)]
pub struct OutletMesh {
    /// `[m]`
    pub vertices: Vec<Vector3<f64>>,
    /// Each three of the vertices.
    pub triangles: Vec<[u32; 3]>,
}

impl Default for Outlet {
    fn default() -> Self {
        Self { aspect: 1.0 }
    }
}

impl Effect for Outlet {
    fn path(&self) -> &'static str {
        "effects.outlet"
    }

    fn check(&self) -> Result<(), SceneError> {
        if (1.0..=LONGEST).contains(&self.aspect) {
            return Ok(());
        }
        Err(SceneError::range("effects.outlet.aspect", self.aspect, "in [1, 3]"))
    }

    fn is_on(&self) -> bool {
        self.aspect != 1.0
    }
}

impl Outlet {
    /// The funnel if its outlet is not round, turned and moved by `pose`; `None` if it is.
    pub fn mesh(self, funnel: &Funnel, pose: Option<&Isometry3<f64>>) -> Option<OutletMesh> {
        if self.aspect == 1.0 {
            return None;
        }
        let (long, short) = (self.aspect.sqrt(), self.aspect.sqrt().recip());
        let (neck, stem) = (funnel.height + funnel.stem_length, funnel.stem_radius);
        let rings = [
            (stem * long, stem * short, funnel.height),
            (stem * long, stem * short, neck),
            (funnel.rim_radius, funnel.rim_radius, funnel.rim_height()),
        ];
        // A polygon of the ellipse's area.
        let step = TAU / f64::from(AROUND);
        let wide = (step / step.sin()).sqrt();
        let vertices = rings.iter().flat_map(|&(x, y, z)| {
            (0..AROUND).map(move |corner| {
                let (sin, cos) = (f64::from(corner) * step).sin_cos();
                Vector3::new(wide * x * cos, wide * y * sin, z)
            })
        });
        let placed = vertices.map(|v| pose.map_or(v, |pose| (pose * Point3::from(v)).coords));
        let triangles = (0..2 * AROUND).flat_map(|corner| {
            let next = if corner % AROUND + 1 == AROUND { corner + 1 - AROUND } else { corner + 1 };
            [[corner, next, corner + AROUND], [next, next + AROUND, corner + AROUND]]
        });
        Some(OutletMesh { vertices: placed.collect(), triangles: triangles.collect() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_oval_outlet_has_the_area_of_the_round_one() {
        let funnel = Funnel::default();
        let outlet = Outlet { aspect: 1.5 };
        let OutletMesh { vertices, triangles } = outlet.mesh(&funnel, None).expect("not round");
        let tip = &vertices[..AROUND as usize];
        let next = tip.iter().cycle().skip(1);
        let area: f64 = tip.iter().zip(next).map(|(a, b)| 0.5 * (a.x * b.y - a.y * b.x)).sum();
        let round = 0.5 * TAU * funnel.stem_radius.powi(2);
        assert!((area / round - 1.0).abs() < 1e-12, "{}", area / round);
        let half = |of: fn(&Vector3<f64>) -> f64| tip.iter().map(of).fold(0.0, f64::max);
        assert!((half(|v| v.x) / half(|v| v.y) - 1.5).abs() < 1e-12);
        // Every edge inside the funnel is shared by two triangles: nothing falls through.
        let mut users = std::collections::HashMap::new();
        for [a, b, c] in triangles {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                *users.entry((from.min(to), from.max(to))).or_insert(0) += 1;
            }
        }
        let at_ends = users.values().filter(|&&count| count == 1).count();
        assert_eq!(at_ends, 2 * AROUND as usize);
        assert!(users.values().all(|&count| count <= 2));
        assert_eq!(Outlet::default().mesh(&funnel, None), None);
    }
}
