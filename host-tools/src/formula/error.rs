//! Why a formula is refused, and where in its text.

use std::ops::Range;

/// A formula is bad.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{problem}\n    {text}\n    {}", marks(.text, .at))]
pub struct FormulaError {
    /// The text, or the part of it about the fault.
    pub text: String,
    /// The bytes of that text that are at fault.
    pub at: Range<usize>,
    /// What is wrong.
    pub problem: FormulaProblem,
}

/// What is wrong with a formula.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FormulaProblem {
    /// More characters, or deeper brackets, than any formula needs.
    #[error("a formula has {limit} {what} at most")]
    TooLong {
        /// "characters", "brackets within each other".
        what: &'static str,
        /// How many.
        limit: usize,
    },
    /// Something else is needed here.
    #[error("{needed} is missing here")]
    Missing {
        /// What.
        needed: &'static str,
    },
    /// A character that no formula has.
    #[error("`{0}` means nothing in a formula")]
    Character(char),
    /// No number.
    #[error("`{0}` is not a number")]
    Number(String),
    /// A function that does not exist.
    #[error("there is no function `{name}`; there are {known}")]
    UnknownFunction {
        /// As written.
        name: String,
        /// Those that exist.
        known: String,
    },
    /// So many arguments are too few or too many.
    #[error("`{name}` takes {count} argument{}", if *.count == 1 { "" } else { "s" })]
    Arguments {
        /// The function.
        name: &'static str,
        /// How many it takes.
        count: usize,
    },
    /// The measured torque, which a formula may not use.
    #[error(
        "`tau` is the measured torque, which a formula may not use: it would explain the noise by itself; `tau_rigid` is the torque that the model transmits"
    )]
    MeasuredTorque,
    /// A joint that the formula's own limb does not have.
    #[error("there is no joint `{name}` in the same limb; there are {known}")]
    UnknownJoint {
        /// As written.
        name: String,
        /// The limb's joints.
        known: String,
    },
    /// A signal that only the formula's own joint, or the log, has.
    #[error("`{0}` is of no other joint")]
    OwnSignal(&'static str),
    /// Nothing to fit.
    #[error("no parameter multiplies this: write `c*(…)`, so that there is a value to identify")]
    NoFactor,
    /// A parameter where only numbers can be.
    #[error("a simulated torque needs numbers: {0} has none")]
    NoNumber(String),
    /// Too many parameters of one kind.
    #[error(
        "too many {what}: {limit} at most; write two formulas, or give the others a `value` and `held = true`"
    )]
    TooMany {
        /// "parameters", "parameters that multiply", "parameters in which it is not linear".
        what: &'static str,
        /// How many.
        limit: usize,
    },
    /// A potential or a dissipation function that cannot be.
    #[error("{0}")]
    Law(&'static str),
    /// No condition.
    #[error("a condition compares two sums, once: `q > 1.2`, `t < 31.4`")]
    NoComparison,
    /// Something that a condition cannot ask.
    #[error(
        "`{0}` is no signal that a condition can ask: those are q, dq, temp and t, of other joints q.NAME"
    )]
    NoSignal(String),
    /// The acceleration where it is not linear.
    #[error(
        "the acceleration may only be multiplied, by functions of positions: no signal of a robot is as noisy"
    )]
    Acceleration,
    /// The time, where another motion than the log's is meant.
    #[error("`t` is the time of one log: a torque over it holds for no other motion")]
    Time,
    /// The transmitted torque and the temperature together.
    #[error("`tau_rigid` and `temp` cannot be in one formula: write two")]
    Inputs,
    /// Units that do not go together.
    #[error("{left} and {right} cannot be added or compared")]
    Units {
        /// Of the one.
        left: String,
        /// Of the other.
        right: String,
    },
    /// A unit where there can be none.
    #[error("`{name}` of {unit}: it needs a number without a unit")]
    NotPlain {
        /// The function, or "an exponent".
        name: &'static str,
        /// The unit of what it is given.
        unit: String,
    },
    /// The result is no torque.
    #[error("this is in {found}, and has to be in {needed}")]
    NoTorque {
        /// Its unit.
        found: String,
        /// The joint's.
        needed: String,
    },
    /// A unit that is not known.
    #[error("`{0}` is no unit of N, m, kg, s, rad, °C")]
    Unit(String),
    /// Nothing, wherever the joint is and however it moves, so that its parameter has no effect.
    #[error("this is zero wherever the joint is: no value of its parameter changes anything")]
    Zero,
    /// Not finite within what the joint does.
    #[error("this is not finite at {0}")]
    NotFinite(String),
    /// A parameter whose name means something else, or that the text does not have.
    #[error("the formula has no parameter `{name}`; it has {known}")]
    UnknownParameter {
        /// As written.
        name: String,
        /// Those that it has.
        known: String,
    },
    /// A number that a parameter cannot have.
    #[error("`{name}`: {what}")]
    Parameter {
        /// Which.
        name: String,
        /// What is wrong with it.
        what: &'static str,
    },
    /// It is said to be of a kind that it is not.
    #[error("it is no {kind} torque: {why}")]
    Kind {
        /// "dissipative", "conservative".
        kind: &'static str,
        /// Where it fails.
        why: String,
    },
    /// A kind that does not exist.
    #[error("there is no kind `{0}`; there are dissipative, conservative, motor, free")]
    UnknownKind(String),
}

/// How much of a text is shown to each side of a fault.
const SHOWN: usize = 60;

impl FormulaError {
    /// A fault at these bytes of the text.
    pub(super) fn new(text: &str, at: &Range<usize>, problem: FormulaProblem) -> Self {
        let boundary = |mut n: usize| {
            while !text.is_char_boundary(n) {
                n -= 1;
            }
            n
        };
        let start = boundary(at.start.saturating_sub(SHOWN).min(text.len()));
        let end = boundary((at.end.max(at.start).min(at.start + SHOWN) + SHOWN).min(text.len()));
        let end = end.max(start);
        let place = |n: usize| boundary(n.clamp(start, end)) - start;
        Self {
            text: text[start..end].replace(['\n', '\r', '\t'], " "),
            at: place(at.start)..place(at.end),
            problem,
        }
    }
}

/// A line of marks below the bytes of a text.
fn marks(text: &str, at: &Range<usize>) -> String {
    let count = |part: &str| part.chars().count();
    let before = text.get(..at.start).map_or(0, count);
    let own = text.get(at.clone()).map_or(1, count).max(1);
    format!("{}{}", " ".repeat(before), "^".repeat(own))
}
