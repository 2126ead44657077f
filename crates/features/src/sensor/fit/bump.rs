//! Whether a part of a flat frame stands off the surface that the rest lies on: equations (11) and (12) of
//! `docs/theory/sensor.md`.
//!
//! A mound is left out of the trend as any fault is, so that it is not seen in what remains. It is seen in the medians
//! of tiles: chance moves them by little, a mound moves those that lie on it.

use nalgebra::{DMatrix, DVector};

use super::flat::{Basis, SD_PER_MAD, median};
use super::frames::Optics;
use crate::error::FeatureError;
use crate::region::Region;
use crate::rng::Stream;

/// Tiles along the longer side that do not overlap; with half a tile between them they are twice as dense. Small tiles
/// see what is steep and narrow, large ones what is low and broad.
const TILES: [usize; 2] = [16, 8];
/// Least side of a tile `[px]`: medians of fewer pixels follow single faults.
const LEAST_SIDE: usize = 4;
/// Robust standard deviations of the tiles beyond which one is no chance. The largest of 256 normal medians reaches 6.0
/// once in a million frames, and with the error of a deviation that 256 tiles estimate 6.8.
const BEYOND_TILES: f64 = 8.0;
/// Standard deviations of single pixels below which nothing is a bump: the rounding of a level surface can move all
/// pixels of a tile by half a step, which is 1.7 of them.
const BEYOND_PIXELS: f64 = 2.0;
/// Independent tiles from which their deviation is known well, and below which it is not known at all.
const MANY_TILES: f64 = 60.0;
const FEWEST_TILES: f64 = 20.0;
/// Draws of as many tiles as the trend has coefficients; one of them has no tile of a mound of a third of the frame
/// with a probability of 1 - 1e-17 for a trend of degree 2.
const DRAWS: usize = 500;
/// Standard deviations from the surface beyond which a tile has no say where it lies.
const CLIP: f64 = 4.0;
/// Rounds of "fit, leave out, fit again".
const MAX_ROUNDS: usize = 40;

/// The tile that stands off farthest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bump {
    /// Its distance from the surface over the largest that chance gives one `[-]`.
    pub(super) ratio: f64,
    /// Its distance from the surface, towards the camera `[m]`.
    pub(super) height: f64,
    /// The pixels of all tiles on its side that are beyond chance.
    pub(super) region: Region,
}

impl Bump {
    /// Refuses what is no chance, in a region of a frame.
    pub(super) fn require_chance(&self, frame: usize, region: &Region) -> Result<(), FeatureError> {
        if self.ratio <= 1.0 {
            return Ok(());
        }
        let place = (region.x + self.region.x, region.y + self.region.y);
        let size = (self.region.width, self.region.height);
        let (height, ratio) = (self.height, self.ratio);
        Err(FeatureError::Bump { frame: frame + 1, place, size, height, ratio })
    }
}

/// A square of pixels and the median of their residuals from the trend.
struct Tile {
    column: usize,
    row: usize,
    x: usize,
    y: usize,
    median: f64,
    /// Error of the sensor per unit of the trend's.
    weight: f64,
}

impl Tile {
    /// Its pixels.
    fn pixels(&self, width: usize, side: usize) -> impl Iterator<Item = usize> {
        let (x, y) = (self.x, self.y);
        (y..y + side).flat_map(move |v| (x..x + side).map(move |u| v * width + u))
    }
}

/// The largest bump of a region, of either size of tiles; none where too few tiles are independent of each other.
pub(super) fn largest(
    optics: &Optics,
    values: &[f64],
    trend: &[f64],
    width: usize,
    degree: usize,
) -> Option<Bump> {
    let basis = Basis { width, height: values.len() / width, degree };
    let seen = TILES.iter().filter_map(|&count| {
        let side = width.max(basis.height).div_ceil(count).max(LEAST_SIDE);
        largest_of_tiles(optics, values, trend, &basis, side)
    });
    seen.max_by(|a, b| a.ratio.total_cmp(&b.ratio))
}

