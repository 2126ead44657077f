//! Connected bodies: the heap, clusters beside it, isolated grains.
//!
//! Two points belong to one body when a chain of points joins them whose steps, seen from above, are no
//! longer than 1.5 spacings: neighbours of a pixel grid along its sides and diagonals (√2). A body is an
//! isolated grain when it fits a circle of 1.5 grain diameters about its centroid; two touching grains
//! need one of two. The largest body by its points is the formation; the others that are no isolated
//! grain are clusters.
//!
//! Cells of a side of 1.5/√2 spacings hold points of one body only, so bodies are unions of cells, and a
//! cell has to look at the 20 cells around it that can be in reach. With a bounded number of points in a
//! cell, as an image has, that is O(n). The cells are found in a table that is a grid as long as the
//! points fill one, and the same grid wound up where they lie far apart.
//!
//! Source: the components of the graph of near points (single linkage), Sibson 1973,
//! doi:10.1093/comjnl/16.1.30; by cells: Gunawan 2013, A faster algorithm for DBSCAN, chapter 3; sets
//! joined as in Tarjan 1975, doi:10.1145/321879.321884.

pub(super) mod joined;

use super::survey::Diagnostic;
use crate::stats::Behaviour;

/// Bodies of a single grain.
pub(super) const ISOLATED_GRAINS: Diagnostic = Diagnostic {
    name: "isolated_grains",
    unit: "-",
    doc: "number of bodies no larger than a grain that touch nothing else",
    behaviour: Behaviour::NUMBER,
    value: |survey| survey.bodies().isolated_grains as f64,
};

/// Bodies of several grains beside the formation.
pub(super) const CLUSTERS: Diagnostic = Diagnostic {
    name: "clusters",
    unit: "-",
    doc: "number of bodies of more than one grain, the largest body not counted",
    behaviour: Behaviour::NUMBER,
    value: |survey| survey.bodies().clusters as f64,
};
