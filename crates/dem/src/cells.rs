//! Pairs of places that are near each other, found by cells.

use nalgebra::Vector3;

/// Cells along an axis at most, and how many of them are left free at its ends: what would look for pairs farther than
/// these looks at all bodies.
const MOST_CELLS: u64 = 1 << 21;
const MARGIN: u64 = 8;

/// Gives each pair of places, the lower number first, that are no farther from each other than `base` and what both are
/// allowed. Cells are as wide as `slow`, in which all are found of those that are allowed little; and are sorted: a row
/// of them along z is one range.
pub(crate) fn pairs_within(
    centres: &[Vector3<f64>],
    allowed: &[f64],
    base: f64,
    slow: f64,
    mut found: impl FnMut(u32, u32),
) {
    let low = centres.iter().fold(Vector3::repeat(f64::MAX), |low, centre| low.inf(centre));
    // Far beyond any scene all are of one cell, whose neighbours still have numbers.
    let place_of = |centre: &Vector3<f64>| {
        <[f64; 3]>::from((centre - low) / slow)
            .map(|c| (c as u64).min(MOST_CELLS - 2 * MARGIN) + MARGIN)
    };
    let cell_of = |centre: &Vector3<f64>| {
        let [x, y, z] = place_of(centre);
        cell(x, y, z)
    };
    let mut cells: Vec<_> = centres.iter().map(cell_of).zip(0_u32..).collect();
    cells.sort_unstable();
    let sorted: Vec<_> =
        cells.iter().map(|&(_, i)| (centres[i as usize], allowed[i as usize])).collect();
    let is_slow = |allowed: f64| base + 2.0 * allowed <= slow;
    for (at, &(of_i, i)) in cells.iter().enumerate() {
        let (centre, mine) = sorted[at];
        let mut look = |from: usize, last: u64, is_mine: &dyn Fn(u32, f64) -> bool| {
            let ahead = cells[from..].iter().zip(&sorted[from..]);
            for (&(_, j), (other, theirs)) in ahead.take_while(|(slot, _)| slot.0 <= last) {
                let within = base + mine + theirs;
                if (other - centre).norm_squared() <= within * within && is_mine(j, *theirs) {
                    found(i.min(j), i.max(j));
                }
            }
        };
        if is_slow(mine) {
            let both = |_, theirs| is_slow(theirs);
            // What comes after it in the order: its own row, and those ahead.
            look(at + 1, of_i + 1, &both);
            let (along_y, along_x) = (cell(0, 1, 0), cell(1, 0, 0));
            for row in
                [of_i + along_y, of_i + along_x - along_y, of_i + along_x, of_i + along_x + along_y]
            {
                look(cells.partition_point(|slot| slot.0 < row - 1), row + 1, &both);
            }
        } else {
            // Of two that are not slow the one that is allowed more finds the other.
            let more = |j: u32, theirs: f64| (theirs, j) < (mine, i);
            let cells_away = (base + 2.0 * mine) / slow;
            if cells_away >= MARGIN as f64 {
                look(0, u64::MAX, &more);
                continue;
            }
            let (away, [x, y, z]) = (cells_away as u64 + 1, place_of(&centre));
            for x in x - away..=x + away {
                for y in y - away..=y + away {
                    let (first, last) = (cell(x, y, z - away), cell(x, y, z + away));
                    look(cells.partition_point(|slot| slot.0 < first), last, &more);
                }
            }
        }
    }
}

/// The number of a cell: in the order of x, then y, then z.
fn cell(x: u64, y: u64, z: u64) -> u64 {
    (x * MOST_CELLS + y) * MOST_CELLS + z
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Each pair once that is as near as it must be, whether its bodies are allowed little, much or very much.
        #[test]
        fn all_pairs_are_found_once(
            centres in prop::collection::vec(prop::array::uniform3(-4.0..4.0_f64), 1..60),
            allowed in prop::collection::vec(prop_oneof![0.0..0.2_f64, 0.2..2.0_f64, Just(0.5), Just(30.0)], 60),
            base in 0.1..1.0_f64,
        ) {
            let centres: Vec<Vector3<f64>> = centres.into_iter().map(Vector3::from).collect();
            let mut found = Vec::new();
            pairs_within(&centres, &allowed[..centres.len()], base, base + 0.4, |i, j| found.push((i, j)));
            found.sort_unstable();
            let is_near = |i: usize, j: usize| {
                let within = base + allowed[i] + allowed[j];
                (centres[i] - centres[j]).norm_squared() <= within * within
            };
            let pairs = (0..centres.len()).flat_map(|i| (i + 1..centres.len()).map(move |j| (i, j)));
            let near = pairs.filter(|&(i, j)| is_near(i, j)).map(|(i, j)| (i as u32, j as u32));
            // Sums in another order may round otherwise at the very edge, which no drawn pair is at.
            prop_assert_eq!(found, near.collect::<Vec<_>>());
        }
    }
}
