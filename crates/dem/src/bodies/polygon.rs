//! What two faces share: a parallelogram within a rectangle.
//!
//! Each edge of the parallelogram is cut to what of it is between both pairs of sides (Liang and Barsky, 1984); the
//! corners of what is shared are the ends of these parts, and those corners of the rectangle that are in the
//! parallelogram. All twelve are worked out and those that count are kept, which leaves a processor nothing to guess.

/// How far a corner of the rectangle is within the parallelogram, over its half edges: what is nearer to an edge is no
/// other than that edge's end `[-]`.
const WITHIN: f64 = 1.0 - 1e-9;

/// Corners of a convex polygon; with each two coordinates a number that is linear in its place.
pub(super) struct Corners {
    all: [[f64; 3]; 13],
    count: usize,
}

impl Corners {
    /// Of what the parallelogram about `middle` with these half edges and the rectangle of these half edges about the
    /// origin share.
    pub fn shared(middle: [f64; 3], [p, q]: [[f64; 3]; 2], half: [f64; 2]) -> Self {
        let mut corners = Self { all: [[0.0; 3]; 13], count: 0 };
        let at = |s: f64, t: f64| along(&along(&middle, s, &p), t, &q);
        let whole = |edge: [f64; 3]| [0, 1].map(|axis| 0.5 / edge[axis]);
        let (of_p, of_q) = (whole(p), whole(q));
        let edges = [
            (1.0, 1.0, -1.0, &p, &of_p),
            (-1.0, 1.0, -1.0, &q, &of_q),
            (-1.0, -1.0, 1.0, &p, &of_p),
            (1.0, -1.0, 1.0, &q, &of_q),
        ];
        for (s, t, sign, edge, inverse) in edges {
            let from = at(s, t);
            let scale = 2.0 * sign;
            let [one, other] =
                [0, 1].map(|axis| between(from[axis], sign * inverse[axis], half[axis]));
            let (enters, leaves) = (one.0.max(other.0).max(0.0), one.1.min(other.1).min(1.0));
            corners.add(enters <= leaves, along(&from, enters * scale, edge));
            corners.add(enters < leaves && leaves < 1.0, along(&from, leaves * scale, edge));
        }
        let inverse = 1.0 / (p[0] * q[1] - p[1] * q[0]);
        for (s, t) in [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)] {
            let corner = [s * half[0], t * half[1]];
            let offset = [corner[0] - middle[0], corner[1] - middle[1]];
            let a = inverse * (offset[0] * q[1] - offset[1] * q[0]);
            let b = inverse * (p[0] * offset[1] - p[1] * offset[0]);
            let height = middle[2] + a * p[2] + b * q[2];
            corners.add(a.abs() < WITHIN && b.abs() < WITHIN, [corner[0], corner[1], height]);
        }
        corners
    }

    pub fn all(&self) -> &[[f64; 3]] {
        &self.all[..self.count]
    }

    /// Keeps a corner if it counts.
    #[inline(always)]
    fn add(&mut self, counts: bool, corner: [f64; 3]) {
        self.all[self.count] = corner;
        self.count += usize::from(counts);
    }
}

/// `from + share * way`.
#[inline(always)]
fn along(from: &[f64; 3], share: f64, way: &[f64; 3]) -> [f64; 3] {
    [from[0] + share * way[0], from[1] + share * way[1], from[2] + share * way[2]]
}

/// Between which shares of a way, given by its reciprocal, what begins at `from` is no farther than `half` from 0.
#[inline(always)]
fn between(from: f64, inverse: f64, half: f64) -> (f64, f64) {
    if inverse.is_infinite() {
        let is_in = from.abs() <= half;
        return if is_in {
            (f64::NEG_INFINITY, f64::INFINITY)
        } else {
            (f64::INFINITY, f64::NEG_INFINITY)
        };
    }
    let (low, high) = ((-half - from) * inverse, (half - from) * inverse);
    (low.min(high), low.max(high))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_on_its_corner_shares_an_octagon() {
        // Corners at 1.2 along either axis; the height is y / 1.2.
        let shared = Corners::shared([0.0; 3], [[0.6, 0.6, 0.5], [-0.6, 0.6, 0.5]], [1.0, 1.0]);
        assert_eq!(shared.all().len(), 8);
        for &[x, y, height] in shared.all() {
            assert!((x.abs() + y.abs() - 1.2).abs() < 1e-12 && x.abs().max(y.abs()) < 1.0 + 1e-12);
            assert!((height - y / 1.2).abs() < 1e-12);
        }
    }

    #[test]
    fn equal_faces_share_their_corners_once() {
        for turned in [0.0, 1e-17, -1e-17, 1e-13, -1e-13] {
            let edges = [[1.0, turned, 0.0], [-turned, 1.0, 0.0]];
            let shared = Corners::shared([0.0; 3], edges, [1.0, 1.0]);
            // Where one is turned, sides cross in their middles, too.
            assert!((4..=8).contains(&shared.all().len()), "{turned}: {:?}", shared.all());
            for corner in [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]] {
                let is_there =
                    |of: &[f64; 3]| (of[0] - corner[0]).abs() + (of[1] - corner[1]).abs() < 1e-12;
                assert_eq!(shared.all().iter().filter(|of| is_there(of)).count(), 1, "{turned}");
            }
        }
    }

    #[test]
    fn the_corners_of_a_face_in_another_are_its_own() {
        let shared =
            Corners::shared([0.2, 0.1, 0.3], [[3.0, 0.0, 0.0], [0.5, 4.0, 0.4]], [1.0, 1.0]);
        assert_eq!(shared.all().len(), 4);
        // On the plane through the parallelogram: 0.1 of the second axis.
        assert!(shared.all().iter().all(|of| (of[2] - 0.3 - 0.1 * (of[1] - 0.1)).abs() < 1e-12));
    }

    #[test]
    fn what_is_beyond_a_side_shares_nothing() {
        let shared =
            Corners::shared([2.5, 0.5, 0.0], [[0.5, 0.0, 0.0], [0.0, 0.5, 0.0]], [1.0, 1.0]);
        assert!(shared.all().is_empty());
    }
}
