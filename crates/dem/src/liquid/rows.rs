//! A system of equations of which each knows itself and its neighbours.

/// Rows of a tridiagonal system, those of circles.
pub(super) struct Rows {
    /// With the circle inside, with itself and with the one outside.
    entries: Vec<[f64; 3]>,
    /// The right side.
    pub acts: Vec<f64>,
}

impl Rows {
    pub fn new(count: usize) -> Self {
        Self { entries: vec![[0.0; 3]; count], acts: vec![0.0; count] }
    }

    /// Adds to the entry of a row with itself or a neighbour.
    pub fn add(&mut self, row: usize, with: usize, value: f64) {
        self.entries[row][1 + with - row] += value;
    }

    /// The solution, by elimination; 0 in rows of no mass.
    pub fn solve(mut self, mass: &[f64]) -> Vec<f64> {
        let count = self.entries.len();
        for (row, &mass) in mass.iter().enumerate() {
            if mass == 0.0 {
                (self.entries[row], self.acts[row]) = ([0.0, 1.0, 0.0], 0.0);
            }
        }
        for row in 1..count {
            let share = self.entries[row][0] / self.entries[row - 1][1];
            self.entries[row][1] -= share * self.entries[row - 1][2];
            self.acts[row] -= share * self.acts[row - 1];
        }
        let mut beyond = 0.0;
        for row in (0..count).rev() {
            beyond = (self.acts[row] - self.entries[row][2] * beyond) / self.entries[row][1];
            self.acts[row] = beyond;
        }
        self.acts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_solved_solves_the_rows() {
        let mut rows = Rows::new(3);
        for (row, with, value) in [
            (0, 0, 2.0),
            (0, 1, -1.0),
            (1, 0, -0.5),
            (1, 1, 3.0),
            (1, 2, 1.0),
            (2, 1, 0.2),
            (2, 2, 1.5),
        ] {
            rows.add(row, with, value);
        }
        rows.acts = vec![1.0, -2.0, 0.5];
        let found = rows.solve(&[1.0; 3]);
        let left = [
            2.0 * found[0] - found[1] - 1.0,
            -0.5 * found[0] + 3.0 * found[1] + found[2] + 2.0,
            0.2 * found[1] + 1.5 * found[2] - 0.5,
        ];
        assert!(left.iter().all(|left| left.abs() < 1e-14), "{left:?}");
    }
}
