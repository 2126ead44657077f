//! Complementarity as equations: Fischer-Burmeister and min-map, and the rows that Newton makes of them.
//!
//! `0 <= x _|_ y >= 0` becomes `psi(x, y) = 0`; docs/theory/solvers.md, box 2a. What is 0/0 in the formulas
//! has a limit, and a row whose S grows without bound is an impulse that vanishes: both are said here.

use granulcal_scene::Complementarity;

/// S over the contact's own stiffness from which a row is an impulse that vanishes.
const NEVER_ACTS: f64 = 1e9;

/// A row `(A + shift) d_lambda = right` of the Newton system; `None` where the impulse must vanish.
pub(super) type NormalRow = Option<(f64, f64)>;

/// Rows of the Newton system.
pub(super) trait Rows {
    /// The row of `0 <= a _|_ lambda_n >= 0`, with `c = stiffness lambda_n` as the second argument of psi.
    fn normal(self, a: f64, lambda_n: f64, stiffness: f64) -> NormalRow;

    /// W of the row `(A + W) d_lambda = -(u + W lambda)`, by which `u` comes to oppose an impulse of the
    /// norm `lambda` or to vanish inside the ball of radius `limit`; `None` where the impulse must vanish.
    fn friction(self, speed: f64, lambda: f64, limit: f64, stiffness: f64) -> Option<f64>;
}

impl Rows for Complementarity {
    fn normal(self, a: f64, lambda_n: f64, stiffness: f64) -> NormalRow {
        let c = stiffness * lambda_n;
        let (psi, psi_a, psi_c) = match self {
            Self::MinMap if a < c => (a, 1.0, 0.0),
            Self::MinMap => return None,
            Self::FischerBurmeister => fischer_burmeister(a, c),
        };
        let shift = stiffness * psi_c / psi_a;
        // Also None for the infinite a of what cannot touch.
        (shift < NEVER_ACTS * stiffness).then(|| (shift, -psi / psi_a))
    }

    fn friction(self, speed: f64, lambda: f64, limit: f64, stiffness: f64) -> Option<f64> {
        let room = stiffness * (limit - lambda);
        let psi = match self {
            Self::MinMap => {
                if room < speed {
                    room
                } else {
                    speed
                }
            }
            Self::FischerBurmeister => fischer_burmeister(speed, room).0,
        };
        let mut reach = lambda + psi / stiffness;
        if room < 0.0 {
            // Outside the ball Fischer-Burmeister overshoots its rim, and may point backwards.
            reach = reach.max(limit);
        }
        let weight = (speed - psi) / reach;
        // Also None for the 0/0 of an impulse that has no room.
        (weight < NEVER_ACTS * stiffness).then(|| weight.max(0.0))
    }
}

/// psi and its derivatives by x and y, without cancellation; at the origin those of the direction (1, 1).
fn fischer_burmeister(x: f64, y: f64) -> (f64, f64, f64) {
    let norm = (x * x + y * y).sqrt();
    if norm == 0.0 {
        let slope = 1.0 - std::f64::consts::FRAC_1_SQRT_2;
        return (0.0, slope, slope);
    }
    // norm - x = y^2 / (norm + x) keeps its digits where x > 0.
    let short = |x: f64, y: f64| if x > 0.0 { y * y / (norm + x) } else { norm - x };
    let (short_x, short_y) = (short(x, y), short(y, x));
    (if x > y { y - short_x } else { x - short_y }, short_x / norm, short_y / norm)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const BOTH: [Complementarity; 2] =
        [Complementarity::FischerBurmeister, Complementarity::MinMap];

    #[test]
    fn fischer_burmeister_has_its_values_at_hand() {
        // 3 + 4 - 5 = 2, 1 - 3/5 and 1 - 4/5.
        let (psi, by_x, by_y) = fischer_burmeister(3.0, 4.0);
        assert!((psi - 2.0).abs() < 1e-15);
        assert!((by_x - 0.4).abs() < 1e-15 && (by_y - 0.2).abs() < 1e-15);
        // Far from the axes of the other: 1e-8 - 1e-16 / 2, which a plain difference loses.
        let (psi, by_x, _) = fischer_burmeister(1.0, 1e-8);
        assert!((psi / 1e-8 - 1.0).abs() < 1e-7);
        assert!((by_x / 5e-17 - 1.0).abs() < 1e-7);
    }

    #[test]
    fn what_is_complementary_stays() {
        for psi in BOTH {
            // Closed: a = 0, lambda > 0: the constraint holds and asks for nothing.
            assert_eq!(psi.normal(0.0, 0.3, 2.0), Some((0.0, 0.0)));
            // Open without an impulse: it keeps none.
            assert_eq!(psi.normal(0.3, 0.0, 2.0), None);
            // Stick inside the ball, and slip on its rim against the impulse: W = u / lambda.
            assert_eq!(psi.friction(0.0, 0.1, 0.2, 7.0), Some(0.0));
            let slip = psi.friction(0.6, 0.2, 0.2, 7.0).expect("a resistance");
            assert!((slip - 3.0).abs() < 1e-14);
        }
    }

    #[test]
    fn what_is_undefined_has_a_limit() {
        for psi in BOTH {
            if let Some((shift, right)) = psi.normal(0.0, 0.0, 2.0) {
                assert!(shift.is_finite() && right == 0.0);
            }
            assert_eq!(psi.normal(f64::INFINITY, 0.0, 2.0), None);
            assert_eq!(psi.normal(f64::NAN, 0.0, 2.0), None);
            // No room and no impulse: nothing to hold on to, moving or not.
            assert_eq!(psi.friction(0.0, 0.0, 0.0, 7.0), None);
            assert_eq!(psi.friction(1.0, 0.0, 0.0, 7.0), None);
            assert_eq!(psi.friction(f64::NAN, 0.1, 0.2, 7.0), None);
        }
    }

    proptest! {
        #[test]
        fn derivatives_are_those_of_psi(x in -9f64..9.0, y in -9f64..9.0) {
            prop_assume!(x.abs() + y.abs() > 0.1);
            let h = 1e-6;
            let psi = |x, y| fischer_burmeister(x, y).0;
            let (_, by_x, by_y) = fischer_burmeister(x, y);
            prop_assert!((by_x - (psi(x + h, y) - psi(x - h, y)) / (2.0 * h)).abs() < 1e-6);
            prop_assert!((by_y - (psi(x, y + h) - psi(x, y - h)) / (2.0 * h)).abs() < 1e-6);
        }

        #[test]
        fn shifts_and_weights_are_never_negative(
            a in -9f64..9.0, lambda in -5f64..5.0, limit in 0f64..5.0,
        ) {
            for psi in BOTH {
                if let Some((shift, right)) = psi.normal(a, lambda, 2.0) {
                    prop_assert!(shift >= 0.0 && right.is_finite());
                }
                if let Some(weight) = psi.friction(a.abs(), lambda.abs(), limit, 7.0) {
                    prop_assert!(weight >= 0.0);
                }
            }
        }
    }
}
