//! The contact law: Signorini, Coulomb, rolling resistance.
//!
//! Pure functions without loops over contacts; docs/theory/contact.md derives them.

use granulcal_scene::{GrainShape, Scene};

use crate::lanes::{Reg, Reg3, Width};

/// Number of the law that pours follow: of contacts, impacts, starts and of how all of it is solved.
///
/// It counts up whenever the physics of a pour changes, whatever the version of the package: data sets, checkpoints,
/// models and kept pours state it, so that pours of two laws are never mixed. 1 had impacts one by one; 2 has them as
/// springs in the limit of infinite stiffness.
pub const LAW: u32 = 2;

/// Number of the arithmetic that the law is worked out in, of pours of a scene.
///
/// It counts up whenever such a pour changes by its rounding or the order of its contacts alone: the same seed is then
/// another pour of the same law. Data sets and checkpoints state it, so that a batch is not gone on with by another; what
/// is learned from pours does not depend on it. 1 is double precision throughout; grains with a shape came to 2 when
/// their points were swept eight at a time, and to 3 when walls were foreseen and cores told how bodies lie; boxes came to
/// 4 when their separating axes were tried by the crate itself. Boxes came to 5 and the others to 4 when what is foreseen
/// was looked at where a way leads elsewhere, and boxes met eight pairs at a time; to 6 and 5 when a corner that has gone
/// round the end of a shell was no longer taken for one that has come through it. Cylinders came to 6 when their nearest
/// points were those of their features.
pub fn arithmetic(scene: &Scene) -> u32 {
    match scene.grains.shape {
        Some(GrainShape::Box { .. } | GrainShape::Cylinder { .. }) => 6,
        Some(_) => 5,
        None => 1,
    }
}

/// Share of a penetration that is corrected in one substep (Baumgarte).
pub(crate) const CORRECTION: f64 = 0.2;
/// Penetration that is left alone, so that resting contacts stay closed `[m]`.
pub(crate) const SLOP: f64 = 1e-5;
/// Fastest correction of a penetration `[m/s]`.
pub(crate) const CORRECTION_SPEED: f64 = 0.5;
/// Fastest way out `[m/s]` that is asked of a contact whose grains have parted in an impact and are pressed together
/// again in the same substep.
pub(crate) const PINNED_SPEED: f64 = 0.1;
/// Approach below which an impact is inelastic `[m/s]`: a matter of the contact solve, not of `impact`.
pub(crate) const IMPACT_SPEED: f64 = 0.05;
/// The same where a dashpot acts on rolling, which brakes a grain however slowly it is met `[m/s]`.
pub(crate) const DAMPED_IMPACT_SPEED: f64 = 0.01;

/// Inverse moment of inertia of a sphere times its mass and squared radius, 5/2.
pub(crate) const INVERSE_INERTIA: f64 = 2.5;

/// Inverse of the tangential over the normal Delassus element of two spheres: 1 + 5/2.
pub(crate) const TANGENTIAL_INERTIA: f64 = 3.5;

/// Bias b of `0 <= w_n + b _|_ lambda_n >= 0` from the gap.
///
/// Open contacts may close their gap but not cross it; closed ones are pushed apart slowly.
#[inline(always)]
pub(crate) fn bias_lanes<W: Width>(gap: Reg<W>, dt: f64) -> Reg<W> {
    let (zero, step) = (Reg::splat(0.0), Reg::splat(dt));
    let push = Reg::splat(CORRECTION) * (gap + Reg::splat(SLOP)).over(step);
    gap.if_less(zero, push.max(Reg::splat(-CORRECTION_SPEED)), gap.over(step))
}

/// The bias of a contact of which a grain has had an impact: at the time `clock` of that impact there is this
/// gap, which opens at `w_n`. What the solve changes acts for the whole substep, so the gap counts that
/// would have been at its begin.
#[inline(always)]
pub(crate) fn bias_after_impact<W: Width>(
    gap: Reg<W>,
    w_n: Reg<W>,
    clock: Reg<W>,
    dt: f64,
) -> Reg<W> {
    let begin = (gap - clock * w_n).over(Reg::splat(dt)).max(Reg::splat(-PINNED_SPEED));
    gap.if_less(Reg::splat(0.0), bias_lanes(gap, dt), begin)
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

    #[test]
    fn bodies_have_an_arithmetic_of_their_own() {
        let balls = Scene::funnel(0.12);
        let of = |shape| {
            let mut bodies = balls.clone();
            bodies.grains.shape = Some(shape);
            arithmetic(&bodies)
        };
        assert_eq!(arithmetic(&balls), 1);
        assert_eq!(of(GrainShape::Box { aspect: [1.0; 3] }), 6);
        assert_eq!(of(GrainShape::Cylinder { aspect: 1.0 }), 6);
        let superquadric = GrainShape::Superquadric { aspect: [1.0; 3], exponents: [2.0; 2] };
        assert_eq!(of(superquadric), 5);
    }

    #[test]
    fn bias_has_its_modes() {
        let bias = |gap| first(bias_lanes(R::splat(gap), DT));
        assert_eq!(bias(1e-3), 1e-3 / DT); // open: the gap may close
        assert_eq!(bias(0.0), 0.0);
        assert_eq!(bias(-1e-2), -CORRECTION_SPEED); // deep: capped correction
        assert!((bias(-2e-5) + CORRECTION * 1e-5 / DT).abs() < 1e-12);
        assert_eq!(bias(-SLOP), 0.0); // at the slop nothing moves
    }

    proptest! {
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
