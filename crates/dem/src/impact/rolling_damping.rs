//! A dashpot on rolling beside the moment limit, as LIGGGHTS' `epsd` has it (docs/theory/contact.md).
//!
//! With y the rolling displacement, f the normal force and time in 1/omega, per A_n:
//!
//! ```text
//! spring  2.25 mu_r^2 y, at most mu_r f;    dashpot  c r,  c = 3 x_r mu_r sqrt(7/5), while the spring is below its limit
//! ```
//!
//! Source: rolling model `epsd` of LIGGGHTS (Ai et al. 2011, model C, without a dashpot at full mobilisation).

use nalgebra::Vector3;

/// Stiffness of rolling over mu_r^2 times the normal one `[-]`.
const STIFFNESS: f64 = 2.25;
/// Moment of inertia of a sphere about a point of its surface over its mass and squared radius `[-]`.
const ABOUT_CONTACT: f64 = 1.4;

/// The rolling spring of a link that has the dashpot.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RollingSpring {
    /// Displacement `[m/s]`, as compressions are.
    y: Vector3<f64>,
}

impl RollingSpring {
    /// The impulse m of the dashpot of a contact with A_r = `a_r` and A_n = 1 / `compliance_n` on what rolls at `r`,
    /// over a time in which the normal impulse was `push`.
    pub fn act(
        &mut self,
        r: &Vector3<f64>,
        push: f64,
        time: f64,
        [damping, rolling, a_r, compliance_n]: [f64; 4],
    ) -> Vector3<f64> {
        self.y += time * r;
        let most = push / (compliance_n * time) / (STIFFNESS * rolling).max(f64::MIN_POSITIVE);
        let length = self.y.norm();
        if length > most {
            self.y *= most / length;
            return Vector3::zeros();
        }
        let c = 2.0 * damping * rolling * (STIFFNESS * ABOUT_CONTACT).sqrt() * compliance_n;
        // What is left of r after the time falls exponentially: no energy is created.
        r * (libm::expm1(-a_r * c * time) / a_r)
    }
}
