//! Whether a grid that was read from bytes is one.

use super::PairSearch;

impl PairSearch {
    /// Whether the grid is empty or has so many grains in its cells.
    ///
    /// # Errors
    /// What is wrong.
    pub fn check(&self, grains: usize) -> Result<(), &'static str> {
        if self.starts.is_empty() {
            let known = self.outside.iter().all(|&grain| (grain as usize) < grains);
            return if known { Ok(()) } else { Err("a path of a grain that the scene has not") };
        }
        let [x, y, z] = self.cells;
        let cells = x.checked_mul(y).and_then(|cells| cells.checked_mul(z));
        let fits = cells.and_then(|cells| cells.checked_add(1)) == Some(self.starts.len())
            && self.starts.is_sorted()
            && self.starts.last().is_some_and(|&end| end as usize == self.order.len())
            // Those that have left are in no cell.
            && self.order.len() <= grains
            && self.order.iter().all(|&grain| (grain as usize) < grains)
            && self.edge > 0.0
            && self.latest.len() + 1 == self.starts.len()
            && self.latest.iter().all(|&latest| latest as usize <= self.added.len())
            // Chains lead back, so that none is a ring.
            && self.added.iter().enumerate().all(|(number, added)| added.before as usize <= number)
            && self.added.iter().all(|added| (added.grain as usize) < grains)
            && self.outside.iter().all(|&grain| (grain as usize) < grains);
        if fits { Ok(()) } else { Err("a grid of another number of grains") }
    }
}
