//! Units of a formula: read from a text, found for parameters that state none, checked over the tree.
//!
//! An angle is no dimension: sin(3 q) is right. A number in a text may stand for any unit where nothing else would be right
//! (`tanh(dq/0.05)`, `step(t - 31.4)`), which is how people write.

use std::fmt;
use std::ops::Range;

use super::error::FormulaProblem;
use super::expression::{Expression, Function, Node, Operator, Signal};

/// Powers of kg, m, s, K, and, for words alone, of rad.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Unit {
    kg: f64,
    m: f64,
    s: f64,
    kelvin: f64,
    rad: f64,
}

impl Unit {
    pub(super) const PLAIN: Self = Self {
        kg: 0.0,
        m: 0.0,
        s: 0.0,
        kelvin: 0.0,
        rad: 0.0,
    };
    pub(super) const TORQUE: Self = Self {
        kg: 1.0,
        m: 2.0,
        s: -2.0,
        ..Self::PLAIN
    };
    pub(super) const FORCE: Self = Self {
        m: 1.0,
        ..Self::TORQUE
    };
    const SECOND: Self = Self {
        s: 1.0,
        ..Self::PLAIN
    };
    const METRE: Self = Self {
        m: 1.0,
        ..Self::PLAIN
    };
    const RADIAN: Self = Self {
        rad: 1.0,
        ..Self::PLAIN
    };
    const KELVIN: Self = Self {
        kelvin: 1.0,
        ..Self::PLAIN
    };
    const KILOGRAM: Self = Self {
        kg: 1.0,
        ..Self::PLAIN
    };

    pub(super) fn power(self, n: f64) -> Self {
        Self {
            kg: self.kg * n,
            m: self.m * n,
            s: self.s * n,
            kelvin: self.kelvin * n,
            rad: self.rad * n,
        }
    }

    pub(super) fn times(self, other: Self) -> Self {
        Self {
            kg: self.kg + other.kg,
            m: self.m + other.m,
            s: self.s + other.s,
            kelvin: self.kelvin + other.kelvin,
            rad: self.rad + other.rad,
        }
    }

    pub(super) fn over(self, other: Self) -> Self {
        self.times(other.power(-1.0))
    }

    /// Whether two may be added: angles are numbers.
    pub(super) fn is(self, other: Self) -> bool {
        let same = |a: f64, b: f64| (a - b).abs() < 1e-9;
        same(self.kg, other.kg)
            && same(self.m, other.m)
            && same(self.s, other.s)
            && same(self.kelvin, other.kelvin)
    }

    /// The unit of a text: `N m s^2/rad^2`, `1/rad`, `N m/(rad °C)`; powers as `^2` or `²`.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let mut parts = text.split('/');
        let product = |part: &str| {
            let part = part.trim().trim_start_matches('(').trim_end_matches(')');
            let mut unit = Self::PLAIN;
            for token in part.split(|c: char| c.is_whitespace() || matches!(c, '·' | '*')) {
                unit = unit.times(factor(token)?);
            }
            Some(unit)
        };
        let first = product(parts.next()?)?;
        parts.try_fold(first, |unit, part| Some(unit.over(product(part)?)))
    }
}

/// One unit with its power.
fn factor(token: &str) -> Option<Unit> {
    if matches!(token, "" | "1" | "-") {
        return Some(Unit::PLAIN);
    }
    let (name, power) = match token.split_once('^') {
        Some((name, power)) => (name, power.parse().ok()?),
        None => match token.strip_suffix('²') {
            Some(name) => (name, 2.0),
            None => (token, 1.0),
        },
    };
    let unit = match name {
        "N" => Unit::FORCE,
        "Nm" => Unit::TORQUE,
        "m" => Unit::METRE,
        "kg" => Unit::KILOGRAM,
        "s" => Unit::SECOND,
        "rad" => Unit::RADIAN,
        "°C" | "K" | "degC" => Unit::KELVIN,
        _ => return None,
    };
    Some(unit.power(power))
}