/// The largest bump that is seen in tiles of one size.
fn largest_of_tiles(
    optics: &Optics,
    values: &[f64],
    trend: &[f64],
    basis: &Basis,
    side: usize,
) -> Option<Bump> {
    let Basis { width, height, .. } = *basis;
    let tiles = tiles(optics, values, trend, width, side);
    let (off, kept) = off_surface(&tiles, basis, side)?;
    let count = kept.iter().filter(|&&k| k).count();
    let mut near: Vec<f64> = (0..tiles.len()).filter(|&i| kept[i]).map(|i| off[i].abs()).collect();
    let spread = SD_PER_MAD * median(&mut near) * spared(count, basis.len());
    // Neighbours overlap: a quarter of the tiles is independent at most.
    let independent = count as f64 / 4.0 * independence(&tiles, &off, &kept);
    if independent < FEWEST_TILES {
        return None;
    }
    let few = (MANY_TILES / independent).sqrt().max(1.0);
    let pixel = pixel_deviation(values, trend, width, side, &tiles, &off, &kept);
    let worst = (0..tiles.len()).max_by(|&a, &b| off[a].abs().total_cmp(&off[b].abs()))?;
    let at = |tile: &Tile| trend[(tile.y + side / 2) * width + tile.x + side / 2];
    let step = optics.step(at(&tiles[worst]), width.max(height));
    let allowed = (BEYOND_TILES * few * spread).max(BEYOND_PIXELS * pixel).max(step);
    let beyond = |i: usize| off[i] * off[worst].signum() > allowed;
    let all = (0..tiles.len()).filter(|&i| i == worst || beyond(i)).map(|i| &tiles[i]);
    let (mut low, mut high) = ((width, height), (0, 0));
    for tile in all {
        low = (low.0.min(tile.x), low.1.min(tile.y));
        high = (high.0.max(tile.x + side), high.1.max(tile.y + side));
    }
    let region = Region { x: low.0, y: low.1, width: high.0 - low.0, height: high.1 - low.1 };
    let ratio = off[worst].abs() / allowed;
    Some(Bump { ratio, height: optics.height(at(&tiles[worst]), off[worst]), region })
}

/// Robust standard deviation of the single pixels of the tiles that are kept from the surface, in the sensor's unit.
fn pixel_deviation(
    values: &[f64],
    trend: &[f64],
    width: usize,
    side: usize,
    tiles: &[Tile],
    off: &[f64],
    kept: &[bool],
) -> f64 {
    let mut distances = Vec::new();
    for (i, tile) in tiles.iter().enumerate().filter(|(i, _)| kept[*i]) {
        let surface = tile.median - off[i] / tile.weight;
        let residuals = tile.pixels(width, side).map(|i| values[i] - trend[i]);
        let found = residuals.filter(|residual| residual.is_finite());
        distances.extend(found.map(|residual| (tile.weight * (residual - surface)).abs()));
    }
    SD_PER_MAD * median(&mut distances)
}

/// Squares half a side apart, those of which at least half of the pixels have data.
fn tiles(optics: &Optics, values: &[f64], trend: &[f64], width: usize, side: usize) -> Vec<Tile> {
    let height = values.len() / width;
    // The last tile ends where the region does; they lie half a side apart, or a little less.
    let places = |length: usize| -> Vec<usize> {
        let Some(room) = length.checked_sub(side) else { return Vec::new() };
        let steps = room.div_ceil((side / 2).max(1)).max(1);
        (0..=steps).map(|step| step * room / steps).collect()
    };
    let mut tiles = Vec::new();
    for (row, y) in places(height).into_iter().enumerate() {
        for (column, x) in places(width).into_iter().enumerate() {
            let weight = optics.slope(trend[(y + side / 2) * width + x + side / 2]);
            let mut tile = Tile { column, row, x, y, median: 0.0, weight };
            let residuals = tile.pixels(width, side).map(|i| values[i] - trend[i]);
            let mut found: Vec<f64> = residuals.filter(|residual| residual.is_finite()).collect();
            if 2 * found.len() >= side * side {
                tile.median = median(&mut found);
                tiles.push(tile);
            }
        }
    }
    tiles
}

