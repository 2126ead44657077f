//! The nearest points of two equal cylinders, from the pairs of features that can hold them.
//!
//! A unit vector n from the first to the second proves that they are apart by
//!
//! ```text
//! s(n) = n . (c_2 - c_1) - sigma(n . a_1) - sigma(n . a_2),   sigma(k) = h |k| + r sqrt(1 - k^2)
//! ```
//!
//! and two points of theirs that they are no farther apart than those: points whose distance is that of their own line,
//! |p_2 - p_1| = s(n), are the nearest. Each pair of features (an end, the side, a rim) has its own nearest points; the
//! first whose points say so are those of the cylinders.

use nalgebra::{Unit, Vector3};

use super::meeting::Nearest;

/// Newton's steps to the nearest points of a rim, at most, and how small the last is `[-]`.
const STEPS: usize = 12;
const SETTLED: f64 = 1e-5;
/// Sines and cosines that are nothing `[-]`.
const NOTHING: f64 = 1e-6;

/// One of the two.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cylinder {
    pub centre: Vector3<f64>,
    /// Unit.
    pub axis: Vector3<f64>,
    pub radius: f64,
    /// Half of its length.
    pub half: f64,
}

/// Points of two features, the first cylinder's first; `along` leads roughly from it to the second.
type OfFeatures = fn([&Cylinder; 2], along: &Vector3<f64>) -> [Vector3<f64>; 2];

/// And whether they are the second's and the first's.
const FEATURES: [(OfFeatures, bool); 6] = [
    (end_and_rim, false),
    (end_and_rim, true),
    (sides, false),
    (side_and_rim, false),
    (side_and_rim, true),
    (rims, false),
];

/// The nearest points of two cylinders that are no farther apart than `farthest`, to `near`; none where they meet, or
/// where no pair of features answers.
pub(super) fn nearest([one, other]: &[Cylinder; 2], farthest: f64, near: f64) -> Option<Nearest> {
    let pair = [one, other];
    let mut along = (other.centre - one.centre).try_normalize(0.0)?;
    let mut most = separation(pair, &along);
    for (of_features, is_turned) in FEATURES {
        let [on_1, on_2] = if is_turned {
            let [on_2, on_1] = of_features([other, one], &-along);
            [on_1, on_2]
        } else {
            of_features(pair, &along)
        };
        // Features that are not there have no points: not a number.
        let Some((towards, distance)) = Unit::try_new_and_get(on_2 - on_1, near) else {
            continue;
        };
        let least = separation(pair, &towards);
        if least > farthest {
            return Some(Nearest::Farther);
        }
        if distance - least < near {
            return Some(Nearest::Points([on_1, on_2], towards.into_inner()));
        }
        if least > most {
            (along, most) = (towards.into_inner(), least);
        }
    }
    None
}

/// How far the two are apart at least, s(n).
fn separation([one, other]: [&Cylinder; 2], n: &Vector3<f64>) -> f64 {
    n.dot(&(other.centre - one.centre)) - one.width(n) - other.width(n)
}

impl Cylinder {
    /// How far it reaches from its centre along a unit vector.
    fn width(&self, n: &Vector3<f64>) -> f64 {
        let along = n.dot(&self.axis);
        self.half * along.abs() + self.radius * (1.0 - along * along).max(0.0).sqrt()
    }

    /// What of a vector is across the axis.
    fn across(&self, vector: &Vector3<f64>) -> Vector3<f64> {
        vector - vector.dot(&self.axis) * self.axis
    }

    /// The middle of the end that looks along a vector.
    fn end(&self, along: &Vector3<f64>) -> Vector3<f64> {
        self.centre + self.half.copysign(along.dot(&self.axis)) * self.axis
    }

    /// A vector from the axis, no longer than the radius.
    fn within(&self, across: Vector3<f64>) -> Vector3<f64> {
        let length = across.norm();
        if length > self.radius { across * (self.radius / length) } else { across }
    }

    /// The place along the axis, of those that the cylinder has.
    fn place(&self, along: f64) -> Vector3<f64> {
        self.centre + along.clamp(-self.half, self.half) * self.axis
    }
}

/// The end of the first, and of the second what reaches farthest towards it.
fn end_and_rim([one, other]: [&Cylinder; 2], along: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let end = one.end(along);
    let n = (end - one.centre) / one.half;
    let across = other.across(&n);
    let (sine, cosine) = (across.norm(), n.dot(&other.axis));
    let place = if cosine.abs() < NOTHING {
        other.place((end - other.centre).dot(&other.axis))
    } else {
        other.end(&-n)
    };
    let on_2 = if sine < NOTHING {
        place + other.within(other.across(&(end - place)))
    } else {
        place - across * (other.radius / sine)
    };
    [end + one.within(one.across(&(on_2 - end))), on_2]
}

