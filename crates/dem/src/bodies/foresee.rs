//! What the end of a substep tells: what is nearest at its begin is not all that meets in it.

use super::around::Around;
use super::body::Moving;
use super::collide::{Contacts, at_all_of_walls, clearance, meet};
use super::contact::{Point, SAME_PLACE};
use super::meeting::Asked;
use super::motion::{Motion, Way};
use super::pairs::{Neighbours, Pair, SLACK};
use super::pose::Pose;

/// What goes farther than this within a substep is examined where it will be, too, in the least margin `[-]`.
const FORESEEN: f64 = 0.5;
/// Gaps of points that bodies turn past are corrected by no less than this, in their reach `[-]`.
const CORRECTED: f64 = 2e-3;
/// Ways that lead no farther from each other than this, in the bodies' reach, lead into the same `[-]`: two bodies get
/// deeper by twice of it, a third of what sweeps may leave a point.
const SAME_WAY: f64 = 2e-3;
/// Two bodies that go no farther beside each other, in their reach, meet at the points that are known of them `[-]`:
/// another would lie within half of what makes it one of these.
const KNOWN_WAY: f64 = 0.5 * SAME_PLACE;

impl Contacts {
    /// Adds the points at which bodies would lie in something at the end of the substep, behind the others: a corner
    /// that swings in from elsewhere is none of those that are nearest at its begin. Returns whether there are any.
    pub fn foresee(
        &mut self,
        around: &Around<'_>,
        bodies: &[Moving],
        neighbours: &mut Neighbours,
    ) -> bool {
        let (sorted, known) = (self.manifolds.points(), self.points.len());
        self.corrected.clear();
        self.seek_farther(around, bodies, neighbours);
        let (reach, dt) = (around.solid.reach, around.dt);
        let ways: Vec<_> = bodies.iter().map(|body| Way::of(body, reach, dt)).collect();
        let is_other = self.examine(around, &ways);
        if !is_other.contains(&true) {
            return false;
        }
        let least = FORESEEN * around.least();
        // What is no deeper than sweeps leave a point is none yet.
        let range = -around.may_close;
        let mut later = Later::new(around, bodies);
        let mut new = Vec::new();
        for (i, way) in ways.iter().enumerate() {
            let goes = way.length + around.way_of_walls(&bodies[i].pose.centre);
            if is_other[i] && goes > least.max(self.clear_of_walls[i]) {
                at_all_of_walls(around, later.find(i), i, (dt, range), &mut new);
            }
        }
        let mut asked = Vec::new();
        let lengths: Vec<_> = ways.iter().map(|way| way.length).collect();
        let longest = lengths.iter().copied().fold(0.0, f64::max);
        for &Pair { i, j, clear, .. } in &self.pairs {
            let is_known = clear == f64::NEG_INFINITY;
            let far = if is_known { KNOWN_WAY * reach } else { least.max(clear) };
            if far < 2.0 * longest
                && (is_other[i] || is_other[j])
                && lengths[i] + lengths[j] > far
                && ways[i].beside(&ways[j]) > far
            {
                later.find(i);
                later.find(j);
                if clearance(around.solid, later.pose(i), later.pose(j)) <= range {
                    asked.push(Asked { i, j, range });
                }
            }
        }
        meet(
            around,
            |body| later.pose(body),
            &asked,
            |number, meeting| {
                meeting.points(around, &asked[number], |point| new.push(point));
            },
        );
        let (least, mut is_news) = (CORRECTED * around.solid.reach, false);
        for point in new {
            let point = point.foreseen(bodies, |body| later.pose(body), around.dt);
            let name = point.name();
            let mut manifold = self.manifolds.of(name);
            let of_manifold = manifold.as_ref().map_or(0..0, |manifold| manifold.range());
            let same = of_manifold
                .chain((sorted..known).filter(|&number| self.points[number].name() == name))
                .find(|&number| self.points[number].is_like(&point, around.solid.reach));
            match same {
                // Its bodies turn so far that it gets there sooner than its velocity says.
                Some(number) if point.gap < self.points[number].gap - least => {
                    self.points[number].gap = point.gap;
                    if let Some(manifold) = &mut manifold {
                        manifold.is_news = true;
                    }
                    self.corrected.push(number);
                }
                Some(_) => continue,
                None => self.points.push(point),
            }
            is_news = true;
        }
        is_news
    }

