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
        require(self.partners.len() == listed, "partners of another number of grains")?;
        let partners = self.partners.iter().flatten();
        let known = partners.copied().all(|partner| (partner as usize) < grains + walls);
        require(known, "a partner that the scene has not")?;
        let known = self.renewed.iter().all(|&grain| (grain as usize) < grains);
        require(known, "a path of a grain that the scene has not")?;
        self.pairs.check(listed, None)?;
        self.at_walls.check(listed, Some(walls))?;
        self.search.check(listed)
    }
}
