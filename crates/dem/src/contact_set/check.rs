//! Whether contacts that were read from bytes can be solved: the kernels index without looking.

use super::{BodyKind, ContactSet, LANES};

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
        let is_at_walls = self.second != BodyKind::Grain;
        require(is_at_walls == walls.is_some(), "contacts of another kind")?;
        for (number, batch) in self.batches.iter().enumerate() {
            require((batch.law as usize) < self.laws.len(), "a contact without a law")?;
            self.check_lanes(number, is_at_walls)?;
        }
        for at in &self.at_walls {
            let fits = at.wall.iter().all(|&wall| (wall as usize) < walls.unwrap_or(0));
            require(fits, "a contact at a wall that the scene has not")?;
        }
        self.check_parts()
    }

    /// Lanes in use have grains, the others the resting body.
    fn check_lanes(&self, number: usize, is_at_walls: bool) -> Result<(), &'static str> {
        let batch = &self.batches[number];
        let (used, resting) = (batch.used as usize, self.grains as u32);
        let (i, j) = (&batch.i, &batch.j);
        let fits = used <= LANES
            && i[..used].iter().all(|&grain| grain < resting)
            && j[..used].iter().enumerate().all(|(lane, &body)| {
                if is_at_walls { body == self.wall_body(number, lane) } else { body < resting }
            })
            && i[used..].iter().chain(&j[used..]).all(|&body| body == resting);
        if fits { Ok(()) } else { Err("a contact of grains that the scene has not") }
    }

    /// The parts are all batches in turn, the phases all parts, and no grain is in two parts of a phase or in two lanes
    /// of a batch.
    fn check_parts(&self) -> Result<(), &'static str> {
        let (mut part, mut batch) = (0, 0);
        let mut part_of = vec![usize::MAX; self.grains];
        let mut batch_of = vec![usize::MAX; self.grains];
        let mut phase_of = vec![usize::MAX; self.grains];
        for (phase, parts) in self.phases.iter().enumerate() {
            if parts.start != part || parts.end <= part || parts.end > self.parts.len() {
                return Err("phases that are not all parts in turn");
            }
            for number in parts.clone() {
                let batches = &self.parts[number];
                if batches.start != batch
                    || batches.end <= batch
                    || batches.end > self.batches.len()
                {
                    return Err("parts that are not all contacts in turn");
                }
                for number_of_batch in batches.clone() {
                    for grain in self.grains_of(number_of_batch) {
                        let elsewhere = phase_of[grain] == phase && part_of[grain] != number;
                        if elsewhere || batch_of[grain] == number_of_batch {
                            return Err("a grain with two contacts at once");
                        }
                        phase_of[grain] = phase;
                        part_of[grain] = number;
                        batch_of[grain] = number_of_batch;
                    }
                }
                batch = batches.end;
            }
            part = parts.end;
        }
        let is_all = part == self.parts.len() && batch == self.batches.len();
        if is_all { Ok(()) } else { Err("contacts without a part") }
    }

    fn grains_of(&self, batch: usize) -> impl Iterator<Item = usize> + '_ {
        let batch = &self.batches[batch];
        let bodies = batch.lanes().flat_map(|lane| [batch.i[lane], batch.j[lane]]);
        bodies.map(|body| body as usize).filter(|&body| body < self.grains)
    }
}
