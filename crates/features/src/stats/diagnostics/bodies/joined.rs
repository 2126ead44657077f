//! Points joined to bodies, and the bodies counted: how, and by whom, is in the head of `bodies.rs`.

use crate::stats::sum::extremes;

/// Longest step within a body, in spacings.
const REACH: f64 = 1.5;
/// Diameter of the circle that holds an isolated grain, in grain diameters.
const GRAIN_CIRCLE: f64 = 1.5;
/// Cells within reach of a cell that come after it, row by row.
const NEIGHBOURS: [(i64, i64); 10] =
    [(1, 0), (2, 0), (-2, 1), (-1, 1), (0, 1), (1, 1), (2, 1), (-1, 2), (0, 2), (1, 2)];

/// What the bodies are counted as.
#[derive(Debug, Clone)]
pub(crate) struct Bodies {
    pub(crate) isolated_grains: usize,
    pub(crate) clusters: usize,
}

impl Bodies {
    pub(crate) fn new(x: &[f64], y: &[f64], spacing: f64, grain_diameter: f64) -> Self {
        let reach = REACH * spacing;
        let body_of_point = Cells::new(x, y, reach).bodies();
        let mut bodies = vec![Body::default(); x.len()];
        let located = || body_of_point.iter().zip(x.iter().zip(y));
        for (&body, (x, y)) in located() {
            let body = &mut bodies[body as usize];
            body.count += 1;
            body.x += x;
            body.y += y;
        }
        for body in &mut bodies {
            body.x /= body.count as f64;
            body.y /= body.count as f64;
        }
        for (&body, (x, y)) in located() {
            let body = &mut bodies[body as usize];
            body.reach_sq = body.reach_sq.max((x - body.x).powi(2) + (y - body.y).powi(2));
        }
        let radius = 0.5 * GRAIN_CIRCLE * grain_diameter;
        let is_grain = |body: &&Body| body.reach_sq <= radius * radius;
        let formed: Vec<_> = bodies.iter().filter(|body| body.count > 0).collect();
        let isolated_grains = formed.iter().copied().filter(is_grain).count();
        // Of bodies with the same number of points, one of several grains is rather the formation.
        let largest = formed.iter().max_by_key(|body| (body.count, !is_grain(body)));
        let formation = usize::from(largest.is_some_and(|body| !is_grain(body)));
        Self { isolated_grains, clusters: formed.len() - isolated_grains - formation }
    }
}

/// Number of bodies of points, `spacing` being that of their pixels `[m]`; none without points.
pub(crate) fn count(x: &[f64], y: &[f64], spacing: f64) -> usize {
    if x.is_empty() {
        return 0;
    }
    let mut names = Cells::new(x, y, REACH * spacing).bodies();
    names.sort_unstable();
    names.dedup();
    names.len()
}

/// One body: its points, their centroid and the largest squared distance from it.
#[derive(Debug, Clone, Copy, Default)]
struct Body {
    count: usize,
    x: f64,
    y: f64,
    reach_sq: f64,
}

/// Points in square cells whose diagonal is the reach.
struct Cells<'a> {
    x: &'a [f64],
    y: &'a [f64],
    reach: f64,
    table: Table,
    /// The last point put into each cell.
    heads: Vec<u32>,
    cell_of_point: Vec<u32>,
    /// The point that was put into the cell before, `NONE` for the first.
    before: Vec<u32>,
    /// A cell of the same body, nearer to the one that names it.
    parents: Vec<u32>,
}

/// No point, no cell.
const NONE: u32 = u32::MAX;

