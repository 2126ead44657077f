//! Assembly of one substep's contact problem: gaps, normals, biases, and which contacts are impacts.
//!
//! Reads spheres and velocities (gravity included), writes the batches.

use crate::contact::{Batch, Candidate};
use crate::contact_set::ContactSet;
use crate::lanes::{LANES, Lanes, Reg, Reg3, Row, Width, each, vectors, widest};
use crate::law::{self, Small};
use crate::particles::Particles;
use crate::period::Period;
use crate::wall::{Nearest, Walls};
use nalgebra::Vector3;

/// Distance below which two centres are one point and the normal is the vertical `[m]`.
const COINCIDENT: f64 = 1e-12;

const LANE_NUMBERS: [u32; LANES] = [0, 1, 2, 3, 4, 5, 6, 7];

/// What the assembly saw.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Seen {
    /// Deepest overlap over the radius of the smaller grain `[-]`.
    pub penetration: f64,
}

impl Seen {
    /// The worse of both.
    pub fn max(self, other: Self) -> Self {
        Self { penetration: self.penetration.max(other.penetration) }
    }
}

widest! {
    /// Refreshes the contacts between grains at the beginning of a substep of length `dt` `[s]` and lists the possible
    /// impacts, which close at `impact_speed` `[m/s]` at least.
    pub(crate) fn assemble_pairs<W>(
        batches: &mut [Batch],
        particles: &Particles,
        step: (f64, &Small),
        impact_speed: f64,
        candidates: &mut Vec<Candidate>,
    ) -> Seen {
        let (dt, small) = step;
        let mut overlap = Reg::<W>::splat(0.0);
        for batch in batches {
            let sphere = |body: u32| W::load_row(&particles.spheres[body as usize]);
            let (i, j) = (each(&batch.i, sphere), each(&batch.j, sphere));
            let (gap, distance) = pair_geometry::<W>(batch, i, j, particles.period.as_ref(), &mut overlap);
            let gap = empty_lanes_open(batch, gap);
            let velocity = |body: u32| W::load_row(&particles.bodies[body as usize].velocity);
            let v_i = vectors::<W>(each(&batch.i, velocity));
            let v_j = vectors::<W>(each(&batch.j, velocity));
            let dv = v_i - v_j;
            let w_n = Reg3::load(&batch.normal).dot(dv);
            let time = Reg::splat(dt);
            let aside = passing(distance, dv, w_n, time).over(time);
            finish(batch, law::bias_lanes(gap, dt, small) + aside);
            let closes = closing_bits(gap, w_n, dt, impact_speed);
            for lane in batch.lanes().filter(|lane| closes >> lane & 1 == 1) {
                candidates.push(Candidate { i: batch.i[lane], partner: batch.j[lane] });
            }
        }
        let mut lanes = Lanes::ZERO;
        overlap.store(&mut lanes);
        Seen { penetration: lanes.0.into_iter().fold(0.0, f64::max) }
    }
}

widest! {
    /// Refreshes the contacts at walls, lists the possible impacts and notes in `lost` every grain whose
    /// centre went through a wall.
    pub(crate) fn assemble_walls<W>(
        set: &mut ContactSet,
        walls: &Walls,
        particles: &Particles,
        step: (f64, &Small),
        impact_speed: f64,
        lost: &mut [bool],
        candidates: &mut Vec<Candidate>,
    ) -> Seen {
        let (dt, small) = step;
        let mut seen = Seen::default();
        for number in 0..set.batches.len() {
            let WallGeometry { gap, follows, passing } =
                wall_geometry(set, number, walls, particles, dt, &mut seen);
            let gap = Reg::<W>::load(&gap);
            let (batch, at) = (&mut set.batches[number], &mut set.at_walls[number]);
            for lane in batch.lanes() {
                lost[batch.i[lane] as usize] |= at.went_through[lane];
            }
            let velocity = |body: u32| W::load_row(&particles.bodies[body as usize].velocity);
            let w_n = Reg3::load(&batch.normal).dot(vectors::<W>(each(&batch.i, velocity)));
            let w_n = w_n - Reg::load(&follows);
            finish(batch, law::bias_lanes(gap, dt, small) + Reg::load(&passing));
            let closes = closing_bits(gap, w_n, dt, impact_speed);
            for lane in batch.lanes().filter(|lane| closes >> lane & 1 == 1) {
                let partner = particles.count() as u32 + at.wall[lane];
                candidates.push(Candidate { i: batch.i[lane], partner });
            }
        }
        seen
    }
}

