//! What scans of a limb make and need again, kept: directions in the space of a joint's windows, which depend on the motion and on which
//! windows count, not on what is left in those; columns; predictions.

use std::collections::HashMap;
use std::hash::Hash;
use std::sync::{Arc, Mutex, PoisonError};

use proprio_core::effect::{EffectKind, MAX_SHAPES};

/// Vectors, a number per window.
pub(super) type Vectors = Vec<Vec<f64>>;
/// Orthonormal ones.
pub(super) type Span = Arc<Vectors>;

/// What a span is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Key {
    pub(super) joint: usize,
    /// The effect and its shapes; nothing for what friction, a rotor and a constant torque explain.
    pub(super) effect: Option<(EffectKind, [u64; MAX_SHAPES])>,
    /// What the encoder gets wrong, bit by bit.
    pub(super) encoder: [u64; 3],
}

/// Most numbers that are kept: 8 MB.
const MOST: usize = 1_000_000;

/// The spans of a limb.
pub(crate) type Directions = Kept<Key>;

/// Vectors by what they are of; beyond [`MOST`] numbers no more are kept. A scan asks for all of them in turn: letting go of the oldest,
/// or of all, would leave the next one nothing.
#[derive(Debug)]
pub(crate) struct Kept<K>(Mutex<HashMap<K, Arc<Vectors>>>);

impl<K> Default for Kept<K> {
    fn default() -> Self {
        Self(Mutex::default())
    }
}

impl<K: Eq + Hash> Kept<K> {
    pub(super) fn get(&self, key: &K) -> Option<Arc<Vectors>> {
        let known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        known.get(key).cloned()
    }

    pub(super) fn put(&self, key: K, vectors: Vectors) -> Arc<Vectors> {
        let vectors = Arc::new(vectors);
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let kept: usize = known.values().map(|vectors| size(vectors)).sum();
        if kept + size(&vectors) <= MOST {
            known.insert(key, vectors.clone());
        }
        vectors
    }

    /// What is known, or else is made now.
    pub(super) fn get_or(&self, key: K, make: impl FnOnce() -> Vectors) -> Arc<Vectors> {
        self.get(&key).unwrap_or_else(|| self.put(key, make()))
    }
}

fn size(vectors: &[Vec<f64>]) -> usize {
    vectors.iter().map(Vec::len).sum()
}
