//! The text of a formula into its tree: a parser of precedence (`+ −`, `* /`, unary `−`, `^`), of bounded depth.

use std::ops::Range;

use super::error::{FormulaError, FormulaProblem};
use super::expression::{Expression, Function, Node, Operator, Signal, Variable};
use super::law::Law;

/// No formula for a joint's torque has more characters; it keeps what is shown and searched bounded.
const MOST_CHARACTERS: usize = 500;
/// Nor more brackets, signs and powers within each other: the parser calls itself for each.
const MOST_DEPTH: usize = 32;

/// What a text says, before anything is asked of it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Parsed {
    pub(super) expression: Expression,
    /// The parameters' names in the order of the text.
    pub(super) parameters: Vec<String>,
    /// Where other joints are named, and how many places after its own in the limb each is.
    pub(super) names: Vec<(Range<usize>, isize)>,
}

/// A limb's joints as a formula at one of them names them.
#[derive(Debug, Clone, Copy)]
pub struct Names<'a> {
    /// Of all joints of the limb.
    pub joints: &'a [&'a str],
    /// Its own.
    pub own: usize,
}

/// The tree of a text.
pub(super) fn parse(text: &str, names: Names) -> Result<Parsed, FormulaError> {
    if text.chars().count() > MOST_CHARACTERS {
        let problem = FormulaProblem::TooLong {
            what: "characters",
            limit: MOST_CHARACTERS,
        };
        return Err(FormulaError::new(text, &(0..0), problem));
    }
    let tokens = tokens(text)?;
    let mut parser = Parser {
        text,
        tokens: &tokens,
        next: 0,
        depth: 0,
        names,
        parsed: Parsed {
            expression: Expression::new(0..0, Node::Number(0.0)),
            parameters: Vec::new(),
            names: Vec::new(),
        },
    };
    let expression = parser.sum()?;
    if let Some(token) = parser.peek() {
        return Err(parser.missing("an operator", token.at.clone()));
    }
    if let Some(part) = Law::within(&expression) {
        let problem =
            FormulaProblem::Law("a potential or a dissipation function is a whole formula");
        return Err(FormulaError::new(text, &part.at, problem));
    }
    parser.parsed.expression = expression;
    Ok(parser.parsed)
}

#[derive(Debug, Clone, PartialEq)]
enum Kind {
    Number(f64),
    /// A name, and the joint behind its dot.
    Name(String, Option<(String, Range<usize>)>),
    Sign(char),
}

#[derive(Debug, Clone, PartialEq)]
struct Token {
    at: Range<usize>,
    kind: Kind,
}

fn is_letter(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

fn tokens(text: &str) -> Result<Vec<Token>, FormulaError> {
    let mut tokens = Vec::new();
    let mut at = 0;
    let end_of = |from: usize, is: &dyn Fn(char) -> bool| {
        let rest = &text[from..];
        from + rest.find(|c| !is(c)).unwrap_or(rest.len())
    };
    while let Some(c) = text[at..].chars().next() {
        let start = at;
        if c.is_whitespace() {
            at += c.len_utf8();
            continue;
        }
        if c.is_ascii_digit() || c == '.' {
            at = end_of(at, &|c| c.is_ascii_digit() || c == '.');
            if text[at..].starts_with(['e', 'E']) {
                let digits = at + 1 + usize::from(text[at + 1..].starts_with(['+', '-']));
                let end = end_of(digits, &|c| c.is_ascii_digit());
                at = if end > digits { end } else { at };
            }
            let number = text[start..at].parse::<f64>().ok();
            let Some(number) = number.filter(|x| x.is_finite()) else {
                let problem = FormulaProblem::Number(text[start..at].to_owned());
                return Err(FormulaError::new(text, &(start..at), problem));
            };
            tokens.push(Token {
                at: start..at,
                kind: Kind::Number(number),
            });
            continue;
        }
        if is_letter(c) {
            at = end_of(at, &is_letter);
            let name = text[start..at].to_owned();
            let mut of = None;
            if text[at..].starts_with('.') {
                at += 1;
                let quoted = text[at..].starts_with('"');
                let from = at + usize::from(quoted);
                let end = if quoted {
                    end_of(from, &|c| c != '"')
                } else {
                    end_of(from, &is_letter)
                };
                of = Some((text[from..end].to_owned(), from..end));
                at = (end + usize::from(quoted)).min(text.len());
            }
            tokens.push(Token {
                at: start..at,
                kind: Kind::Name(name, of),
            });
            continue;
        }
        // As people write them: signs of other keyboards, and Python's power.
        let (sign, length) = match c {
            '−' | '–' => ('-', c.len_utf8()),
            '·' | '×' => ('*', c.len_utf8()),
            '*' if text[at..].starts_with("**") => ('^', 2),
            '+' | '-' | '*' | '/' | '^' | '(' | ')' | ',' => (c, 1),
            _ => {
                let problem = FormulaProblem::Character(c);
                return Err(FormulaError::new(text, &(at..at + c.len_utf8()), problem));
            }
        };
        at += length;
        tokens.push(Token {
            at: start..at,
            kind: Kind::Sign(sign),
        });
    }
    Ok(tokens)
}

struct Parser<'a> {
    text: &'a str,
    tokens: &'a [Token],
    next: usize,
    depth: usize,
    names: Names<'a>,
    parsed: Parsed,
}