widest! {
    /// Refreshes the batches of pairs in which a grain has had an impact, as they are when the later one of
    /// their last impacts happened.
    pub(crate) fn refresh_pairs<W>(batches: &mut [Batch], particles: &Particles, step: (f64, &Small)) {
        let (dt, small) = step;
        for batch in batches {
            let mut clocks = Lanes::ZERO;
            for lane in batch.lanes() {
                let (i, j) = (batch.i[lane] as usize, batch.j[lane] as usize);
                clocks.0[lane] = particles.clocks[i].max(particles.clocks[j]);
            }
            if clocks == Lanes::ZERO {
                continue;
            }
            let at = |grains: &[u32; LANES]| -> [Row; LANES] {
                std::array::from_fn(|lane| particles.sphere_at(grains[lane] as usize, clocks.0[lane]))
            };
            let (i, j) = (at(&batch.i), at(&batch.j));
            let sphere = |rows: &[Row; LANES]| each(&LANE_NUMBERS, |lane| W::load_row(&rows[lane as usize]));
            let mut unseen = Reg::splat(0.0);
            let period = particles.period.as_ref();
            let (gap, distance) = pair_geometry::<W>(batch, sphere(&i), sphere(&j), period, &mut unseen);
            let velocity = |body: u32| W::load_row(&particles.bodies[body as usize].velocity);
            let dv = vectors::<W>(each(&batch.i, velocity)) - vectors(each(&batch.j, velocity));
            let w_n = Reg3::load(&batch.normal).dot(dv);
            let gap = empty_lanes_open(batch, gap);
            let clock = Reg::load(&clocks);
            let bias = law::bias_after_impact(gap, w_n, clock, dt, small);
            let time = Reg::splat(dt);
            finish(batch, bias + passing(distance, dv, w_n, time - clock).over(time));
        }
    }
}

widest! {
    /// The same for the contacts at walls.
    pub(crate) fn refresh_walls<W>(set: &mut ContactSet, walls: &Walls, particles: &Particles, step: (f64, &Small)) {
        let (dt, small) = step;
        for number in 0..set.batches.len() {
            let mut clocks = Lanes::ZERO;
            for lane in set.batches[number].lanes() {
                clocks.0[lane] = particles.clocks[set.batches[number].i[lane] as usize];
            }
            if clocks == Lanes::ZERO {
                continue;
            }
            let WallGeometry { gap, follows, passing } =
                wall_geometry(set, number, walls, particles, dt, &mut Seen::default());
            let gap = Reg::<W>::load(&gap);
            let batch = &mut set.batches[number];
            let velocity = |body: u32| W::load_row(&particles.bodies[body as usize].velocity);
            let w_n = Reg3::load(&batch.normal).dot(vectors::<W>(each(&batch.i, velocity)));
            let w_n = w_n - Reg::load(&follows);
            let bias = law::bias_after_impact(gap, w_n, Reg::load(&clocks), dt, small);
            finish(batch, bias + Reg::load(&passing));
        }
    }
}

/// Which lanes would close within the substep faster than an impact must.
#[inline(always)]
fn closing_bits<W: Width>(gap: Reg<W>, w_n: Reg<W>, dt: f64, impact_speed: f64) -> u32 {
    let zero = Reg::<W>::splat(0.0);
    let end = gap + Reg::splat(dt) * w_n;
    W::less_bits(end.0, zero.0) & W::less_bits(w_n.0, Reg::<W>::splat(-impact_speed).0)
}

/// An infinite gap, hence an infinite bias and no impulse, where there is no contact.
#[inline(always)]
fn empty_lanes_open<W: Width>(batch: &Batch, gap: Reg<W>) -> Reg<W> {
    if batch.used as usize == LANES {
        return gap;
    }
    let mut gaps = Lanes::ZERO;
    gap.store(&mut gaps);
    gaps.0[batch.used as usize..].fill(f64::INFINITY);
    Reg::load(&gaps)
}

/// How much farther from each other two centres are after a time, for they pass each other, than along their first
/// normal `[m]`: `d' - d - w_n time` with their distance `d'` then, to second order `w_t^2 time^2 / (2 d)`.
#[inline(always)]
fn passing<W: Width>(distance: Reg<W>, dv: Reg3<W>, w_n: Reg<W>, time: Reg<W>) -> Reg<W> {
    let (zero, two) = (Reg::splat(0.0), Reg::splat(2.0));
    let way = time * dv.dot(dv);
    let square = distance.times_plus(distance, time * (two * distance).times_plus(w_n, way));
    let end = square.max(zero).sqrt();
    // Without the difference of two distances that hardly differ.
    let twice = time * w_n.times_plus(distance - end, way);
    twice.over((end + distance).max(Reg::splat(COINCIDENT)))
}