/// How far each tile stands off the surface that most of them lie on, and which of them do.
///
/// Least median of squares over random draws finds the surface though tiles of a mound are among them; least squares on
/// the tiles near it places it (Rousseeuw 1984, doi:10.1080/01621459.1984.10477105).
fn off_surface(tiles: &[Tile], basis: &Basis, side: usize) -> Option<(Vec<f64>, Vec<bool>)> {
    let terms = basis.len();
    if tiles.len() < 2 * terms {
        return None;
    }
    let mut rows = DMatrix::zeros(tiles.len(), terms);
    let mut row = vec![0.0; terms];
    for (i, tile) in tiles.iter().enumerate() {
        basis.at(tile.x + side / 2, tile.y + side / 2, &mut row);
        row.iter().enumerate().for_each(|(j, value)| rows[(i, j)] = tile.weight * value);
    }
    let right = DVector::from_iterator(tiles.len(), tiles.iter().map(|t| t.weight * t.median));
    let mut stream = Stream::new(0);
    let mut best = (f64::INFINITY, DVector::zeros(terms));
    for _ in 0..DRAWS {
        let drawn = draw(&mut stream, tiles.len(), terms);
        let (few, their) = (rows.select_rows(&drawn), right.select_rows(&drawn));
        let Some(coefficients) = few.lu().solve(&their) else { continue };
        let mut off: Vec<f64> = (&right - &rows * &coefficients).iter().map(|r| r.abs()).collect();
        let middle = median(&mut off);
        if middle < best.0 {
            best = (middle, coefficients);
        }
    }
    let mut off = &right - &rows * &best.1;
    let mut reach = CLIP * SD_PER_MAD * best.0;
    let mut kept = Vec::new();
    for _ in 0..MAX_ROUNDS {
        let again: Vec<bool> = off.iter().map(|r| r.abs() <= reach).collect();
        let near: Vec<usize> = (0..tiles.len()).filter(|&i| again[i]).collect();
        if again == kept || near.len() < 2 * terms {
            break;
        }
        kept = again;
        let (some, their) = (rows.select_rows(&near), right.select_rows(&near));
        let factor = (some.transpose() * &some).cholesky()?;
        off = &right - &rows * factor.solve(&(some.transpose() * their));
        let mut distances: Vec<f64> = near.iter().map(|&i| off[i].abs()).collect();
        reach = CLIP * SD_PER_MAD * median(&mut distances);
    }
    (!kept.is_empty()).then(|| (off.iter().copied().collect(), kept))
}

/// `count` different indices below `len`.
fn draw(stream: &mut Stream, len: usize, count: usize) -> Vec<usize> {
    let mut drawn = Vec::with_capacity(count);
    while drawn.len() < count {
        let index = stream.index(len);
        if !drawn.contains(&index) {
            drawn.push(index);
        }
    }
    drawn
}

/// What the coefficients of a trend take from a standard deviation.
fn spared(count: usize, terms: usize) -> f64 {
    let count = count as f64;
    (count / (count - terms as f64).max(1.0)).sqrt()
}

/// Share of tiles side by side that count as independent in a deviation: (1 - ρ²)/(1 + ρ²) along each axis, ρ from how
/// often two neighbours stand on the same side.
fn independence(tiles: &[Tile], off: &[f64], kept: &[bool]) -> f64 {
    let columns = tiles.iter().map(|tile| tile.column + 1).max().unwrap_or(0);
    let rows = tiles.iter().map(|tile| tile.row + 1).max().unwrap_or(0);
    let mut grid = vec![f64::NAN; columns * rows];
    for (i, tile) in tiles.iter().enumerate().filter(|(i, _)| kept[*i]) {
        grid[tile.row * columns + tile.column] = off[i];
    }
    // Tiles two places apart do not overlap.
    let along = |x: usize, y: usize| {
        let (mut same, mut pairs) = (0.0, 0.0);
        for row in 0..rows.saturating_sub(y) {
            for column in 0..columns.saturating_sub(x) {
                let product = grid[row * columns + column] * grid[(row + y) * columns + column + x];
                if product.is_finite() {
                    pairs += 1.0;
                    same += f64::from(u8::from(product > 0.0));
                }
            }
        }
        let share: f64 = if pairs > 0.0 { same / pairs } else { 0.5 };
        let square = (std::f64::consts::PI * (share - 0.5)).sin().max(0.0).powi(2);
        (1.0 - square) / (1.0 + square)
    };
    along(2, 0) * along(0, 2)
}

#[cfg(test)]
mod tests;
