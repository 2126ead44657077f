//! Rims of shells and discs: where a wall ends, or where two bend away from what they hold.
//!
//! A ball meets a rim at the point that is nearest to its centre. A face or an edge of a body that is not round meets
//! it anywhere along the circle (`bodies/rims.rs`).

use nalgebra::{Vector2, Vector3};

use super::surface::{SAME, Surface, is_same_circle};

/// A circle where surfaces of a wall end.
#[derive(Clone, Debug)]
pub(crate) struct Rim {
    /// `[m]`
    pub centre: Vector3<f64>,
    /// Unit.
    pub axis: Vector3<f64>,
    /// `[m]`
    pub radius: f64,
    /// Unit directions from the rim into each of its surfaces: along the axis and away from it.
    pub into: Vec<Vector2<f64>>,
}

impl Rim {
    /// Adds the rims of a surface to those that are known; one that is there already gets one more direction.
    pub fn gather(surface: &Surface, known: &mut Vec<Self>) {
        let mut add = |centre: Vector3<f64>,
                       axis: Vector3<f64>,
                       radius: f64,
                       into: Vector2<f64>| {
            let is_same = |rim: &&mut Self| {
                is_same_circle(&(rim.centre, rim.radius), &(centre, radius))
                    && rim.axis.cross(&axis).norm() < SAME
            };
            match known.iter_mut().find(is_same) {
                Some(rim) => {
                    let along = rim.axis.dot(&axis).signum();
                    rim.into.push(Vector2::new(along * into.x, into.y));
                }
                // The tip of a cone is no rim.
                None if radius > 0.0 => known.push(Self { centre, axis, radius, into: vec![into] }),
                None => {}
            }
        };
        match surface {
            Surface::Plane { .. } => {}
            Surface::Disc { centre, normal, radius } => {
                add(*centre, *normal, *radius, Vector2::new(0.0, -1.0));
            }
            Surface::Frustum(shell) => {
                let [begin, end] = shell.ends();
                let along = shell.generator().normalize();
                add(begin.0, *shell.axis(), begin.1, along);
                add(end.0, *shell.axis(), end.1, -along);
            }
        }
    }

    /// Whether a surface ends there and no other begins.
    pub fn is_free(&self) -> bool {
        self.into.len() == 1
    }

    /// Whether a place is beyond the ends of all surfaces that meet here.
    pub fn ends_before(&self, place: &Vector3<f64>) -> bool {
        let offset = place - self.centre;
        let along = offset.dot(&self.axis);
        self.leads_off(along, (offset - along * self.axis).norm() - self.radius)
    }

    /// Whether a way along the axis and away from it leads into none of the surfaces.
    fn leads_off(&self, along: f64, away: f64) -> bool {
        self.into.iter().all(|into| into.x * along + into.y * away <= 0.0)
    }

    /// Its point at an angle about the axis, and the unit direction away from the axis there.
    pub fn at(&self, [first, second]: &[Vector3<f64>; 2], angle: f64) -> [Vector3<f64>; 2] {
        let outward = angle.cos() * first + angle.sin() * second;
        [self.centre + self.radius * outward, outward]
    }

    /// Whether a thing that lies towards `normal` of the rim's point touches the rim and not a surface beside it: into
    /// each of them the way leads off it.
    pub fn holds(&self, outward: &Vector3<f64>, normal: &Vector3<f64>) -> bool {
        self.leads_off(normal.dot(&self.axis), normal.dot(outward))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wall::surface::surfaces;
    use granulcal_scene::{Ends, Shape};

    fn rims(shapes: &[Shape]) -> Vec<Rim> {
        let mut known = Vec::new();
        shapes.iter().flat_map(surfaces).for_each(|surface| Rim::gather(&surface, &mut known));
        known
    }

    #[test]
    fn a_cone_over_a_stem_shares_its_rim_with_it() {
        let cone = Shape::Cone {
            from: [0.0, 0.0, 0.13],
            to: [0.0, 0.0, 0.2],
            radius_from: 0.016,
            radius_to: 0.06,
            closed: Ends::None,
        };
        let (from, to) = ([0.0, 0.0, 0.13], [0.0, 0.0, 0.12]);
        let stem = Shape::Cylinder { from, to, radius: 0.016, closed: Ends::None };
        let rims = rims(&[cone, stem]);
        assert_eq!(rims.len(), 3);
        let shared = rims.iter().find(|rim| rim.into.len() == 2).unwrap();
        let outward = Vector3::x();
        let holds = |x: f64, z: f64| shared.holds(&outward, &Vector3::new(x, 0.0, z).normalize());
        // Between the normals of stem and cone, and nothing steeper than the cone's.
        assert!(holds(-1.0, 0.1) && holds(-1.0, 0.4));
        assert!(!holds(-1.0, -0.1) && !holds(-1.0, 0.8) && !holds(1.0, 0.0));
        let tip = rims.iter().find(|rim| rim.centre.z < 0.125).unwrap();
        let under = |x: f64, z: f64| tip.holds(&outward, &Vector3::new(x, 0.0, z).normalize());
        assert!(under(-1.0, -0.1) && under(1.0, -0.1) && !under(-1.0, 0.1));
    }

    #[test]
    fn a_cup_has_one_rim_that_ends_and_one_that_holds_nothing_inside() {
        let (from, to) = ([0.0; 3], [0.0, 0.0, 0.05]);
        let rims = rims(&[Shape::Cylinder { from, to, radius: 0.02, closed: Ends::From }]);
        let bottom = rims.iter().find(|rim| rim.into.len() == 2).unwrap();
        assert!(!bottom.holds(&Vector3::x(), &Vector3::new(-0.6, 0.0, 0.8)));
        assert!(bottom.holds(&Vector3::x(), &Vector3::new(0.6, 0.0, -0.8)));
    }
}
