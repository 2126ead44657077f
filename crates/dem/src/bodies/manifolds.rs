//! Which points of a substep lie between the same two: those of one manifold are one behind the other, and manifolds in
//! the order of their names.

use std::ops::Range;

use super::body::{Moving, last_hit};
use super::contact::{Name, Point};

/// Consecutive points of one pair, or of one body and one surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Manifold {
    pub name: Name,
    first: u32,
    end: u32,
    /// Whether impacts have not been looked for at it since a point of it was found or its gap corrected.
    pub is_news: bool,
}

impl Manifold {
    /// The numbers of its points.
    pub fn range(&self) -> Range<usize> {
        self.first as usize..self.end as usize
    }

    /// Body i.
    pub fn i(&self) -> usize {
        self.name.1 as usize
    }

    /// Body j; none at a wall.
    pub fn j(&self) -> Option<usize> {
        let (is_of_two, _, j) = self.name;
        is_of_two.then_some(j as usize)
    }

    /// When the later of the last impacts of its bodies was, 0 if there was none `[s]`.
    pub fn last_hit(&self, bodies: &[Moving]) -> f64 {
        last_hit(bodies, self.i(), self.j())
    }
}

/// The manifolds of a list of points.
#[derive(Clone, Debug, Default)]
pub(super) struct Manifolds(Vec<Manifold>);

impl Manifolds {
    pub fn all(&self) -> &[Manifold] {
        &self.0
    }

    pub fn all_mut(&mut self) -> &mut [Manifold] {
        &mut self.0
    }

    /// The number of points in them.
    pub fn points(&self) -> usize {
        self.0.last().map_or(0, |last| last.end as usize)
    }

    /// The one of this name.
    pub fn of(&mut self, name: Name) -> Option<&mut Manifold> {
        self.0.binary_search_by_key(&name, |manifold| manifold.name).ok().map(|at| &mut self.0[at])
    }

    /// Appends those of the points that follow, which are in the order of their names and begin with a new one.
    #[inline(always)]
    pub fn add(&mut self, following: &[Point]) {
        for group in following.chunk_by(|a, b| a.name() == b.name()) {
            self.push(group[0].name(), group.len(), true);
        }
    }

    /// Takes points in, in the order of their names: behind those of the same.
    pub fn merge(&mut self, new: &[Point]) {
        let old = std::mem::replace(self, Self(Vec::with_capacity(self.0.len() + new.len())));
        let mut groups = new.chunk_by(|a, b| a.name() == b.name()).peekable();
        for manifold in old.0 {
            while let Some(group) = groups.next_if(|group| group[0].name() < manifold.name) {
                self.push(group[0].name(), group.len(), true);
            }
            let more = groups.next_if(|group| group[0].name() == manifold.name);
            let count = manifold.range().len() + more.map_or(0, <[_]>::len);
            self.push(manifold.name, count, manifold.is_news || more.is_some());
        }
        for group in groups {
            self.push(group[0].name(), group.len(), true);
        }
    }

    fn push(&mut self, name: Name, count: usize, is_news: bool) {
        let first = self.points();
        debug_assert!(self.0.last().is_none_or(|last| last.name < name));
        self.0.push(Manifold { name, first: first as u32, end: (first + count) as u32, is_news });
    }
}
