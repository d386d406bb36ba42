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
    /// What a whole text may be: see [`Law`](super::law::Law). It has no value of its own.
    Potential,
    /// The same.
    Dissipation,
}

impl Function {
    /// All, with their names in a text and how many arguments they take.
    pub(crate) const ALL: [(&'static str, Self, usize); 13] = [
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
        ("potential", Self::Potential, 1),
        ("dissipation", Self::Dissipation, 1),
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
    /// A function of it, by that function's value and slope at a number.
    fn map(self, of: impl Fn(f64) -> [f64; 2]) -> Self;
    /// This where `is_first` says so of the two, else the other.
    fn choose(self, other: Self, is_first: impl Fn(f64, f64) -> bool) -> Self;
    /// It to the power of another. Of a negative number only whole powers are real.
    fn power(self, exponent: Self) -> Self;
}

impl Scalar for f64 {
    fn constant(value: f64) -> Self {
        value
    }

    fn map(self, of: impl Fn(f64) -> [f64; 2]) -> Self {
        of(self)[0]
    }

    fn choose(self, other: Self, is_first: impl Fn(f64, f64) -> bool) -> Self {
        if is_first(self, other) { self } else { other }
    }

    fn power(self, exponent: Self) -> Self {
        if exponent.fract() == 0.0 && exponent.abs() <= 64.0 {
            self.powi(exponent as i32)
        } else {
            self.powf(exponent)
        }
    }
}

/// How many instants are worked out together: enough that walking the tree costs little beside what its nodes do.
pub(crate) const LANES: usize = 16;

/// Numbers of [`LANES`] instants.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lanes(pub(crate) [f64; LANES]);

impl Lanes {
    fn each(self, of: impl Fn(f64) -> f64) -> Self {
        Self(self.0.map(of))
    }

    fn both(self, other: Self, of: impl Fn(f64, f64) -> f64) -> Self {
        Self(std::array::from_fn(|n| of(self.0[n], other.0[n])))
    }
}

/// An operator, instant by instant.
macro_rules! by_lanes {
    ($($operator:ident $method:ident),+) => {
        $(impl $operator for Lanes {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                self.both(other, f64::$method)
            }
        })+
    };
}

by_lanes!(Add add, Sub sub, Mul mul, Div div);

impl Neg for Lanes {
    type Output = Self;
    fn neg(self) -> Self {
        self.each(f64::neg)
    }
}

impl Scalar for Lanes {
    fn constant(value: f64) -> Self {
        Self([value; LANES])
    }

    fn map(self, of: impl Fn(f64) -> [f64; 2]) -> Self {
        self.each(|x| x.map(&of))
    }

    fn choose(self, other: Self, is_first: impl Fn(f64, f64) -> bool) -> Self {
        self.both(other, |a, b| a.choose(b, &is_first))
    }

    fn power(self, exponent: Self) -> Self {
        self.both(exponent, f64::power)
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

    fn map(self, of: impl Fn(f64) -> [f64; 2]) -> Self {
        let [value, slope] = of(self.value);
        // What does not move has no slope, however steep the function is.
        let is_still = self.slope == 0.0;
        let slope = if is_still { 0.0 } else { slope * self.slope };
        Self { value, slope }
    }

    fn choose(self, other: Self, is_first: impl Fn(f64, f64) -> bool) -> Self {
        let is_first = is_first(self.value, other.value);
        if is_first { self } else { other }
    }

    fn power(self, exponent: Self) -> Self {
        let (x, n) = (self.value, exponent.value);
        let value = x.power(n);
        let by_base = self.map(|_| [value, n * x.powf(n - 1.0)]);
        // An exponent that moves adds its own slope.
        let by_exponent = exponent.map(|_| [0.0, value * x.ln()]);
        by_base + by_exponent
    }
}

/// The instant at which a formula is evaluated.
pub(crate) struct Scope<'a, T> {
    pub(crate) variable: &'a dyn Fn(Variable) -> T,
    /// The direction in which a joint moves, by its own rule of rest.
    pub(crate) direction: &'a dyn Fn(isize) -> T,
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

    /// Where the text first has a signal.
    pub(crate) fn first_of(&self, signal: Signal) -> Option<Range<usize>> {
        let mut places = Vec::new();
        self.each(&mut |e| {
            if matches!(e.node, Node::Variable(v) if v.signal == signal) {
                places.push(e.at.clone());
            }
        });
        places.into_iter().min_by_key(|at| at.start)
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
                    Operator::Power => a.power(right.value(scope)),
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
            let direction = (scope.direction)(joint);
            return direction.map(|towards| match function {
                Function::Step => [0.5 * (1.0 + sign * towards), 0.0],
                _ => [sign * towards, 0.0],
            });
        }
        let a = first.value(scope);
        let of_two = |is_first: fn(f64, f64) -> bool| {
            let second = arguments.get(1);
            second.map_or(T::constant(f64::NAN), |b| {
                a.choose(b.value(scope), is_first)
            })
        };
        match function {
            Function::Abs => a.map(|x| [x.abs(), sign(x)]),
            Function::Sign => a.map(|x| [sign(x), 0.0]),
            Function::Step => a.map(|x| [step(x), 0.0]),
            Function::Exp => a.map(|x| [x.exp(), x.exp()]),
            Function::Log => a.map(|x| [x.ln(), x.recip()]),
            Function::Sqrt => a.map(|x| [x.sqrt(), 0.5 / x.sqrt()]),
            Function::Sin => a.map(|x| [x.sin(), x.cos()]),
            Function::Cos => a.map(|x| [x.cos(), -x.sin()]),
            Function::Tanh => a.map(|x| [x.tanh(), 1.0 - x.tanh().powi(2)]),
            // What is no number stays none, whichever of the two it is.
            Function::Min => of_two(|a, b| a <= b || a.is_nan()),
            Function::Max => of_two(|a, b| a >= b || a.is_nan()),
            Function::Potential | Function::Dissipation => T::constant(f64::NAN),
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

fn step(x: f64) -> f64 {
    match x {
        x if x.is_nan() => x,
        x if x < 0.0 => 0.0,
        _ => 1.0,
    }
}

fn sign(x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x.signum() }
}
