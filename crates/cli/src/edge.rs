//! What is said of pixels at the edge of an image that are taken for grains.

use granulcal_features::Formation;

/// How many there are, and what leaves them out; none without any.
pub fn pixels_at_edge(formation: &Formation) -> Option<String> {
    let edge = formation.edge()?;
    Some(format!(
        "{} pixels at the edge of the image, apart from the formation, are taken for grains; --border {} leaves them out",
        edge.count,
        edge.frame * formation.downsample
    ))
}
