//! Grains that are not round: equal spheres in a row, joined to a rigid body.
//!
//! ```text
//! aspect = length / width,   centres at distances 2 rho (aspect - 1) / (spheres - 1) along the row
//! r(x)^2 = max over i of rho^2 - (x - x_i)^2
//! V = pi int r^2 dx,   I_along / m = (pi / 2 V) int r^4 dx,   I_across / m = (pi / V) int (r^4 / 4 + r^2 x^2) dx
//! ```
//!
//! The union of the spheres is a body of revolution, whose volume and inertia these integrals are, whatever the
//! overlap; rho is such that V is the volume of the ball that the scene states. An aspect of 1 is that ball;
//! couscous has about 1.2, rice 2 to 3.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::effect::Effect;
use crate::error::SceneError;
use crate::grains::Grains;

/// The shape of every grain.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Clump {
    /// Spheres in a row, 2 to 4.
    pub spheres: usize,
    /// Length over width `[-]`, from 1, a ball, to the number of spheres.
    pub aspect: f64,
}

impl Default for Clump {
    fn default() -> Self {
        Self { spheres: 2, aspect: 1.0 }
    }
}

/// A shape of a size.
#[derive(Clone, Debug, PartialEq)]
pub struct ClumpShape {
    /// Radius of each sphere `[m]`.
    pub radius: f64,
    /// Centres of the spheres from the middle, along the body's x axis `[m]`.
    pub offsets: Vec<Vector3<f64>>,
    /// Moments of inertia about the body's axes over the mass `[m^2]`.
    pub inertia: Vector3<f64>,
}

impl Effect for Clump {
    fn path(&self) -> &'static str {
        "effects.clump"
    }

    fn check(&self) -> Result<(), SceneError> {
        if !(2..=4).contains(&self.spheres) {
            let got = self.spheres as f64;
            return Err(SceneError::range("effects.clump.spheres", got, "2, 3 or 4"));
        }
        if !(1.0..=self.spheres as f64).contains(&self.aspect) {
            let allowed = "from 1 to effects.clump.spheres";
            return Err(SceneError::range("effects.clump.aspect", self.aspect, allowed));
        }
        Ok(())
    }

    fn is_on(&self) -> bool {
        self.aspect > 1.0
    }

    fn changes_contacts(&self) -> bool {
        true
    }
}

impl Clump {
    /// Spheres that a grain of the scene is made of.
    pub fn members(&self) -> usize {
        if self.is_on() { self.spheres } else { 1 }
    }

    /// The diameter of the ball that holds a grain, whichever way it is turned `[m]`.
    pub fn envelope(&self, grains: &Grains) -> f64 {
        if self.is_on() { 2.0 * self.aspect * self.shape(grains).radius } else { grains.diameter }
    }

    /// Radius, places and inertia of the spheres.
    pub fn shape(&self, grains: &Grains) -> ClumpShape {
        let spacing = 2.0 * (self.aspect - 1.0) / (self.spheres as f64 - 1.0);
        let middle = 0.5 * (self.spheres as f64 - 1.0);
        let centres: Vec<f64> = (0..self.spheres).map(|i| spacing * (i as f64 - middle)).collect();
        let [volume, along, across] = integrals(&centres);
        let ball = 4.0 / 3.0 * std::f64::consts::PI;
        let radius = grains.radius() * (ball / volume).cbrt();
        let inertia = radius * radius * Vector3::new(along, across, across);
        let offset = |centre: &f64| Vector3::new(radius * centre, 0.0, 0.0);
        ClumpShape { radius, offsets: centres.iter().map(offset).collect(), inertia }
    }
}

/// Volume, and moments of inertia along and across over the mass, of spheres of radius 1 in a row about 0. Between the
/// planes half way to the neighbours the body is one sphere, and the integrands are polynomials of degree 4: three
/// points of Gauss are exact.
fn integrals(centres: &[f64]) -> [f64; 3] {
    const POINTS: [(f64, f64); 3] = [
        (-0.774_596_669_241_483_4, 5.0 / 9.0),
        (0.0, 8.0 / 9.0),
        (0.774_596_669_241_483_4, 5.0 / 9.0),
    ];
    let (first, last) = (centres[0], centres[centres.len() - 1]);
    let mut sums = [0.0; 3];
    for (number, &centre) in centres.iter().enumerate() {
        let begin = if number == 0 { first - 1.0 } else { 0.5 * (centres[number - 1] + centre) };
        let end = centres.get(number + 1).map_or(last + 1.0, |next| 0.5 * (centre + next));
        let (middle, half) = (0.5 * (begin + end), 0.5 * (end - begin));
        for (point, weight) in POINTS {
            let x = middle + half * point;
            let square = 1.0 - (x - centre) * (x - centre);
            let weight = std::f64::consts::PI * half * weight;
            sums[0] += weight * square;
            sums[1] += weight * 0.5 * square * square;
            sums[2] += weight * (0.25 * square * square + square * x * x);
        }
    }
    [sums[0], sums[1] / sums[0], sums[2] / sums[0]]
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRAINS: Grains = Grains::balls(1, 4e-3, 1300.0);

    #[test]
    fn an_aspect_of_one_is_the_ball() {
        let shape = Clump { spheres: 3, aspect: 1.0 }.shape(&GRAINS);
        assert!((shape.radius - 2e-3).abs() < 1e-15);
        for moment in shape.inertia.iter() {
            assert!((moment / (0.4 * 4e-6) - 1.0).abs() < 1e-12, "{moment}");
        }
    }

    #[test]
    fn touching_spheres_have_the_inertia_of_two_balls() {
        let shape = Clump { spheres: 2, aspect: 2.0 }.shape(&GRAINS);
        let rho = shape.radius;
        assert!((2.0 * rho.powi(3) / 8e-9 - 1.0).abs() < 1e-12);
        let expected = rho * rho * Vector3::new(0.4, 1.4, 1.4);
        assert!((shape.inertia - expected).norm() < 1e-12 * expected.norm());
    }

    #[test]
    fn overlapping_spheres_have_the_volume_and_inertia_of_their_union() {
        // By counting points of a fine grid inside the union.
        let shape = Clump { spheres: 4, aspect: 2.2 }.shape(&GRAINS);
        let (rho, reach, steps) = (shape.radius, 2.3 * shape.radius, 160);
        let step = 2.0 * reach / f64::from(steps);
        let at = |k: i32| -reach + (f64::from(k) + 0.5) * step;
        let (mut volume, mut along, mut across) = (0.0, 0.0, 0.0);
        for a in 0..steps {
            for b in 0..steps {
                for c in 0..steps {
                    let point = Vector3::new(at(a), at(b), at(c));
                    if shape.offsets.iter().any(|o| (point - o).norm_squared() < rho * rho) {
                        volume += 1.0;
                        along += point.y * point.y + point.z * point.z;
                        across += point.x * point.x + point.y * point.y;
                    }
                }
            }
        }
        let expected = 4.0 / 3.0 * std::f64::consts::PI * 8e-9;
        assert!((volume * step.powi(3) / expected - 1.0).abs() < 5e-3);
        assert!((along / volume / shape.inertia.x - 1.0).abs() < 5e-3);
        assert!((across / volume / shape.inertia.y - 1.0).abs() < 5e-3);
    }
}
