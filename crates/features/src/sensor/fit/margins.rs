//! How far holes reach beyond the jump of the disparity, from frames that show depth edges.

use super::flat::median;
use super::frames::FlatFrames;

/// Least jump of the disparity `[px]` that makes an edge.
const LEAST_JUMP: f64 = 2.0;
/// Edges below which the margin is not believed.
const LEAST_EDGES: usize = 30;

/// Margins of the holes of a stereo camera.
pub(super) struct Margins {
    /// Width of a hole at a nearer surface on its right, less the jump `[px]`.
    pub(super) edge: f64,
    /// Holes that decided it.
    pub(super) edge_holes: usize,
    /// First column with data, less its disparity `[px]`.
    pub(super) left: f64,
}

/// The margins of frames of disparities; 0 where the frames do not show them.
pub(super) fn of_holes(frames: &FlatFrames) -> Margins {
    let (mut excesses, mut lefts, mut rows) = (Vec::new(), Vec::new(), 0);
    for row in frames.values.iter().flat_map(|values| values.chunks_exact(frames.width)) {
        rows += 1;
        let mut last: Option<(usize, f64)> = None;
        for (u, &disparity) in row.iter().enumerate().filter(|(_, d)| d.is_finite()) {
            match last {
                None if u > 0 => lefts.push(u as f64 - disparity),
                Some((before, farther)) if u > before + 1 => {
                    let (width, jump) = ((u - before - 1) as f64, disparity - farther);
                    if jump > LEAST_JUMP {
                        excesses.push(width - jump);
                    }
                }
                _ => {}
            }
            last = Some((u, disparity));
        }
    }
    let edge_holes = excesses.len();
    Margins {
        edge: if edge_holes < LEAST_EDGES { 0.0 } else { median(&mut excesses).max(0.0) },
        edge_holes: if edge_holes < LEAST_EDGES { 0 } else { edge_holes },
        left: if 2 * lefts.len() < rows { 0.0 } else { median(&mut lefts).max(0.0) },
    }
}