/// The nearest points of the axes, if the cylinders go so far, and those of the sides across them.
fn sides([one, other]: [&Cylinder; 2], _: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let offset = other.centre - one.centre;
    let cosine = one.axis.dot(&other.axis);
    let (along, back) = (offset.dot(&one.axis), -offset.dot(&other.axis));
    let square = 1.0 - cosine * cosine;
    let first = if square < NOTHING {
        // Side by side: half way between the centres.
        0.5 * along
    } else {
        (along + cosine * back) / square
    };
    let on_1 = one.place(first);
    let on_2 = other.place((on_1 - other.centre).dot(&other.axis));
    let on_1 = one.place((on_2 - one.centre).dot(&one.axis));
    let n = (on_2 - on_1).try_normalize(0.0).unwrap_or(offset);
    [
        on_1 + one.radius * one.across(&n).normalize(),
        on_2 - other.radius * other.across(&n).normalize(),
    ]
}

/// The side of the first and the rim of the second's end that looks at it: seen along the first's axis the rim is an
/// ellipse, and the nearest point of both is that nearest to the axis.
fn side_and_rim([one, other]: [&Cylinder; 2], along: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let middle = other.end(&-along);
    let level = one.axis.cross(&other.axis);
    let sine = level.norm();
    let level = if sine < NOTHING {
        one.across(&along.map(|x| x + NOTHING)).normalize()
    } else {
        level / sine
    };
    let steep = other.axis.cross(&level);
    let half = [other.radius, other.radius * one.axis.dot(&other.axis).abs()];
    let to_axis = one.across(&(one.centre - middle));
    let seen = one.across(&steep).try_normalize(0.0).unwrap_or_default();
    let [first, second] = nearest_of_ellipse(half, [to_axis.dot(&level), to_axis.dot(&seen)]);
    let around = (first * level + second * steep).try_normalize(0.0).unwrap_or(level);
    let on_2 = middle + other.radius * around;
    let place = one.place((on_2 - one.centre).dot(&one.axis));
    let out = one.across(&(on_2 - place)).try_normalize(0.0).unwrap_or(level);
    [place + one.radius * out, on_2]
}

/// The point of an ellipse that is nearest to one outside of it, in its half axes k: x_i = k_i^2 y_i / (t + k_i^2),
/// with sum (x_i / k_i)^2 = 1, has the root t to which Newton's steps rise (D. Eberly, Distance from a point to an
/// ellipse, 2013).
fn nearest_of_ellipse(half: [f64; 2], outside: [f64; 2]) -> [f64; 2] {
    let square = half.map(|half| half * half);
    let share = |i: usize, root: f64| {
        if half[i] * outside[i] == 0.0 { 0.0 } else { half[i] * outside[i] / (root + square[i]) }
    };
    let least = |i: usize| half[i] * outside[i].abs() - square[i];
    let mut root = least(0).max(least(1));
    for _ in 0..STEPS {
        let squares = [0, 1].map(|i| share(i, root).powi(2));
        let slope =
            |i: usize| if squares[i] == 0.0 { 0.0 } else { squares[i] / (root + square[i]) };
        let step = (squares[0] + squares[1] - 1.0) / (2.0 * (slope(0) + slope(1)));
        root += step;
        // Where the point is the middle no step is a number.
        if step.abs() < SETTLED * square[0] || !step.is_finite() {
            break;
        }
    }
    [share(0, root), share(1, root)]
}

