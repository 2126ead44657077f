//! Pile or ring: is the formation higher in the middle or around it?

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

use super::levelled::Levelled;

/// The middle: radii up to this share of the half-volume radius.
const INNER: f64 = 0.5;
/// The rim: radii within this share of the half-volume radius from it.
const RIM: f64 = 0.2;
/// A ring is lower in the middle than its rim by at least this share of the rim's height. Of the 41
/// measured maps of known kind the mounds reach +0.1 and more, the rings -0.55 and less.
const LEAST_DIP: f64 = 0.25;

/// The kind of a formation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Highest in the middle.
    Pile,
    /// Lower in the middle than around it; also a crater with its rim.
    Ring,
}

impl Kind {
    /// The word for it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pile => "pile",
            Self::Ring => "ring",
        }
    }
}

/// Pile or ring, and the numbers that decided.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shape {
    /// The kind.
    pub kind: Kind,
    /// Radius about the volume's centroid that holds half of the volume above the ground `[m]`.
    pub half_volume_radius: f64,
    /// Mean height within half that radius, bare ground and pits included `[m]`.
    pub inner_height: f64,
    /// Mean height around that radius `[m]`.
    pub rim_height: f64,
}

/// The shape of what the mask shows.
pub(super) fn of(levelled: &Levelled) -> Shape {
    let weight = |volume: f64| volume.max(0.0);
    let mut sum = Vector2::zeros();
    let mut total = 0.0;
    for (point, _, volume) in levelled.samples().filter(|(_, masked, _)| *masked) {
        sum += weight(volume) * point.xy();
        total += weight(volume);
    }
    let centroid = sum / total;
    let mut by_radius: Vec<(f64, f64)> = levelled
        .samples()
        .filter(|(_, masked, _)| *masked)
        .map(|(point, _, volume)| ((point.xy() - centroid).norm(), weight(volume)))
        .collect();
    by_radius.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut inside = 0.0;
    let half = by_radius.iter().find(|(_, volume)| {
        inside += volume;
        inside >= 0.5 * total
    });
    let radius = half.map_or(0.0, |(radius, _)| *radius);
    let mean_height = |from: f64, to: f64| {
        let (mut sum, mut count) = (0.0, 0.0);
        for (point, _, _) in levelled.samples() {
            if (from..=to).contains(&(point.xy() - centroid).norm()) {
                sum += point.z;
                count += 1.0;
            }
        }
        if count > 0.0 { sum / count } else { 0.0 }
    };
    let inner_height = mean_height(0.0, INNER * radius);
    let rim_height = mean_height((1.0 - RIM) * radius, (1.0 + RIM) * radius);
    let is_ring = inner_height < rim_height - LEAST_DIP * rim_height.abs();
    Shape {
        kind: if is_ring { Kind::Ring } else { Kind::Pile },
        half_volume_radius: radius,
        inner_height,
        rim_height,
    }
}
