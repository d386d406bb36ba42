//! A formula as window columns: which of its parameters multiply, and what of it needs no integral.
//!
//! A torque f(q) q̈ is d/dt(f q̇) − ḟ q̇, so that no acceleration is needed, and c q̇ is d/dt(c q): both enter a window by differences
//! between its ends, as the catalogue's rotor inertia and viscous friction do.

use proprio_core::effect::{JointState, MAX_COLUMNS, Term};

use super::error::FormulaProblem;
use super::expression::{
    Dual, Expression, LANES, Lanes, Node, Operator, Scalar, Scope, Signal, Variable,
};

/// Of a formula that is a sum of so many multiples of its linear parameters.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Split {
    /// The parameters that multiply, in the order of the text.
    pub(super) linear: Vec<usize>,
    /// What each of them multiplies.
    pub(super) factors: Vec<Expression>,
}

/// Splits an expression by as many parameters as multiply all of it, the earlier ones in the text first; `None` if a term has none.
pub(super) fn split(expression: &Expression, parameters: usize) -> Option<Split> {
    // Five parameters at most: 31 sets. Reversed bits order sets of one size by their earliest parameters.
    let mut sets: Vec<usize> = (1..1usize << parameters).collect();
    sets.sort_by_key(|set| std::cmp::Reverse((set.count_ones(), set.reverse_bits())));
    sets.into_iter().find_map(|set| {
        let linear: Vec<usize> = (0..parameters).filter(|n| set >> n & 1 == 1).collect();
        let place = |node: &Node| match node {
            Node::Parameter(n) => linear.iter().position(|own| own == n),
            _ => None,
        };
        let mut parts = affine(expression, linear.len(), &place)?;
        let rest = parts.pop()?;
        let factors: Option<Vec<Expression>> = parts.into_iter().collect();
        match (rest, factors) {
            (None, Some(factors)) => Some(Split { linear, factors }),
            _ => None,
        }
    })
}

/// What each of so many atoms is multiplied by, and last what has none; `None` if an expression is not affine in them.
fn affine(
    e: &Expression,
    count: usize,
    place: &dyn Fn(&Node) -> Option<usize>,
) -> Option<Vec<Option<Expression>>> {
    let mut parts = vec![None; count + 1];
    if let Some(n) = place(&e.node) {
        parts[n] = Some(Expression::new(e.at.clone(), Node::Number(1.0)));
        return Some(parts);
    }
    if !e.has(&|node| place(node).is_some()) {
        parts[count] = Some(e.clone());
        return Some(parts);
    }
    match &e.node {
        Node::Negative(of) => {
            let of = affine(of, count, place)?;
            let negative =
                |of: Expression| Expression::new(e.at.clone(), Node::Negative(Box::new(of)));
            Some(of.into_iter().map(|part| part.map(negative)).collect())
        }
        Node::Binary(operator @ (Operator::Plus | Operator::Minus), left, right) => {
            let (left, right) = (affine(left, count, place)?, affine(right, count, place)?);
            let both = |(left, right): (Option<Expression>, Option<Expression>)| match (left, right)
            {
                (Some(a), Some(b)) => Some(Expression::binary(*operator, a, b)),
                (a, None) => a,
                (None, Some(b)) if *operator == Operator::Plus => Some(b),
                (None, Some(b)) => Some(Expression::new(b.at.clone(), Node::Negative(Box::new(b)))),
            };
            Some(left.into_iter().zip(right).map(both).collect())
        }
        Node::Binary(operator @ (Operator::Times | Operator::Over), left, right) => {
            let has = |e: &Expression| e.has(&|node| place(node).is_some());
            let times = |part: Option<Expression>, by: &Expression, first: bool| {
                part.map(|part| match (&part.node, *operator) {
                    (Node::Number(1.0), Operator::Times) => by.clone(),
                    _ if first => Expression::binary(*operator, part, by.clone()),
                    _ => Expression::binary(*operator, by.clone(), part),
                })
            };
            let (of, by, first) = match (has(left), has(right), *operator) {
                (true, false, _) => (left, right, true),
                (false, true, Operator::Times) => (right, left, false),
                _ => return None,
            };
            let of = affine(of, count, place)?.into_iter();
            Some(of.map(|part| times(part, by, first)).collect())
        }
        _ => None,
    }
}