    /// Moves those of the points of which impacts have moved a body to where its last motion begins: the impulses of
    /// sweeps act from there.
    pub fn carry(&mut self, bodies: &[Moving]) {
        for manifold in self.manifolds.all() {
            if manifold.last_hit(bodies) > 0.0 {
                carry(&mut self.points[manifold.range()], bodies);
            }
        }
    }

    /// The same of the points from `first` on, which are in no manifold yet.
    pub fn carry_from(&mut self, first: usize, bodies: &[Moving]) {
        for point in &mut self.points[first..] {
            if point.last_hit(bodies) > 0.0 {
                carry(std::slice::from_mut(point), bodies);
            }
        }
    }

    /// Puts the points that are in no manifold yet among the others, in the order of their names: behind those of the
    /// same.
    pub fn merge(&mut self) {
        let sorted = self.manifolds.points();
        let mut new = self.points.split_off(sorted);
        new.sort_by_key(Point::name);
        self.manifolds.merge(&new);
        let (mut left, mut at) = (sorted, sorted + new.len());
        self.points.extend_from_slice(&new);
        for point in new.into_iter().rev() {
            while left > 0 && self.points[left - 1].name() > point.name() {
                (left, at) = (left - 1, at - 1);
                self.points[at] = self.points[left];
            }
            at -= 1;
            self.points[at] = point;
        }
    }

    /// Adds the pairs of bodies whose motion impacts have changed so much that they may meet others.
    fn seek_farther(
        &mut self,
        around: &Around<'_>,
        bodies: &[Moving],
        neighbours: &mut Neighbours,
    ) {
        let reach = around.solid.reach;
        let now: Vec<_> = bodies.iter().map(|body| Motion::of(body, reach)).collect();
        let slack = SLACK * reach / around.dt;
        let is_other = |(now, then): (&Motion, &Motion)| {
            (now.velocity - then.velocity).norm() + (now.turning - then.turning).max(0.0) > slack
        };
        let other: Vec<_> = now.iter().zip(&self.motions).map(is_other).collect();
        if other.contains(&true) {
            neighbours.more(around, bodies, &now, |body| other[body], &mut self.pairs);
            self.motions = now;
        }
    }

    /// Which bodies go another way than that of which the end has been looked at last; it is taken as looked at.
    fn examine(&mut self, around: &Around<'_>, ways: &[Way]) -> Vec<bool> {
        if self.examined.is_empty() {
            self.examined = ways.to_vec();
            return vec![true; ways.len()];
        }
        let least = SAME_WAY * around.solid.reach;
        let is_other = |(then, now): (&mut Way, &Way)| {
            let is_other = now.differs(then, around.solid.reach) > least;
            if is_other {
                *then = *now;
            }
            is_other
        };
        self.examined.iter_mut().zip(ways).map(is_other).collect()
    }
}

/// Moves points to where the last motions of their bodies begin.
fn carry(points: &mut [Point], bodies: &[Moving]) {
    for point in points {
        point.carry(|body| bodies[body].pose, |body| bodies[body].foreseen(0.0));
    }
}

/// Where bodies will be at the end of the substep, each found when it is asked for.
struct Later<'a> {
    around: &'a Around<'a>,
    bodies: &'a [Moving],
    poses: Vec<Pose>,
    /// The number of each body's pose among them.
    places: Vec<u32>,
}

/// No pose is known.
const UNKNOWN: u32 = u32::MAX;

impl<'a> Later<'a> {
    fn new(around: &'a Around<'a>, bodies: &'a [Moving]) -> Self {
        Self { around, bodies, poses: Vec::new(), places: vec![UNKNOWN; bodies.len()] }
    }

    fn find(&mut self, body: usize) -> &Pose {
        if self.places[body] == UNKNOWN {
            self.places[body] = self.poses.len() as u32;
            self.poses.push(self.bodies[body].foreseen(self.around.dt));
        }
        self.pose(body)
    }

    /// That of a body for which it has been found.
    fn pose(&self, body: usize) -> &Pose {
        &self.poses[self.places[body] as usize]
    }
}
