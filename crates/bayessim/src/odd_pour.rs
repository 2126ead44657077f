//! Is one of several pours another than the rest?
//!
//! A wrong recording among ten moves their mean by a tenth of what is wrong with it, which a test of the mean, or of
//! how much all differ, need not see. With `y_i` the pours on axes of uncorrelated noise and `s_j` the noise at the
//! fit,
//!
//! ```text
//! d_i = k / (k - 1) sum_j (y_ij - mean_j)^2 / s_j^2
//! ```
//!
//! is the squared distance of pour i from the mean of the others, in units of its noise. The largest is ranked among
//! those of as many held-out residuals, and so is its share of all: pours that all differ by more than the model's have
//! a noise of their own, and none is odd.

use std::fmt;

use crate::matrix::Matrix;
use crate::random::Random;

const DRAWS: usize = 2000;
/// Pours from which on one can be odd: two are as far from each other.
const LEAST_POURS: usize = 3;
/// A pour that is one of them is called odd as often as this.
const SIGNIFICANCE: f64 = 0.002;
/// The same of its share alone.
const OF_SHARE: f64 = 0.01;

/// A pour that lies farther from the others than pours of one material do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OddPour {
    /// Its number, from 1.
    pub number: usize,
    /// Its distance from the mean of the others over that of a pour of the same material.
    pub times: f64,
    /// Chance of a distance as large, if all are of one material.
    pub p_value: f64,
}

impl fmt::Display for OddPour {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { number, times, p_value } = self;
        write!(
            f,
            "Pour {number} is odd: it lies {times:.1} times as far from the others as pours of one material do (p = \
             {p_value:.4}). Is it one of them?"
        )
    }
}

impl OddPour {
    /// The odd one of pours `y`, if there is one; `noise` is the variance of each axis at the fit, `own_noise` what
    /// held-out pours have in units of its standard deviation.
    pub(crate) fn among(y: &[Vec<f64>], noise: &[f64], own_noise: &Matrix) -> Option<Self> {
        if y.len() < LEAST_POURS {
            return None;
        }
        let unit = |row: &Vec<f64>| row.iter().zip(noise).map(|(y, s)| y / s.sqrt()).collect();
        let found = Farthest::of(&y.iter().map(unit).collect::<Vec<Vec<f64>>>());
        let mut random = Random::new(0);
        let mut draw = || {
            let row = |_| own_noise.row(random.below(own_noise.rows())).to_vec();
            Farthest::of(&(0..y.len()).map(row).collect::<Vec<_>>())
        };
        let null: Vec<_> = (0..DRAWS).map(|_| draw()).collect();
        let p_of = |value: fn(&Farthest) -> f64| {
            let beyond = null.iter().filter(|draw| value(draw) >= value(&found)).count();
            (1 + beyond) as f64 / (1 + DRAWS) as f64
        };
        let p_value = p_of(|farthest| farthest.square);
        if p_value > SIGNIFICANCE || p_of(Farthest::share) > OF_SHARE {
            return None;
        }
        let usual = null.iter().map(|draw| draw.all).sum::<f64>() / (DRAWS * y.len()) as f64;
        Some(Self { number: found.row + 1, times: (found.square / usual).sqrt(), p_value })
    }
}

/// The row that lies farthest from the mean of the others.
struct Farthest {
    row: usize,
    /// Squared distance, and the sum of those of all rows.
    square: f64,
    all: f64,
}

impl Farthest {
    fn of(rows: &[Vec<f64>]) -> Self {
        let count = rows.len() as f64;
        let mean = |j: usize| rows.iter().map(|row| row[j]).sum::<f64>() / count;
        let mean: Vec<_> = (0..rows[0].len()).map(mean).collect();
        let square = |row: &Vec<f64>| {
            let of_mean = row.iter().zip(&mean).map(|(y, mean)| (y - mean).powi(2)).sum::<f64>();
            count / (count - 1.0) * of_mean
        };
        let squares: Vec<f64> = rows.iter().map(square).collect();
        let farthest = squares.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
        let (row, &square) = farthest.expect("there are rows");
        Self { row, square, all: squares.iter().sum() }
    }

    fn share(&self) -> f64 {
        self.square / self.all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn normal(rows: usize, columns: usize, random: &mut Random) -> Matrix {
        Matrix { data: (0..rows * columns).map(|_| random.normal()).collect(), columns }
    }

    #[test]
    fn one_of_ten_is_odd_and_ten_of_a_wider_noise_are_not() {
        let mut random = Random::new(7);
        let own_noise = normal(600, 8, &mut random);
        let noise = [0.25; 8];
        let pours = |sd: f64, random: &mut Random| -> Vec<Vec<f64>> {
            (0..10).map(|_| (0..8).map(|_| sd * random.normal()).collect()).collect()
        };
        let (mut false_alarms, mut named, mut of_wider) = (0, 0, 0);
        for set in 0..200 {
            let mut seen = pours(0.5, &mut random);
            false_alarms += usize::from(OddPour::among(&seen, &noise, &own_noise).is_some());
            // 7 standard deviations along one axis.
            seen[set % 10][set % 8] += 3.5;
            let odd = OddPour::among(&seen, &noise, &own_noise);
            named += usize::from(odd.is_some_and(|odd| odd.number == set % 10 + 1));
            let wider = pours(1.0, &mut random);
            of_wider += usize::from(OddPour::among(&wider, &noise, &own_noise).is_some());
        }
        assert!(false_alarms <= 3, "{false_alarms} of 200");
        assert!(named >= 150, "{named} of 200");
        assert!(of_wider <= 8, "{of_wider} of 200");
    }

    #[test]
    fn of_two_pours_none_is_odd() {
        let own_noise = normal(100, 2, &mut Random::new(1));
        assert_eq!(OddPour::among(&[vec![0.0; 2], vec![9.0; 2]], &[1.0; 2], &own_noise), None);
    }
}
