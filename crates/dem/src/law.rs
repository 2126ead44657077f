//! The contact law on lanes: Signorini, Coulomb, rolling resistance and Newton's restitution.
//!
//! Pure functions without loops over contacts; docs/theory/contact.md derives them.

use crate::lanes::{Reg, Reg3, Width};

/// Share of a penetration that is corrected in one substep (Baumgarte).
pub(crate) const CORRECTION: f64 = 0.2;
/// Penetration that is left alone, so that resting contacts stay closed `[m]`.
pub(crate) const SLOP: f64 = 1e-5;
/// Fastest correction of a penetration `[m/s]`.
pub(crate) const CORRECTION_SPEED: f64 = 0.5;
/// Approach below which an impact is inelastic `[m/s]`: it must exceed what gravity adds in two
/// substeps, or resting contacts bounce.
pub(crate) const IMPACT_SPEED: f64 = 0.05;

/// Inverse of the tangential over the normal Delassus element of two spheres: 1 + 5/2.
pub(crate) const TANGENTIAL_INERTIA: f64 = 3.5;

/// Bias b of `0 <= w_n + b _|_ lambda_n >= 0` from the gap, the approach speed before gravity and e.
///
/// Open contacts may close their gap but not cross it; closed ones are pushed apart slowly; an
/// approach that would close the gap within the substep bounces.
#[inline(always)]
pub(crate) fn bias_lanes<W: Width>(
    gap: Reg<W>,
    approach: Reg<W>,
    restitution: Reg<W>,
    dt: f64,
) -> Reg<W> {
    let zero = Reg::splat(0.0);
    let step = Reg::splat(dt);
    let open = gap.over(step);
    let push = Reg::splat(CORRECTION) * (gap + Reg::splat(SLOP)).over(step);
    let keep_apart = gap.if_less(zero, push.max(Reg::splat(-CORRECTION_SPEED)), open);
    let bounce = restitution * approach;
    let bounce = gap.if_less(zero, bounce.min(keep_apart), bounce);
    if_impact(gap, approach, dt, bounce, keep_apart)
}

/// `yes` where a contact would close within this substep faster than [`IMPACT_SPEED`], `no` elsewhere.
#[inline(always)]
pub(crate) fn if_impact<W: Width>(
    gap: Reg<W>,
    approach: Reg<W>,
    dt: f64,
    yes: Reg<W>,
    no: Reg<W>,
) -> Reg<W> {
    let closes = (gap + Reg::splat(dt) * approach).if_less(Reg::splat(0.0), yes, no);
    approach.if_less(Reg::splat(-IMPACT_SPEED), closes, no)
}

/// The nearest point of the ball of radius `limit` to `impulse`: stick inside, slip on the rim.
#[inline(always)]
pub(crate) fn project_ball<W: Width>(impulse: Reg3<W>, limit: Reg<W>) -> Reg3<W> {
    let norm = impulse.norm();
    impulse.scale(limit.if_less(norm, limit.over(norm), Reg::splat(1.0)))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::lanes::{Lanes, Portable};

    type R = Reg<Portable>;

    fn first(value: R) -> f64 {
        let mut lanes = Lanes::ZERO;
        value.store(&mut lanes);
        lanes.0[0]
    }

    const DT: f64 = 1.0 / 2400.0;

    /// The law in scalars, as the theory writes it.
    fn bias(gap: f64, approach: f64, restitution: f64, dt: f64) -> f64 {
        let keep_apart = if gap >= 0.0 {
            gap / dt
        } else {
            (CORRECTION * ((gap + SLOP) / dt)).max(-CORRECTION_SPEED)
        };
        if gap + dt * approach >= 0.0 || approach >= -IMPACT_SPEED {
            return keep_apart;
        }
        let bounce = restitution * approach;
        if gap < 0.0 { bounce.min(keep_apart) } else { bounce }
    }

    fn bias_of(gap: f64, approach: f64, restitution: f64, dt: f64) -> f64 {
        first(bias_lanes(R::splat(gap), R::splat(approach), R::splat(restitution), dt))
    }

    #[test]
    fn bias_has_its_three_modes() {
        assert_eq!(bias_of(1e-3, -0.1, 0.5, DT), 1e-3 / DT); // open: the gap may close
        assert_eq!(bias_of(1e-4, -2.0, 0.5, DT), -1.0); // bounces with e times the approach
        assert_eq!(bias_of(0.0, -0.04, 0.5, DT), 0.0); // too slow to bounce
        assert_eq!(bias_of(-1e-2, 0.0, 0.5, DT), -CORRECTION_SPEED); // deep: capped correction
        assert!((bias_of(-2e-5, 0.0, 0.5, DT) + CORRECTION * 1e-5 / DT).abs() < 1e-12);
        assert_eq!(bias_of(-SLOP, 0.0, 0.5, DT), 0.0); // at the slop nothing moves
    }

    proptest! {
        #[test]
        fn lanes_follow_the_scalar_law(gap in -1e-3f64..1e-3, approach in -3f64..3.0, e in 0f64..1.0) {
            prop_assert_eq!(bias_of(gap, approach, e, DT), bias(gap, approach, e, DT));
        }

        #[test]
        fn projection_is_inside_and_idempotent(
            x in -9f64..9.0, y in -9f64..9.0, z in -9f64..9.0, limit in 0f64..5.0,
        ) {
            let vector = Reg3 { x: R::splat(x), y: R::splat(y), z: R::splat(z) };
            let once = project_ball(vector, R::splat(limit));
            prop_assert!(first(once.norm()) <= limit * (1.0 + 1e-14));
            let twice = project_ball(once, R::splat(limit));
            prop_assert!(first((twice - once).norm()) <= 1e-14 * limit);
            if first(vector.norm()) <= limit {
                prop_assert_eq!(first((once - vector).norm()), 0.0);
            }
        }
    }
}
