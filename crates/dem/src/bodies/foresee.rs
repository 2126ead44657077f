//! What the end of a substep tells: what is nearest at its begin is not all that meets in it.

use super::around::Around;
use super::body::Moving;
use super::collide::{Contacts, at_walls, clearance, meet};
use super::contact::Point;
use super::meeting::Asked;
use super::motion::{Motion, Way};
use super::pairs::{Neighbours, Pair, SLACK};
use super::pose::Pose;
use super::rims::at_rims;

/// What goes farther than this within a substep is examined where it will be, too, in the least margin `[-]`.
const FORESEEN: f64 = 0.5;
/// Gaps of points that bodies turn past are corrected by no less than this, in their reach `[-]`.
const CORRECTED: f64 = 2e-3;
/// Ways that lead no farther from each other than this, in the bodies' reach, lead into the same `[-]`.
const SAME_WAY: f64 = 2e-4;

impl Contacts {
    /// Adds the points at which bodies would lie in something at the end of the substep, behind the others: a corner that
    /// swings in from elsewhere is none of those that are nearest at its begin. Those before `sorted` are in the order of
    /// their names. Returns whether there are any.
    pub fn foresee(
        &mut self,
        around: &Around<'_>,
        bodies: &[Moving],
        neighbours: &mut Neighbours,
        sorted: usize,
    ) -> bool {
        let known = self.points.len();
        self.seek_farther(around, bodies, neighbours);
        let (reach, dt) = (around.solid.reach, around.dt);
        let ways: Vec<_> = bodies.iter().map(|body| Way::of(body, reach, dt)).collect();
        let is_other = self.examine(around, &ways);
        let least = FORESEEN * around.least();
        let mut later = Later::new(around, bodies);
        let mut new = Vec::new();
        for (i, way) in ways.iter().enumerate() {
            let goes = way.length() + around.way_of_walls(&bodies[i].pose.centre);
            if is_other[i] && goes > least.max(self.clear_of_walls[i]) {
                let pose = later.pose(i);
                at_walls(around, pose, i, (dt, 0.0), &mut new);
                at_rims(around, pose, i, (dt, 0.0), &mut new);
            }
        }
        let mut asked = Vec::new();
        for &Pair { i, j, clear } in &self.pairs {
            if (is_other[i] || is_other[j]) && ways[i].beside(&ways[j]) > least.max(clear) {
                let (a, b) = (*later.pose(i), *later.pose(j));
                if clearance(around.solid, &a, &b) <= 0.0 {
                    asked.push(Asked { i, j, range: 0.0 });
                }
            }
        }
        meet(around, &later.poses, &asked, |number, meeting| {
            meeting.points(around, &asked[number], |point| new.push(point));
        });
        let (least, mut is_news) = (CORRECTED * around.solid.reach, false);
        for point in new {
            let point = point.foreseen(bodies, &later.poses, around.dt);
            let first = self.points[..sorted].partition_point(|of| of.name() < point.name());
            let of_manifold = |number: &usize| self.points[*number].name() == point.name();
            let same = (first..sorted)
                .take_while(of_manifold)
                .chain((sorted..known).filter(of_manifold))
                .find(|&number| self.points[number].is_like(&point, around.solid.reach));
            match same {
                // Its bodies turn so far that it gets there sooner than its velocity says.
                Some(number) if point.gap < self.points[number].gap - least => {
                    self.points[number].gap = point.gap;
                }
                Some(_) => continue,
                None => self.points.push(point),
            }
            is_news = true;
        }
        is_news
    }

    /// Puts the points from `sorted` on among those before, in the order of their names: behind those of the same.
    pub fn merge(&mut self, sorted: usize) {
        let mut new = self.points.split_off(sorted);
        new.sort_by_key(Point::name);
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

/// Where bodies will be at the end of the substep, each found when it is asked for.
struct Later<'a> {
    around: &'a Around<'a>,
    bodies: &'a [Moving],
    /// Of those not asked for yet where they are now.
    poses: Vec<Pose>,
    is_known: Vec<bool>,
}

impl<'a> Later<'a> {
    fn new(around: &'a Around<'a>, bodies: &'a [Moving]) -> Self {
        let poses = bodies.iter().map(|body| body.pose).collect();
        Self { around, bodies, poses, is_known: vec![false; bodies.len()] }
    }

    fn pose(&mut self, body: usize) -> &Pose {
        if !std::mem::replace(&mut self.is_known[body], true) {
            self.poses[body] = self.bodies[body].foreseen(self.around.dt);
        }
        &self.poses[body]
    }
}
