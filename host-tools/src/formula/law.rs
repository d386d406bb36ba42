//! Torques of several joints from one function: a potential V gives each joint ∂V/∂q, a dissipation function D each ∂D/∂q̇ (Rayleigh's), what the
//! motors have to give beyond the rest. So their values are one, and a potential makes no energy.

use super::derivative::derivative;
use super::error::FormulaProblem;
use super::expression::{Expression, Function, Node, Signal, Variable};

/// What a formula's text is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Law {
    /// The torque of its own joint.
    Torque,
    /// An energy, over positions.
    Potential,
    /// Half a power, over velocities and positions.
    Dissipation,
}

/// How many places after the formula's own a joint is, and what each parameter multiplies there.
pub(super) type AtJoint = (isize, Vec<Option<Expression>>);

impl Law {
    /// The function's own name, and the law that it is.
    const ALL: [(Function, Self); 2] = [
        (Function::Potential, Self::Potential),
        (Function::Dissipation, Self::Dissipation),
    ];

    /// Of a whole text, and what it is of.
    pub(super) fn of(e: &Expression) -> (Self, &Expression) {
        let Node::Call(function, arguments) = &e.node else {
            return (Self::Torque, e);
        };
        let own = Self::ALL.iter().find(|(own, _)| own == function);
        match (own, arguments.first()) {
            (Some((_, law)), Some(of)) => (*law, of),
            _ => (Self::Torque, e),
        }
    }

    /// Where an expression has one that is not the whole of it.
    pub(super) fn within(e: &Expression) -> Option<Expression> {
        let (_, whole) = Self::of(e);
        let mut found = None;
        whole.each(&mut |e| {
            if !std::ptr::eq(Self::of(e).1, e) {
                found = found.take().or(Some(e.clone()));
            }
        });
        found
    }

    /// The signal that a joint's torque is the derivative in; none of a torque.
    fn signal(self) -> Option<Signal> {
        match self {
            Self::Torque => None,
            Self::Potential => Some(Signal::Position),
            Self::Dissipation => Some(Signal::Velocity),
        }
    }

    /// The torque of a joint, so many places after the formula's own; nothing where it has none.
    pub(super) fn torque(self, e: &Expression, joint: isize) -> Option<Expression> {
        match self.signal() {
            None => (joint == 0).then(|| e.clone()),
            Some(signal) => derivative(e, Variable { signal, joint }),
        }
    }

    /// The other joints at which it is a torque.
    pub(super) fn others(self, e: &Expression) -> Vec<isize> {
        let variables = e.variables().into_iter();
        let own = variables.filter(|v| Some(v.signal) == self.signal() && v.joint != 0);
        own.map(|v| v.joint).collect()
    }

    /// What it may not be a function of.
    pub(super) fn check(self, e: &Expression) -> Result<(), FormulaProblem> {
        let may = |v: &Variable| match self {
            Self::Torque => true,
            Self::Potential => v.signal == Signal::Position,
            Self::Dissipation => matches!(v.signal, Signal::Position | Signal::Velocity),
        };
        match (self, e.variables().iter().all(may)) {
            (_, true) => Ok(()),
            (Self::Dissipation, _) => Err(FormulaProblem::Law(
                "a dissipation function is of velocities and positions alone",
            )),
            _ => Err(FormulaProblem::Law("a potential is of positions alone")),
        }
    }
}
