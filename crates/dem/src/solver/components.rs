//! Vectors over all contacts: seven numbers each, and the operators between contacts and bodies.
//!
//! With J the rows `w_n, u_t, rho` of every contact and M the masses, `spread` is `M^-1 J^T`, from impulses
//! to velocities of bodies, and `collect` is J, from there to velocities at the contacts. No matrix is formed.

use crate::bed::{Body, SharedBodies};
use crate::contact::{Batch, ContactSet};
use crate::lanes::{Lanes, Reg, Reg3, Width, widest};
use crate::solver::nsgs::Velocities;

/// Numbers of a contact: one normal, three tangential, three rolling.
pub(super) const COUNT: usize = 7;

/// Impulses of the contacts of a batch, or velocities at them: normal, tangential (3), rolling (3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Components(pub [Lanes; COUNT]);

impl Components {
    pub const ZERO: Self = Self([Lanes::ZERO; COUNT]);

    /// The impulses of a batch.
    pub fn of(batch: &Batch) -> Self {
        let (t, r) = (&batch.lambda_t, &batch.lambda_r);
        Self([batch.lambda_n, t.x, t.y, t.z, r.x, r.y, r.z])
    }

    /// Makes these the impulses of a batch.
    pub fn put(&self, batch: &mut Batch) {
        let [n, tx, ty, tz, rx, ry, rz] = self.0;
        let (t, r) = (&mut batch.lambda_t, &mut batch.lambda_r);
        (batch.lambda_n, t.x, t.y, t.z) = (n, tx, ty, tz);
        (r.x, r.y, r.z) = (rx, ry, rz);
    }

    /// Sets the seven numbers of one lane.
    pub fn set(&mut self, lane: usize, n: f64, t: [f64; 3], r: [f64; 3]) {
        let numbers = [n, t[0], t[1], t[2], r[0], r[1], r[2]];
        for (row, number) in self.0.iter_mut().zip(numbers) {
            row.0[lane] = number;
        }
    }

    /// The seven numbers of one lane: normal, tangential, rolling.
    pub fn get(&self, lane: usize) -> (f64, [f64; 3], [f64; 3]) {
        let [n, tx, ty, tz, rx, ry, rz] = std::array::from_fn(|row| self.0[row].0[lane]);
        (n, [tx, ty, tz], [rx, ry, rz])
    }

    #[inline(always)]
    pub fn load<W: Width>(&self) -> (Reg<W>, Reg3<W>, Reg3<W>) {
        let [n, tx, ty, tz, rx, ry, rz] = &self.0;
        let vector = |x, y, z| Reg3 { x: Reg::load(x), y: Reg::load(y), z: Reg::load(z) };
        (Reg::load(n), vector(tx, ty, tz), vector(rx, ry, rz))
    }

    #[inline(always)]
    fn store<W: Width>(&mut self, n: Reg<W>, t: Reg3<W>, r: Reg3<W>) {
        for (row, value) in self.0.iter_mut().zip([n, t.x, t.y, t.z, r.x, r.y, r.z]) {
            value.store(row);
        }
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
        let bodies = SharedBodies::new(bodies);
        for (batch, impulses) in set.batches.iter().zip(impulses) {
            let law = &set.laws[batch.law as usize];
            let (lambda_n, lambda_t, lambda_r) = impulses.load::<W>();
            let mut velocities = Velocities::<W>::gather(batch, &bodies);
            velocities.push(law, &Reg3::load(&batch.normal), lambda_n, lambda_t);
            velocities.roll(law, lambda_r);
            velocities.scatter(batch, &bodies);
        }
    }
}

widest! {
    fn collect_set<W>(set: &ContactSet, bodies: &mut [Body], at_contacts: &mut [Components]) {
        let bodies = SharedBodies::new(bodies);
        for (batch, at_contacts) in set.batches.iter().zip(at_contacts) {
            let law = &set.laws[batch.law as usize];
            let n = Reg3::<W>::load(&batch.normal);
            let Velocities { v_i, w_i, v_j, w_j } = Velocities::<W>::gather(batch, &bodies);
            let dv = v_i - v_j;
            let w_n = n.dot(dv);
            let u_t = dv + n.cross(w_i + w_j) - n.scale(w_n);
            let rho = w_i.scale(Reg::load(&law.lever_i)) - w_j.scale(Reg::load(&law.lever_j));
            at_contacts.store(w_n, u_t, rho);
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
            body.velocity[axis] += factor * more.velocity[axis];
            body.spin[axis] += factor * more.spin[axis];
        }
    }
}
