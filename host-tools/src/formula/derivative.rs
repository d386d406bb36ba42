//! The derivative of an expression in a variable, as an expression: what a potential or a dissipation function is to the torques of its joints.
//!
//! An expression has all that a formula's torque has: friction that enters by a difference of positions, the joint's own rule of rest, units. Its value
//! is the slope of a [`Dual`](super::expression::Dual), which a test compares.

use super::expression::{Expression, Function, Node, Operator, Variable};

/// The derivative of `e`; `None` where it does not depend on the variable.
pub(super) fn derivative(e: &Expression, by: Variable) -> Option<Expression> {
    let new = |node: Node| Expression::new(e.at.clone(), node);
    let number = |x: f64| new(Node::Number(x));
    let join = |operator: Operator, a: Expression, b: Expression| {
        new(Node::Binary(operator, Box::new(a), Box::new(b)))
    };
    let times = |a: Expression, b: Expression| match (&a.node, &b.node) {
        (Node::Number(1.0), _) => b,
        (_, Node::Number(1.0)) => a,
        _ => join(Operator::Times, a, b),
    };
    let negative = |a: Expression| new(Node::Negative(Box::new(a)));
    let sum = |a: Option<Expression>, b: Option<Expression>| match (a, b) {
        (Some(a), Some(b)) => Some(join(Operator::Plus, a, b)),
        (a, b) => a.or(b),
    };
    let minus = |a: Option<Expression>, b: Option<Expression>| match (a, b) {
        (Some(a), Some(b)) => Some(join(Operator::Minus, a, b)),
        (a, b) => a.or(b.map(negative)),
    };
    let call = |function: Function, of: &Expression| new(Node::Call(function, vec![of.clone()]));
    match &e.node {
        Node::Number(_) | Node::Parameter(_) => None,
        Node::Variable(variable) => (*variable == by).then(|| number(1.0)),
        Node::Negative(of) => derivative(of, by).map(negative),
        Node::Binary(operator, left, right) => {
            let (a, b) = (derivative(left, by), derivative(right, by));
            let (left, right) = (|| (**left).clone(), || (**right).clone());
            match operator {
                Operator::Plus => sum(a, b),
                Operator::Minus => minus(a, b),
                Operator::Times => sum(a.map(|a| times(a, right())), b.map(|b| times(left(), b))),
                Operator::Over => minus(
                    a.map(|a| join(Operator::Over, a, right())),
                    b.map(|b| {
                        let square = join(Operator::Power, right(), number(2.0));
                        join(Operator::Over, times(left(), b), square)
                    }),
                ),
                Operator::Power => {
                    let exponent = right();
                    let less = match exponent.node {
                        Node::Number(n) => number(n - 1.0),
                        _ => join(Operator::Minus, right(), number(1.0)),
                    };
                    let power = match less.node {
                        Node::Number(1.0) => left(),
                        _ => join(Operator::Power, left(), less),
                    };
                    let by_base = a.map(|a| times(times(exponent, power), a));
                    let by_exponent =
                        b.map(|b| times(times(e.clone(), call(Function::Log, &left())), b));
                    sum(by_base, by_exponent)
                }
            }
        }
        Node::Call(function, arguments) => {
            let first = arguments.first()?;
            let a = derivative(first, by);
            let outer = match function {
                Function::Sign | Function::Step | Function::Potential | Function::Dissipation => {
                    return None;
                }
                Function::Min | Function::Max => {
                    let second = arguments.get(1)?;
                    let (more, less) = match function {
                        Function::Max => (first, second),
                        _ => (second, first),
                    };
                    // Each derivative once: of functions within each other they would become as many as two to their number.
                    let is_first = join(Operator::Minus, more.clone(), less.clone());
                    let is_first = call(Function::Step, &is_first);
                    let is_other = join(Operator::Minus, number(1.0), is_first.clone());
                    let b = derivative(second, by).map(|b| times(is_other, b));
                    return sum(a.map(|a| times(is_first, a)), b);
                }
                Function::Abs => call(Function::Sign, first),
                Function::Exp => e.clone(),
                Function::Log => join(Operator::Over, number(1.0), first.clone()),
                Function::Sqrt => join(Operator::Over, number(0.5), e.clone()),
                Function::Sin => call(Function::Cos, first),
                Function::Cos => negative(call(Function::Sin, first)),
                Function::Tanh => {
                    let square = join(Operator::Power, e.clone(), number(2.0));
                    join(Operator::Minus, number(1.0), square)
                }
            };
            a.map(|a| times(outer, a))
        }
    }
}