impl fmt::Display for Unit {
    /// By torques and forces where there are any: `N m s/rad`, and `kg m^2` for what multiplies an acceleration.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (mut above, mut below) = (Vec::new(), Vec::new());
        let mut put = |name: &str, n: f64| {
            let n = (n * 1e6).round() / 1e6;
            let text = match n.abs() {
                0.0 => return,
                1.0 => name.to_owned(),
                n => format!("{name}^{n}"),
            };
            if n > 0.0 { &mut above } else { &mut below }.push(text);
        };
        let mut rest = *self;
        let is_inertia = self.s == 0.0 && (self.rad == 0.0 || self.rad == -1.0);
        if self.kg == 1.0 && !is_inertia {
            put("N", 1.0);
            rest = rest.over(Self::FORCE);
            if rest.m >= 1.0 {
                put("m", 1.0);
                rest.m -= 1.0;
            }
        } else if self.kg == 1.0 {
            // An inertia's radians are nobody's.
            rest.rad = 0.0;
        }
        for (name, n) in [
            ("kg", rest.kg),
            ("m", rest.m),
            ("s", rest.s),
            ("rad", rest.rad),
            ("°C", rest.kelvin),
        ] {
            put(name, n);
        }
        let above = match above.is_empty() {
            true => "1".to_owned(),
            false => above.join(" "),
        };
        match below.as_slice() {
            [] => f.write_str(&above),
            [one] => write!(f, "{above}/{one}"),
            more => write!(f, "{above}/({})", more.join(" ")),
        }
    }
}

/// A unit, and whether a number in the text may still stand for another one.
#[derive(Debug, Clone, Copy)]
struct Found {
    unit: Unit,
    open: bool,
}

/// A fault of units: where, and what.
pub(super) type Fault = (Range<usize>, FormulaProblem);

/// The parameters' units, those that are stated first of all, of a torque in `needed` at a joint that turns, or slides.
pub(super) struct Units<'a> {
    pub(super) slides: bool,
    pub(super) stated: &'a [Option<Unit>],
}

