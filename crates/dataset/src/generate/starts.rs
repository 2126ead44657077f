//! Whether the grains of a batch's draws begin clear of the walls, asked before the first pour.
//!
//! To start all rows would take as long as some pours. What varies the start or a wall goes one way: the rows with the
//! least and the greatest value of each such parameter tell most of what is wrong.

use granulcal_dem::Simulation;
use granulcal_scene::{Prior, Scene};

use super::options::GenerateOptions;
use crate::random::pour_seed;
use crate::{DatasetError, Room};

/// Rows among which the extremes are looked for, at most.
const MOST_ROWS: u64 = 100_000;

/// Starts the rows at the extremes of what may move grains into walls.
///
/// # Errors
/// [`DatasetError::Row`] of the first that cannot begin.
pub(super) fn check(
    scene: &Scene,
    prior: &Prior,
    options: &GenerateOptions,
) -> Result<(), DatasetError> {
    for row in extremes(prior, options) {
        let begin = || {
            let values = prior.sample(options.seed, row);
            let scene = prior.apply(scene, &values).map_err(DatasetError::refused)?;
            Room::of_pour(&scene, None).require(None)?;
            Simulation::new(&scene, pour_seed(options.seed, row))
                .and_then(|simulation| simulation.check_start())
                .map_err(DatasetError::Simulation)
        };
        begin().map_err(|source| DatasetError::Row { row, source: Box::new(source) })?;
    }
    Ok(())
}

/// The rows with the least and the greatest value of each parameter that is of no material, once each.
fn extremes(prior: &Prior, options: &GenerateOptions) -> Vec<u64> {
    let varied = prior.free_beside_material();
    if varied.is_empty() {
        return Vec::new();
    }
    let mut ends = vec![[(f64::INFINITY, 0), (f64::NEG_INFINITY, 0)]; varied.len()];
    for row in 0..options.rows.min(MOST_ROWS) {
        let values = prior.sample(options.seed, row);
        for (&number, [least, greatest]) in varied.iter().zip(&mut ends) {
            let value = values[number];
            if value < least.0 {
                *least = (value, row);
            }
            if value > greatest.0 {
                *greatest = (value, row);
            }
        }
    }
    let mut rows: Vec<u64> = ends.iter().flatten().map(|&(_, row)| row).collect();
    rows.sort_unstable();
    rows.dedup();
    rows
}
