//! A formula as a tree, and its value at an instant: a number, or a number with its slope.

use std::ops::{Add, Div, Mul, Neg, Range, Sub};

/// A node, with the bytes of the text that it is of.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Expression {
    pub(crate) at: Range<usize>,
    pub(crate) node: Node,
}

/// What a node is.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Node {
    Number(f64),
    /// A parameter, by its place in the order in which the text names them.
    Parameter(usize),
    Variable(Variable),
    Negative(Box<Expression>),
    Binary(Operator, Box<Expression>, Box<Expression>),
    Call(Function, Vec<Expression>),
}

/// Of two operands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Operator {
    Plus,
    Minus,
    Times,
    Over,
    Power,
}

/// What a joint, or the log, has at an instant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Signal {
    /// `q`, rad.
    Position,
    /// `dq`, rad/s.
    Velocity,
    /// `ddq`, rad/s².
    Acceleration,
    /// `tau_rigid`, N m: what the gear transmits under the model.
    TransmittedTorque,
    /// `temp`, °C.
    Temperature,
    /// `t`, s since the log's start.
    Time,
}

impl Signal {
    /// All, with their names in a text.
    pub(crate) const ALL: [(&'static str, Self); 6] = [
        ("q", Self::Position),
        ("dq", Self::Velocity),
        ("ddq", Self::Acceleration),
        ("tau_rigid", Self::TransmittedTorque),
        ("temp", Self::Temperature),
        ("t", Self::Time),
    ];
}

/// A signal of a joint: `joint` places after the formula's own in its limb.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Variable {
    pub(crate) signal: Signal,
    pub(crate) joint: isize,
}

/// A function of one or two arguments.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Function {
    Abs,
    Sign,
    Step,
    Exp,
    Log,
    Sqrt,
    Sin,
    Cos,
    Tanh,
    Min,
    Max,
}

impl Function {
    /// All, with their names in a text and how many arguments they take.
    pub(crate) const ALL: [(&'static str, Self, usize); 11] = [
        ("abs", Self::Abs, 1),
        ("sign", Self::Sign, 1),
        ("step", Self::Step, 1),
        ("exp", Self::Exp, 1),
        ("log", Self::Log, 1),
        ("sqrt", Self::Sqrt, 1),
        ("sin", Self::Sin, 1),
        ("cos", Self::Cos, 1),
        ("tanh", Self::Tanh, 1),
        ("min", Self::Min, 2),
        ("max", Self::Max, 2),
    ];
}

/// What a formula is evaluated in.
pub(crate) trait Scalar:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    fn constant(value: f64) -> Self;
    fn value(self) -> f64;
    /// A function of it by that function's value and slope there.
    fn with(self, value: f64, slope: f64) -> Self;
}

impl Scalar for f64 {
    fn constant(value: f64) -> Self {
        value
    }

    fn value(self) -> f64 {
        self
    }

    fn with(self, value: f64, _: f64) -> Self {
        value
    }
}

/// A number and its slope along one direction: forward-mode differentiation, exact to rounding (Griewank & Walther, *Evaluating
/// Derivatives*, 2008, §3.1). A jump has no slope.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Dual {
    pub(crate) value: f64,
    pub(crate) slope: f64,
}

impl Add for Dual {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            slope: self.slope + other.slope,
        }
    }
}

impl Sub for Dual {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self {
            value: self.value - other.value,
            slope: self.slope - other.slope,
        }
    }
}

impl Mul for Dual {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self {
            value: self.value * other.value,
            slope: self.slope * other.value + self.value * other.slope,
        }
    }
}

impl Div for Dual {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        Self {
            value,
            slope: (self.slope - value * other.slope) / other.value,
        }
    }
}

impl Neg for Dual {
    type Output = Self;
    fn neg(self) -> Self {
        Self {
            value: -self.value,
            slope: -self.slope,
        }
    }
}

impl Scalar for Dual {
    fn constant(value: f64) -> Self {
        Self { value, slope: 0.0 }
    }

    fn value(self) -> f64 {
        self.value
    }

    fn with(self, value: f64, slope: f64) -> Self {
        Self {
            value,
            // What does not move has no slope, however steep the function is.
            slope: if self.slope == 0.0 {
                0.0
            } else {
                slope * self.slope
            },
        }
    }
}

/// The instant at which a formula is evaluated.
pub(crate) struct Scope<'a, T> {
    pub(crate) variable: &'a dyn Fn(Variable) -> T,
    /// The direction in which a joint moves, by its own rule of rest.
    pub(crate) direction: &'a dyn Fn(isize) -> f64,
    pub(crate) parameters: &'a [f64],
}

impl Expression {
    pub(crate) fn new(at: Range<usize>, node: Node) -> Self {
        Self { at, node }
    }

