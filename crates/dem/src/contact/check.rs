//! Whether contacts that were read from bytes can be solved: the kernels index without looking.

use super::{Batch, ContactSet, LANES};

impl ContactSet {
    /// Whether the contacts are between so many grains and, if they are at walls, so many walls.
    ///
    /// # Errors
    /// What is wrong.
    pub fn check(&self, grains: usize, walls: Option<usize>) -> Result<(), &'static str> {
        let require = |holds: bool, what| if holds { Ok(()) } else { Err(what) };
        let at_walls = walls.map_or(0, |_| self.batches.len());
        require(self.at_walls.len() == at_walls, "walls that do not fit their contacts")?;
        require(self.uniform.len() == self.laws.len(), "laws that do not fit")?;
        require(self.coloured <= self.batches.len(), "more coloured batches than there are")?;
        if self.batches.is_empty() {
            return Ok(());
        }
        require(self.grains == grains, "contacts of another number of grains")?;
        for batch in &self.batches {
            require((batch.law as usize) < self.laws.len(), "a contact without a law")?;
            self.check_lanes(batch, walls.is_some())?;
        }
        for at in &self.at_walls {
            let fits = at.wall.iter().all(|&wall| usize::from(wall) < walls.unwrap_or(0));
            require(fits, "a contact at a wall that the scene has not")?;
        }
        self.check_colours()
    }

    /// Lanes in use have grains, the others the resting body.
    fn check_lanes(&self, batch: &Batch, is_at_walls: bool) -> Result<(), &'static str> {
        let (used, resting) = (batch.used as usize, self.grains as u32);
        let (i, j) = (&batch.i, &batch.j);
        let fits = used <= LANES
            && i[..used].iter().all(|&grain| grain < resting)
            && j[..used].iter().all(|&grain| (grain < resting) != is_at_walls && grain <= resting)
            && i[used..].iter().chain(&j[used..]).all(|&body| body == resting);
        if fits { Ok(()) } else { Err("a contact of grains that the scene has not") }
    }

    /// The colours are all batches in turn, and where threads may share them no grain is in two batches.
    fn check_colours(&self) -> Result<(), &'static str> {
        let mut end = 0;
        let mut colour_of = vec![usize::MAX; self.grains + 1];
        for (number, colour) in self.colours.iter().enumerate() {
            if colour.batches.start != end || colour.batches.end <= end {
                return Err("colours that are not all contacts in turn");
            }
            end = colour.batches.end;
            let batches = self.batches.get(colour.batches.clone());
            for batch in batches.ok_or("a colour without contacts")? {
                if !colour.is_disjoint {
                    break;
                }
                for grain in batch.lanes().flat_map(|lane| [batch.i[lane], batch.j[lane]]) {
                    let grain = grain as usize;
                    if grain < self.grains && colour_of[grain] == number {
                        return Err("a colour in which a grain has two contacts");
                    }
                    colour_of[grain] = number;
                }
            }
        }
        if end == self.batches.len() { Ok(()) } else { Err("contacts without a colour") }
    }
}
