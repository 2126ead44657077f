//! The search against a comparison of all pairs.

use proptest::prelude::*;

use super::*;
use crate::lanes::Row;

fn bed(points: &[([f64; 3], [f64; 3], f64)]) -> Particles {
    let places = points.iter().map(|&(position, _, radius)| Row::new(&position.into(), radius));
    let mut bed = Particles::new(places.collect(), vec![1.0; points.len()], None);
    for (i, (_, velocity, _)) in points.iter().enumerate() {
        bed.bodies[i].velocity = Row::new(&(*velocity).into(), 0.0);
    }
    bed
}

fn brute_force(bed: &Particles, reach: Reach) -> Vec<Neighbours> {
    let pairs = (0..bed.count()).flat_map(|i| (i + 1..bed.count()).map(move |j| (i, j)));
    let path = |grain| Path { from: bed.position(grain), velocity: bed.velocity(grain) };
    let within = |i, j, gap| {
        let limit = bed.radius(i) + bed.radius(j) + gap;
        path(i).comes_within(&path(j), bed, limit, reach.interval)
    };
    pairs
        .filter(|&(i, j)| within(i, j, reach.far))
        .map(|(i, j)| Neighbours { i: i as u32, j: j as u32, come_near: within(i, j, reach.near) })
        .collect()
}

proptest! {
    #[test]
    fn finds_every_pair_once(points in proptest::collection::vec(
        (prop::array::uniform3(-0.03f64..0.03), prop::array::uniform3(-3f64..3.0), 0.0005f64..0.004), 0..120),
        interval in 0f64..0.004, far in 0f64..3.0, is_periodic: bool) {
        let mut bed = bed(&points);
        bed.places[0].0[0] += far; // one grain far out stretches the grid
        bed.period = is_periodic.then(|| Period::of(&granulcal_scene::Periodic {
            axis: granulcal_scene::PeriodicAxis::Y, from: -0.03, to: 0.03,
        }));
        let mut pairs = Vec::new();
        let paths: Vec<Path> = (0..bed.count())
            .map(|i| Path { from: bed.position(i), velocity: bed.velocity(i) })
            .collect();
        let reach = Reach { interval, near: 0.0001, far: 0.0005 };
        for threads in [1, 2] {
            let threads = Threads::new(threads).unwrap();
            PairSearch::default().pairs(&bed, &paths, reach, &threads, &mut pairs);
            pairs.sort_unstable();
            prop_assert_eq!(&pairs, &brute_force(&bed, reach));
        }
    }
}
