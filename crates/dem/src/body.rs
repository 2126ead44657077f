//! The velocities of one body, and of all where several threads change them.

use std::marker::PhantomData;

use serde::{Deserialize, Serialize};

use crate::lanes::{Row, Width};

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
}