/// A factor by what enters at a window's ends and what is integrated.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Integrated {
    /// Joints whose acceleration is multiplied, and by which function of positions.
    momentum: Vec<(isize, Expression)>,
    /// Joints whose velocity is multiplied, and by which number.
    travel: Vec<(isize, f64)>,
    /// What is integrated.
    rate: Option<Expression>,
}

impl Integrated {
    /// Of what a linear parameter multiplies.
    pub(super) fn of(factor: &Expression) -> Result<Self, (Expression, FormulaProblem)> {
        let accelerated: Vec<isize> = (factor.variables().iter())
            .filter(|v| v.signal == Signal::Acceleration)
            .map(|v| v.joint)
            .collect();
        let place = |node: &Node| match node {
            Node::Variable(Variable {
                signal: Signal::Acceleration,
                joint,
            }) => accelerated.iter().position(|own| own == joint),
            _ => None,
        };
        let refused = || (factor.clone(), FormulaProblem::Acceleration);
        let mut parts = affine(factor, accelerated.len(), &place).ok_or_else(refused)?;
        let rest = parts.pop().flatten();
        let mut momentum = Vec::new();
        for (joint, by) in accelerated.into_iter().zip(parts) {
            let Some(by) = by else { continue };
            let of_positions = |v: &Variable| v.signal == Signal::Position;
            if !by.variables().iter().all(of_positions) {
                return Err((by, FormulaProblem::Acceleration));
            }
            momentum.push((joint, by));
        }
        let (mut travel, mut rate) = (Vec::new(), None);
        if let Some(rest) = rest {
            for (is_negative, term) in terms(&rest) {
                match travels(&term) {
                    Some((joint, by)) => {
                        travel.push((joint, if is_negative { -by } else { by }));
                    }
                    None => rate = Some(with(rate, is_negative, term)),
                }
            }
        }
        Ok(Self {
            momentum,
            travel,
            rate,
        })
    }

    /// The window term at joint `at` of a limb.
    pub(super) fn term(
        &self,
        joints: &[JointState<f64>],
        at: usize,
        parameters: &[f64],
    ) -> Option<Term<f64>> {
        let place = |joint: isize| at.checked_add_signed(joint).and_then(|n| joints.get(n));
        let state = |joint: isize| place(joint).copied();
        let mut term = Term::<f64>::zero();
        for (joint, by) in &self.travel {
            term.boundary += by * state(*joint)?.q;
        }
        for (joint, by) in &self.momentum {
            let by = by.value(&Scope {
                // Only positions are in it.
                variable: &|v: Variable| match place(v.joint) {
                    Some(state) => Dual {
                        value: state.q,
                        slope: state.dq,
                    },
                    None => Dual {
                        value: f64::NAN,
                        slope: 0.0,
                    },
                },
                direction: &|_| Dual::constant(0.0),
                parameters,
            });
            let dq = state(*joint)?.dq;
            term.boundary += by.value * dq;
            term.rate -= by.slope * dq;
        }
        if let Some(rate) = &self.rate {
            term.rate += value(rate, joints, at, parameters);
        }
        (term.boundary.is_finite() && term.rate.is_finite()).then_some(term)
    }
}

/// What an expression without accelerations is at an instant.
pub(super) fn value(
    e: &Expression,
    joints: &[JointState<f64>],
    at: usize,
    parameters: &[f64],
) -> f64 {
    let of = |joint: isize, of: &dyn Fn(&JointState<f64>) -> f64| seen(joints, at, joint, of);
    e.value(&Scope {
        variable: &|v: Variable| of(v.joint, &|state| signal(v.signal, state)),
        direction: &|joint| of(joint, &JointState::sign),
        parameters,
    })
}

