//! Cosines and sines of random frequencies, so many side by side as the processor takes.

use std::f64::consts::TAU;

use crate::matrix::Matrix;

/// Added and taken away again it leaves the nearest whole number.
const ROUND: f64 = 6_755_399_441_055_744.0;

/// Frequencies over p inputs.
#[derive(Clone, Debug)]
pub struct Waves {
    count: usize,
    /// For each input what all frequencies multiply it with [turns per unit].
    turns: Vec<f64>,
}

impl Waves {
    /// Of one frequency a row.
    pub fn of(frequencies: &Matrix) -> Self {
        let count = frequencies.rows();
        let column = |i: usize| (0..count).map(move |k| frequencies.row(k)[i] / TAU);
        Self { count, turns: (0..frequencies.columns).flat_map(column).collect() }
    }

    /// Number of cosines and sines.
    pub fn size(&self) -> usize {
        2 * self.count
    }

    /// All cosines at `v`, then all sines, `size` times.
    #[inline(always)]
    pub fn fill(&self, v: &[f64], size: f64, waves: &mut [f64]) {
        let (cosines, sines) = waves.split_at_mut(self.count);
        sines.fill(0.0);
        for (v, turns) in v.iter().zip(self.turns.chunks_exact(self.count.max(1))) {
            for (sum, turn) in sines.iter_mut().zip(turns) {
                *sum += v * turn;
            }
        }
        for (cosine, sine) in cosines.iter_mut().zip(sines) {
            (*sine, *cosine) = sin_cos(*sine);
            *sine *= size;
            *cosine *= size;
        }
    }
}

/// Terms of each series: 13 digits over half a turn.
const TERMS: usize = 10;
const SINE: [f64; TERMS] = series(1.0);
const COSINE: [f64; TERMS] = series(0.0);

/// Coefficients of Taylor's series in the square, the highest first: `(-1)^k / (2 k + offset)!`.
const fn series(offset: f64) -> [f64; TERMS] {
    let mut terms = [1.0; TERMS];
    let mut k = 1;
    while k < TERMS {
        let last = 2.0 * k as f64 + offset;
        terms[TERMS - 1 - k] = -terms[TERMS - k] / (last * (last - 1.0));
        k += 1;
    }
    terms
}

/// Sine and cosine of so many turns, without a branch.
#[inline(always)]
fn sin_cos(turns: f64) -> (f64, f64) {
    let halves = (2.0 * turns + ROUND) - ROUND;
    let x = TAU * (turns - 0.5 * halves);
    let odd = halves - 2.0 * ((0.5 * halves + ROUND) - ROUND);
    let sign = 1.0 - 2.0 * odd * odd;
    let square = x * x;
    let (mut sine, mut cosine) = (SINE[0], COSINE[0]);
    for k in 1..TERMS {
        sine = SINE[k] + square * sine;
        cosine = COSINE[k] + square * cosine;
    }
    (sign * x * sine, sign * cosine)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_are_those_of_the_standard_library() {
        let data = (0..21).map(|i| 3.7 * f64::from(i) - 40.0).collect();
        let frequencies = Matrix { data, columns: 3 };
        let waves = Waves::of(&frequencies);
        let v = [0.3, -1.2, 2.5];
        let mut found = vec![0.0; waves.size()];
        waves.fill(&v, 2.0, &mut found);
        for k in 0..7 {
            let phase: f64 = frequencies.row(k).iter().zip(v).map(|(f, v)| f * v).sum();
            assert!((found[k] - 2.0 * phase.cos()).abs() < 1e-13, "{phase}");
            assert!((found[7 + k] - 2.0 * phase.sin()).abs() < 1e-13, "{phase}");
        }
    }
}
