//! A convex polygon in a plane, cut to a rectangle: what two faces share.

/// A convex polygon of eight corners at most; with each two coordinates a number that is linear in its place.
pub(super) struct Polygon {
    corners: [[f64; 3]; 8],
    count: usize,
}

impl Polygon {
    pub fn of([a, b, c, d]: [[f64; 3]; 4]) -> Self {
        let none = [0.0; 3];
        Self { corners: [a, b, c, d, none, none, none, none], count: 4 }
    }

    pub fn corners(&self) -> &[[f64; 3]] {
        &self.corners[..self.count]
    }

    /// What is within the rectangle of these half edges about the origin: one side after the other cuts off what is
    /// beyond it (Sutherland and Hodgman, 1974).
    pub fn within(mut self, half: [f64; 2]) -> Self {
        for (axis, half) in half.into_iter().enumerate() {
            for side in [1.0, -1.0] {
                self.cut(|corner| half - side * corner[axis]);
            }
        }
        self
    }

    /// Cuts off what is less than 0.
    fn cut(&mut self, inside: impl Fn(&[f64; 3]) -> f64) {
        let (from, count) = (self.corners, self.count);
        let mut depths = [0.0; 8];
        for (depth, corner) in depths.iter_mut().zip(self.corners()) {
            *depth = inside(corner);
        }
        if depths[..count].iter().all(|depth| *depth >= 0.0) {
            return;
        }
        self.count = 0;
        for number in 0..count {
            let next = if number + 1 < count { number + 1 } else { 0 };
            let (in_a, in_b) = (depths[number], depths[next]);
            if in_a >= 0.0 {
                self.add(from[number]);
            }
            if (in_a >= 0.0) != (in_b >= 0.0) {
                let (a, b, share) = (from[number], from[next], in_a / (in_a - in_b));
                self.add(std::array::from_fn(|c| a[c] + share * (b[c] - a[c])));
            }
        }
    }

    /// A corner more; a side can add one only, but for rounding, which can add none that says anything new.
    fn add(&mut self, corner: [f64; 3]) {
        if self.count < self.corners.len() {
            self.corners[self.count] = corner;
            self.count += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_on_its_corner_shares_an_octagon() {
        let corners = [[1.2, 0.0, 0.0], [0.0, 1.2, 1.0], [-1.2, 0.0, 0.0], [0.0, -1.2, -1.0]];
        let shared = Polygon::of(corners).within([1.0, 1.0]);
        assert_eq!(shared.corners().len(), 8);
        for &[x, y, height] in shared.corners() {
            assert!((x.abs() + y.abs() - 1.2).abs() < 1e-12 && x.abs().max(y.abs()) < 1.0 + 1e-12);
            assert!((height - y / 1.2).abs() < 1e-12);
        }
    }

    #[test]
    fn what_is_beyond_a_side_shares_nothing() {
        let aside = [[2.0, 0.0, 0.0], [3.0, 0.0, 0.0], [3.0, 1.0, 0.0], [2.0, 1.0, 0.0]];
        assert!(Polygon::of(aside).within([1.0, 1.0]).corners().is_empty());
    }
}
