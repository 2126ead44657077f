//! Broad phase: which grains may touch before the next search.
//!
//! Every grain is a ball swept over the coming interval: centre at mid-interval, radius grown by half
//! the way it travels and by half the margin. Pairs of such balls that overlap are candidates, and those
//! that come near on their straight paths are the answer. A dense grid of cells holds the centres, x
//! fastest, so that neighbouring cells of a row are one range of slots. A ball much wider than the others would make
//! all cells as wide as itself: it is in none, and is asked for what lies around it.

mod check;

use std::ops::Range;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::lanes::widest;
use crate::parallel::Threads;
use crate::particles::Particles;
use crate::path::{Ball, Path, Reach};
use crate::period::Period;

/// Upper bound of the number of cells: clearing them must stay cheaper than the search itself.
const MAX_CELLS: f64 = 65_536.0;
/// A grain wider than this in mean radii is in no cell `[-]`.
const WIDE: f64 = 4.0;
/// Balls tested at once.
const CHUNK: usize = 16;
/// Rows of cells that a thread takes at once.
const ROWS: usize = if cfg!(test) { 4 } else { 64 };

/// The search and its buffers.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct PairSearch {
    #[serde(skip)]
    middles: Vec<Vector3<f64>>,
    #[serde(skip)]
    reaches: Vec<f64>,
    /// Grains that were added since, each with the next one of its cell; the last of each cell.
    added: Vec<Added>,
    latest: Vec<u32>,
    /// Wide grains, and added ones that fit into no cell.
    outside: Vec<u32>,
    /// Wide grains in the scene, in rising order.
    #[serde(skip)]
    wide: Vec<u32>,
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
    /// Fills `found` with every pair of grains that come within `reach` of each other on their paths. Each pair once;
    /// the order depends on the state alone.
    pub fn pairs(
        &mut self,
        particles: &Particles,
        paths: &[Path],
        reach: Reach,
        threads: &Threads,
        found: &mut Vec<Neighbours>,
    ) {
        found.clear();
        self.starts.clear();
        self.added.clear();
        self.outside.clear();
        self.find_wide(particles);
        if particles.present().count() < 2 {
            return;
        }
        self.sweep_balls(particles, paths, reach);
        self.sort_into_cells(particles);
        let search = &*self;
        threads.gather_ranges(self.cells[1] * self.cells[2], ROWS, found, |rows, found| {
            let first = found.len();
            overlapping(search, rows, found);
            keep_from(found, first, |pair| {
                pair.is_direct(particles, paths) && pair.follow(particles, paths, reach)
            });
        });
        self.around_wide(particles, paths, reach, found);
        if let Some(period) = &particles.period {
            self.across(particles, paths, reach, period, found);
        }
    }

    fn find_wide(&mut self, particles: &Particles) {
        let radii = || (0..particles.count()).map(|grain| particles.radius(grain));
        let limit = WIDE * radii().sum::<f64>() / particles.count() as f64;
        let wide = particles.present().filter(|&grain| particles.radius(grain) > limit);
        self.wide.clear();
        self.wide.extend(wide.map(|grain| grain as u32));
        self.outside.extend(&self.wide);
    }

    /// Adds the pairs of wide grains with each other and with those in the cells.
    fn around_wide(
        &self,
        particles: &Particles,
        paths: &[Path],
        reach: Reach,
        found: &mut Vec<Neighbours>,
    ) {
        for &wide in &self.wide {
            let grain = wide as usize;
            self.around(
                &Ball { middle: self.middles[grain], reach: self.reaches[grain] },
                |other| {
                    // Two wide ones find each other: once is enough.
                    if other <= wide && self.wide.binary_search(&other).is_ok() {
                        return;
                    }
                    let (i, j) = (wide.min(other), wide.max(other));
                    let mut pair = Neighbours { i, j, come_near: false };
                    if pair.is_direct(particles, paths) && pair.follow(particles, paths, reach) {
                        found.push(pair);
                    }
                },
            );
        }
    }

    /// Adds the pairs that come within reach across the end of the period: those whose nearest images are not direct.
    fn across(
        &self,
        particles: &Particles,
        paths: &[Path],
        reach: Reach,
        period: &Period,
        found: &mut Vec<Neighbours>,
    ) {
        for grain in particles.present() {
            let path = &paths[grain];
            let (i, middle) = (grain as u32, self.middles[grain] + period.step());
            self.around(&Ball { middle, reach: self.reaches[grain] }, |j| {
                // The lower of the two is the one that is shifted.
                let apart = paths[j as usize].from - path.from;
                let mut pair = Neighbours { i: i.min(j), j: i.max(j), come_near: false };
                if !period.is_direct(&apart)
                    && period.is_ahead(&apart)
                    && pair.follow(particles, paths, reach)
                {
                    found.push(pair);
                }
            });
        }
    }

    /// Centres of the swept balls at the last search for at least two grains.
    pub fn middles(&self) -> &[Vector3<f64>] {
        &self.middles
    }

    /// Grains much wider than the others that are in the scene, in rising order.
    pub fn wide(&self) -> &[u32] {
        &self.wide
    }

    /// How far apart the centres of two overlapping swept balls are at most, if neither is wide.
    pub fn longest(&self) -> f64 {
        self.edge
    }

    /// Adds a grain's new swept ball to those that [`Self::around`] finds.
    pub fn add(&mut self, grain: u32, ball: &Ball) {
        let from_corner = (ball.middle - Vector3::from(self.corner)) / self.edge;
        let is_inside = |axis: usize| (0.0..self.cells[axis] as f64).contains(&from_corner[axis]);
        if self.starts.is_empty() || ball.reach > 0.5 * self.edge || !(0..3).all(is_inside) {
            self.outside.push(grain);
            return;
        }
        let [x, y, z] = [0, 1, 2].map(|axis| from_corner[axis] as usize);
        let latest = &mut self.latest[(z * self.cells[1] + y) * self.cells[0] + x];
        self.added.push(Added { grain, before: *latest });
        *latest = self.added.len() as u32;
    }

    /// Calls `visit` for every grain whose swept ball, as searched or added, may overlap this one.
    pub fn around(&self, ball: &Ball, mut visit: impl FnMut(u32)) {
        self.outside.iter().for_each(|&grain| visit(grain));
        if self.starts.is_empty() {
            return;
        }
        let (point, reach) = (&ball.middle, ball.reach + 0.5 * self.edge);
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
                    visit(grain);
                }
                for &latest in &self.latest[first..last] {
                    let mut next = latest;
                    while next != 0 {
                        let Added { grain, before } = self.added[next as usize - 1];
                        visit(grain);
                        next = before;
                    }
                }
            }
        }
    }

    fn sweep_balls(&mut self, particles: &Particles, paths: &[Path], reach: Reach) {
        self.middles.clear();
        self.reaches.clear();
        for (grain, path) in paths.iter().enumerate() {
            let ball = Ball::swept(path, particles.radius(grain), reach.interval, reach.far);
            self.middles.push(ball.middle);
            self.reaches.push(ball.reach);
        }
    }

    /// Counting sort by cell. A cell is as wide as the two widest balls reach, so that partners are neighbours.
    fn sort_into_cells(&mut self, particles: &Particles) {
        let is_wide = |grain: usize| self.wide.binary_search(&(grain as u32)).is_ok();
        let mut low = Vector3::repeat(f64::INFINITY);
        let (mut high, mut widest) = (-low, 0.0);
        for grain in (0..self.middles.len()).filter(|&grain| !is_wide(grain)) {
            low = low.inf(&self.middles[grain]);
            high = high.sup(&self.middles[grain]);
            widest = f64::max(widest, self.reaches[grain]);
        }
        let mut edge = 2.0 * widest;
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
        self.latest.clear();
        self.latest.resize(total, 0);
        self.cell_of.clear();
        let mut count = 0;
        for (grain, middle) in self.middles.iter().enumerate() {
            if particles.has_left(grain) || is_wide(grain) {
                self.cell_of.push(u32::MAX);
                continue;
            }
            count += 1;
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
        let cells = self.cell_of.iter().enumerate().rev();
        for (grain, &cell) in cells.filter(|(_, cell)| **cell != u32::MAX) {
            let start = &mut self.starts[cell as usize];
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
    fn row(&self, y: usize, z: usize, found: &mut Vec<Neighbours>) {
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
    fn partners(&self, slot: usize, mut begin: usize, end: usize, found: &mut Vec<Neighbours>) {
        while begin < end {
            let mut hits = self.near(slot, begin);
            if end - begin < CHUNK {
                hits &= (1 << (end - begin)) - 1;
            }
            while hits != 0 {
                let other = begin + hits.trailing_zeros() as usize;
                hits &= hits - 1;
                let (i, j) = (self.order[slot], self.order[other]);
                found.push(Neighbours { i: i.min(j), j: i.max(j), come_near: false });
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
    /// All pairs of overlapping swept balls whose first is in these rows of cells, in the order of the slots.
    fn overlapping<W>(search: &PairSearch, rows: Range<usize>, found: &mut Vec<Neighbours>) {
        for row in rows {
            search.row(row % search.cells[1], row / search.cells[1], found);
        }
    }
}

/// Keeps of the items from `first` on those that `is_kept` says.
fn keep_from<T: Copy>(items: &mut Vec<T>, first: usize, mut is_kept: impl FnMut(&mut T) -> bool) {
    let mut end = first;
    for number in first..items.len() {
        let mut item = items[number];
        if is_kept(&mut item) {
            items[end] = item;
            end += 1;
        }
    }
    items.truncate(end);
}

/// A grain that was added to a cell, and the number, from 1 on, of the one that was added to it before.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Added {
    grain: u32,
    before: u32,
}

/// Two grains, `i < j`, whose paths come within reach of each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Neighbours {
    pub i: u32,
    pub j: u32,
    /// Whether they come near, and not only within the margin.
    pub come_near: bool,
}

impl Neighbours {
    /// Whether neither is nearer to the other's image.
    #[inline]
    fn is_direct(&self, particles: &Particles, paths: &[Path]) -> bool {
        particles.period.is_none_or(|period| {
            period.is_direct(&(paths[self.i as usize].from - paths[self.j as usize].from))
        })
    }

    /// Whether they are within reach on their paths; notes whether they come near.
    #[inline]
    fn follow(&mut self, particles: &Particles, paths: &[Path], reach: Reach) -> bool {
        let (i, j) = (self.i as usize, self.j as usize);
        let nearest = paths[i].nearest_squared(&paths[j], particles, reach.interval);
        let touching = particles.radius(i) + particles.radius(j);
        self.come_near = nearest < (touching + reach.near).powi(2);
        nearest < (touching + reach.far).powi(2)
    }
}

#[cfg(test)]
mod tests;