    /// Two operands' node, over the text of both.
    pub(crate) fn binary(operator: Operator, left: Self, right: Self) -> Self {
        Self {
            at: left.at.start.min(right.at.start)..left.at.end.max(right.at.end),
            node: Node::Binary(operator, Box::new(left), Box::new(right)),
        }
    }

    /// The value at an instant.
    pub(crate) fn value<T: Scalar>(&self, scope: &Scope<T>) -> T {
        match &self.node {
            Node::Number(x) => T::constant(*x),
            Node::Parameter(n) => {
                T::constant(scope.parameters.get(*n).copied().unwrap_or(f64::NAN))
            }
            Node::Variable(variable) => (scope.variable)(*variable),
            Node::Negative(of) => -of.value(scope),
            Node::Binary(operator, left, right) => {
                let a = left.value(scope);
                match operator {
                    Operator::Plus => a + right.value(scope),
                    Operator::Minus => a - right.value(scope),
                    Operator::Times => a * right.value(scope),
                    Operator::Over => a / right.value(scope),
                    Operator::Power => power(a, right.value(scope)),
                }
            }
            Node::Call(function, arguments) => self.call(*function, arguments, scope),
        }
    }

    fn call<T: Scalar>(&self, function: Function, arguments: &[Self], scope: &Scope<T>) -> T {
        let Some(first) = arguments.first() else {
            return T::constant(f64::NAN);
        };
        // The sign of a velocity about standstill is a matter of noise: the joint's own rule tells it.
        if let (Function::Sign | Function::Step, Some((joint, sign))) =
            (function, first.is_velocity())
        {
            let direction = sign * (scope.direction)(joint);
            return T::constant(match function {
                Function::Step => 0.5 * (1.0 + direction),
                _ => direction,
            });
        }
        let a = first.value(scope);
        let x = a.value();
        match function {
            Function::Abs => a.with(x.abs(), sign(x)),
            Function::Sign => T::constant(sign(x)),
            Function::Step => T::constant(if x < 0.0 { 0.0 } else { 1.0 }),
            Function::Exp => a.with(x.exp(), x.exp()),
            Function::Log => a.with(x.ln(), x.recip()),
            Function::Sqrt => a.with(x.sqrt(), 0.5 / x.sqrt()),
            Function::Sin => a.with(x.sin(), x.cos()),
            Function::Cos => a.with(x.cos(), -x.sin()),
            Function::Tanh => a.with(x.tanh(), 1.0 - x.tanh().powi(2)),
            Function::Min | Function::Max => {
                let Some(second) = arguments.get(1) else {
                    return T::constant(f64::NAN);
                };
                let b = second.value(scope);
                let is_first = match function {
                    Function::Min => x <= b.value(),
                    _ => x >= b.value(),
                };
                if is_first { a } else { b }
            }
        }
    }

    /// The joint whose velocity this is, and 1, or −1 where it is its negative.
    fn is_velocity(&self) -> Option<(isize, f64)> {
        match &self.node {
            Node::Variable(Variable {
                signal: Signal::Velocity,
                joint,
            }) => Some((*joint, 1.0)),
            Node::Negative(of) => of.is_velocity().map(|(joint, sign)| (joint, -sign)),
            _ => None,
        }
    }

    /// Tells each node, the outer ones first.
    pub(crate) fn each(&self, tell: &mut dyn FnMut(&Self)) {
        tell(self);
        match &self.node {
            Node::Number(_) | Node::Parameter(_) | Node::Variable(_) => {}
            Node::Negative(of) => of.each(tell),
            Node::Binary(_, left, right) => {
                left.each(tell);
                right.each(tell);
            }
            Node::Call(_, arguments) => arguments.iter().for_each(|a| a.each(tell)),
        }
    }

    /// Whether any node is one of these.
    pub(crate) fn has(&self, is: &dyn Fn(&Node) -> bool) -> bool {
        let mut has = false;
        self.each(&mut |e| has |= is(&e.node));
        has
    }

    /// Its variables, each once, in order.
    pub(crate) fn variables(&self) -> Vec<Variable> {
        let mut found = Vec::new();
        self.each(&mut |e| {
            if let Node::Variable(variable) = e.node {
                found.push(variable);
            }
        });
        found.sort_unstable();
        found.dedup();
        found
    }
}

fn sign(x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x.signum() }
}

/// a to the power of b. Of a negative number only whole powers are real.
fn power<T: Scalar>(a: T, b: T) -> T {
    let (x, n) = (a.value(), b.value());
    let value = if n.fract() == 0.0 && n.abs() <= 64.0 {
        x.powi(n as i32)
    } else {
        x.powf(n)
    };
    let by_base = a.with(value, n * x.powf(n - 1.0));
    // An exponent that moves adds its own slope.
    let by_exponent = b.with(0.0, value * x.ln());
    by_base + by_exponent
}