impl<'a> Cells<'a> {
    fn new(x: &'a [f64], y: &'a [f64], reach: f64) -> Self {
        let side = reach * std::f64::consts::FRAC_1_SQRT_2;
        let ((left, right), (bottom, top)) = (extremes(x), extremes(y));
        let (columns, rows) = ((right - left) / side, (top - bottom) / side);
        let mut cells = Self {
            x,
            y,
            reach,
            table: Table::new(columns as i64 + 1, rows as i64 + 1, x.len()),
            heads: Vec::new(),
            cell_of_point: Vec::with_capacity(x.len()),
            before: Vec::with_capacity(x.len()),
            parents: Vec::new(),
        };
        for (point, (x, y)) in (0..).zip(x.iter().zip(y)) {
            let place = (((x - left) / side) as i64, ((y - bottom) / side) as i64);
            let cell = cells.table.find_or_insert(place);
            if cell as usize == cells.heads.len() {
                cells.heads.push(NONE);
            }
            let head = &mut cells.heads[cell as usize];
            cells.before.push(*head);
            *head = point;
            cells.cell_of_point.push(cell);
        }
        cells.parents = (0..cells.heads.len() as u32).collect();
        cells
    }

    /// A number for each point, the same within a body.
    fn bodies(mut self) -> Vec<u32> {
        for cell in 0..self.heads.len() as u32 {
            let (column, row) = self.table.places[cell as usize];
            for (right, up) in NEIGHBOURS {
                let Some(other) = self.table.find((column + right, row + up)) else { continue };
                let (a, b) = (self.root(cell), self.root(other));
                if a != b && self.in_reach(cell, other) {
                    self.parents[a.max(b) as usize] = a.min(b);
                }
            }
        }
        let cells = std::mem::take(&mut self.cell_of_point);
        cells.into_iter().map(|cell| self.root(cell)).collect()
    }

    /// The cell that names the body, with the way there halved.
    fn root(&mut self, mut cell: u32) -> u32 {
        while self.parents[cell as usize] != cell {
            let grandparent = self.parents[self.parents[cell as usize] as usize];
            self.parents[cell as usize] = grandparent;
            cell = grandparent;
        }
        cell
    }

    /// Whether any two points of two cells are within reach.
    fn in_reach(&self, a: u32, b: u32) -> bool {
        let reach_sq = self.reach * self.reach;
        self.points(a).any(|p| {
            let (x, y) = (self.x[p], self.y[p]);
            self.points(b).any(|q| (self.x[q] - x).powi(2) + (self.y[q] - y).powi(2) <= reach_sq)
        })
    }

    fn points(&self, cell: u32) -> impl Iterator<Item = usize> {
        let head = self.heads[cell as usize];
        let before =
            |&point: &u32| Some(self.before[point as usize]).filter(|&point| point != NONE);
        std::iter::successors(Some(head), before).map(|point| point as usize)
    }
}

/// The numbers of the cells that hold points, by column and row.
struct Table {
    /// Number of the cell in a slot, or `NONE`; a power of two, at most half of it taken.
    slots: Vec<u32>,
    columns: i64,
    /// Column and row of each cell.
    places: Vec<(i64, i64)>,
}

impl Table {
    /// A table for at most `points` cells of a grid.
    fn new(columns: i64, rows: i64, points: usize) -> Self {
        let grid = columns.saturating_mul(rows).try_into().unwrap_or(usize::MAX);
        let slots = grid.clamp(2 * points, 8 * points).next_power_of_two();
        Self { slots: vec![NONE; slots], columns, places: Vec::with_capacity(points) }
    }

    fn find(&self, place: (i64, i64)) -> Option<u32> {
        let cell = self.slots[self.slot(place)];
        (cell != NONE).then_some(cell)
    }

    fn find_or_insert(&mut self, place: (i64, i64)) -> u32 {
        let slot = self.slot(place);
        if self.slots[slot] == NONE {
            self.slots[slot] = self.places.len() as u32;
            self.places.push(place);
        }
        self.slots[slot]
    }

    /// The slot of a cell, or the free one where it would be put: cells of a grid that does not fit
    /// share slots, and the next free one is taken.
    fn slot(&self, (column, row): (i64, i64)) -> usize {
        let last = self.slots.len() - 1;
        let mut slot = row.wrapping_mul(self.columns).wrapping_add(column) as usize & last;
        while self.slots[slot] != NONE && self.places[self.slots[slot] as usize] != (column, row) {
            slot = (slot + 1) & last;
        }
        slot
    }
}
