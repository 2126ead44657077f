//! Broad phase: which grains may touch before the next search.
//!
//! Every grain is a ball swept over the coming interval: centre at mid-interval, radius grown by half
//! the way it travels and by half the margin. Pairs of such balls that overlap are candidates, and those
//! that come near on their straight paths are the answer. A dense grid of cells holds the centres, x
//! fastest, so that neighbouring cells of a row are one range of slots.

mod check;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::bed::Bed;
use crate::lanes::widest;

/// Upper bound of the number of cells: clearing them must stay cheaper than the search itself.
const MAX_CELLS: f64 = 65_536.0;
/// Balls tested at once.
const CHUNK: usize = 16;
/// What rounding to single precision may hide in a grid of metres `[m]`.
const ROUNDING: f64 = 1e-6;

/// The search and its buffers.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct PairSearch {
    #[serde(skip)]
    middles: Vec<Vector3<f64>>,
    #[serde(skip)]
    reaches: Vec<f64>,
    /// Lower corner of the grid `[m]` and the width of a cell `[m]`.
    corner: [f64; 3],
    edge: f64,
    cells: [usize; 3],
    /// First slot of each cell, and the end.
    starts: Vec<u32>,
    #[serde(skip)]
    cell_of: Vec<u32>,
    /// Grains in the order of their cells.
    order: Vec<u32>,
    /// Centre from the grid's corner and grown radius, in the order of the cells; single precision for speed.
    #[serde(skip)]
    x: Vec<f32>,
    #[serde(skip)]
    y: Vec<f32>,
    #[serde(skip)]
    z: Vec<f32>,
    #[serde(skip)]
    reach: Vec<f32>,
}

impl PairSearch {
    /// Fills `found` with every pair `(i, j)`, `i < j`, of grains whose gap falls below `margin` `[m]` within
    /// `interval` `[s]` on their paths. Each pair once; the order depends on the state alone.
    pub fn pairs(
        &mut self,
        bed: &Bed,
        paths: &[Path],
        interval: f64,
        margin: f64,
        found: &mut Vec<(u32, u32)>,
    ) {
        found.clear();
        self.starts.clear();
        if bed.count() < 2 {
            return;
        }
        self.sweep_balls(bed, interval, margin);
        self.sort_into_cells();
        overlapping(self, found);
        found.retain(|&(i, j)| {
            let (i, j) = (i as usize, j as usize);
            let limit = bed.radius(i) + bed.radius(j) + margin;
            paths[i].comes_within(&paths[j], limit, interval)
        });
    }

    /// Calls `visit` for every grain whose swept ball may overlap the ball of radius `reach` `[m]` about `point`.
    pub fn around(&self, point: &Vector3<f64>, reach: f64, mut visit: impl FnMut(usize)) {
        if self.starts.is_empty() {
            return;
        }
        let reach = reach + 0.5 * self.edge;
        let [(x0, x1), (y0, y1), (z0, z1)] = [0, 1, 2].map(|axis| {
            let cell = |at: f64| {
                let cell = ((at - self.corner[axis]) / self.edge).floor();
                cell.clamp(-1.0, self.cells[axis] as f64)
            };
            let (first, last) = (cell(point[axis] - reach), cell(point[axis] + reach));
            (first.max(0.0) as usize, ((last + 1.0) as usize).min(self.cells[axis]))
        });
        for z in z0..z1 {
            for y in y0..y1 {
                let row = (z * self.cells[1] + y) * self.cells[0];
                let (first, last) = (row + x0, row + x1.max(x0));
                let slots = self.starts[first] as usize..self.starts[last] as usize;
                for &grain in &self.order[slots] {
                    visit(grain as usize);
                }
            }
        }
    }

    fn sweep_balls(&mut self, bed: &Bed, interval: f64, margin: f64) {
        self.middles.clear();
        self.reaches.clear();
        for grain in 0..bed.count() {
            let position = bed.position(grain);
            let half_way = 0.5 * interval * bed.velocity(grain);
            self.middles.push(position + half_way);
            self.reaches.push(bed.radius(grain) + half_way.norm() + 0.5 * margin + ROUNDING);
        }
    }

