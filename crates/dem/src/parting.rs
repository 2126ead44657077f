//! Grains of different size on a lattice that is as wide as grains of one size need: parted before the pour begins.
//!
//! While any two overlap, each pair that does is moved apart along the line between its centres, either grain by half
//! of it, in the order of their numbers (Gauss and Seidel's rounds of position-based dynamics; Müller et al. 2007), and
//! what is in a wall is moved out of it: docs/theory/effects.md, polydispersity.

use nalgebra::Vector3;

use crate::cells::pairs_within;
use crate::lanes::Row;
use crate::period::Period;
use crate::wall::Walls;

/// Two that overlap are moved so much farther apart than they must be, in the sum of their radii `[-]`: what is parted
/// stays so while its neighbours are.
const FARTHER: f64 = 1e-3;
/// Pairs are known so much farther than they touch, in the largest radius, and found anew when grains may have gone so
/// far `[-]`.
const SKIN: f64 = 0.4;
/// Rounds at most: what a closed container has no room for is left to the pour.
const ROUNDS: usize = 10_000;

/// Parts spheres that overlap each other, across the ends of a period too, or a wall; none goes through a wall. Those
/// that hang in the air keep the height of their lowest point.
pub(crate) fn part(spheres: &mut [Row], walls: &Walls, period: Option<Period>, hangs: bool) {
    let mut places = Places::of(spheres, period);
    let floor = places.lowest();
    let is_moved = places.relax(walls);
    if is_moved && hangs {
        let lift = floor - places.lowest();
        places.centres.iter_mut().for_each(|centre| centre.z += lift);
        // It may have come into a wall beside it.
        places.relax(walls);
    }
    for (sphere, centre) in spheres.iter_mut().zip(&places.centres) {
        *sphere = Row::new(centre, sphere.0[3]);
    }
}

/// Where spheres are, and how large.
struct Places {
    centres: Vec<Vector3<f64>>,
    radii: Vec<f64>,
    period: Option<Period>,
}

impl Places {
    fn of(spheres: &[Row], period: Option<Period>) -> Self {
        let centres = spheres.iter().map(Row::vector).collect();
        Self { centres, radii: spheres.iter().map(|sphere| sphere.0[3]).collect(), period }
    }

    /// Height of the lowest point `[m]`.
    fn lowest(&self) -> f64 {
        let bottoms =
            self.centres.iter().zip(&self.radii).map(|(centre, radius)| centre.z - radius);
        bottoms.fold(f64::INFINITY, f64::min)
    }

    /// Moves what overlaps until nothing does; returns whether anything did.
    fn relax(&mut self, walls: &Walls) -> bool {
        let largest = self.radii.iter().copied().fold(0.0, f64::max);
        let (mut near, mut sought_at, mut before) = (Vec::new(), Vec::new(), Vec::new());
        for round in 0..ROUNDS {
            let gone = |(now, then): (&Vector3<f64>, &Vector3<f64>)| (now - then).norm();
            let may_go = 0.5 * SKIN * largest;
            let is_known = sought_at.len() == self.centres.len()
                && self.centres.iter().zip(&sought_at).map(gone).all(|way| way <= may_go);
            if !is_known {
                sought_at.clone_from(&self.centres);
                near = self.near(SKIN * largest, largest);
            }
            before.clone_from(&self.centres);
            let overlapped = self.part_pairs(&near) | self.leave_walls(walls);
            self.stay_inside(&before, walls);
            if !overlapped {
                return round > 0;
            }
        }
        true
    }

    /// Pairs that are no farther than `skin` from touching, in order; those across the ends of a period, too.
    fn near(&self, skin: f64, largest: f64) -> Vec<(usize, usize)> {
        let (count, width) = (self.centres.len(), skin + 2.0 * largest);
        let (mut places, mut radii) = (self.centres.clone(), self.radii.clone());
        let mut owners: Vec<_> = (0..count).collect();
        if let Some(period) = &self.period {
            for place in &mut places {
                *place += period.shift(place).unwrap_or_default();
            }
            // What begins beside one end is seen again beyond the other.
            for grain in 0..count {
                if period.is_near_begin(&places[grain], width) {
                    places.push(places[grain] + period.step());
                    radii.push(radii[grain]);
                    owners.push(grain);
                }
            }
        }
        let mut pairs = Vec::new();
        pairs_within(&places, &radii, skin, width, |i, j| {
            let (i, j) = (owners[i as usize], owners[j as usize]);
            if i != j {
                pairs.push((i.min(j), i.max(j)));
            }
        });
        pairs.sort_unstable();
        pairs.dedup();
        pairs
    }

