//! The contact problem of a substep as an .npz archive; docs/theory/contact-problem.md describes the arrays.

use std::path::Path;

use granulcal_dem::{ContactProblem, Partner};
use nalgebra::Vector6;

use crate::npz::write_arrays;
use crate::{DatasetError, npy};

/// Version of the arrays and their meaning.
const FORMAT: i64 = 1;
/// Partner or wall of a contact that has none.
const NONE: i64 = -1;

/// Writes a contact problem and its solution for NumPy.
///
/// # Errors
/// [`DatasetError::Io`] or [`DatasetError::Npz`].
pub fn write_contact_problem(path: &Path, problem: &ContactProblem) -> Result<(), DatasetError> {
    let (contacts, blocks) = (&problem.contacts, problem.delassus());
    let (grains, count) = (problem.inverse_mass.len(), contacts.len());
    let number = |value| npy::encode(&[], [value]);
    let column = |value: &dyn Fn(usize) -> f64| npy::encode(&[count], (0..count).map(value));
    let integers = |values: Vec<i64>| npy::encode_integers(&[values.len()], values);
    let rows = |rows: &[Vector6<f64>]| npy::encode(&[rows.len(), 6], six(rows));
    let (biases, impulses): (Vec<_>, Vec<_>) =
        contacts.iter().map(|contact| (contact.bias, contact.impulse)).unzip();
    let partner = |at_wall: bool| {
        let number = |partner| match partner {
            Partner::Grain(j) if !at_wall => j as i64,
            Partner::Wall(wall) if at_wall => wall as i64,
            _ => NONE,
        };
        integers(contacts.iter().map(|contact| number(contact.partner)).collect())
    };
    let normals = contacts.iter().flat_map(|contact| contact.normal.data.0[0]);
    let tangents = contacts.iter().flat_map(|contact| contact.tangents).flat_map(|t| t.data.0[0]);
    // nalgebra keeps columns, NumPy rows.
    let entries = blocks.iter().flat_map(|block| block.block.transpose().data.0).flatten();
    let arrays = [
        ("format", npy::encode_integers(&[], [FORMAT])),
        ("time", number(problem.time)),
        ("dt", number(problem.dt)),
        ("inverse_mass", npy::encode(&[grains], problem.inverse_mass.iter().copied())),
        ("free_velocity", rows(&problem.free_velocities)),
        ("grain", integers(contacts.iter().map(|contact| contact.grain as i64).collect())),
        ("partner", partner(false)),
        ("wall", partner(true)),
        ("normal", npy::encode(&[count, 3], normals)),
        ("tangents", npy::encode(&[count, 2, 3], tangents)),
        ("lever", npy::encode(&[count, 2], contacts.iter().flat_map(|contact| contact.lever))),
        ("sliding_friction", column(&|at| contacts[at].sliding_friction)),
        ("rolling_friction", column(&|at| contacts[at].rolling_friction)),
        ("torsional_friction", column(&|at| contacts[at].torsional_friction)),
        ("bias", rows(&biases)),
        ("delassus_row", integers(blocks.iter().map(|block| block.row as i64).collect())),
        ("delassus_column", integers(blocks.iter().map(|block| block.column as i64).collect())),
        ("delassus", npy::encode(&[blocks.len(), 6, 6], entries)),
        ("right_hand_side", rows(&problem.right_hand_side())),
        ("impulse", rows(&impulses)),
        ("velocity", rows(&problem.velocities())),
        ("residual", number(problem.residual())),
        ("sweeps", npy::encode_integers(&[], [problem.sweeps as i64])),
    ];
    write_arrays(path, &arrays)
}

fn six(rows: &[Vector6<f64>]) -> impl Iterator<Item = f64> {
    rows.iter().flat_map(|row| row.data.0[0])
}

#[cfg(test)]
mod tests {
    use granulcal_dem::Simulation;
    use granulcal_scene::Scene;

    use super::*;
    use crate::Npz;

    #[test]
    fn the_arrays_of_a_file_are_the_problem() {
        let mut scene = Scene::drop(0.004);
        scene.grains.count = 30;
        let mut simulation = Simulation::new(&scene, 1).unwrap();
        simulation.advance(0.04);
        let problem = simulation.contact_problem().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frozen.npz");
        write_contact_problem(&path, &problem).unwrap();

        let mut archive = Npz::open(&path).unwrap();
        let mut array = |name| archive.array(name).unwrap();
        let (contacts, grains) = (problem.contacts.len(), 30);
        assert!(contacts > 10);
        for (name, shape) in [
            ("free_velocity", vec![grains, 6]),
            ("tangents", vec![contacts, 2, 3]),
            ("wall", vec![contacts]),
            ("dt", vec![]),
        ] {
            assert_eq!(array(name).shape, shape, "{name}");
        }
        // W r + q from the file is what the problem's velocities give.
        let (row, column) = (array("delassus_row").values, array("delassus_column").values);
        let (blocks, impulse) = (array("delassus").values, array("impulse").values);
        let mut y = array("right_hand_side").values;
        for (number, block) in blocks.chunks_exact(36).enumerate() {
            let (row, column) = (row[number] as usize, column[number] as usize);
            for (i, entries) in block.chunks_exact(6).enumerate() {
                for (j, entry) in entries.iter().enumerate() {
                    y[6 * row + i] += entry * impulse[6 * column + j];
                }
            }
        }
        let expected = problem.relative_velocities(&problem.velocities());
        for (y, expected) in y.iter().zip(six(&expected)) {
            assert!((y - expected).abs() < 1e-13, "{y} {expected}");
        }
        let (partner, wall) = (array("partner").values, array("wall").values);
        assert!(partner.iter().zip(&wall).all(|(j, wall)| (*j == -1.0) != (*wall == -1.0)));
    }
}