/// The same at many instants, each that of all joints.
pub(super) fn values(
    e: &Expression,
    instants: &[Vec<JointState<f64>>],
    at: usize,
    parameters: &[f64],
) -> Vec<f64> {
    let together = |instants: &[Vec<JointState<f64>>]| {
        let of = |joint: isize, of: &dyn Fn(&JointState<f64>) -> f64| {
            Lanes(std::array::from_fn(|n| {
                let joints = &instants[n.min(instants.len() - 1)];
                seen(joints, at, joint, of)
            }))
        };
        let all = e.value(&Scope {
            variable: &|v: Variable| of(v.joint, &|state| signal(v.signal, state)),
            direction: &|joint| of(joint, &JointState::sign),
            parameters,
        });
        all.0.into_iter().take(instants.len())
    };
    instants.chunks(LANES).flat_map(together).collect()
}

/// What there is to see of the joint so many places after the formula's own; not a number where the limb has none.
fn seen(
    joints: &[JointState<f64>],
    at: usize,
    joint: isize,
    of: &dyn Fn(&JointState<f64>) -> f64,
) -> f64 {
    let place = at.checked_add_signed(joint).and_then(|n| joints.get(n));
    place.map_or(f64::NAN, of)
}

/// A signal of a joint. What a joint's acceleration does is no value of an instant.
pub(super) fn signal(signal: Signal, state: &JointState<f64>) -> f64 {
    match signal {
        Signal::Position => state.q,
        Signal::Velocity => state.speed,
        Signal::Acceleration => f64::NAN,
        Signal::TransmittedTorque => state.load,
        Signal::Temperature => state.temperature,
        Signal::Time => state.time,
    }
}

/// The window terms of a formula's columns; nothing where they are not finite or the limb has no such joint.
pub(super) fn window_terms(
    columns: &[Integrated],
    joints: &[JointState<f64>],
    at: usize,
    parameters: &[f64],
) -> [Term<f64>; MAX_COLUMNS] {
    std::array::from_fn(|n| {
        let column = columns.get(n);
        let term = column.and_then(|column| column.term(joints, at, parameters));
        term.unwrap_or_else(Term::zero)
    })
}

/// The terms of a sum, each with whether it is subtracted.
fn terms(e: &Expression) -> Vec<(bool, Expression)> {
    match &e.node {
        Node::Binary(Operator::Plus, left, right) => {
            let mut all = terms(left);
            all.extend(terms(right));
            all
        }
        Node::Binary(Operator::Minus, left, right) => {
            let mut all = terms(left);
            all.extend(terms(right).into_iter().map(|(is, term)| (!is, term)));
            all
        }
        Node::Negative(of) => (terms(of).into_iter())
            .map(|(is, term)| (!is, term))
            .collect(),
        _ => vec![(false, e.clone())],
    }
}

/// A sum and one term more.
fn with(sum: Option<Expression>, is_negative: bool, term: Expression) -> Expression {
    match (sum, is_negative) {
        (Some(sum), false) => Expression::binary(Operator::Plus, sum, term),
        (Some(sum), true) => Expression::binary(Operator::Minus, sum, term),
        (None, false) => term,
        (None, true) => Expression::new(term.at.clone(), Node::Negative(Box::new(term))),
    }
}

/// The joint whose velocity a term is a multiple of, and that number.
fn travels(term: &Expression) -> Option<(isize, f64)> {
    let [variable] = term.variables()[..] else {
        return None;
    };
    if variable.signal != Signal::Velocity || term.has(&|node| matches!(node, Node::Parameter(_))) {
        return None;
    }
    let place = |node: &Node| (*node == Node::Variable(variable)).then_some(0);
    let mut parts = affine(term, 1, &place)?;
    let (rest, by) = (parts.pop()?, parts.pop()??);
    let nothing = Scope {
        variable: &|_| f64::NAN,
        direction: &|_| f64::NAN,
        parameters: &[],
    };
    let by = by.value(&nothing);
    (rest.is_none() && by.is_finite()).then_some((variable.joint, by))
}
