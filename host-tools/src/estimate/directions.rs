//! Directions in the space of a joint's windows, kept for all scans of a limb: what an effect of some shape adds to what friction, a
//! rotor and a constant torque explain. They depend on the motion and on which windows count, not on what is left in those.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use proprio_core::effect::EffectKind;

/// Orthonormal vectors, a number per window.
pub(super) type Span = Arc<Vec<Vec<f64>>>;

/// What a span is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Key {
    pub(super) joint: usize,
    /// The effect and its shape; nothing for what friction, a rotor and a constant torque explain.
    pub(super) effect: Option<(EffectKind, u64)>,
    /// The encoder's offset.
    pub(super) offset: u64,
}

/// Most numbers that are kept: 8 MB.
const MOST: usize = 1_000_000;

/// The spans of a limb.
#[derive(Debug, Default)]
pub(crate) struct Directions(Mutex<HashMap<Key, Span>>);

impl Directions {
    pub(super) fn get(&self, key: &Key) -> Option<Span> {
        let known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        known.get(key).cloned()
    }

    pub(super) fn put(&self, key: Key, span: Vec<Vec<f64>>) -> Span {
        let span = Arc::new(span);
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let size: usize = known.values().map(|span| size(span)).sum();
        if size + self::size(&span) > MOST {
            known.retain(|key, _| key.effect.is_none());
        }
        known.insert(key, span.clone());
        span
    }
}

fn size(span: &[Vec<f64>]) -> usize {
    span.iter().map(Vec::len).sum()
}