/// Sets the normals and returns the gaps and distances of a batch of pairs whose grains are these spheres.
#[inline(always)]
fn pair_geometry<W: Width>(
    batch: &mut Batch,
    i: [W::Quad; LANES],
    j: [W::Quad; LANES],
    period: Option<&Period>,
    overlap: &mut Reg<W>,
) -> (Reg<W>, Reg<W>) {
    let ([x_i, y_i, z_i, r_i], [x_j, y_j, z_j, r_j]) = (W::columns(i), W::columns(j));
    let mut apart = Reg3::<W> { x: Reg(x_i), y: Reg(y_i), z: Reg(z_i) }
        - Reg3 { x: Reg(x_j), y: Reg(y_j), z: Reg(z_j) };
    if let Some(period) = period {
        period.nearest_lanes(&mut apart);
    }
    let (r_i, r_j) = (Reg::<W>(r_i), Reg(r_j));
    let (zero, one) = (Reg::splat(0.0), Reg::splat(1.0));
    let distance = apart.norm();
    // Two centres in one point have no normal: push them apart vertically.
    let coincide = |yes, no| distance.if_less(Reg::splat(COINCIDENT), yes, no);
    let mut normal = apart.scale(coincide(zero, one.over(distance)));
    normal.z = normal.z + coincide(one, zero);
    normal.store(&mut batch.normal);
    let gap = distance - (r_i + r_j);
    // Empty lanes have no radius, hence no overlap that is a number.
    let penetration = (zero - gap).over(r_i.min(r_j));
    *overlap = overlap.if_less(penetration, penetration, *overlap);
    (gap, distance)
}

/// Contacts of a batch at walls.
struct WallGeometry {
    gap: Lanes,
    /// How fast the walls move along the normals `[m/s]`.
    follows: Lanes,
    /// How much slower the grains approach walls that bend than along their first normal `[m/s]`.
    passing: Lanes,
}

/// Sets the normals of a batch at walls; a grain that has had an impact is seen where it was then.
fn wall_geometry(
    set: &mut ContactSet,
    number: usize,
    walls: &Walls,
    particles: &Particles,
    dt: f64,
    seen: &mut Seen,
) -> WallGeometry {
    let (batch, at) = (&mut set.batches[number], &mut set.at_walls[number]);
    let (follows, passing) = (Lanes::ZERO, Lanes::ZERO);
    let mut geometry = WallGeometry { gap: Lanes::splat(f64::INFINITY), follows, passing };
    for lane in batch.lanes() {
        let i = batch.i[lane] as usize;
        let (surface, place) = (at.wall[lane] as usize, particles.position(i));
        let (wall, near) =
            (walls.wall(surface), walls.nearest(surface, &place, particles.clocks[i]));
        let mut relative = particles.velocity(i);
        if wall.is_moving() && near.distance.is_finite() {
            let touching = place - near.distance * near.normal;
            let velocity = wall.motion_at(&touching).0;
            geometry.follows.0[lane] = near.normal.dot(&velocity);
            relative -= velocity;
        }
        batch.normal.set(lane, near.normal.into());
        let gap = near.distance - particles.radius(i);
        geometry.gap.0[lane] = gap;
        let left = dt - particles.clocks[i];
        if near.bends && gap < left * relative.norm() {
            let end = walls.nearest(surface, &(place + left * particles.velocity(i)), dt);
            geometry.passing.0[lane] = passing_of_wall(&near, &end, &relative, left) / dt;
        }
        at.went_through[lane] |= near.side * at.side[lane] < 0;
        at.side[lane] = near.side;
        seen.penetration = seen.penetration.max(-gap / particles.radius(i));
    }
    geometry
}

/// How much farther from a wall that bends a grain is after a time on its straight way than its first normal says
/// `[m]`; at the edge of a mesh whose next point to touch is another facet's, as from the edge.
fn passing_of_wall(near: &Nearest, end: &Nearest, relative: &Vector3<f64>, time: f64) -> f64 {
    let w_n = near.normal.dot(relative);
    if end.distance.is_finite() {
        return end.distance - near.distance - time * w_n;
    }
    let across = relative.norm_squared() - w_n * w_n;
    across * time * time / (2.0 * near.distance.max(COINCIDENT))
}

/// Bias and tangent plane of a batch whose normals are fresh.
#[inline(always)]
fn finish<W: Width>(batch: &mut Batch, bias: Reg<W>) {
    bias.store(&mut batch.bias);
    let n = Reg3::<W>::load(&batch.normal);
    let lambda_t = Reg3::load(&batch.lambda_t);
    lambda_t.minus(n.dot(lambda_t), n).store(&mut batch.lambda_t);
}