type Result<T, E = FormulaError> = std::result::Result<T, E>;

impl<'a> Parser<'a> {
    fn peek(&self) -> Option<&'a Token> {
        self.tokens.get(self.next)
    }

    fn sign(&mut self, signs: &[char]) -> Option<char> {
        match self.peek()?.kind {
            Kind::Sign(c) if signs.contains(&c) => {
                self.next += 1;
                Some(c)
            }
            _ => None,
        }
    }

    fn fault(&self, at: &Range<usize>, problem: FormulaProblem) -> FormulaError {
        FormulaError::new(self.text, at, problem)
    }

    fn missing(&self, needed: &'static str, at: Range<usize>) -> FormulaError {
        self.fault(&at, FormulaProblem::Missing { needed })
    }

    /// One level deeper, as far as that is allowed.
    fn deeper(&mut self, then: impl FnOnce(&mut Self) -> Result<Expression>) -> Result<Expression> {
        self.depth += 1;
        if self.depth > MOST_DEPTH {
            let at = self.peek().map_or(0..0, |token| token.at.clone());
            let problem = FormulaProblem::TooLong {
                what: "brackets within each other",
                limit: MOST_DEPTH,
            };
            return Err(self.fault(&at, problem));
        }
        let found = then(self)?;
        self.depth -= 1;
        Ok(found)
    }

    fn sum(&mut self) -> Result<Expression> {
        let mut left = self.product()?;
        while let Some(sign) = self.sign(&['+', '-']) {
            let operator = if sign == '+' {
                Operator::Plus
            } else {
                Operator::Minus
            };
            left = Expression::binary(operator, left, self.product()?);
        }
        Ok(left)
    }

    fn product(&mut self) -> Result<Expression> {
        let mut left = self.signed()?;
        while let Some(sign) = self.sign(&['*', '/']) {
            let operator = if sign == '*' {
                Operator::Times
            } else {
                Operator::Over
            };
            left = Expression::binary(operator, left, self.signed()?);
        }
        Ok(left)
    }

    fn signed(&mut self) -> Result<Expression> {
        let start = self.peek().map_or(self.text.len(), |token| token.at.start);
        match self.sign(&['+', '-']) {
            Some(sign) => self.deeper(|parser| {
                let of = parser.signed()?;
                let at = start..of.at.end;
                Ok(match sign {
                    '-' => Expression::new(at, Node::Negative(Box::new(of))),
                    _ => of,
                })
            }),
            None => self.power(),
        }
    }

    fn power(&mut self) -> Result<Expression> {
        let base = self.atom()?;
        if self.sign(&['^']).is_none() {
            return Ok(base);
        }
        // To the right, and a sign binds there: 2^-x^2.
        let exponent = self.deeper(Self::signed)?;
        Ok(Expression::binary(Operator::Power, base, exponent))
    }

    fn atom(&mut self) -> Result<Expression> {
        let end = self.text.len();
        let Some(token) = self.peek() else {
            return Err(self.missing("a number, a name or a bracket", end..end));
        };
        self.next += 1;
        match &token.kind {
            Kind::Number(x) => Ok(Expression::new(token.at.clone(), Node::Number(*x))),
            Kind::Sign('(') => {
                let inner = self.deeper(Self::sum)?;
                self.close()?;
                Ok(inner)
            }
            Kind::Sign(_) => Err(self.missing("a number, a name or a bracket", token.at.clone())),
            Kind::Name(name, of) => match self.peek().map(|next| &next.kind) {
                Some(Kind::Sign('(')) => self.call(name, &token.at),
                _ => self.name(name, of.as_ref(), &token.at),
            },
        }
    }

    fn close(&mut self) -> Result<()> {
        let end = self.text.len();
        let at = self.peek().map_or(end..end, |token| token.at.clone());
        match self.sign(&[')']) {
            Some(_) => Ok(()),
            None => Err(self.missing("`)`", at)),
        }
    }

    fn call(&mut self, name: &str, at: &Range<usize>) -> Result<Expression> {
        let found = Function::ALL.iter().find(|(known, ..)| *known == name);
        let Some(&(name, function, count)) = found else {
            let known: Vec<&str> = Function::ALL.iter().map(|(known, ..)| *known).collect();
            let problem = FormulaProblem::UnknownFunction {
                name: name.to_owned(),
                known: known.join(", "),
            };
            return Err(self.fault(at, problem));
        };
        self.next += 1;
        let mut arguments = vec![self.deeper(Self::sum)?];
        while self.sign(&[',']).is_some() {
            arguments.push(self.deeper(Self::sum)?);
        }
        self.close()?;
        let end = self.tokens[self.next - 1].at.end;
        let at = at.start..end;
        if arguments.len() != count {
            return Err(self.fault(&at, FormulaProblem::Arguments { name, count }));
        }
        Ok(Expression::new(at, Node::Call(function, arguments)))
    }

    /// A signal, π, or a parameter.
    fn name(
        &mut self,
        name: &str,
        of: Option<&(String, Range<usize>)>,
        at: &Range<usize>,
    ) -> Result<Expression> {
        if matches!(name, "tau" | "tau_est" | "effort") {
            return Err(self.fault(at, FormulaProblem::MeasuredTorque));
        }
        let signal = Signal::ALL.iter().find(|(known, _)| *known == name);
        let node = match (signal, of) {
            (Some(&(name, signal)), of) => {
                let joint = of.map_or(Ok(0), |(of, place)| self.other(name, signal, of, place))?;
                Node::Variable(Variable { signal, joint })
            }
            (None, Some((of, place))) => {
                let known: Vec<&str> = Signal::ALL.iter().map(|(name, _)| *name).collect();
                let problem = FormulaProblem::UnknownParameter {
                    name: format!("{name}.{of}"),
                    known: format!("signals {}", known.join(", ")),
                };
                return Err(self.fault(&(at.start..place.end), problem));
            }
            (None, None) if matches!(name, "pi" | "π") => Node::Number(std::f64::consts::PI),
            (None, None) => {
                let names = &mut self.parsed.parameters;
                let known = names.iter().position(|known| known == name);
                Node::Parameter(known.unwrap_or_else(|| {
                    names.push(name.to_owned());
                    names.len() - 1
                }))
            }
        };
        Ok(Expression::new(at.clone(), node))
    }

    /// How many places after its own in the limb a joint is.
    fn other(
        &mut self,
        name: &'static str,
        signal: Signal,
        of: &str,
        at: &Range<usize>,
    ) -> Result<isize> {
        if !matches!(
            signal,
            Signal::Position | Signal::Velocity | Signal::Acceleration
        ) {
            return Err(self.fault(at, FormulaProblem::OwnSignal(name)));
        }
        let Names { joints, own } = self.names;
        let Some(found) = joints.iter().position(|joint| *joint == of) else {
            let problem = FormulaProblem::UnknownJoint {
                name: of.to_owned(),
                known: joints.join(", "),
            };
            return Err(self.fault(at, problem));
        };
        let joint = found as isize - own as isize;
        self.parsed.names.push((at.clone(), joint));
        Ok(joint)
    }
}
