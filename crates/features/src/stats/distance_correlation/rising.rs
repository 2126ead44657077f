//! The sum of products of differences over the pairs in which y rises with x.
//!
//! \\( \sum_{i<j} |x_j - x_i| |y_j - y_i| \\) differs from the sum without bars, which is a product of
//! sums, only where y falls: it is twice the sum over rising pairs less the sum without bars.

/// Points of a block within which every pair is examined: 500 products in vector registers cost less
/// than the five partings that they replace.
const BLOCK: usize = 32;
/// Running sums side by side.
const LANES: usize = 8;

/// One point: its places in the orders of x and of y.
#[derive(Debug, Clone, Copy, Default)]
struct Point {
    x_rank: u32,
    y_rank: u32,
    /// Points of low rank before it when it was last parted.
    low_before: u32,
}

/// Both variables in ascending order.
#[derive(Clone, Copy)]
struct Values<'a> {
    x: &'a [f64],
    y: &'a [f64],
}

impl Values<'_> {
    #[inline(always)]
    fn of(&self, point: &Point) -> (f64, f64) {
        (self.x[point.x_rank as usize], self.y[point.y_rank as usize])
    }
}

/// \\( \sum (x_j - x_i)(y_j - y_i) \\) over the pairs with x_i ≤ x_j and y_i ≤ y_j, for two variables in
/// ascending order and the rank in y of each point in the order of x.
///
/// The points are parted by the highest bit of their rank in y, which keeps the order of x on both
/// sides, then each half by the next bit, until blocks are left; parted pairs are counted as they part.
/// The positions of a part are its ranks, so parting needs no comparison and no branch.
pub(super) fn rising(x: &[f64], y: &[f64], y_ranks: &[u32]) -> f64 {
    let values = Values { x, y };
    let point = |(x_rank, &y_rank)| Point { x_rank, y_rank, low_before: 0 };
    let mut points: Vec<_> = (0..).zip(y_ranks).map(point).collect();
    let mut parted = points.clone();
    let mut sums = Vec::new();
    let mut total = 0.0;
    let mut half = points.len().next_power_of_two() / 2;
    while half >= BLOCK {
        for (from, to) in points.chunks(2 * half).zip(parted.chunks_mut(2 * half)) {
            if from.len() > half {
                part(from, half, to);
                total += rising_between(values, to.split_at(half), &mut sums);
            } else {
                to.copy_from_slice(from);
            }
        }
        std::mem::swap(&mut points, &mut parted);
        half /= 2;
    }
    let within_blocks =
        || points.chunks(BLOCK).map(|block| rising_in_block(values, block)).sum::<f64>();
    // The widest registers of the machine: no step is fused, so the bits are the same on all.
    total + pulp::Arch::new().dispatch(within_blocks)
}

/// Moves the `half` points of low rank before the others.
fn part(from: &[Point], half: usize, to: &mut [Point]) {
    let bit = half.trailing_zeros();
    let mut low = 0;
    for (i, point) in from.iter().enumerate() {
        let is_high = (point.y_rank >> bit) & 1;
        let place = std::hint::select_unpredictable(is_high == 1, half + i - low, low);
        to[place] = Point { low_before: low as u32, ..*point };
        low += 1 - is_high as usize;
    }
}

/// Sums over the first few low points: of x, of y, of x y.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    x: f64,
    y: f64,
    xy: f64,
}

/// The sum over pairs of a low point and a high one after it in x.
fn rising_between(
    values: Values,
    (lows, highs): (&[Point], &[Point]),
    sums: &mut Vec<Sums>,
) -> f64 {
    let mut before = Sums::default();
    sums.clear();
    sums.push(before);
    sums.extend(lows.iter().map(|low| {
        let (x, y) = values.of(low);
        before.x += x;
        before.y += y;
        before.xy += x * y;
        before
    }));
    let mut total = 0.0;
    for high in highs {
        let ((x, y), before) = (values.of(high), &sums[high.low_before as usize]);
        total += x * (f64::from(high.low_before) * y - before.y) - (y * before.x - before.xy);
    }
    total
}

/// The same sum over all pairs of a few points, in any order.
#[inline(always)]
fn rising_in_block(values: Values, block: &[Point]) -> f64 {
    // NaN is not above 0: places without a point add nothing.
    let (mut x, mut y) = ([f64::NAN; BLOCK], [f64::NAN; BLOCK]);
    for (i, point) in block.iter().enumerate() {
        (x[i], y[i]) = values.of(point);
    }
    let (x_rows, y_rows) = (x.as_chunks::<LANES>().0, y.as_chunks::<LANES>().0);
    let mut lanes = [0.0; LANES];
    for i in 0..block.len() {
        for row in i / LANES..block.len().div_ceil(LANES) {
            // Pairs within a row of lanes are met twice, from both of their ends.
            let weight = if row == i / LANES { 0.5 } else { 1.0 };
            for lane in 0..LANES {
                let product = (x_rows[row][lane] - x[i]) * (y_rows[row][lane] - y[i]);
                lanes[lane] += if product > 0.0 { weight * product } else { 0.0 };
            }
        }
    }
    lanes.iter().sum()
}
