//! Assembly of one substep's contact problem: gaps, normals, biases and the warm start.
//!
//! Reads positions and the velocities before gravity; writes the batches and, by applying the
//! impulses of the last substep, the bodies.

use nalgebra::Vector3;

use crate::bed::{Bed, Body, INVERSE_INERTIA};
use crate::contact::{Batch, ContactSet, LawLanes};
use crate::lanes::{LANES, Lanes, Lanes3, Reg, Reg3, Width, widest};
use crate::law;
use crate::wall::Wall;

/// Distance below which two centres are one point and the normal is the vertical `[m]`.
const COINCIDENT: f64 = 1e-12;

/// What the assembly saw.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Seen {
    /// Deepest overlap over the radius of the smaller grain `[-]`.
    pub penetration: f64,
}

/// Velocity and spin of one body for each lane, from the bodies' rows.
#[inline(always)]
pub(crate) fn gather<W: Width>(
    index: &[u32; LANES],
    row: impl Fn(u32) -> W::Value,
) -> (Reg3<W>, Reg3<W>) {
    let [a, b, c, d, e, f, g, h] = *index;
    let rows = [row(a), row(b), row(c), row(d), row(e), row(f), row(g), row(h)];
    let [vx, vy, vz, _, wx, wy, wz, _] = W::transpose(rows);
    let vector = |x, y, z| Reg3 { x: Reg(x), y: Reg(y), z: Reg(z) };
    (vector(vx, vy, vz), vector(wx, wy, wz))
}

impl Seen {
    /// The worse of both.
    pub fn max(self, other: Self) -> Self {
        Self { penetration: self.penetration.max(other.penetration) }
    }
}

widest! {
    /// Refreshes the contacts between grains for the positions in `bed` and the velocities `before` gravity.
    pub(crate) fn refresh_pairs<W>(
        set: &mut ContactSet,
        bed: &mut Bed,
        before: &[Body],
        dt: f64,
    ) -> Seen {
        let mut overlap = Lanes::ZERO;
        for number in 0..set.batches.len() {
            let gap = pair_geometry::<W>(&mut set.batches[number], bed, &mut overlap);
            finish::<W>(set, number, &gap, bed, before, dt);
        }
        Seen { penetration: overlap.0.into_iter().fold(0.0, f64::max) }
    }
}

/// Sets the normals and returns the gaps of a batch of pairs.
#[inline(always)]
fn pair_geometry<W: Width>(batch: &mut Batch, bed: &Bed, overlap: &mut Lanes) -> Lanes {
    let mut apart = Lanes3 { x: Lanes::ZERO, y: Lanes::ZERO, z: Lanes::splat(1.0) };
    let mut touching = Lanes::ZERO;
    let mut smaller = Lanes::splat(1.0);
    for lane in batch.lanes() {
        let (i, j) = (batch.i[lane] as usize, batch.j[lane] as usize);
        let (a, b) = (&bed.positions[i], &bed.positions[j]);
        apart.set(lane, [a.x - b.x, a.y - b.y, a.z - b.z]);
        touching.0[lane] = bed.radii[i] + bed.radii[j];
        smaller.0[lane] = bed.radii[i].min(bed.radii[j]);
    }
    let apart = Reg3::<W>::load(&apart);
    let (zero, one) = (Reg::splat(0.0), Reg::splat(1.0));
    let distance = apart.norm();
    // Two centres in one point have no normal: push them apart vertically.
    let coincide = |yes, no| distance.if_less(Reg::splat(COINCIDENT), yes, no);
    let mut normal = apart.scale(coincide(zero, one.over(distance)));
    normal.z = normal.z + coincide(one, zero);
    normal.store(&mut batch.normal);

    let gap = distance - Reg::load(&touching);
    let penetration = (zero - gap).over(Reg::load(&smaller));
    penetration.max(Reg::load(overlap)).store(overlap);
    let mut gaps = Lanes::ZERO;
    gap.store(&mut gaps);
    for lane in batch.used as usize..LANES {
        gaps.0[lane] = f64::INFINITY;
    }
    gaps
}

