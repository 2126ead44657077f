//! The search against a comparison of all pairs.

use proptest::prelude::*;

use super::*;
use crate::lanes::Row;

fn particles(points: &[([f64; 3], [f64; 3], f64)]) -> Particles {
    let spheres = points.iter().map(|&(position, _, radius)| Row::new(&position.into(), radius));
    let mut particles = Particles::new(spheres.collect(), vec![1.0; points.len()], None);
    for (i, (_, velocity, _)) in points.iter().enumerate() {
        particles.bodies[i].velocity = Row::new(&(*velocity).into(), 0.0);
    }
    particles
}

fn brute_force(particles: &Particles, reach: Reach) -> Vec<Neighbours> {
    let pairs =
        (0..particles.count()).flat_map(|i| (i + 1..particles.count()).map(move |j| (i, j)));
    let path =
        |grain| Path { from: particles.position(grain), velocity: particles.velocity(grain) };
    let within = |i, j, gap| {
        let limit = particles.radius(i) + particles.radius(j) + gap;
        path(i).comes_within(&path(j), particles, limit, reach.interval)
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
        interval in 0f64..0.004, far in 0f64..3.0, is_periodic: bool, wide in 0usize..3) {
        let mut particles = particles(&points);
        // Some are far wider than the others, but not than space is where it repeats.
        let wide = if is_periodic { 0 } else { wide.min(particles.count() / 10) };
        for grain in 0..wide {
            particles.spheres[10 * grain].0[3] = 0.03;
        }
        particles.spheres[0].0[0] += far; // one grain far out stretches the grid
        particles.period = is_periodic.then(|| Period::of(&granulcal_scene::Periodic {
            axis: granulcal_scene::PeriodicAxis::Y, from: -0.03, to: 0.03,
        }));
        let mut pairs = Vec::new();
        let paths: Vec<Path> = (0..particles.count())
            .map(|i| Path { from: particles.position(i), velocity: particles.velocity(i) })
            .collect();
        let reach = Reach { interval, near: 0.0001, far: 0.0005 };
        for threads in [1, 2] {
            let threads = Threads::new(threads).unwrap();
            let mut search = PairSearch::default();
            search.pairs(&particles, &paths, reach, &threads, &mut pairs);
            prop_assert!(search.wide().len() >= wide.min(usize::from(particles.count() > 20)));
            pairs.sort_unstable();
            prop_assert_eq!(&pairs, &brute_force(&particles, reach));
        }
    }
}