    /// Takes back whoever has been moved through a wall.
    fn stay_inside(&mut self, before: &[Vector3<f64>], walls: &Walls) {
        for ((centre, from), &radius) in self.centres.iter_mut().zip(before).zip(&self.radii) {
            let mut has_passed = false;
            let way = (*centre - from).norm();
            if way > 0.0 {
                walls.reached(centre, radius + way, |surface| {
                    has_passed |= walls.is_passed(surface, from, centre, 0.0);
                });
            }
            if has_passed {
                *centre = *from;
            }
        }
    }

    /// One round over pairs; returns whether any overlapped.
    fn part_pairs(&mut self, near: &[(usize, usize)]) -> bool {
        let mut overlapped = false;
        for &(i, j) in near {
            let apart = self.centres[j] - self.centres[i];
            let offset = self.period.map_or(apart, |period| period.nearest(apart));
            let (apart, distance) = (self.radii[i] + self.radii[j], offset.norm());
            if distance < apart {
                let along = if distance > 0.0 { offset / distance } else { Vector3::z() };
                let aside = 0.5 * ((1.0 + FARTHER) * apart - distance) * along;
                self.centres[i] -= aside;
                self.centres[j] += aside;
                overlapped = true;
            }
        }
        overlapped
    }

    /// One round over what is in a wall; returns whether any was.
    fn leave_walls(&mut self, walls: &Walls) -> bool {
        let mut overlapped = false;
        for (centre, &radius) in self.centres.iter_mut().zip(&self.radii) {
            let at = *centre;
            walls.reached(&at, radius, |surface| {
                let near = walls.nearest(surface, centre, 0.0);
                if near.distance < radius {
                    *centre += ((1.0 + FARTHER) * radius - near.distance) * near.normal;
                    overlapped = true;
                }
            });
        }
        overlapped
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use granulcal_scene::Scene;

    fn ball(cv: f64) -> Vec<Row> {
        let mut scene = Scene::drop(0.05);
        scene.grains.count = 500;
        scene.effects.polydispersity.cv = cv;
        let radii = scene.effects.polydispersity.radii(500, scene.grains.radius(), 3).unwrap();
        let places = scene.starting_positions(3);
        places.iter().zip(radii).map(|(at, radius)| Row::new(at, radius)).collect()
    }

    fn deepest(spheres: &[Row]) -> f64 {
        let mut deepest = 0.0_f64;
        for (i, a) in spheres.iter().enumerate() {
            for b in &spheres[..i] {
                deepest = deepest.max(a.0[3] + b.0[3] - (a.vector() - b.vector()).norm());
            }
        }
        deepest
    }

    fn lowest(spheres: &[Row]) -> f64 {
        spheres.iter().map(|sphere| sphere.0[2] - sphere.0[3]).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn no_two_overlap_at_any_spread_and_the_ball_hangs_where_it_did() {
        for cv in [0.05, 0.2, 0.5] {
            let before = ball(cv);
            let mut spheres = before.clone();
            part(&mut spheres, &Walls::of(&Scene::drop(0.05)), None, true);
            assert!(deepest(&before) > 0.0 && deepest(&spheres) <= 0.0, "{cv}");
            assert!((lowest(&spheres) - lowest(&before)).abs() < 1e-12);
            let (mean, widest) =
                before.iter().zip(&spheres).fold((0.0, 0.0_f64), |(sum, most), (a, b)| {
                    let way = (a.vector() - b.vector()).norm();
                    (sum + way / 500.0, most.max(way))
                });
            // Some radii, of 2 mm, at the outside of the ball.
            assert!(mean < 4e-3 && widest < 2e-2, "{cv}: {mean} {widest}");
        }
    }

    #[test]
    fn a_column_stays_in_its_tube() {
        let mut scene = Scene::parse(include_str!("../../../examples/column.toml")).unwrap();
        scene.effects.polydispersity.cv = 0.2;
        let (count, radius) = (scene.grains.count, scene.grains.radius());
        let radii = scene.effects.polydispersity.radii(count, radius, 3).unwrap();
        let places = scene.starting_positions(3);
        let mut spheres: Vec<_> =
            places.iter().zip(radii).map(|(at, radius)| Row::new(at, radius)).collect();
        let walls = Walls::of(&scene);
        assert!(deepest(&spheres) > 0.1 * radius);
        part(&mut spheres, &walls, None, false);
        assert!(deepest(&spheres) <= 0.0);
        for sphere in &spheres {
            let centre = sphere.vector();
            for surface in 0..walls.surfaces() {
                assert!(walls.nearest(surface, &centre, 0.0).distance >= sphere.0[3], "{centre}");
            }
        }
    }

    fn grid(text: &str) -> (Scene, Vec<Row>) {
        let head = "name = 'p'\n[material]\nsliding_friction = 0.5\nrolling_friction = 0.1\nrestitution = 0.5\n";
        let scene = Scene::parse(&format!("{head}{text}")).unwrap();
        let (count, radius) = (scene.grains.count, scene.grains.radius());
        let radii = scene.effects.polydispersity.radii(count, radius, 0).unwrap();
        let places = scene.starting_positions(0);
        let spheres = places.iter().zip(radii).map(|(at, radius)| Row::new(at, radius)).collect();
        (scene, spheres)
    }

    const CROWD: &str = "[grains]\ncount = 200\ndiameter = 4e-3\ndensity = 1300.0\n[start]\nkind = 'grid'\n\
                         counts = [5, 5, 8]\nspacing = 4.1e-3\njitter = 1e-5\nbase = 3e-3\n[end]\nhorizon = 0.5\n";

    #[test]
    fn none_goes_through_the_walls_of_a_box_that_is_too_small() {
        let (scene, mut spheres) = grid(&format!(
            "{CROWD}[[walls]]\nshape = {{ kind = 'box', min = [-0.0103, -0.0103, -0.001], \
             max = [0.0103, 0.0103, 0.3] }}\n[effects.polydispersity]\ndiameters = [2e-3, 4e-3, 8e-3]\n"
        ));
        part(&mut spheres, &Walls::of(&scene), None, false);
        for sphere in &spheres {
            let place = sphere.vector();
            assert!(place.x.abs() < 0.0103 && place.y.abs() < 0.0103, "{place}");
        }
    }

    #[test]
    fn what_overlaps_across_the_ends_of_a_period_is_parted() {
        let (scene, mut spheres) = grid(&format!(
            "{}[periodic]\naxis = 'y'\nfrom = -0.0205\nto = 0.0205\n[effects.polydispersity]\ncv = 0.2\n",
            CROWD.replace("[5, 5, 8]", "[5, 10, 4]")
        ));
        let period = scene.periodic.as_ref().map(Period::of);
        let deepest = |spheres: &[Row]| {
            let mut deepest = 0.0_f64;
            for (i, a) in spheres.iter().enumerate() {
                for b in &spheres[..i] {
                    let apart = period.unwrap().nearest(a.vector() - b.vector());
                    deepest = deepest.max(a.0[3] + b.0[3] - apart.norm());
                }
            }
            deepest
        };
        assert!(deepest(&spheres) > 1e-4);
        part(&mut spheres, &Walls::of(&scene), period, false);
        assert!(deepest(&spheres) <= 0.0);
    }

    #[test]
    fn what_does_not_overlap_stays_where_it_is() {
        let mut spheres = [0.0, 4e-3, 8.5e-3].map(|x| Row::new(&Vector3::new(x, 0.0, 0.1), 2e-3));
        let before = spheres;
        part(&mut spheres, &Walls::of(&Scene::drop(0.05)), None, true);
        assert_eq!(spheres.map(|s| s.0), before.map(|s| s.0));
    }
}
