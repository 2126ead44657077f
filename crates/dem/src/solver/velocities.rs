//! Velocities of the two bodies of each contact of a batch, in registers.

use crate::body::SharedBodies;
use crate::contact::{Batch, LawLanes};
use crate::lanes::{LANES, Reg, Reg3, Width, each, vectors};
use crate::law::INVERSE_INERTIA;

/// Velocities of both grains of each contact.
#[derive(Clone, Copy)]
pub(super) struct Velocities<W: Width> {
    pub v_i: Reg3<W>,
    pub w_i: Reg3<W>,
    pub v_j: Reg3<W>,
    pub w_j: Reg3<W>,
}

impl<W: Width> Velocities<W> {
    #[inline(always)]
    #[allow(unsafe_code)]
    pub fn gather<const AT_WALLS: bool>(batch: &Batch, bodies: &SharedBodies<'_>) -> Self {
        // SAFETY: the indices are in bounds (`nsgs::for_each_phase`), and a body is another batch's only if it rests.
        let body = |body| unsafe { bodies.load::<W>(body) };
        let [v_i, w_i] = pairs(each(&batch.i, body));
        let rest = Reg3 { x: Reg::splat(0.0), y: Reg::splat(0.0), z: Reg::splat(0.0) };
        let [v_j, w_j] = if AT_WALLS { [rest; 2] } else { pairs(each(&batch.j, body)) };
        Self { v_i, w_i, v_j, w_j }
    }

    #[inline(always)]
    pub fn scatter<const AT_WALLS: bool>(&self, batch: &Batch, bodies: &SharedBodies<'_>) {
        scatter(batch.used, &batch.i, bodies, self.v_i, self.w_i);
        if !AT_WALLS {
            scatter(batch.used, &batch.j, bodies, self.v_j, self.w_j);
        }
    }

    /// Applies normal and tangential impulses.
    #[inline(always)]
    pub fn push(&mut self, law: &LawLanes, n: &Reg3<W>, normal: Reg<W>, tangential: Reg3<W>) {
        let (mass_i, mass_j) = (Reg::load(&law.inverse_mass_i), Reg::load(&law.inverse_mass_j));
        let force = tangential.plus(normal, *n);
        let twist = n.cross(tangential).scale(Reg::splat(INVERSE_INERTIA));
        self.v_i = self.v_i.plus(mass_i, force);
        self.v_j = self.v_j.minus(mass_j, force);
        self.w_i = self.w_i.minus(mass_i, twist);
        self.w_j = self.w_j.minus(mass_j, twist);
    }

    /// Applies rolling impulses.
    #[inline(always)]
    pub fn roll(&mut self, law: &LawLanes, rolling: Reg3<W>) {
        let (mass_i, mass_j) = (Reg::load(&law.inverse_mass_i), Reg::load(&law.inverse_mass_j));
        let step = rolling.scale(Reg::splat(INVERSE_INERTIA));
        self.w_i = self.w_i.plus(mass_i * Reg::load(&law.lever_i), step);
        self.w_j = self.w_j.minus(mass_j * Reg::load(&law.lever_j), step);
    }
}

/// Velocities and spins of eight bodies.
#[inline(always)]
pub(crate) fn pairs<W: Width>(rows: [(W::Quad, W::Quad); LANES]) -> [Reg3<W>; 2] {
    let [a, b, c, d, e, f, g, h] = rows;
    let first = [a.0, b.0, c.0, d.0, e.0, f.0, g.0, h.0];
    let second = [a.1, b.1, c.1, d.1, e.1, f.1, g.1, h.1];
    [vectors(first), vectors(second)]
}

/// Puts the velocities and spins of the lanes in use back.
#[inline(always)]
#[allow(unsafe_code)]
pub(crate) fn scatter<W: Width>(
    used: u32,
    index: &[u32; LANES],
    bodies: &SharedBodies<'_>,
    v: Reg3<W>,
    w: Reg3<W>,
) {
    let zero = W::splat(0.0);
    let velocities = W::rows([v.x.0, v.y.0, v.z.0, zero]);
    let spins = W::rows([w.x.0, w.y.0, w.z.0, zero]);
    // SAFETY: the lanes in use have grains of their own, in bounds, that no other contact of this colour has.
    let store = |lane: usize| unsafe {
        bodies.store::<W>(index[lane], velocities[lane], spins[lane]);
    };
    if used as usize == LANES {
        store(0);
        store(1);
        store(2);
        store(3);
        store(4);
        store(5);
        store(6);
        store(7);
    } else {
        (0..used as usize).for_each(store);
    }
}
