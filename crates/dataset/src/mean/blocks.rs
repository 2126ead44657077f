//! Whether an image is of another view than the mean of those before it, told block by block.

/// Blocks of one view, but for a few, differ by less than so many metres, or robust standard deviations of what all
/// blocks of the image do: that is the camera's noise, which grows with the square of the depth. Two frames of a D435
/// at 1.5 m have 2 of 1142 blocks beyond, another pour of 2000 grains at 0.3 m has 125 of 900.
const OFF: f64 = 1e-3;
const DEVIATIONS: f64 = 6.0;
/// Where all of the image, or one side of it, is nearer than this `[-]`, or farther, the camera was moved or turned:
/// noise goes both ways.
const MOVED: f64 = 0.01;
/// Standard deviations in a median of absolute values.
const OF_MEDIAN: f64 = 1.4826;

/// A block of an image beside the mean of those before it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block {
    /// Its middle from the image's, over width and height, -1/2 to 1/2 `[-]`.
    pub(super) x: f64,
    pub(super) y: f64,
    /// Mean depth `[m]`, and how much farther the image is, over it `[-]`.
    pub(super) depth: f64,
    pub(super) share: f64,
}

/// How many blocks are off by more than noise. What a camera that was lowered or turned does to all of them, a shift
/// and a slope across the image, is no noise: it is taken off before that is told, by medians, which heaps do not move.
pub(super) fn count_off(blocks: &[Block]) -> usize {
    let slope = |of: fn(&Block) -> f64| {
        let (after, before): (Vec<Block>, Vec<Block>) =
            blocks.iter().copied().partition(|block| of(block) > 0.0);
        let share = |half: &[Block]| median(half.iter().map(|block| block.share));
        // The middles of the halves are half an image apart.
        2.0 * (share(&after) - share(&before))
    };
    let (along_x, along_y) = (slope(|block| block.x), slope(|block| block.y));
    let tilted = |block: &Block| block.share - along_x * block.x - along_y * block.y;
    let shift = median(blocks.iter().map(tilted));
    let left = |block: &Block| tilted(block) - shift;
    let scatter = OF_MEDIAN * median(blocks.iter().map(|block| left(block).abs()));
    // At the image's edge. Noise that large parts of the image share makes some of it.
    if shift.abs() + 0.5 * along_x.hypot(along_y) > MOVED.max(scatter) {
        return blocks.iter().filter(|block| block.share.abs() > MOVED).count();
    }
    let noise = OF_MEDIAN * median(blocks.iter().map(|block| left(block).abs() / block.depth));
    let is_off = |block: &&Block| {
        let depth = block.depth;
        left(block).abs() * depth > OFF.max(DEVIATIONS * noise * depth * depth)
    };
    blocks.iter().filter(is_off).count()
}

/// The median, the upper one of two; 0 of nothing.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    let middle = values.len() / 2;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
}