widest! {
    /// Refreshes the contacts at walls and notes every grain whose centre went through a wall in `lost`.
    pub(crate) fn refresh_walls<W>(
        set: &mut ContactSet,
        walls: &[Wall],
        bed: &mut Bed,
        before: &[Body],
        dt: f64,
        lost: &mut [bool],
    ) -> Seen {
        let mut seen = Seen::default();
        for number in 0..set.batches.len() {
            let gap = wall_geometry(set, number, walls, bed, &mut seen, lost);
            finish::<W>(set, number, &gap, bed, before, dt);
        }
        seen
    }
}

/// Sets the normals and returns the gaps of a batch at walls.
fn wall_geometry(
    set: &mut ContactSet,
    number: usize,
    walls: &[Wall],
    bed: &Bed,
    seen: &mut Seen,
    lost: &mut [bool],
) -> Lanes {
    let (batch, at) = (&mut set.batches[number], &mut set.at_walls[number]);
    let mut gap = Lanes::splat(f64::INFINITY);
    for lane in batch.lanes() {
        let i = batch.i[lane] as usize;
        let near = walls[at.wall[lane] as usize].surface.nearest(&bed.positions[i]);
        batch.normal.set(lane, near.normal.into());
        gap.0[lane] = near.distance - bed.radii[i];
        if near.side * at.side[lane] < 0 {
            lost[i] = true;
        }
        at.side[lane] = near.side;
        seen.penetration = seen.penetration.max(-gap.0[lane] / bed.radii[i]);
    }
    gap
}

/// Bias and warm start of a batch whose gaps and normals are fresh. Empty lanes have an infinite gap,
/// hence an infinite bias, and their impulses stay zero.
#[inline(always)]
fn finish<W: Width>(
    set: &mut ContactSet,
    number: usize,
    gap: &Lanes,
    bed: &mut Bed,
    before: &[Body],
    dt: f64,
) {
    let batch = &mut set.batches[number];
    let law = &set.laws[batch.law as usize];
    let gap = Reg::<W>::load(gap);
    let n = Reg3::load(&batch.normal);
    let row = |body: u32| W::load(before[body as usize].row());
    let (v_i, w_i) = gather::<W>(&batch.i, row);
    let (v_j, w_j) = gather::<W>(&batch.j, row);
    let dv = v_i - v_j;
    let approach = n.dot(dv);
    law::bias_lanes(gap, approach, Reg::load(&law.restitution), dt).store(&mut batch.bias);
    if let Some(bias_t) = set.bias_t.get_mut(number) {
        let u_t = dv + n.cross(w_i + w_j) - n.scale(approach);
        let e_t = Reg::load(&law.tangential_restitution);
        let e_t = law::if_impact(gap, approach, dt, e_t, Reg::splat(0.0));
        u_t.scale(e_t).store(bias_t);
    }
    let lambda_t = Reg3::load(&batch.lambda_t);
    (lambda_t - n.scale(n.dot(lambda_t))).store(&mut batch.lambda_t);
    warm_start(batch, law, &mut bed.bodies);
}

/// Applies the impulses that a batch already carries.
#[inline(always)]
fn warm_start(batch: &Batch, law: &LawLanes, bodies: &mut [Body]) {
    for lane in batch.lanes() {
        if batch.lambda_n.0[lane] == 0.0 {
            continue; // both friction impulses vanish with the normal one
        }
        let normal = Vector3::from(batch.normal.get(lane));
        let lambda_t = Vector3::from(batch.lambda_t.get(lane));
        let lambda_r = Vector3::from(batch.lambda_r.get(lane));
        let force = batch.lambda_n.0[lane] * normal + lambda_t;
        let twist = normal.cross(&lambda_t);
        let sides = [
            (batch.i[lane], law.inverse_mass_i.0[lane], law.lever_i.0[lane], 1.0),
            (batch.j[lane], law.inverse_mass_j.0[lane], law.lever_j.0[lane], -1.0),
        ];
        for (body, inverse_mass, lever, sign) in sides {
            let body = &mut bodies[body as usize];
            for axis in 0..3 {
                body.velocity[axis] += sign * inverse_mass * force[axis];
                body.spin[axis] +=
                    INVERSE_INERTIA * inverse_mass * (sign * lever * lambda_r[axis] - twist[axis]);
            }
        }
    }
}
