//! The front of a sheet that spreads about an axis, of its profile.

/// The largest radius at which a surface over rings of width `ring` is at least `depth` high, linear between the
/// middles of two rings `[m]`; `None` if it is nowhere.
pub fn sheet_radius(ring: f64, heights: &[f64], depth: f64) -> Option<f64> {
    let last = heights.iter().rposition(|&height| height >= depth)?;
    let (here, next) = (heights[last], heights.get(last + 1).copied().unwrap_or(0.0));
    Some(ring * (last as f64 + 0.5 + (here - depth) / (here - next)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sheet_ends_where_it_is_thinner_for_good() {
        // Middles at 1, 3, 5 and 7 mm.
        let found = sheet_radius(2e-3, &[4e-3, 1e-4, 3e-3, 1e-3], 2e-3);
        assert!((found.unwrap() - 6e-3).abs() < 1e-12, "{found:?}");
        let found = sheet_radius(2e-3, &[4e-3, 1e-4, 3e-3, 1e-3], 5e-4);
        assert!((found.unwrap() - 8e-3).abs() < 1e-12, "{found:?}");
        assert_eq!(sheet_radius(2e-3, &[4e-3], 5e-3), None);
        assert_eq!(sheet_radius(2e-3, &[], 5e-3), None);
    }
}