    /// Counting sort by cell. A cell is as wide as the two widest balls reach, so that partners are neighbours.
    fn sort_into_cells(&mut self) {
        let count = self.middles.len();
        let (mut low, mut high) = (self.middles[0], self.middles[0]);
        for middle in &self.middles {
            low = low.inf(middle);
            high = high.sup(middle);
        }
        let mut edge = 2.0 * self.reaches.iter().copied().fold(0.0, f64::max);
        let extent = high - low;
        let cells = |edge: f64| extent.iter().map(|e| (e / edge).floor() + 1.0).product::<f64>();
        // A wide, thin scatter of grains must not cost a huge grid.
        while cells(edge) > MAX_CELLS {
            edge *= 1.25;
        }
        self.cells = [0, 1, 2].map(|axis| (extent[axis] / edge) as usize + 1);
        self.corner = low.into();
        self.edge = edge;

        let total = self.cells.iter().product::<usize>();
        self.starts.clear();
        self.starts.resize(total + 1, 0);
        self.cell_of.clear();
        for middle in &self.middles {
            let [x, y, z] = [0, 1, 2].map(|axis| ((middle[axis] - low[axis]) / edge) as usize);
            let cell = (z * self.cells[1] + y) * self.cells[0] + x;
            self.cell_of.push(cell as u32);
            self.starts[cell] += 1;
        }
        let mut slots = 0;
        for start in &mut self.starts {
            slots += *start;
            *start = slots;
        }
        self.order.resize(count, 0);
        for buffer in [&mut self.x, &mut self.y, &mut self.z, &mut self.reach] {
            // A range's last chunk may read beyond the last slot: there must be something to read.
            buffer.resize(count + CHUNK, 0.0);
        }
        // Backwards, so that each start ends up at the first slot of its cell.
        for grain in (0..count).rev() {
            let start = &mut self.starts[self.cell_of[grain] as usize];
            *start -= 1;
            let slot = *start as usize;
            self.order[slot] = grain as u32;
            let from_corner = self.middles[grain] - low;
            self.x[slot] = from_corner.x as f32;
            self.y[slot] = from_corner.y as f32;
            self.z[slot] = from_corner.z as f32;
            self.reach[slot] = self.reaches[grain] as f32;
        }
    }

    /// Partners of every grain of the row of cells `(y, z)` among the slots that come after it.
    #[inline(always)]
    fn row(&self, y: usize, z: usize, found: &mut Vec<(u32, u32)>) {
        let [nx, ny, nz] = self.cells;
        let row = |y: usize, z: usize| (z * ny + y) * nx;
        // The rows that come after this one and touch it.
        let mut after = [None; 4];
        if y + 1 < ny {
            after[0] = Some(row(y + 1, z));
        }
        if z + 1 < nz {
            after[1] = (y > 0).then(|| row(y.wrapping_sub(1), z + 1));
            after[2] = Some(row(y, z + 1));
            after[3] = (y + 1 < ny).then(|| row(y + 1, z + 1));
        }
        let here = row(y, z);
        for x in 0..nx {
            let (begin, end) = (self.starts[here + x] as usize, self.starts[here + x + 1] as usize);
            let (left, right) = (x.saturating_sub(1), (x + 2).min(nx));
            let own_end = self.starts[here + right] as usize;
            for slot in begin..end {
                self.partners(slot, slot + 1, own_end, found);
                for row in after.into_iter().flatten() {
                    let (first, last) = (self.starts[row + left], self.starts[row + right]);
                    self.partners(slot, first as usize, last as usize, found);
                }
            }
        }
    }

    /// Appends the balls of `begin..end` that overlap the ball in `slot`.
    #[inline(always)]
    fn partners(&self, slot: usize, mut begin: usize, end: usize, found: &mut Vec<(u32, u32)>) {
        while begin < end {
            let mut hits = self.near(slot, begin);
            if end - begin < CHUNK {
                hits &= (1 << (end - begin)) - 1;
            }
            while hits != 0 {
                let other = begin + hits.trailing_zeros() as usize;
                hits &= hits - 1;
                let (i, j) = (self.order[slot], self.order[other]);
                found.push((i.min(j), i.max(j)));
            }
            begin += CHUNK;
        }
    }

