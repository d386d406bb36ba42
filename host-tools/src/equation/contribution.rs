//! What each effect of a model adds to a joint's torque at an instant.

use proprio_core::effect::{EffectKind, JointState, MAX_COLUMNS, Shapes, Term};

use super::column::{Column, Columns, coupled_terms, parent};
use super::values::Values;

/// An effect at a joint: its shapes and what its columns are times.
#[derive(Clone)]
pub(crate) struct Contribution {
    pub(crate) effect: EffectKind,
    pub(crate) shapes: Shapes,
    /// Of one that couples joints its own, and the one that carries that.
    coupled: Option<(usize, Option<usize>)>,
    numbers: Vec<(usize, f64)>,
}

/// Of each joint the effects that add to its torque.
pub(crate) fn contributions(columns: &Columns, values: &Values) -> Vec<Vec<Contribution>> {
    let numbers = columns.numbers(values);
    let of = |(at, numbers): (usize, &Vec<f64>)| {
        let mut all: Vec<Contribution> = Vec::new();
        for (column, &number) in columns.of_joint[at].iter().zip(numbers) {
            let (effect, shapes, coupled, n) = match *column {
                _ if number == 0.0 => continue,
                Column::Own {
                    effect, shapes, n, ..
                } => (effect, shapes, None, n),
                Column::Coupled {
                    joint,
                    effect,
                    shapes,
                    n,
                } => {
                    let parent = parent(&columns.subtree_end, joint);
                    (effect, shapes, Some((joint, parent)), n)
                }
                _ => continue,
            };
            match all
                .iter_mut()
                .find(|own| (own.effect, own.shapes, own.coupled) == (effect, shapes, coupled))
            {
                Some(own) => own.numbers.push((n, number)),
                None => all.push(Contribution {
                    effect,
                    shapes,
                    coupled,
                    numbers: vec![(n, number)],
                }),
            }
        }
        all
    };
    numbers.iter().enumerate().map(of).collect()
}

impl Contribution {
    /// Adds what the effect does at joint `at`, the limb's joints in these states, to what enters by its difference and to what is
    /// integrated.
    pub(crate) fn add(
        &self,
        at: usize,
        states: &[JointState<f64>],
        [boundary, rate]: [&mut f64; 2],
    ) {
        let terms = match self.coupled {
            Some((own, parent)) => {
                coupled_terms(self.effect, ([own, at], parent), states, self.shapes)
                    .unwrap_or([Term::zero(); MAX_COLUMNS])
            }
            None => self.effect.terms_among(states, at, self.shapes),
        };
        for &(n, number) in &self.numbers {
            *boundary += number * terms[n].boundary;
            *rate += number * terms[n].rate;
        }
    }
}
