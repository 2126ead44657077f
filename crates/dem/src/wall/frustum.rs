//! A frustum, a cone or a cylinder, is a thin shell of revolution. In the half plane through its axis and the grain it
//! is a straight segment, so the nearest point is the nearest point of a segment.

use nalgebra::Vector3;

use super::nearest::{Nearest, Passage, any_normal};

/// A shell of revolution whose generator is a segment.
#[derive(Clone, Debug)]
pub(crate) struct Frustum {
    from: Vector3<f64>,
    axis: Vector3<f64>,
    radius_from: f64,
    /// The generator in the half plane (along the axis, away from it).
    generator: Vector2,
    /// Ball about the middle of the axis that holds the shell: a cheap first test.
    middle: Vector3<f64>,
    reach: f64,
    /// Whether the rims at its begin and end are its own to touch, or those of a shell that it joins.
    pub owns: [bool; 2],
}

type Vector2 = nalgebra::Vector2<f64>;

/// How often the way between two places is halved to find where it crosses a shell.
const HALVINGS: usize = 40;

impl Frustum {
    pub fn new(from: Vector3<f64>, to: Vector3<f64>, radius_from: f64, radius_to: f64) -> Self {
        let length = (to - from).norm();
        let generator = Vector2::new(length, radius_to - radius_from);
        let reach = (0.5 * length).hypot(radius_from.max(radius_to));
        let middle = 0.5 * (from + to);
        let axis = (to - from) / length;
        Self { from, axis, radius_from, generator, middle, reach, owns: [true; 2] }
    }

    /// Unit, from its begin to its end.
    pub fn axis(&self) -> &Vector3<f64> {
        &self.axis
    }

    /// From its begin to its end, along the axis and away from it `[m]`.
    pub fn generator(&self) -> &Vector2 {
        &self.generator
    }

    /// Centres and radii of the circles at its begin and end `[m]`.
    pub fn ends(&self) -> [(Vector3<f64>, f64); 2] {
        [[0.0; 2], self.generator.into()]
            .map(|[along, outward]| (self.from + along * self.axis, self.radius_from + outward))
    }

    pub fn nearest(&self, centre: &Vector3<f64>) -> Nearest {
        let (near, share) = self.nearest_of_all(centre);
        let is_joined = (share <= 0.0 && !self.owns[0]) || (share >= 1.0 && !self.owns[1]);
        if is_joined { Nearest { distance: f64::INFINITY, ..near } } else { near }
    }

    /// Whether it may be nearer than `range` `[m]`; false only when it surely is not.
    pub fn may_reach(&self, centre: &Vector3<f64>, range: f64) -> bool {
        let reach = self.reach + range;
        (centre - self.middle).norm_squared() < reach * reach
            && self.nearest_of_all(centre).0.distance < range
    }

    /// A place from the begin of the generator, along the axis and away from it `[m]`; and the unit direction away from
    /// the axis there.
    fn seen(&self, centre: &Vector3<f64>) -> (Vector2, Vector3<f64>) {
        let offset = centre - self.from;
        let along = offset.dot(&self.axis);
        let outward = offset - along * self.axis;
        let radius = outward.norm();
        // On the axis every direction is as near as any other: take one at right angles to it.
        let outward = if radius > 0.0 { outward / radius } else { any_normal(&self.axis) };
        (Vector2::new(along, radius - self.radius_from), outward)
    }

    pub fn leads_round(
        &self,
        from: &Vector3<f64>,
        to: &Vector3<f64>,
    ) -> Option<(Vector3<f64>, f64)> {
        // A way that is shorter than it is to either end crosses the shell between them.
        let (way, length) = ((to - from).norm(), self.generator.norm());
        let along = self.seen(from).0.dot(&self.generator) / length;
        if way <= along && along <= length - way {
            return None;
        }
        self.beyond(self.crossing(from, to)?)
    }

    pub fn passed(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> Option<Passage> {
        if self.beyond(self.crossing(from, to)?).is_some() {
            return None;
        }
        let (end, outward) = self.seen(to);
        let length = self.generator.norm();
        let height = self.generator.perp(&end) / length;
        // Towards the side where the way begins, across the generator.
        let back = Vector2::new(self.generator.y, -self.generator.x) * (height.signum() / length);
        let normal = back.x * self.axis + back.y * outward;
        let share = end.dot(&self.generator) / self.generator.norm_squared();
        Some(Passage { depth: height.abs(), normal, beyond: self.beyond(share) })
    }

    /// The circle at the end beyond which a share of the generator is, if it is beyond one.
    fn beyond(&self, share: f64) -> Option<(Vector3<f64>, f64)> {
        let [at_begin, at_end] = self.ends();
        match share {
            share if share < 0.0 => Some(at_begin),
            share if share > 1.0 => Some(at_end),
            _ => None,
        }
    }

    /// Where a way goes through the shell or what would go on beyond its ends, as a share of the generator.
    fn crossing(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> Option<f64> {
        let is_outside = |x: &Vector3<f64>| self.generator.perp(&self.seen(x).0) > 0.0;
        let begin = is_outside(from);
        if is_outside(to) == begin {
            return None;
        }
        let (mut before, mut after) = (*from, *to);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (before + after);
            *(if is_outside(&middle) == begin { &mut before } else { &mut after }) = middle;
        }
        Some(self.seen(&after).0.dot(&self.generator) / self.generator.norm_squared())
    }

    /// The nearest point whoever owns it, and where along the generator it would be.
    fn nearest_of_all(&self, centre: &Vector3<f64>) -> (Nearest, f64) {
        let (in_plane, outward) = self.seen(centre);
        let share = in_plane.dot(&self.generator) / self.generator.norm_squared();
        let gap = in_plane - share.clamp(0.0, 1.0) * self.generator;
        let distance = gap.norm();
        let cross = self.generator.perp(&in_plane);
        let beyond_the_ends = share <= 0.0 || share >= 1.0;
        let side = if beyond_the_ends || cross == 0.0 { 0 } else { cross.signum() as i8 };
        // A centre on the shell itself is pushed inwards.
        let inwards = Vector2::new(self.generator.y, -self.generator.x);
        let direction = if distance > 0.0 { gap / distance } else { inwards.normalize() };
        let normal = direction.x * self.axis + direction.y * outward;
        (Nearest { distance, normal, side, bends: true }, share)
    }
}
