//! One search for pairs, frozen: what studies of its cost repeat.

use crate::contact_context::ContactContext;
use crate::neighbor::{Neighbours, PairSearch};
use crate::parallel::Threads;
use crate::particles::Particles;
use crate::path::{Path, Reach};

/// The grains of a moment, whose neighbours can be searched again and again.
#[derive(Clone, Debug)]
pub struct FrozenSearch {
    particles: Particles,
    paths: Vec<Path>,
    reach: Reach,
    threads: Threads,
    search: PairSearch,
    found: Vec<Neighbours>,
}

impl FrozenSearch {
    pub(crate) fn new(particles: Particles, around: &ContactContext) -> Self {
        Self {
            paths: Path::all_of(&particles),
            reach: around.reach(),
            threads: around.threads.clone(),
            search: PairSearch::default(),
            found: Vec::new(),
            particles,
        }
    }

    /// Lists the pairs that may touch before the next list and returns their number.
    pub fn pairs(&mut self) -> usize {
        self.search.pairs(&self.particles, &self.paths, self.reach, &self.threads, &mut self.found);
        self.found.len()
    }
}
