//! Separate patches of what stands above half a grain.
//!
//! The points with z above half a grain diameter, joined to bodies as in `bodies.rs`: one for a smooth heap, as many as
//! there are clods for terraces, and one for each grain that lies alone.
//!
//! Source: connected components of a level set, as `bodies.rs`.

use super::bodies::joined::count;
use super::survey::{Diagnostic, Survey};
use crate::stats::Behaviour;

/// Bodies above half a grain.
pub(super) const PATCHES: Diagnostic = Diagnostic {
    name: "patches",
    unit: "-",
    doc: "number of connected bodies of the points that are higher than half a grain diameter",
    behaviour: Behaviour::WEIGHED_NUMBER,
    value: |survey| patches(survey) as f64,
};

fn patches(survey: &Survey) -> usize {
    let level = 0.5 * survey.grain_diameter;
    let high = |of: &[f64]| -> Vec<f64> {
        of.iter().zip(&survey.z).filter(|(_, z)| **z > level).map(|(&value, _)| value).collect()
    };
    count(&high(&survey.x), &high(&survey.y), survey.spacing)
}
