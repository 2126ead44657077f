//! Warm start: the impulses with which points go on from a substep to the next.

use serde::{Deserialize, Serialize};

use super::body::Moving;
use super::contact::{Name, Point};
use super::manifolds::Manifolds;
use nalgebra::Vector3;

/// A point is known again within this distance from where it was on its body, in its reach `[-]`.
const KNOWN: f64 = 0.15;

/// A point's manifold, where the point was on its body, and its impulse.
type Mark = (Name, [f64; 3], [f64; 3]);

/// The points of a substep that had an impulse, in the order of their manifolds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Marks(Vec<Mark>);

impl Marks {
    /// Whether they are in order, and of no more than so many bodies.
    pub fn are_of(&self, bodies: usize) -> bool {
        let is_there = |&((is_of_two, i, j), ..): &Mark| {
            (i as usize) < bodies && (!is_of_two || (j as usize) < bodies)
        };
        self.0.is_sorted_by_key(|mark| mark.0) && self.0.iter().all(is_there)
    }

    /// A point that is where one was begins with its impulse, which its bodies get; `reach` is theirs `[m]`.
    pub fn recall(
        &self,
        (manifolds, points): (&Manifolds, &mut [Point]),
        bodies: &mut [Moving],
        reach: f64,
    ) {
        debug_assert!(points.is_sorted_by_key(Point::name) && points.len() == manifolds.points());
        let near = KNOWN * reach;
        let mut is_free = vec![true; self.0.len()];
        let mut first = 0;
        for manifold in manifolds.all() {
            // Both are in one order.
            let name = manifold.name;
            first += self.0[first..].iter().take_while(|mark| mark.0 < name).count();
            let end = first + self.0[first..].iter().take_while(|mark| mark.0 == name).count();
            for point in &mut points[manifold.range()] {
                let square = |mark: &Mark| (Vector3::from(mark.1) - point.mark).norm_squared();
                let nearest = (first..end)
                    .filter(|&number| is_free[number])
                    .map(|number| (number, square(&self.0[number])))
                    .min_by(|a, b| a.1.total_cmp(&b.1));
                if let Some((number, square)) = nearest
                    && square < near * near
                {
                    // No two points go on from one.
                    is_free[number] = false;
                    point.impulse = point.admitted(&self.0[number].2.into());
                    point.give(bodies, &point.impulse);
                }
            }
            first = end;
        }
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.0.clear();
    }

    /// Keeps the impulse of a point, if it has one, behind the others.
    pub fn keep(&mut self, point: &Point) {
        if point.impulse != Vector3::zeros() {
            self.0.push((point.name(), point.mark.into(), point.impulse.into()));
        }
    }

    /// Puts them in the order of their manifolds.
    pub fn sort(&mut self) {
        self.0.sort_by_key(|mark| mark.0);
    }
}
