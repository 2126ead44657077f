//! The velocities of one body, and of all where several threads change them.

use std::marker::PhantomData;

use serde::{Deserialize, Serialize};

use crate::lanes::{LANES, Reg3, Row, Width, each, vectors};

/// Linear and scaled angular velocity of one body, a cache line.
///
/// `spin` is `r * omega` `[m/s]`: with it the contact equations of unequal spheres have the
/// same coefficients as those of equal ones. The fourth numbers are zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[repr(C, align(64))]
pub(crate) struct Body {
    pub velocity: Row,
    pub spin: Row,
}

/// Bodies that several threads change at once, each the grains of its own contacts.
///
/// The colouring guarantees that no two contacts that are solved at the same time share a grain; the
/// resting body, which they do share, is never written.
pub(crate) struct SharedBodies<'a> {
    first: *mut Body,
    /// All bodies.
    count: u32,
    lifetime: PhantomData<&'a mut [Body]>,
}

// SAFETY: see the type; every access goes through `load` and `store`.
#[allow(unsafe_code)]
unsafe impl Sync for SharedBodies<'_> {}

impl<'a> SharedBodies<'a> {
    /// Shares `bodies`, the grains first.
    pub fn new(bodies: &'a mut [Body]) -> Self {
        let count = bodies.len() as u32;
        Self { first: bodies.as_mut_ptr(), count, lifetime: PhantomData }
    }

    /// Velocity and spin of a body.
    ///
    /// # Safety
    /// `body` is one of the bodies, and nobody writes it now.
    #[inline(always)]
    #[allow(unsafe_code)]
    pub unsafe fn load<W: Width>(&self, body: u32) -> (W::Quad, W::Quad) {
        debug_assert!(body < self.count);
        // SAFETY: in bounds and not written, as the caller promises.
        let body = unsafe { &*self.first.add(body as usize) };
        (W::load_row(&body.velocity), W::load_row(&body.spin))
    }

    /// Puts velocity and spin of a body back.
    ///
    /// # Safety
    /// `body` is one of the bodies, not the resting one, and nobody else reads or writes it now.
    #[inline(always)]
    #[allow(unsafe_code)]
    pub unsafe fn store<W: Width>(&self, body: u32, velocity: W::Quad, spin: W::Quad) {
        debug_assert!(body < self.count);
        // SAFETY: in bounds and nobody else's, as the caller promises.
        let body = unsafe { &mut *self.first.add(body as usize) };
        W::store_row(velocity, &mut body.velocity);
        W::store_row(spin, &mut body.spin);
    }

    /// Velocities and spins of eight bodies.
    ///
    /// # Safety
    /// That of [`Self::load`] for each.
    #[inline(always)]
    #[allow(unsafe_code)]
    pub unsafe fn gather<W: Width>(&self, index: &[u32; LANES]) -> [Reg3<W>; 2] {
        // SAFETY: as the caller promises.
        let rows = each(index, |body| unsafe { self.load::<W>(body) });
        let [a, b, c, d, e, f, g, h] = rows;
        let first = [a.0, b.0, c.0, d.0, e.0, f.0, g.0, h.0];
        let second = [a.1, b.1, c.1, d.1, e.1, f.1, g.1, h.1];
        [vectors(first), vectors(second)]
    }

    /// Puts the velocities and spins of the first `used` of eight bodies back.
    ///
    /// # Safety
    /// That of [`Self::store`] for each of them.
    #[inline(always)]
    #[allow(unsafe_code)]
    pub unsafe fn scatter<W: Width>(
        &self,
        used: u32,
        index: &[u32; LANES],
        v: Reg3<W>,
        w: Reg3<W>,
    ) {
        let zero = W::splat(0.0);
        let velocities = W::rows([v.x.0, v.y.0, v.z.0, zero]);
        let spins = W::rows([w.x.0, w.y.0, w.z.0, zero]);
        // SAFETY: as the caller promises.
        let store = |lane: usize| unsafe {
            self.store::<W>(index[lane], velocities[lane], spins[lane]);
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::Portable;

    #[test]
    #[allow(unsafe_code)]
    fn threads_change_bodies_of_their_own_and_read_the_resting_one() {
        const COUNT: u32 = 24;
        let body = |n: u32| {
            let row = |scale: f64| Row(std::array::from_fn(|i| scale * f64::from(n) + i as f64));
            Body { velocity: row(1.0), spin: row(-2.0) }
        };
        let mut bodies: Vec<Body> = (0..=COUNT).map(body).collect();
        let shared = SharedBodies::new(&mut bodies);
        std::thread::scope(|scope| {
            for thread in 0..3 {
                let shared = &shared;
                scope.spawn(move || {
                    for n in (thread..COUNT).step_by(3) {
                        // SAFETY: every third body is this thread's; the last is written by none.
                        unsafe {
                            let (velocity, _) = shared.load::<Portable>(n);
                            let (_, resting) = shared.load::<Portable>(COUNT);
                            shared.store::<Portable>(n, resting, velocity);
                        }
                    }
                });
            }
        });
        for (n, found) in (0..COUNT).zip(&bodies) {
            assert_eq!(*found, Body { velocity: body(COUNT).spin, spin: body(n).velocity });
        }
        assert_eq!(bodies[COUNT as usize], body(COUNT));
    }
}
