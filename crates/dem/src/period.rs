//! Space that repeats along one axis: a grain that leaves at one end comes in at the other.
//!
//! Places are kept in `[from, from + length)` at the begin of every substep, so that two of them are less than two
//! lengths apart and the nearest image of one seen from the other is at most one length away (minimum image
//! convention; Allen and Tildesley, Computer Simulation of Liquids, 1.6.2).

use granulcal_scene::Periodic;
use nalgebra::Vector3;

use crate::lanes::{Reg, Reg3, Width};

/// The axis along which space repeats.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Period {
    /// 0 or 1: x or y.
    axis: usize,
    from: f64,
    length: f64,
}

impl Period {
    pub fn of(periodic: &Periodic) -> Self {
        let Periodic { axis, from, to } = *periodic;
        Self { axis: axis.index(), from, length: to - from }
    }

    /// One length along the axis `[m]`.
    pub fn step(&self) -> Vector3<f64> {
        let mut step = Vector3::zeros();
        step[self.axis] = self.length;
        step
    }

    /// The way between two places, or to the image of one that is nearer.
    #[inline]
    pub fn nearest(&self, mut apart: Vector3<f64>) -> Vector3<f64> {
        let along = &mut apart[self.axis];
        if *along > 0.5 * self.length {
            *along -= self.length;
        } else if *along < -0.5 * self.length {
            *along += self.length;
        }
        apart
    }

    /// The same of eight ways at once.
    #[inline(always)]
    pub fn nearest_lanes<W: Width>(&self, apart: &mut Reg3<W>) {
        let along = if self.axis == 0 { &mut apart.x } else { &mut apart.y };
        let (half, length) = (Reg::splat(0.5 * self.length), Reg::splat(self.length));
        let (way, zero) = (*along, Reg::splat(0.0));
        // One shift at most, whichever way.
        let back = half.if_less(way, length, zero);
        let on = way.if_less(zero - half, length, zero);
        *along = way - back + on;
    }

    /// Whether the nearest image of one place seen from the other is the place itself.
    #[inline]
    pub fn is_direct(&self, apart: &Vector3<f64>) -> bool {
        apart[self.axis].abs() <= 0.5 * self.length
    }

    /// Whether a way leads on along the axis.
    pub fn is_ahead(&self, apart: &Vector3<f64>) -> bool {
        apart[self.axis] > 0.0
    }

    /// Whether a place is no farther than `width` from the begin of where places are kept.
    pub fn is_near_begin(&self, place: &Vector3<f64>, width: f64) -> bool {
        place[self.axis] - self.from < width
    }

    /// By how much a place must be shifted to lie where places are kept, if it does not.
    pub fn shift(&self, place: &Vector3<f64>) -> Option<Vector3<f64>> {
        let lengths = ((place[self.axis] - self.from) / self.length).floor();
        // What is not a number stays where it is; the health says so.
        (lengths != 0.0 && lengths.is_finite()).then(|| -lengths * self.step())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use granulcal_scene::PeriodicAxis;

    #[test]
    fn nearest_images_are_at_most_half_a_length_away() {
        let period = Period::of(&Periodic { axis: PeriodicAxis::Y, from: -0.01, to: 0.03 });
        for along in [-0.039, -0.021, -0.02, -0.001, 0.0, 0.019, 0.021, 0.039] {
            let way = period.nearest(Vector3::new(0.5, along, -0.5));
            assert!(way.y.abs() <= 0.02 + 1e-15, "{along} {way}");
            let lengths = (along - way.y) / 0.04;
            assert!((lengths - lengths.round()).abs() < 1e-12 && (way.x, way.z) == (0.5, -0.5));
            assert_eq!(period.is_direct(&Vector3::new(0.0, along, 0.0)), way.y == along);
        }
        let shifted = |y| period.shift(&Vector3::new(1.0, y, 2.0)).map_or(y, |s| y + s.y);
        assert!((shifted(0.05) - 0.01).abs() < 1e-15 && (shifted(-0.011) - 0.029).abs() < 1e-15);
        assert_eq!(
            (period.shift(&Vector3::zeros()), shifted(f64::INFINITY)),
            (None, f64::INFINITY)
        );
    }
}
