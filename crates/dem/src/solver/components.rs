//! Vectors over all contacts: eight numbers each, and the operators between contacts and bodies.
//!
//! With J the rows `w_n, u_t, rho` of every contact, rho split into its part across the normal and the one along it,
//! and M the masses, `spread` is `M^-1 J^T`, from impulses to velocities of bodies, and `collect` is J, from there to
//! velocities at the contacts. No matrix is formed.

use crate::body::{Body, SharedBodies};
use crate::contact::Batch;
use crate::contact_set::ContactSet;
use crate::lanes::{Lanes, Reg, Reg3, Width, widest};
use crate::solver::nsgs::is_at_rest;
use crate::solver::velocities::Velocities;

/// Numbers of a contact: one normal, three tangential, three rolling, one of torsion.
pub(super) const COUNT: usize = 8;

/// Impulses of the contacts of a batch, or velocities at them: normal, tangential (3), rolling across the normal
/// (3), torsion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Components(pub [Lanes; COUNT]);

/// The numbers of one contact: impulses, or velocities.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Parts {
    pub normal: f64,
    pub tangential: [f64; 3],
    /// Across the normal.
    pub rolling: [f64; 3],
    /// Along the normal.
    pub torsion: f64,
}

impl Components {
    pub const ZERO: Self = Self([Lanes::ZERO; COUNT]);

    /// The impulses of a batch.
    pub fn of(batch: &Batch) -> Self {
        let t = &batch.lambda_t;
        let mut components = Self([Lanes::ZERO; COUNT]);
        components.0[..4].copy_from_slice(&[batch.lambda_n, t.x, t.y, t.z]);
        for lane in batch.lanes() {
            let (n, r) = (batch.normal.get(lane), batch.lambda_r.get(lane));
            let torsion = n[0] * r[0] + n[1] * r[1] + n[2] * r[2];
            for axis in 0..3 {
                components.0[4 + axis].0[lane] = r[axis] - torsion * n[axis];
            }
            components.0[7].0[lane] = torsion;
        }
        components
    }

    /// Makes these the impulses of a batch.
    pub fn put(&self, batch: &mut Batch) {
        let [n, tx, ty, tz, ..] = self.0;
        let t = &mut batch.lambda_t;
        (batch.lambda_n, t.x, t.y, t.z) = (n, tx, ty, tz);
        for lane in batch.lanes() {
            let Parts { rolling, torsion, .. } = self.get(lane);
            let n = batch.normal.get(lane);
            batch.lambda_r.set(lane, std::array::from_fn(|axis| rolling[axis] + torsion * n[axis]));
        }
    }

    /// Sets the numbers of one lane.
    pub fn set(&mut self, lane: usize, parts: &Parts) {
        let ([tx, ty, tz], [rx, ry, rz]) = (parts.tangential, parts.rolling);
        let numbers = [parts.normal, tx, ty, tz, rx, ry, rz, parts.torsion];
        for (row, number) in self.0.iter_mut().zip(numbers) {
            row.0[lane] = number;
        }
    }

    /// The numbers of one lane.
    pub fn get(&self, lane: usize) -> Parts {
        let [normal, tx, ty, tz, rx, ry, rz, torsion] =
            std::array::from_fn(|row| self.0[row].0[lane]);
        Parts { normal, tangential: [tx, ty, tz], rolling: [rx, ry, rz], torsion }
    }
}

/// Batches of all sets, in order.
pub(super) fn batches<'a>(
    sets: &'a [&mut ContactSet],
) -> impl Iterator<Item = (&'a ContactSet, usize)> {
    sets.iter().flat_map(|set| (0..set.batches.len()).map(move |number| (&**set, number)))
}

/// The impulses of all contacts.
pub(super) fn impulses(sets: &[&mut ContactSet]) -> Vec<Components> {
    batches(sets).map(|(set, number)| Components::of(&set.batches[number])).collect()
}

/// Makes `new` the impulses of all contacts.
pub(super) fn put_impulses(sets: &mut [&mut ContactSet], new: &[Components]) {
    let batches = sets.iter_mut().flat_map(|set| &mut set.batches);
    batches.zip(new).for_each(|(batch, new)| new.put(batch));
}

/// Adds `M^-1 J^T impulses` to the bodies.
pub(super) fn spread(sets: &[&mut ContactSet], impulses: &[Components], bodies: &mut [Body]) {
    let mut rest = impulses;
    for set in sets {
        let (own, others) = rest.split_at(set.batches.len());
        spread_set(set, own, bodies);
        rest = others;
    }
}

/// `J bodies`: the velocities at all contacts.
pub(super) fn collect(
    sets: &[&mut ContactSet],
    bodies: &mut [Body],
    at_contacts: &mut [Components],
) {
    let mut rest = at_contacts;
    for set in sets {
        let (own, others) = rest.split_at_mut(set.batches.len());
        collect_set(set, bodies, own);
        rest = others;
    }
}

