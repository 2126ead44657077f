//! How a rigid body turns on in a substep while nothing meets it.
//!
//! ```text
//! dq/dt = (0, omega) q / 2,   omega = R I^-1 R^T L,   L constant
//! ```
//!
//! A part of the substep is one turn about the angular velocity of its middle (explicit midpoint, second order), which
//! keeps L and gains `(Omega dt)^4 / 8` of the energy in nutation, of the rate `Omega ~ (I_max / I_min - 1) omega`. The
//! substep has as many parts as keep that small.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// Angle of nutation in a part of a substep, at most `[rad]`: 1e-6 of the energy.
const NUTATION: f64 = 0.05;
/// Bodies whose moments of inertia differ by no more than this share turn in one part, for they hardly nutate `[-]`.
const ALIKE: f64 = 0.2;

/// Half the angle of a turn up to which a series gives it `[rad]`.
const SMALL: f64 = 0.2;

/// Moments that differ by less than this of the least are the same `[-]`.
const SAME: f64 = 1e-12;

/// The inverse of the tensor of inertia in the scene's axes, from the moments about the body's.
pub(crate) fn inverse_inertia(axes: &Matrix3<f64>, moments: &Vector3<f64>) -> Matrix3<f64> {
    let inverse = Matrix3::from_diagonal(&moments.map(|moment| 1.0 / moment));
    axes * inverse * axes.transpose()
}

/// By how much the largest moment of inertia exceeds the least, in the least.
fn unlikeness(moments: &Vector3<f64>) -> f64 {
    moments.max() / moments.min() - 1.0
}

/// Whether a body turns alike about all axes.
pub(crate) fn turns_alike(moments: &Vector3<f64>) -> bool {
    unlikeness(moments) <= SAME
}

/// Whether a body's turn about its middle angular velocity may need more than one part.
pub(crate) fn nutates(moments: &Vector3<f64>) -> bool {
    unlikeness(moments) > ALIKE
}

/// The turn about a vector by its length `[rad]`, by the series of `cos x` and `sin x / x` of half the angle x where
/// that is small: the first term that is left out is below 1e-17.
pub(crate) fn turn_by(vector: &Vector3<f64>) -> UnitQuaternion<f64> {
    let square = 0.25 * vector.norm_squared();
    if square > SMALL * SMALL {
        return UnitQuaternion::new(*vector);
    }
    let series = |inverses: [f64; 6]| inverses.iter().rev().fold(0.0, |sum, k| k - square * sum);
    let cos = series([1.0, 1.0 / 2.0, 1.0 / 24.0, 1.0 / 720.0, 1.0 / 40320.0, 1.0 / 3628800.0]);
    let sin = series([1.0, 1.0 / 6.0, 1.0 / 120.0, 1.0 / 5040.0, 1.0 / 362880.0, 1.0 / 39916800.0]);
    UnitQuaternion::new_unchecked(Quaternion::from_parts(cos, 0.5 * sin * vector))
}

/// How a body is turned after `dt` `[s]`: with these moments of inertia, the angular momentum L, and the angular
/// velocity omega at the begin `[rad/s]`; `twist` is by how much impacts turn it besides `[rad]`.
pub(crate) fn turned_on(
    from: &UnitQuaternion<f64>,
    moments: &Vector3<f64>,
    [momentum, omega]: [&Vector3<f64>; 2],
    twist: &Vector3<f64>,
    dt: f64,
) -> UnitQuaternion<f64> {
    if turns_alike(moments) {
        // Its angular velocity stays as it is.
        return turn_by(&(dt * omega + twist)) * from;
    }
    let of = |turned: &UnitQuaternion<f64>| {
        inverse_inertia(turned.to_rotation_matrix().matrix(), moments) * momentum
    };
    let parts = if nutates(moments) {
        (unlikeness(moments) * dt * omega.norm() / NUTATION).ceil().max(1.0)
    } else {
        1.0
    };
    let (share, part) = (1.0 / parts, dt / parts);
    let (mut turned, mut omega) = (*from, *omega);
    // By the library's turns: pours of clumps would be others by the last bits of a series.
    for number in 1..=parts as usize {
        let half = UnitQuaternion::new(0.5 * (part * omega + share * twist)) * turned;
        turned = UnitQuaternion::new(part * of(&half) + share * twist) * turned;
        if number < parts as usize {
            omega = of(&turned);
        }
    }
    turned
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_by_series_is_the_turn() {
        let axis = Vector3::new(0.48, -0.6, 0.64);
        for angle in [0.0, 1e-12, 1e-3, 0.1, 0.399_999, 0.4, 0.400_001, 3.0] {
            let [series, exact] = [turn_by(&(angle * axis)), UnitQuaternion::new(angle * axis)];
            assert!((series.coords - exact.coords).amax() < 3e-16, "{angle}");
        }
    }

    #[test]
    fn free_bodies_keep_their_energy_however_fast_they_turn() {
        let (dt, still) = (5e-4, Vector3::zeros());
        for moments in [[17.0, 17.0, 2.0], [5.0, 4.0, 2.0], [2.0, 2.3, 2.3], [1.0; 3]] {
            let moments = 1e-6 * Vector3::from(moments);
            for speed in [10.0, 100.0, 600.0, 3000.0] {
                let omega: Vector3<f64> = speed * Vector3::new(0.5, 0.3, 0.8);
                let momentum = omega.component_mul(&moments);
                let mut turned = UnitQuaternion::identity();
                let spin = |turned: &UnitQuaternion<f64>| {
                    inverse_inertia(turned.to_rotation_matrix().matrix(), &moments) * momentum
                };
                for _ in 0..2000 {
                    let omega = spin(&turned);
                    turned = turned_on(&turned, &moments, [&momentum, &omega], &still, dt);
                    turned = UnitQuaternion::new_normalize(turned.into_inner());
                }
                let [before, after] =
                    [omega, spin(&turned)].map(|omega| 0.5 * momentum.dot(&omega));
                let gained = after / before - 1.0;
                let most = if nutates(&moments) { 0.01 } else { 0.1 };
                assert!(gained.abs() < most, "{moments:?} {speed}: {gained:e}");
            }
        }
    }

    #[test]
    fn a_symmetric_top_nutates_at_its_closed_form_rate() {
        // About its axis a free top of moments (A, A, C) goes round at L / A in space.
        let moments = Vector3::new(17e-6, 17e-6, 2e-6);
        let (dt, steps, still) = (5e-4, 400, Vector3::zeros());
        let omega = Vector3::new(0.0, 120.0, 200.0);
        let momentum = omega.component_mul(&moments);
        let mut turned = UnitQuaternion::identity();
        for _ in 0..steps {
            let axes = turned.to_rotation_matrix();
            let omega = inverse_inertia(axes.matrix(), &moments) * momentum;
            turned = turned_on(&turned, &moments, [&momentum, &omega], &still, dt);
        }
        let round = momentum.norm() / moments.x * dt * f64::from(steps);
        let expected = UnitQuaternion::new(momentum.normalize() * round) * Vector3::z();
        assert!((turned * Vector3::z() - expected).norm() < 2e-3);
    }
}
