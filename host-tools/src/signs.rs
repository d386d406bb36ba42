//! Signs that are drawn, for the wild bootstrap: numbers keep their size, and what neighbours have in common goes.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Draws signs; the same ones each time.
pub(crate) struct Signs(ChaCha8Rng);

impl Signs {
    pub(crate) fn new() -> Self {
        Self(ChaCha8Rng::seed_from_u64(1))
    }

    /// The number with the next sign.
    pub(crate) fn of(&mut self, x: f64) -> f64 {
        match self.0.next_u32() & 1 {
            0 => x,
            _ => -x,
        }
    }
}
