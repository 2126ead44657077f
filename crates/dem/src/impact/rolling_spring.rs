//! Rolling in an impact by a spring and a dashpot, as LIGGGHTS' `epsd` has it (docs/theory/contact.md).
//!
//! With y the rolling displacement, f the normal force and time in 1/omega, so that the normal spring is 1 / A_n:
//!
//! ```text
//! r' = A_r m',    m' = -k y - c r,    k = 2.25 mu_r^2 / A_n,    c = 2 x_r sqrt(3.5 k / A_r)
//! ```
//!
//! while `k |y| < mu_r f`; from then on `|m'| = mu_r f` without the dashpot. LIGGGHTS' critical dashpot is that of the
//! moments of inertia about the contact, 7/5 m R^2 in parallel, R the radius, not the effective one.
//!
//! Source: rolling model `epsd` of LIGGGHTS (Ai et al. 2011, model C, without a dashpot at full mobilisation).

use nalgebra::Vector3;

/// Stiffness of rolling over mu_r^2 times the normal one `[-]`.
const STIFFNESS: f64 = 2.25;
/// 7/5, a sphere's moment of inertia about a point of its surface, times 5/2 of A_r `[-]`.
const CRITICAL: f64 = 3.5;

/// The rolling spring of a link.
#[derive(Clone, Copy, Debug)]
pub(super) struct RollingSpring {
    /// A_r.
    a_r: f64,
    /// The limit over the normal impulse.
    cone: f64,
    /// k and c.
    stiffness: f64,
    dashpot: f64,
    /// y, a velocity, as compressions are `[m/s]`.
    y: Vector3<f64>,
}

impl RollingSpring {
    /// The spring of a contact with mu_r = `friction`, `cone` in an impact, and a `share` x_r of the critical dashpot.
    pub fn new([friction, cone]: [f64; 2], share: f64, a_r: f64, compliance_n: f64) -> Self {
        let stiffness = STIFFNESS * friction * friction * compliance_n;
        let dashpot = 2.0 * share * (CRITICAL * stiffness / a_r).sqrt();
        Self { a_r, cone, stiffness, dashpot, y: Vector3::zeros() }
    }

    /// m of what rolls at `r`, over a time in which the normal impulse was `push`.
    pub fn act(&mut self, r: &Vector3<f64>, push: f64, time: f64) -> Vector3<f64> {
        let most = self.cone * push;
        let limit = most / (time * self.stiffness).max(f64::MIN_POSITIVE);
        let (y, r_end) = self.flow(r, time);
        let length = y.norm();
        if length <= limit {
            self.y = y;
            return (r_end - r) / self.a_r;
        }
        let along = y / length;
        let loading = along.dot(r);
        // What still loads the spring is stopped at most: the limit is no motor.
        let moment = if loading > 0.0 { most.min(loading / self.a_r) } else { most };
        let m = -moment * along;
        let way = time * (r + 0.5 * self.a_r * m);
        let moved = shortened(self.y + way, limit);
        let gained = 0.5 * self.stiffness * (moved.norm_squared() - self.y.norm_squared());
        if gained + m.dot(&way) / time > 0.0 {
            self.y = shortened(self.y, limit);
            return Vector3::zeros();
        }
        self.y = moved;
        m
    }

    /// y and r after a time without the limit: a damped oscillator, exactly.
    fn flow(&self, r: &Vector3<f64>, time: f64) -> (Vector3<f64>, Vector3<f64>) {
        let (square, gamma) = (self.a_r * self.stiffness, 0.5 * self.a_r * self.dashpot);
        let nu = (square - gamma * gamma).abs().sqrt();
        let decay = libm::exp(-gamma * time);
        // Near the critical dashpot sin and sinh are their arguments.
        let (even, odd) = if nu * time < 1e-6 {
            (decay, decay * time)
        } else if square > gamma * gamma {
            let (sin, cos) = libm::sincos(nu * time);
            (decay * cos, decay * sin / nu)
        } else {
            let (slow, fast) = (libm::exp((nu - gamma) * time), libm::exp(-(nu + gamma) * time));
            (0.5 * (slow + fast), 0.5 * (slow - fast) / nu)
        };
        let y = even * self.y + odd * (r + gamma * self.y);
        (y, even * r - odd * (square * self.y + gamma * r))
    }
}

fn shortened(y: Vector3<f64>, limit: f64) -> Vector3<f64> {
    let length = y.norm();
    if length > limit { y * (limit / length) } else { y }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIME: f64 = 0.1;

    impl RollingSpring {
        /// Of the roll and of what is stored.
        fn energy(&self, r: &Vector3<f64>) -> f64 {
            0.5 * (r.norm_squared() / self.a_r + self.stiffness * self.y.norm_squared())
        }
    }

    /// Share of a unit of rolling that a half wave of normal force `push sin t` leaves, in steps of `TIME`.
    fn kept(mut spring: RollingSpring, push: f64) -> f64 {
        let mut r = Vector3::x();
        for step in 0..(std::f64::consts::PI / TIME) as usize {
            let pushed = push * libm::sin((step as f64 + 0.5) * TIME) * TIME;
            let before = spring.energy(&r);
            r += spring.a_r * spring.act(&r, pushed, TIME);
            let after = spring.energy(&r);
            assert!(after <= before * (1.0 + 1e-12), "step {step}: {before} to {after}");
        }
        r.x
    }

    #[test]
    fn below_the_limit_it_is_a_damped_oscillator() {
        // Where the limit is far and the spring soft, the dashpot alone: exp(-A_r c pi).
        let spring = RollingSpring::new([1e-3; 2], 0.7, 1.25, 0.5);
        let expected = (-1.25 * spring.dashpot * std::f64::consts::PI).exp();
        assert!((kept(spring, 1e9) / expected - 1.0).abs() < 1e-3);
        // At a pair of equal spheres c is that of a wall times sqrt(A_r A_n / 5/2) = 1, not 1 / A_n.
        let wall = RollingSpring::new([0.1; 2], 0.7, 2.5, 1.0);
        let pair = RollingSpring::new([0.1; 2], 0.7, 1.25, 0.5);
        assert!((pair.dashpot / wall.dashpot - 1.0).abs() < 1e-12);
    }

    #[test]
    fn it_creates_no_energy_at_any_dashpot_limit_or_speed() {
        for share in [1e-3, 0.3, 0.534, 0.7, 5.0] {
            for friction in [0.0, 0.03, 0.3, 1.0, 30.0] {
                for push in [0.01, 0.3, 1.0, 10.0, 1e3] {
                    let left = kept(RollingSpring::new([friction; 2], share, 1.25, 0.5), push);
                    assert!(left.abs() <= 1.0, "{share} {friction} {push}: {left}");
                }
            }
        }
    }
}
