//! An edge of a triangle where its mesh ends or bends, as faces of bodies that are not round meet it
//! (`bodies/edges.rs`).

use nalgebra::Vector3;

/// A way that leads into a body by less than this leads along it, as a sine `[-]`: a face lies flat on an edge of what
/// it lies on, but for rounding.
const ALONG: f64 = 0.02;

/// A triangle across an edge.
#[derive(Clone, Debug)]
pub(super) struct Across {
    pub facet: u32,
    /// From the edge into that triangle, at right angles to the edge.
    pub inwards: Vector3<f64>,
}

/// An edge where a mesh ends or bends, where its wall is stated.
pub(crate) struct Edge<'a> {
    /// Its begin `[m]`.
    pub from: Vector3<f64>,
    /// Unit.
    pub along: Vector3<f64>,
    /// `[m]`
    pub length: f64,
    /// From it into its own triangle, at right angles to it.
    inwards: Vector3<f64>,
    /// What else has it.
    across: &'a [Across],
    /// Directions in which edges leave its begin and its end.
    leaving: [&'a [Vector3<f64>]; 2],
}

impl<'a> Edge<'a> {
    pub(super) fn new(
        [from, to]: [Vector3<f64>; 2],
        third: Vector3<f64>,
        across: &'a [Across],
        leaving: [&'a [Vector3<f64>]; 2],
    ) -> Self {
        let length = (to - from).norm();
        let along = (to - from) / length;
        let inwards = (third - from) - (third - from).dot(&along) * along;
        Self { from, along, length, inwards, across, leaving }
    }

    /// Whether a thing that lies towards `normal` of the edge touches it and not a triangle beside it: into each of
    /// them the way leads off it.
    pub fn holds(&self, normal: &Vector3<f64>) -> bool {
        let others = self.across.iter().map(|other| &other.inwards);
        others.chain([&self.inwards]).all(|into| leads_off(normal, into))
    }

    /// The same of its begin or its end, and of what leaves them.
    pub fn holds_at(&self, end: usize, normal: &Vector3<f64>) -> bool {
        self.leaving[end].iter().all(|into| leads_off(normal, into))
    }
}

fn leads_off(normal: &Vector3<f64>, into: &Vector3<f64>) -> bool {
    normal.dot(into) <= ALONG * into.norm()
}
