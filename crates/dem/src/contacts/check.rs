//! Whether lists that were read from bytes are lists of a scene.

use super::Contacts;

impl Contacts {
    /// Whether everything listed is between so many grains and walls.
    ///
    /// # Errors
    /// What is wrong.
    pub fn check(&self, grains: usize, walls: usize) -> Result<(), &'static str> {
        let require = |holds: bool, what| if holds { Ok(()) } else { Err(what) };
        // Before the first substep nothing is listed.
        let listed = if self.paths.is_empty() { 0 } else { grains };
        require(self.paths.len() == listed, "paths of another number of grains")?;
        self.partners.check(listed, grains + walls)?;
        self.pairs.check(listed, None)?;
        self.at_walls.check(listed, Some(walls))?;
        self.search.check(listed)
    }
}
