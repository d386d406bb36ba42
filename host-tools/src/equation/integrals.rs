//! Window integrals of columns that the motion alone makes, kept for all fits of a limb.
//!
//! A fit makes its rows again after each correction, a diagnosis makes hundreds of fits: most of their columns (those of the bodies,
//! of friction, of a rotor, of a constant torque) are the same each time. They change only with what moves the motion itself: a delay,
//! the base's tilt, an encoder's offset. What depends on the bodies' numbers (a load's share, a slope) is not kept.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use proprio_core::effect::{EffectKind, MAX_SHAPES};

use super::column::Column;
use super::values::{Place, Values};

/// Most numbers that are kept of a limb: 8 MB.
const MOST: usize = 1_000_000;

/// One column of one joint, a number per window, N m per unit.
pub(super) type Integral = Arc<[f64]>;

/// Where the motion is taken: bits of the delay, of the base's tilt and of the encoders' offsets.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Where(Vec<u64>);

/// A joint's column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Key {
    Inertial {
        joint: usize,
        body: usize,
        parameter: usize,
    },
    Own {
        joint: usize,
        effect: EffectKind,
        shapes: [u64; MAX_SHAPES],
        n: usize,
    },
}

impl Where {
    pub(super) fn of(values: &Values, delay: f64) -> Self {
        let numbers = [delay].into_iter().chain(values.tilt());
        let all = numbers.chain(values.encoders().flat_map(|encoder| encoder.numbers()));
        // Zero is zero, whatever its sign.
        Self(all.map(|x| (x + 0.0).to_bits()).collect())
    }
}

impl Key {
    /// A column's key at a joint; `None` if more than the motion makes it.
    pub(super) fn of(column: &Column, joint: usize, values: &Values) -> Option<Self> {
        let moves_link =
            |place: Place| place.0.description().is_compliant() && values.get(place, 0) != 0.0;
        match *column {
            Column::Inertial(body, parameter) => {
                let still = !values.places().any(moves_link);
                still.then_some(Self::Inertial {
                    joint,
                    body,
                    parameter,
                })
            }
            Column::Own { effect, .. } if effect.description().depends_on_model() => None,
            Column::Own {
                effect, shapes, n, ..
            } => Some(Self::Own {
                joint,
                effect,
                shapes: shapes.map(f64::to_bits),
                n,
            }),
            // The joint at which the effect is, and the one at which it is felt.
            Column::Coupled {
                joint: at,
                effect,
                n,
                ..
            } if effect.couples_with_parent() => Some(Self::Own {
                joint,
                effect,
                shapes: [at as u64; MAX_SHAPES],
                n,
            }),
            _ => None,
        }
    }
}

/// The integrals of a limb, the motion that was asked for last at the end.
#[derive(Debug, Default)]
pub(crate) struct Integrals(Mutex<Vec<(Where, HashMap<Key, Integral>)>>);

impl Integrals {
    /// Those that are known.
    pub(super) fn get(&self, at: &Where, keys: &[Option<Key>]) -> Vec<Option<Integral>> {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(n) = all.iter().position(|(known, _)| known == at) else {
            return vec![None; keys.len()];
        };
        all[n..].rotate_left(1);
        let (_, known) = &all[all.len() - 1];
        let of = |key: &Option<Key>| known.get(key.as_ref()?).cloned();
        keys.iter().map(of).collect()
    }

    /// Keeps some more, and forgets what was asked for longest ago if it becomes too much.
    pub(super) fn put(&self, at: &Where, new: impl Iterator<Item = (Key, Integral)>) {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let n = all.iter().position(|(known, _)| known == at);
        let mut own = n.map_or_else(|| (at.clone(), HashMap::new()), |n| all.remove(n));
        own.1.extend(new);
        all.push(own);
        let size = |known: &HashMap<Key, Integral>| known.values().map(|x| x.len()).sum::<usize>();
        let mut total: usize = all.iter().map(|(_, known)| size(known)).sum();
        while total > MOST && all.len() > 1 {
            total -= size(&all.remove(0).1);
        }
        if total > MOST {
            // Shapes are many, and each is asked for a few times.
            let known = &mut all[0].1;
            known.retain(|key, _| !matches!(key, Key::Own { effect, .. } if effect.description().has_shape()));
        }
    }
}