/// The rims of the ends that look at each other: Newton's steps along both, from where they reach farthest.
fn rims([one, other]: [&Cylinder; 2], along: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let start = |of: &Cylinder, n: &Vector3<f64>| {
        of.across(n).try_normalize(NOTHING).unwrap_or_else(|| of.across(&n.yzx()).normalize())
    };
    let (end_1, end_2) = (one.end(along), other.end(&-along));
    let (mut out_1, mut out_2) = (start(one, along), start(other, &-along));
    let points = |out_1: &Vector3<f64>, out_2: &Vector3<f64>| {
        [end_1 + one.radius * out_1, end_2 + other.radius * out_2]
    };
    for _ in 0..STEPS {
        let [on_1, on_2] = points(&out_1, &out_2);
        let way = (on_2 - on_1) / one.radius;
        let (ahead_1, ahead_2) = (one.axis.cross(&out_1), other.axis.cross(&out_2));
        // Slopes and curvatures of |p_2 - p_1|^2 / 2 r^2 in the angles; never less than those of the rims' own.
        let slope = [-way.dot(&ahead_1), way.dot(&ahead_2)];
        let curved = [1.0 + way.dot(&out_1).max(0.0), 1.0 - way.dot(&out_2).min(0.0)];
        let mixed = -ahead_1.dot(&ahead_2);
        let determinant = (curved[0] * curved[1] - mixed * mixed).max(NOTHING);
        let step = [
            (mixed * slope[1] - curved[1] * slope[0]) / determinant,
            (mixed * slope[0] - curved[0] * slope[1]) / determinant,
        ];
        out_1 = (out_1 + step[0] * ahead_1).normalize();
        out_2 = (out_2 + step[1] * ahead_2).normalize();
        if step[0].abs().max(step[1].abs()) < SETTLED {
            break;
        }
    }
    points(&out_1, &out_2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_1_SQRT_2;

    const RADIUS: f64 = 0.5;
    const HALF: f64 = 0.8;
    const NEAR: f64 = 1e-9;

    fn cylinder(centre: [f64; 3], axis: [f64; 3]) -> Cylinder {
        let (centre, axis) = (Vector3::from(centre), Vector3::from(axis).normalize());
        Cylinder { centre, axis, radius: RADIUS, half: HALF }
    }

    /// Both ways round, with the one along y at the origin: the gap, and the direction to the other.
    fn assert_apart(other: Cylinder, gap: f64, towards: [f64; 3]) {
        let one = cylinder([0.0; 3], [0.0, 1.0, 0.0]);
        let towards = Vector3::from(towards).normalize();
        for (pair, sign) in [([one, other], 1.0), ([other, one], -1.0)] {
            let Some(Nearest::Points([on_1, on_2], n)) = nearest(&pair, 9.0, NEAR) else {
                panic!("no answer for {other:?}");
            };
            assert!(((on_2 - on_1).norm() - gap).abs() < NEAR, "{on_1} {on_2} {other:?}");
            assert!((n - sign * towards).norm() < 1e-6, "{n} {other:?}");
            assert!(matches!(nearest(&pair, gap - 0.01, NEAR), Some(Nearest::Farther)));
        }
    }

    #[test]
    fn an_end_over_an_end_is_as_high_as_the_gap() {
        assert_apart(cylinder([0.3, 2.0 * HALF + 0.1, 0.2], [0.0, 1.0, 0.0]), 0.1, [0.0, 1.0, 0.0]);
        let lying = cylinder([0.2, HALF + RADIUS + 0.1, 0.0], [0.3, 0.0, 1.0]);
        assert_apart(lying, 0.1, [0.0, 1.0, 0.0]);
        let tilted =
            cylinder([0.4, HALF + (HALF + RADIUS) * FRAC_1_SQRT_2 + 0.1, 0.0], [1.0, 1.0, 0.0]);
        assert_apart(tilted, 0.1, [0.0, 1.0, 0.0]);
    }

    #[test]
    fn sides_are_as_far_apart_as_axes_less_two_radii() {
        let across = [2.0 * RADIUS + 0.1, 0.3, 0.0];
        assert_apart(cylinder(across, [0.0, 1.0, 0.0]), 0.1, [1.0, 0.0, 0.0]);
        assert_apart(cylinder(across, [0.0, 0.2, 1.0]), 0.1, [1.0, 0.0, 0.0]);
        assert_apart(cylinder(across, [0.0, 0.0, 1.0]), 0.1, [1.0, 0.0, 0.0]);
    }

    #[test]
    fn a_rim_meets_a_side_with_its_farthest_point() {
        let x = RADIUS + (HALF + RADIUS) * FRAC_1_SQRT_2 + 0.1;
        assert_apart(cylinder([x, 0.1, 0.0], [1.0, 1.0, 0.0]), 0.1, [1.0, 0.0, 0.0]);
        // Its end stands on the side.
        assert_apart(
            cylinder([RADIUS + HALF + 0.1, 0.1, 0.0], [1.0, 0.0, 0.0]),
            0.1,
            [1.0, 0.0, 0.0],
        );
    }

    #[test]
    fn rims_of_parallel_cylinders_are_corners_of_their_plane() {
        let (aside, above) = (0.06, 0.08);
        let centre = [2.0 * RADIUS + aside, 2.0 * HALF + above, 0.0];
        assert_apart(cylinder(centre, [0.0, 1.0, 0.0]), 0.1, [aside, above, 0.0]);
    }
}
