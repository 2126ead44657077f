//! Velocities of the two bodies of each contact of a batch, in registers.

use crate::body::SharedBodies;
use crate::contact::{Batch, LawLanes};
use crate::lanes::{Reg, Reg3, Width};
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
        let [v_i, w_i] = unsafe { bodies.gather::<W>(&batch.i) };
        let rest = Reg3 { x: Reg::splat(0.0), y: Reg::splat(0.0), z: Reg::splat(0.0) };
        let [v_j, w_j] = if AT_WALLS { [rest; 2] } else { unsafe { bodies.gather::<W>(&batch.j) } };
        Self { v_i, w_i, v_j, w_j }
    }

    #[inline(always)]
    #[allow(unsafe_code)]
    pub fn scatter<const AT_WALLS: bool>(&self, batch: &Batch, bodies: &SharedBodies<'_>) {
        // SAFETY: the lanes in use have grains of their own, in bounds, that no other contact of this colour has.
        unsafe {
            bodies.scatter::<W>(batch.used, &batch.i, self.v_i, self.w_i);
            if !AT_WALLS {
                bodies.scatter::<W>(batch.used, &batch.j, self.v_j, self.w_j);
            }
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
