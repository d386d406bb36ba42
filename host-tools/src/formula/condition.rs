//! Conditions on what joints do, in the words of formulas: `q > 1.2`, `t < 31.4`, `abs(dq.FR_thigh) >= 0.2`.

use proprio_core::effect::JointState;

use super::columns;
use super::error::{FormulaError, FormulaProblem};
use super::expression::{Expression, Signal, Variable};
use super::law::Law;
use super::parse::{Names, parse};

/// A comparison of two sums over the signals of a limb's joints.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Condition {
    /// What has to be the greater one, and the other.
    greater: Expression,
    less: Expression,
}

impl Condition {
    /// Of a text with one of `<`, `<=`, `>`, `>=`.
    pub(crate) fn read(text: &str, names: Names) -> Result<Self, FormulaError> {
        let fault = |problem| FormulaError::new(text, &(0..text.len()), problem);
        let signs = ['<', '>', '≤', '≥'];
        let mut at = text.match_indices(signs);
        let (Some((n, sign)), None) = (at.next(), at.next()) else {
            return Err(fault(FormulaProblem::NoComparison));
        };
        let right = &text[n + sign.len()..];
        let sides = [&text[..n], right.strip_prefix('=').unwrap_or(right)];
        let [left, right] = sides.map(|side| {
            let parsed = parse(side, names)?;
            if Law::of(&parsed.expression).0 != Law::Torque {
                return Err(fault(FormulaProblem::NoComparison));
            }
            let problem = match parsed.parameters.first() {
                Some(name) => FormulaProblem::NoSignal(name.clone()),
                None => match unknown(&parsed.expression) {
                    Some(name) => FormulaProblem::NoSignal(name.to_owned()),
                    None => return Ok(parsed.expression),
                },
            };
            Err(FormulaError::new(side, &(0..side.len()), problem))
        });
        let (left, right) = (left?, right?);
        let (greater, less) = match sign {
            "<" | "≤" => (right, left),
            _ => (left, right),
        };
        Ok(Self { greater, less })
    }

    /// Whether it is one of time alone, the same at every joint.
    pub(crate) fn is_of_time(&self) -> bool {
        self.variables().all(|v| v.signal == Signal::Time)
    }

    /// Whether it holds at joint `own` of a limb whose joints do this. Where a signal is not known, it does not.
    pub(crate) fn holds(&self, joints: &[JointState<f64>], own: usize) -> bool {
        let value = |of: &Expression| columns::value(of, joints, own, &[]);
        value(&self.greater) >= value(&self.less)
    }

    /// Whether one of time holds at `t` or `margin` before or after, s.
    pub(crate) fn holds_near(&self, t: f64, margin: f64) -> bool {
        [0.0, -margin, margin].into_iter().any(|off| {
            let state = JointState {
                time: t + off,
                ..JointState::reported(0.0, 0.0, 0.0)
            };
            self.holds(&[state], 0)
        })
    }

    fn variables(&self) -> impl Iterator<Item = Variable> {
        let less = self.less.variables();
        self.greater.variables().into_iter().chain(less)
    }
}

/// A signal that is not known before a model is fitted, or too noisy to ask.
fn unknown(of: &Expression) -> Option<&'static str> {
    of.variables().iter().find_map(|v| match v.signal {
        Signal::Acceleration => Some("ddq"),
        Signal::TransmittedTorque => Some("tau_rigid"),
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAMES: Names = Names {
        joints: &["hip", "thigh"],
        own: 1,
    };

    #[test]
    fn texts_and_what_they_say() {
        let joints = [
            JointState::reported(0.5, -2.0, 0.0),
            JointState {
                time: 3.0,
                ..JointState::reported(1.25, 0.4, 0.0)
            },
        ];
        for (text, holds) in [
            ("q > 1.2", true),
            ("q>=1.25", true),
            ("q ≤ 1.2", false),
            ("t < 31.4", true),
            ("abs(dq.hip) > 3*dq", true),
            ("1 < q.hip", false),
            ("temp < 60", false),
        ] {
            let condition = Condition::read(text, NAMES).unwrap();
            assert_eq!(condition.holds(&joints, 1), holds, "{text}");
            assert_eq!(condition.is_of_time(), text.contains("t <"), "{text}");
        }
    }

    #[test]
    fn what_is_no_condition_is_refused() {
        for (text, said) in [
            ("q", "compares two"),
            ("0 < q < 1", "compares two"),
            ("", "compares two"),
            ("q > limit", "`limit` is no signal"),
            ("tau > 3", "measured torque"),
            ("tau_rigid > 3", "`tau_rigid` is no signal"),
            ("ddq > 3", "`ddq` is no signal"),
            ("q > ", "missing"),
            ("q.knee > 1", "no joint `knee`"),
            ("q => 1", "`=` means nothing"),
        ] {
            let error = Condition::read(text, NAMES).unwrap_err().to_string();
            assert!(error.contains(said), "{text}: {error}");
        }
    }
}
