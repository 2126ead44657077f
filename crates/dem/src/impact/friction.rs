//! Sliding, rolling and torsion of one contact under a given normal impulse (docs/theory/contact.md, Friction of an
//! impact).
//!
//! With rolling turned into the tangent plane, `rho = n x r`, `lambda_r = n x m`, the two rows are
//!
//! ```text
//! u' = u + A_t lambda_t + kappa m,    |lambda_t| <= mu_s P
//! r' = r + kappa lambda_t + A_r m,    |m| <= mu_r P
//! ```
//!
//! and (lambda_t, m) is where the energy that they leave is least: sticking or on the rim, both at once.

use std::ops::AddAssign;

use nalgebra::Vector3;

use crate::contact::ContactLaw;
use crate::law::{INVERSE_INERTIA, TANGENTIAL_INERTIA};

/// Rounds of both projections where sliding and rolling go on in directions that turn.
const ROUNDS: usize = 24;
/// Change of an impulse over its limit below which the rounds have settled `[-]`.
const SETTLED: f64 = 1e-9;
/// Parts of a lone impact, at most: one for each change from sliding to sticking or of the sense of rolling.
const PARTS: usize = 8;

/// Diagonal and coupling of the friction rows of a contact `[-]`.
#[derive(Clone, Copy, Debug)]
pub(super) struct FrictionBlock {
    pub a_t: f64,
    pub a_r: f64,
    pub kappa: f64,
    /// Cones: mu_s, mu_r and mu_t.
    pub sliding: f64,
    pub rolling: f64,
    pub torsion: f64,
    /// Rolling velocity up to which the rolling impulse grows with it `[m/s]`.
    pub rolling_speed: f64,
}

/// How the surfaces of a contact move: u across n, r (rolling turned into the tangent plane) and the spin about n
/// `[m/s]`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Slip {
    pub u: Vector3<f64>,
    pub r: Vector3<f64>,
    pub about: f64,
}

/// Impulses of friction: lambda_t, m and along n `[m/s]`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Friction {
    pub t: Vector3<f64>,
    pub m: Vector3<f64>,
    pub about: f64,
}

impl AddAssign<&Self> for Friction {
    fn add_assign(&mut self, more: &Self) {
        self.t += more.t;
        self.m += more.m;
        self.about += more.about;
    }
}

impl FrictionBlock {
    /// The block of a contact, its cones `factor` times as wide as in lasting contacts.
    pub fn new(law: &ContactLaw, factor: f64) -> Self {
        let ([c_i, c_j], [l_i, l_j]) = (law.inverse_mass, law.lever);
        Self {
            a_t: TANGENTIAL_INERTIA * (c_i + c_j),
            a_r: INVERSE_INERTIA * (l_i * l_i * c_i + l_j * l_j * c_j),
            kappa: INVERSE_INERTIA * (l_j * c_j - l_i * c_i),
            sliding: factor * law.sliding_friction,
            rolling: factor * law.rolling_friction,
            torsion: factor * law.torsional_friction,
            rolling_speed: law.rolling_speed,
        }
    }

    /// What friction does while the normal impulse grows by `push` `[m/s]`.
    #[inline]
    pub fn act(&self, slip: &Slip, push: f64) -> Friction {
        let torsion = self.torsion * push;
        // Not `clamp`, which panics at a NaN: what is not finite is for the health to see.
        let about = (-slip.about / self.a_r).max(-torsion).min(torsion);
        let (t_max, m_max) = (self.sliding * push, self.rolling * push);
        let mut a_r = self.a_r;
        if self.rolling_speed > 0.0 {
            a_r += self.rolling_speed / m_max.max(f64::MIN_POSITIVE);
        }
        let (a_t, kappa, Slip { u, r, .. }) = (self.a_t, self.kappa, *slip);
        if kappa == 0.0 {
            let (t, m) = (shorten(u * (-1.0 / a_t), t_max), shorten(r * (-1.0 / a_r), m_max));
            return Friction { t, m, about };
        }
        // Sticking: what is left for rolling is a row by itself.
        let m = shorten((kappa / a_t * u - r) * (1.0 / (a_r - kappa * kappa / a_t)), m_max);
        let t = (u + kappa * m) * (-1.0 / a_t);
        if t.norm_squared() <= t_max * t_max {
            return Friction { t, m, about };
        }
        // Sliding, and rolling that stops.
        let t = shorten((kappa / a_r * r - u) * (1.0 / (a_t - kappa * kappa / a_r)), t_max);
        let m = (r + kappa * t) * (-1.0 / a_r);
        if m.norm_squared() <= m_max * m_max {
            return Friction { t, m, about };
        }
        // Both go on.
        let (mut t, mut m) = (t, shorten(m, m_max));
        for _ in 0..ROUNDS {
            let before = t;
            t = shorten((u + kappa * m) * (-1.0 / a_t), t_max);
            m = shorten((r + kappa * t) * (-1.0 / a_r), m_max);
            if (t - before).norm_squared() <= (SETTLED * t_max).powi(2) {
                break;
            }
        }
        Friction { t, m, about }
    }

    /// What friction does during a whole impact of impulse `push` in which nothing else acts: as the normal impulse
    /// grows, from one change of sliding or rolling to the next, exact where both have one direction.
    pub fn act_throughout(&self, mut slip: Slip, push: f64) -> Friction {
        let (mut all, mut left) = (Friction::default(), push);
        for part in 0..PARTS {
            let next = if part + 1 == PARTS { left } else { self.until_change(&slip, left) };
            let got = self.act(&slip, next);
            all += &got;
            left -= next;
            if left <= 0.0 {
                break;
            }
            slip.u += self.a_t * got.t + self.kappa * got.m;
            slip.r += self.kappa * got.t + self.a_r * got.m;
            slip.about += self.a_r * got.about;
        }
        all
    }

    /// The normal impulse after which sliding or rolling, as they go on now, would be at its least; at most `left`.
    /// What stands still need not be examined: its impulse does not change its sense before the other has stopped.
    fn until_change(&self, slip: &Slip, left: f64) -> f64 {
        if self.kappa == 0.0 || self.rolling_speed > 0.0 {
            return left;
        }
        let (u, r) = (slip.u.norm(), slip.r.norm());
        if u < TINY || r < TINY {
            return left;
        }
        let (t, m) = (slip.u * (-self.sliding / u), slip.r * (-self.rolling / r));
        let least = |v: &Vector3<f64>, rate: Vector3<f64>| {
            let at = -v.dot(&rate) / rate.norm_squared();
            if at > TINY { at } else { left }
        };
        let sliding = least(&slip.u, self.a_t * t + self.kappa * m);
        let rolling = least(&slip.r, self.kappa * t + self.a_r * m);
        left.min(sliding).min(rolling)
    }
}

/// Velocities and impulses below this are nothing `[m/s]`.
const TINY: f64 = 1e-14;

/// The vector, or the part of it that is as long as `limit`.
#[inline]
pub(super) fn shorten(vector: Vector3<f64>, limit: f64) -> Vector3<f64> {
    let square = vector.norm_squared();
    if square > limit * limit { vector * (limit / square.sqrt()) } else { vector }
}