    /// One bit for each of the balls from `begin` on that overlaps the ball in `slot`.
    #[inline(always)]
    fn near(&self, slot: usize, begin: usize) -> u32 {
        let chunk = |values: &[f32]| -> [f32; CHUNK] {
            let mut out = [0.0; CHUNK];
            out.copy_from_slice(&values[begin..begin + CHUNK]);
            out
        };
        let (x, y, z) = (chunk(&self.x), chunk(&self.y), chunk(&self.z));
        let reach = chunk(&self.reach);
        let mut bits = 0;
        for lane in 0..CHUNK {
            let (dx, dy, dz) =
                (x[lane] - self.x[slot], y[lane] - self.y[slot], z[lane] - self.z[slot]);
            let limit = reach[lane] + self.reach[slot];
            bits |= u32::from(dx * dx + dy * dy + dz * dz < limit * limit) << lane;
        }
        bits
    }
}

widest! {
    /// All pairs of overlapping swept balls, in the order of the slots.
    fn overlapping<W>(search: &PairSearch, found: &mut Vec<(u32, u32)>) {
        for z in 0..search.cells[2] {
            for y in 0..search.cells[1] {
                search.row(y, z, found);
            }
        }
    }
}

/// A grain's straight way.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(from = "[[f64; 3]; 2]", into = "[[f64; 3]; 2]")]
pub(crate) struct Path {
    pub from: Vector3<f64>,
    pub velocity: Vector3<f64>,
}

impl From<[[f64; 3]; 2]> for Path {
    fn from([from, velocity]: [[f64; 3]; 2]) -> Self {
        Self { from: from.into(), velocity: velocity.into() }
    }
}

impl From<Path> for [[f64; 3]; 2] {
    fn from(path: Path) -> Self {
        [path.from.into(), path.velocity.into()]
    }
}

impl Path {
    #[inline]
    pub fn at(&self, time: f64) -> Vector3<f64> {
        self.from + time * self.velocity
    }

    /// Whether the way comes within `limit` `[m]` of another in the next `interval` `[s]`.
    #[inline]
    pub fn comes_within(&self, other: &Self, limit: f64, interval: f64) -> bool {
        let apart = self.from - other.from;
        if apart.norm_squared() < limit * limit {
            return true;
        }
        let relative = self.velocity - other.velocity;
        let closing = -apart.dot(&relative);
        if closing <= 0.0 {
            return false;
        }
        let nearest = (closing / relative.norm_squared()).min(interval);
        (apart + nearest * relative).norm_squared() < limit * limit
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::lanes::Row;
    use crate::scene::Scene;

    fn bed(points: &[([f64; 3], [f64; 3], f64)]) -> Bed {
        let mut scene = Scene::drop(0.0);
        scene.grains.count = points.len();
        let mut bed = Bed::new(&scene, 0);
        for (i, (position, velocity, radius)) in points.iter().enumerate() {
            bed.places[i] = Row::new(&(*position).into(), *radius);
            bed.bodies[i].velocity = Row::new(&(*velocity).into(), 0.0);
        }
        bed
    }

    fn brute_force(bed: &Bed, interval: f64, margin: f64) -> Vec<(u32, u32)> {
        let pairs = (0..bed.count()).flat_map(|i| (i + 1..bed.count()).map(move |j| (i, j)));
        pairs
            .filter(|&(i, j)| {
                let path =
                    |grain| Path { from: bed.position(grain), velocity: bed.velocity(grain) };
                let limit = bed.radius(i) + bed.radius(j) + margin;
                path(i).comes_within(&path(j), limit, interval)
            })
            .map(|(i, j)| (i as u32, j as u32))
            .collect()
    }

    proptest! {
        #[test]
        fn finds_every_pair_once(points in proptest::collection::vec(
            (prop::array::uniform3(-0.03f64..0.03), prop::array::uniform3(-3f64..3.0), 0.0005f64..0.004), 0..120),
            interval in 0f64..0.004, far in 0f64..3.0) {
            let mut bed = bed(&points);
            bed.places[0].0[0] += far; // one grain far out stretches the grid
            let mut pairs = Vec::new();
            let paths: Vec<Path> = (0..bed.count())
                .map(|i| Path { from: bed.position(i), velocity: bed.velocity(i) })
                .collect();
            PairSearch::default().pairs(&bed, &paths, interval, 0.0005, &mut pairs);
            pairs.sort_unstable();
            prop_assert_eq!(pairs, brute_force(&bed, interval, 0.0005));
        }
    }
}
