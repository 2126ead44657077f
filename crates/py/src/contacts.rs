//! Lasting contacts as arrays.

use granulcal_dem::{ContactForce, DemError, Partner, Simulation};
use nalgebra::Vector3;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;

use crate::array;

/// Rows of the two grains, walls, points [m], normals, forces [N]; names of the walls.
pub(crate) type ContactArrays<'py> = (
    Bound<'py, PyArray2<i64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Vec<String>,
);

/// What stands where there is no second grain, or no wall.
const NONE: i64 = -1;

/// The lasting contacts of a substep.
#[derive(Debug)]
pub(crate) struct Contacts {
    /// Of the grains that are in the scene.
    numbers: Vec<usize>,
    forces: Vec<ContactForce>,
    unit_mass: f64,
    wall_names: Vec<String>,
}

impl Contacts {
    /// Those of a simulation's last substep.
    pub(crate) fn of(simulation: &Simulation) -> Result<Self, DemError> {
        Ok(Self {
            forces: simulation.contact_forces()?,
            numbers: simulation.numbers(),
            unit_mass: simulation.unit_mass(),
            wall_names: simulation.wall_names(),
        })
    }

    /// As arrays, without those of grains that have left since.
    pub(crate) fn arrays<'py>(&self, py: Python<'py>) -> PyResult<ContactArrays<'py>> {
        // The numbers ascend.
        let row = |number: usize| self.numbers.binary_search(&number).ok().map(|row| row as i64);
        let (mut pairs, mut walls) = (Vec::new(), Vec::new());
        let (mut points, mut normals, mut forces) = (Vec::new(), Vec::new(), Vec::new());
        for contact in &self.forces {
            let partner = match contact.partner {
                Partner::Grain(other) => row(other).map(|row| (row, NONE)),
                Partner::Wall(wall) => Some((NONE, wall as i64)),
            };
            let (Some(grain), Some((other, wall))) = (row(contact.grain), partner) else {
                continue;
            };
            pairs.extend([grain, other]);
            walls.push(wall);
            points.push(contact.point);
            normals.push(contact.normal);
            forces.push(self.unit_mass * contact.force);
        }
        let vectors = |all: &[Vector3<f64>]| array::from_vectors(py, all);
        Ok((
            array::matrix(py, pairs, walls.len(), 2)?,
            PyArray1::from_vec(py, walls),
            vectors(&points)?,
            vectors(&normals)?,
            vectors(&forces)?,
            self.wall_names.clone(),
        ))
    }
}
