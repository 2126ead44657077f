//! Which corner of a hull is farthest along a direction: all are asked, eight at a time.
//!
//! GJK asks twice a step, and a superquadric has some two hundred. The products and sums are parry's, one by one, and
//! of equals the first is taken, as there: the answer is the same.

use nalgebra::Vector3;

use crate::lanes::{LANES, Lanes, Lanes3, Reg, Reg3, Width, widest};
use granulcal_scene::Solid;

/// The corners of a polyhedron in units of its reach.
#[derive(Clone, Debug)]
pub(super) struct Corners {
    /// The last is filled up with the first corner.
    batches: Vec<Lanes3>,
}

impl Corners {
    /// None of a cylinder.
    pub fn of(solid: &Solid) -> Option<Self> {
        let all: Vec<_> = solid.corners.iter().map(|corner| corner / solid.reach).collect();
        let first = *all.first()?;
        let batch = |corners: &[Vector3<f64>]| {
            let mut batch = Lanes3::ZERO;
            for lane in 0..LANES {
                batch.set(lane, (*corners.get(lane).unwrap_or(&first)).into());
            }
            batch
        };
        Some(Self { batches: all.chunks(LANES).map(batch).collect() })
    }

    /// The corner that is farthest along a direction, the first of equals.
    pub fn farthest(&self, along: &Vector3<f64>) -> Vector3<f64> {
        let mut number = Lanes::ZERO;
        let most = most(&self.batches, along, &mut number);
        let mut best = 0;
        for lane in 1..LANES {
            let (is_more, is_equal) = (most.0[lane] > most.0[best], most.0[lane] == most.0[best]);
            if is_more || is_equal && number.0[lane] < number.0[best] {
                best = lane;
            }
        }
        let number = number.0[best] as usize;
        self.batches[number / LANES].get(number % LANES).into()
    }
}

widest! {
    /// The largest product of each lane, and the number of the corner that has it first.
    fn most<W>(batches: &[Lanes3], along: &Vector3<f64>, number: &mut Lanes) -> Lanes {
        let along = Reg3 {
            x: Reg::<W>::splat(along.x),
            y: Reg::splat(along.y),
            z: Reg::splat(along.z),
        };
        let (eight, mut of_lane) = (Reg::splat(LANES as f64), Reg::load(&NUMBERS));
        let (mut most, mut of_most) = (product(along, &batches[0]), of_lane);
        for batch in &batches[1..] {
            of_lane = of_lane + eight;
            let found = product(along, batch);
            of_most = most.if_less(found, of_lane, of_most);
            most = most.if_less(found, found, most);
        }
        of_most.store(number);
        let mut all = Lanes::ZERO;
        most.store(&mut all);
        all
    }
}

/// Products and sums each rounded, which a fused one is not.
#[inline(always)]
fn product<W: Width>(along: Reg3<W>, batch: &Lanes3) -> Reg<W> {
    let corner = Reg3::<W>::load(batch);
    corner.x * along.x + corner.y * along.y + corner.z * along.z
}

const NUMBERS: Lanes = Lanes([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);

#[cfg(test)]
mod tests {
    use super::*;
    use granulcal_scene::{GrainShape, parry};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_farthest_corner_is_parrys(
            exponent in 2.0..6.0_f64,
            along in prop::array::uniform3(-1.0..1.0_f64),
            flat in any::<bool>(),
        ) {
            let shape = GrainShape::Superquadric { aspect: [1.0, 0.7, 1.4], exponents: [exponent, 3.0] };
            let solid = Solid::new(&shape, 4e-3).unwrap();
            let mut along = Vector3::from(along);
            if flat {
                along.z = 0.0; // Corners come in pairs of equals.
            }
            let corner = Corners::of(&solid).unwrap().farthest(&along);
            let parrys = solid.unit.as_support_map().unwrap().local_support_point(parry(&along));
            prop_assert_eq!(corner, Vector3::new(parrys.x, parrys.y, parrys.z));
        }
    }
}