widest! {
    fn spread_set<W>(set: &ContactSet, impulses: &[Components], bodies: &mut [Body]) {
        if is_at_rest(set) {
            spread_batches::<W, true>(set, impulses, bodies);
        } else {
            spread_batches::<W, false>(set, impulses, bodies);
        }
    }
}

/// `AT_WALLS`: the second body is the resting one, and stays so.
#[inline(always)]
fn spread_batches<W: Width, const AT_WALLS: bool>(
    set: &ContactSet,
    impulses: &[Components],
    bodies: &mut [Body],
) {
    // Bodies are indexed without looking: the indices were made for as many.
    assert!(set.fits(bodies));
    let bodies = SharedBodies::new(bodies);
    for (batch, impulses) in set.batches.iter().zip(impulses) {
        let law = &set.laws[batch.law as usize];
        let normal = Reg3::<W>::load(&batch.normal);
        let [n, tx, ty, tz, rx, ry, rz, torsion] = each_row(impulses);
        let rolling = Reg3 { x: rx, y: ry, z: rz };
        let mut velocities = Velocities::<W>::gather::<AT_WALLS>(batch, &bodies);
        velocities.push(law, &normal, n, Reg3 { x: tx, y: ty, z: tz });
        velocities.roll(law, rolling + normal.scale(torsion));
        velocities.scatter::<AT_WALLS>(batch, &bodies);
    }
}

#[inline(always)]
fn each_row<W: Width>(components: &Components) -> [Reg<W>; COUNT] {
    let [a, b, c, d, e, f, g, h] = &components.0;
    [a, b, c, d, e, f, g, h].map(Reg::load)
}

widest! {
    fn collect_set<W>(set: &ContactSet, bodies: &mut [Body], at_contacts: &mut [Components]) {
        assert!(set.fits(bodies));
        let bodies = SharedBodies::new(bodies);
        for (batch, at_contacts) in set.batches.iter().zip(at_contacts) {
            let law = &set.laws[batch.law as usize];
            let n = Reg3::<W>::load(&batch.normal);
            let velocities = Velocities::<W>::gather::<false>(batch, &bodies);
            let Velocities { v_i, w_i, v_j, w_j } = velocities;
            let dv = v_i - v_j;
            let w_n = n.dot(dv);
            let u_t = dv + n.cross(w_i + w_j) - n.scale(w_n);
            let rho = w_i.scale(Reg::load(&law.lever_i)) - w_j.scale(Reg::load(&law.lever_j));
            let about = n.dot(rho);
            let rolling = rho - n.scale(about);
            let rows = [w_n, u_t.x, u_t.y, u_t.z, rolling.x, rolling.y, rolling.z, about];
            for (row, value) in at_contacts.0.iter_mut().zip(rows) {
                value.store(row);
            }
        }
    }
}

widest! {
    /// The scalar product; lanes are summed last and in order, so that every width gives the same bits.
    pub(super) fn dot<W>(a: &[Components], b: &[Components]) -> f64 {
        let mut sum = Reg::<W>::splat(0.0);
        for (a, b) in a.iter().zip(b) {
            for (a, b) in a.0.iter().zip(&b.0) {
                sum = sum + Reg::load(a) * Reg::load(b);
            }
        }
        let mut lanes = Lanes::ZERO;
        sum.store(&mut lanes);
        lanes.0.iter().sum()
    }
}

widest! {
    /// `a <- a + factor b`.
    pub(super) fn add_scaled<W>(a: &mut [Components], factor: f64, b: &[Components]) {
        let factor = Reg::<W>::splat(factor);
        for (a, b) in a.iter_mut().zip(b) {
            for (a, b) in a.0.iter_mut().zip(&b.0) {
                (Reg::load(a) + factor * Reg::load(b)).store(a);
            }
        }
    }
}

widest! {
    /// `a <- b + factor a`.
    pub(super) fn scale_and_add<W>(a: &mut [Components], factor: f64, b: &[Components]) {
        let factor = Reg::<W>::splat(factor);
        for (a, b) in a.iter_mut().zip(b) {
            for (a, b) in a.0.iter_mut().zip(&b.0) {
                (Reg::load(b) + factor * Reg::load(a)).store(a);
            }
        }
    }
}

/// Adds `factor` times the velocities of `more` to those of `bodies`.
pub(super) fn add_velocities(bodies: &mut [Body], factor: f64, more: &[Body]) {
    for (body, more) in bodies.iter_mut().zip(more) {
        for axis in 0..3 {
            body.velocity.0[axis] += factor * more.velocity.0[axis];
            body.spin.0[axis] += factor * more.spin.0[axis];
        }
    }
}