impl Units<'_> {
    /// The unit of each parameter: as stated, or as the formula needs it; then the whole is checked.
    pub(super) fn of(&self, e: &Expression, linear: &[usize]) -> Result<Vec<Unit>, Fault> {
        let mut known: Vec<Option<Unit>> = self.stated.to_vec();
        // Each round tells one at least, or none. What is beside a number alone is one, where nothing else tells.
        for beside_numbers in [false, true] {
            for _ in 0..=known.len() {
                e.each(&mut |e| self.ask(e, beside_numbers, &mut known));
            }
        }
        let torque = if self.slides {
            Unit::FORCE
        } else {
            Unit::TORQUE
        };
        self.ask_for(e, torque, &mut known);
        for n in linear {
            // What the sum does not tell: a number.
            known[*n].get_or_insert(Unit::PLAIN);
        }
        let known: Vec<Unit> = known.into_iter().map(Option::unwrap_or_default).collect();
        let some: Vec<Option<Unit>> = known.iter().copied().map(Some).collect();
        let found = self.check(e, &some)?;
        match found {
            Some(found) if !found.unit.is(torque) && !found.open => Err((
                e.at.clone(),
                FormulaProblem::NoTorque {
                    found: found.unit.to_string(),
                    needed: torque.to_string(),
                },
            )),
            _ => Ok(known),
        }
    }

    /// Looks at a node for what it needs its parts to be.
    fn ask(&self, e: &Expression, beside_numbers: bool, known: &mut Vec<Option<Unit>>) {
        let unit = |e: &Expression, known: &[Option<Unit>]| {
            let found = self.check(e, known).ok().flatten();
            found
                .filter(|found| beside_numbers || !found.open)
                .map(|found| found.unit)
        };
        match &e.node {
            Node::Binary(Operator::Plus | Operator::Minus, left, right) => {
                for (told, asked) in [(left, right), (right, left)] {
                    if let Some(unit) = unit(told, known) {
                        self.ask_for(asked, unit, known);
                    }
                }
            }
            Node::Call(Function::Min | Function::Max, arguments) => {
                if let [left, right] = &arguments[..] {
                    for (told, asked) in [(left, right), (right, left)] {
                        if let Some(unit) = unit(told, known) {
                            self.ask_for(asked, unit, known);
                        }
                    }
                }
            }
            Node::Call(
                Function::Exp | Function::Log | Function::Sin | Function::Cos | Function::Tanh,
                arguments,
            ) => {
                for argument in arguments {
                    self.ask_for(argument, Unit::PLAIN, known);
                }
            }
            Node::Binary(Operator::Power, _, exponent) => {
                self.ask_for(exponent, Unit::PLAIN, known);
            }
            _ => {}
        }
    }

    /// Tells the one parameter of a product of unknown unit that makes it `needed`.
    fn ask_for(&self, e: &Expression, needed: Unit, known: &mut Vec<Option<Unit>>) {
        match &e.node {
            Node::Parameter(n) => {
                known[*n].get_or_insert(needed);
            }
            Node::Negative(of) => self.ask_for(of, needed, known),
            Node::Binary(Operator::Plus | Operator::Minus, left, right) => {
                self.ask_for(left, needed, known);
                self.ask_for(right, needed, known);
            }
            Node::Binary(operator @ (Operator::Times | Operator::Over), left, right) => {
                let unit =
                    |e: &Expression, known: &[Option<Unit>]| Some(self.check(e, known).ok()??.unit);
                match (unit(left, known), unit(right, known), operator) {
                    (None, Some(right), Operator::Times) => {
                        self.ask_for(left, needed.over(right), known);
                    }
                    (None, Some(right), _) => self.ask_for(left, needed.times(right), known),
                    (Some(left), None, Operator::Times) => {
                        self.ask_for(right, needed.over(left), known);
                    }
                    (Some(left), None, _) => self.ask_for(right, left.over(needed), known),
                    _ => {}
                }
            }
            Node::Binary(Operator::Power, base, exponent) => {
                if let Node::Number(n) = exponent.node
                    && n != 0.0
                {
                    self.ask_for(base, needed.power(1.0 / n), known);
                }
            }
            Node::Call(Function::Abs, arguments) => {
                arguments
                    .iter()
                    .for_each(|a| self.ask_for(a, needed, known));
            }
            Node::Call(Function::Min | Function::Max, arguments) => {
                arguments
                    .iter()
                    .for_each(|a| self.ask_for(a, needed, known));
            }
            _ => {}
        }
    }

    /// The unit of an expression; nothing where a parameter's is not known yet.
    fn check(&self, e: &Expression, known: &[Option<Unit>]) -> Result<Option<Found>, Fault> {
        let exactly = |unit: Unit| Some(Found { unit, open: false });
        Ok(match &e.node {
            Node::Number(_) => Some(Found {
                unit: Unit::PLAIN,
                open: true,
            }),
            Node::Parameter(n) => known.get(*n).copied().flatten().and_then(exactly),
            Node::Variable(v) => exactly(self.unit_of(v.signal)),
            Node::Negative(of) => self.check(of, known)?,
            Node::Binary(Operator::Plus | Operator::Minus, left, right) => {
                self.same(e, [left, right], known)?
            }
            Node::Binary(operator @ (Operator::Times | Operator::Over), left, right) => {
                let (left, right) = (self.check(left, known)?, self.check(right, known)?);
                left.zip(right).map(|(a, b)| Found {
                    unit: match operator {
                        Operator::Times => a.unit.times(b.unit),
                        _ => a.unit.over(b.unit),
                    },
                    open: a.open || b.open,
                })
            }
            Node::Binary(Operator::Power, base, exponent) => {
                self.plain(exponent, "an exponent", known)?;
                let base = self.check(base, known)?;
                match exponent.node {
                    Node::Number(n) => base.map(|base| Found {
                        unit: base.unit.power(n),
                        ..base
                    }),
                    // Of a power that is not known, a number.
                    _ => base,
                }
            }
            Node::Call(function, arguments) => {
                let first = &arguments[0];
                match function {
                    Function::Abs | Function::Potential | Function::Dissipation => {
                        self.check(first, known)?
                    }
                    Function::Sqrt => self.check(first, known)?.map(|of| Found {
                        unit: of.unit.power(0.5),
                        ..of
                    }),
                    Function::Sign | Function::Step => {
                        self.check(first, known)?;
                        exactly(Unit::PLAIN)
                    }
                    Function::Min | Function::Max => self.same(e, [first, &arguments[1]], known)?,
                    Function::Exp
                    | Function::Log
                    | Function::Sin
                    | Function::Cos
                    | Function::Tanh => {
                        let known_name = Function::ALL.iter().find(|(_, own, _)| own == function);
                        self.plain(first, known_name.map_or("", |(name, ..)| name), known)?;
                        exactly(Unit::PLAIN)
                    }
                }
            }
        })
    }

    fn same(
        &self,
        e: &Expression,
        [left, right]: [&Expression; 2],
        known: &[Option<Unit>],
    ) -> Result<Option<Found>, Fault> {
        let (Some(a), Some(b)) = (self.check(left, known)?, self.check(right, known)?) else {
            return Ok(None);
        };
        if a.unit.is(b.unit) {
            return Ok(Some(Found {
                unit: if a.open { b.unit } else { a.unit },
                open: a.open && b.open,
            }));
        }
        match (a.open, b.open) {
            (true, _) => Ok(Some(b)),
            (false, true) => Ok(Some(a)),
            (false, false) => Err((
                e.at.clone(),
                FormulaProblem::Units {
                    left: a.unit.to_string(),
                    right: b.unit.to_string(),
                },
            )),
        }
    }

    fn plain(
        &self,
        e: &Expression,
        name: &'static str,
        known: &[Option<Unit>],
    ) -> Result<(), Fault> {
        match self.check(e, known)? {
            Some(found) if !found.open && !found.unit.is(Unit::PLAIN) => Err((
                e.at.clone(),
                FormulaProblem::NotPlain {
                    name,
                    unit: found.unit.to_string(),
                },
            )),
            _ => Ok(()),
        }
    }

    fn unit_of(&self, signal: Signal) -> Unit {
        let way = if self.slides {
            Unit::METRE
        } else {
            Unit::RADIAN
        };
        match signal {
            Signal::Position => way,
            Signal::Velocity => way.over(Unit::SECOND),
            Signal::Acceleration => way.over(Unit::SECOND).over(Unit::SECOND),
            Signal::TransmittedTorque if self.slides => Unit::FORCE,
            Signal::TransmittedTorque => Unit::TORQUE,
            Signal::Temperature => Unit::KELVIN,
            Signal::Time => Unit::SECOND,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_read_and_written() {
        for (text, written) in [
            ("N m/rad^2", "N m/rad^2"),
            ("N m s/rad", "N m s/rad"),
            ("Nm", "N m"),
            ("N·m·s²/rad²", "N m s^2/rad^2"),
            ("kg m^2", "kg m^2"),
            ("1/rad", "1/rad"),
            ("N m s/(rad °C)", "N m s/(rad °C)"),
            ("1", "1"),
            ("rad", "rad"),
            ("N s/m", "N s/m"),
        ] {
            let unit = Unit::parse(text).unwrap();
            assert_eq!(unit.to_string(), written, "{text}: {unit:?}");
        }
        assert_eq!(Unit::parse("furlong"), None);
    }
}
