//! Random orientations.

use granulcal_numbers::{box_muller, half_open};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64;

/// Orientations that point everywhere alike, as quaternions i, j, k, w of unit length.
pub(crate) fn turns(seed: u64) -> impl FnMut() -> [f64; 4] {
    let mut random = Pcg64::seed_from_u64(seed);
    let mut normal = move || {
        let [u, v] = [0; 2].map(|_| half_open(random.next_u64()));
        // 1 - u is never 0.
        box_muller(1.0 - u, v)[0]
    };
    // Four normal numbers point everywhere alike on the sphere of quaternions.
    move || {
        let [i, j, k, w] = [0; 4].map(|_| normal());
        let norm = (i * i + j * j + k * k + w * w).sqrt().max(f64::MIN_POSITIVE);
        [i, j, k, w].map(|part| part / norm)
    }
}
