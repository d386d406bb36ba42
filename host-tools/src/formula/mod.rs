//! Effects of a user's own: a torque as a formula over the motion, in a model file or on the command line.
//!
//! `c*(q - q0)*abs(q - q0)` is a torque at a joint. Variables have the log's names: `q`, `dq`, `ddq` (rad, rad/s, rad/s²), `tau_rigid` (N m,
//! what the gear transmits under the model), `temp` (°C), `t` (s); those of another joint of the limb are `q.FR_hip`. Every other name is a
//! parameter. [`define`] turns the text into facts and columns like those of the catalogue, so that every room treats it as one of them:
//!
//! - parameters that multiply (two at most) have columns; two in which the torque is not linear are scanned over a grid and refined; others
//!   are held at a value
//! - the acceleration enters by differences of momentum, f(q) q̈ = d/dt(f q̇) − ḟ q̇: no signal is differentiated twice
//! - the sign of a velocity follows the joint's own rule of rest
//! - the *measured* torque is no variable: an effect may not see what it explains
//! - `potential(0.5*k*(q - r*q.FR_calf)^2)` is the torque of each of its joints, the derivative in the joint's position, and `dissipation(…)` that in
//!   its velocity: one value for all of them
//!
//! Files beside:
//!
//! - `expression`: the tree and its value, with a slope where one is asked
//! - `parse`: text to tree
//! - `derivative`: of a tree in a variable; `law`: torques of several joints by one function
//! - `columns`: tree to window columns
//! - `grammar`: the terms that a search for an unknown torque goes through
//! - `unit`: units, stated and found
//! - `site`: the range of a joint's motion, in which a formula has to be finite and of its kind
//! - `error`: why a formula is refused, and where in its text

mod columns;
mod condition;
mod derivative;
mod error;
mod expression;
pub(crate) mod grammar;
mod law;
mod parse;
mod site;
mod unit;

use std::collections::BTreeMap;
use std::ops::Range;

use proprio_core::effect::{
    CoupledTerms, Description, Form, Grid, Input, JointState, MAX_COLUMNS, MAX_PARAMETERS,
    MAX_SHAPES, OwnEffect, Parameter, Prior, Shapes, Term, Varies,
};

use columns::{Integrated, split, window_terms};
pub(crate) use condition::Condition;
pub use error::{FormulaError, FormulaProblem};
use expression::{Expression, Node, Operator, Signal};
use law::{AtJoint, Law};
pub use parse::Names;
use parse::parse;
pub use site::Site;
use unit::{Unit, Units};

/// What is stated of a parameter beside the formula.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Stated {
    /// Its unit; else what the formula needs.
    pub unit: Option<String>,
    /// Mean and standard deviation before any data; else zero within what the joint's limits leave room for.
    pub prior: Option<[f64; 2]>,
    /// Its least value.
    pub min: Option<f64>,
    /// Its greatest value.
    pub max: Option<f64>,
    /// The value at which it is held: it is not identified.
    pub held: Option<f64>,
}

/// What a formula claims to be; it is checked over the joint's whole range.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Kind {
    /// Anything.
    #[default]
    Free,
    /// It takes energy out of every motion, or none: friction.
    Dissipative,
    /// It depends on the joint's position alone, so that it has a potential.
    Conservative,
    /// The motor makes it: current sensor, cogging.
    Motor,
}

impl Kind {
    /// All, with their names.
    pub const ALL: [(&'static str, Self); 4] = [
        ("dissipative", Self::Dissipative),
        ("conservative", Self::Conservative),
        ("motor", Self::Motor),
        ("free", Self::Free),
    ];

    /// The kind of that name.
    ///
    /// # Errors
    /// [`FormulaProblem::UnknownKind`].
    pub fn named(name: &str) -> Result<Self, FormulaError> {
        let found = Self::ALL.iter().find(|(known, _)| *known == name);
        found.map(|(_, kind)| *kind).ok_or_else(|| {
            FormulaError::new(
                name,
                &(0..name.len()),
                FormulaProblem::UnknownKind(name.to_owned()),
            )
        })
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        let found = Self::ALL.iter().find(|(_, kind)| *kind == self);
        found.map_or("free", |(name, _)| name)
    }
}

/// A formula as it was written, for files and screens.
#[derive(Debug, Clone, PartialEq)]
pub struct Formula {
    text: String,
    /// Where the text names other joints, and how many places after its own each is.
    names: Vec<(Range<usize>, isize)>,
    /// What it claims to be.
    pub kind: Kind,
    /// What is stated of parameters, by their names.
    pub stated: BTreeMap<String, Stated>,
    /// Parameters that are held, each with its value.
    pub held: Vec<(String, f64)>,
    /// Where its text has the time, if it has.
    time: Option<Range<usize>>,
}

impl Formula {
    /// The text at a joint: `name` tells that of the joint so many places after it in its limb.
    pub fn text_at(&self, name: impl Fn(isize) -> String) -> String {
        let mut text = self.text.clone();
        for (at, joint) in self.names.iter().rev() {
            text.replace_range(at.clone(), &name(*joint));
        }
        text
    }

    /// Why it is of no use beyond a diagnosis of a log, and where its text says so: a torque over time is of that log's motion alone.
    pub fn over_time(&self) -> Option<FormulaError> {
        let at = self.time.as_ref()?;
        Some(FormulaError::new(&self.text, at, FormulaProblem::Time))
    }
}

/// [`Formula::over_time`] of the text of a [`torque`].
pub fn over_time(text: &str) -> Option<FormulaError> {
    let parsed = parse(text, NO_JOINTS).ok()?;
    let at = parsed.expression.first_of(Signal::Time)?;
    Some(FormulaError::new(text, &at, FormulaProblem::Time))
}

/// An effect by its text at a joint.
///
/// # Errors
/// [`FormulaError`], with the place in the text.
///
/// # Panics
/// Never.
pub fn define(
    name: &str,
    text: &str,
    kind: Kind,
    stated: &BTreeMap<String, Stated>,
    site: &Site,
) -> Result<(OwnEffect, Formula), FormulaError> {
    let fault = |at: &Range<usize>, problem| FormulaError::new(text, at, problem);
    let whole = 0..text.len();
    let parsed = parse(text, site.names)?;
    let names = &parsed.parameters;
    if let Some(unknown) = stated.keys().find(|name| !names.contains(name)) {
        let problem = FormulaProblem::UnknownParameter {
            name: unknown.clone(),
            known: names.join(", "),
        };
        return Err(fault(&whole, problem));
    }
    let of = |n: usize| stated.get(&names[n]).cloned().unwrap_or_default();
    for n in 0..names.len() {
        checked(&names[n], &of(n)).map_err(|problem| fault(&whole, problem))?;
    }
    let held: Vec<Option<f64>> = (0..names.len()).map(|n| of(n).held).collect();
    let (law, of_law) = Law::of(&parsed.expression);
    let of_law = with_held(of_law, &held);
    law.check(&of_law)
        .map_err(|problem| fault(&whole, problem))?;
    let nothing = || fault(&whole, FormulaProblem::Law(NOTHING_HERE));
    let expression = law.torque(&of_law, 0).ok_or_else(nothing)?;
    let too_many = |what, limit| fault(&whole, FormulaProblem::TooMany { what, limit });
    let free = held.iter().filter(|held| held.is_none()).count();
    if names.len() > MOST_NAMES || free > MAX_PARAMETERS {
        return Err(too_many("parameters", MAX_PARAMETERS));
    }
    let mut parts =
        split(&of_law, names.len()).ok_or_else(|| fault(&whole, FormulaProblem::NoFactor))?;
    let torques = |joint: isize| -> Vec<Option<Expression>> {
        (parts.factors.iter())
            .map(|factor| law.torque(factor, joint))
            .collect()
    };
    // What each parameter multiplies at the other joints, and at its own.
    let others_act: Vec<AtJoint> = (law.others(&of_law).into_iter())
        .map(|joint| (joint, torques(joint)))
        .collect();
    let own: Option<Vec<Expression>> = torques(0).into_iter().collect();
    parts.factors = own.ok_or_else(nothing)?;
    if parts.linear.len() > MAX_COLUMNS {
        return Err(too_many("parameters that multiply", MAX_COLUMNS));
    }
    let shapes: Vec<usize> = (0..names.len())
        .filter(|n| held[*n].is_none() && !parts.linear.contains(n))
        .collect();
    if shapes.len() > MAX_SHAPES {
        let what = "parameters in which it is not linear";
        return Err(too_many(what, MAX_SHAPES));
    }
    let stated_whole = law.torque(Law::of(&parsed.expression).1, 0);
    let units = units(
        text,
        &stated_whole.ok_or_else(nothing)?,
        names,
        (&of, &parts.linear),
        site.slides,
    )?;
    let integrated =
        |factor: &Expression| Integrated::of(factor).map_err(|(e, problem)| fault(&e.at, problem));
    let columns: Vec<Integrated> = (parts.factors.iter())
        .map(integrated)
        .collect::<Result<_, _>>()?;
    let mut columns_of: Vec<(isize, Vec<Option<Integrated>>)> = Vec::new();
    for (joint, factors) in &others_act {
        let own = factors
            .iter()
            .map(|factor| factor.as_ref().map(integrated).transpose());
        columns_of.push((*joint, own.collect::<Result<_, _>>()?));
    }
    let input = input(&of_law).map_err(|problem| fault(&whole, problem))?;
    let with_grid = |n: usize| (n, grid(&of(n), &expression, (n, &units[n]), site));
    let mut shapes: Vec<(usize, Grid)> = shapes.into_iter().map(with_grid).collect();
    // A search has all values of the first beside a few of the second.
    shapes.sort_by_key(|(_, grid)| width_of(*grid));
    // Each example of one beside each of the other.
    let mut sets = vec![vec![1.0; names.len()]];
    for (n, grid) in &shapes {
        let with = |set: &Vec<f64>| {
            site.examples(*grid).map(|value| {
                let mut set = set.clone();
                set[*n] = value;
                set
            })
        };
        sets = sets.iter().flat_map(with).collect();
    }
    let at_others = others_act.iter().flat_map(|(_, all)| all.iter().flatten());
    let everywhere: Vec<Expression> = parts.factors.iter().chain(at_others).cloned().collect();
    site.check_finite(&expression, &everywhere, &sets)
        .map_err(|(at, problem)| fault(&at, problem))?;
    for (n, own) in parts.factors.iter().enumerate() {
        let at_others = (others_act.iter()).filter_map(|(_, all)| all.get(n)?.as_ref());
        let all: Vec<&Expression> = std::iter::once(own).chain(at_others).collect();
        if let Some(at) = site.zero(&all, &sets) {
            return Err(fault(&at, FormulaProblem::Zero));
        }
    }
    let bounds = match law {
        Law::Torque => site.bounds_of(kind, &parts.factors, &sets),
        _ => site.bounds_of_law((law, kind), (&parts.factors, &others_act), &sets),
    };
    let bounds = bounds.map_err(|problem| fault(&whole, problem))?;
    let mut parameters = Vec::new();
    let mut priors = Vec::new();
    for (n, factor, bounds) in parts
        .linear
        .iter()
        .zip(&parts.factors)
        .zip(bounds)
        .map(|((n, factor), bounds)| (*n, factor, bounds))
    {
        let stated = of(n);
        let lower = stated.min.unwrap_or(bounds[0]);
        let upper = stated.max.unwrap_or(bounds[1]);
        parameters.push(Parameter::new(
            leaked(&names[n]),
            leaked(&units[n].to_string()),
            lower,
            upper,
        ));
        let room = site.room(factor, &sets);
        priors.push(stated.prior.map_or(
            Prior {
                mean: 0.0f64.clamp(lower, upper),
                std: room,
            },
            |[mean, std]| Prior { mean, std },
        ));
    }
    for &(n, grid) in &shapes {
        let stated = of(n);
        let [least, most] = site.range(grid);
        let positive = if grid_is_positive(grid) {
            0.0
        } else {
            f64::NEG_INFINITY
        };
        let lower = stated.min.unwrap_or(positive);
        let upper = stated.max.unwrap_or(f64::INFINITY);
        let parameter = Parameter::new(
            leaked(&names[n]),
            leaked(&units[n].to_string()),
            lower,
            upper,
        );
        parameters.push(parameter.shape(grid));
        priors.push(stated.prior.map_or(
            Prior {
                mean: (0.5 * (least + most)).clamp(lower, upper),
                std: (most - least).abs().max(f64::MIN_POSITIVE),
            },
            |[mean, std]| Prior { mean, std },
        ));
    }
    let mut others: Vec<isize> = (of_law.variables().iter())
        .map(|v| v.joint)
        .filter(|joint| *joint != 0)
        .collect();
    others.sort_unstable();
    others.dedup();
    let varies = match (expression.variables().iter()).all(|v| {
        matches!(
            v.signal,
            Signal::Position | Signal::Time | Signal::Temperature
        )
    }) {
        true => Varies::Slowly,
        false => Varies::Fast,
    };
    let count = names.len();
    let mut places = [MOST_NAMES; MAX_SHAPES];
    (places.iter_mut().zip(&shapes)).for_each(|(place, (n, _))| *place = *n);
    let parameters_of = move |shapes: Shapes| {
        let mut parameters = [1.0; MOST_NAMES];
        for (place, shape) in places.into_iter().zip(shapes) {
            if let Some(parameter) = parameters.get_mut(place) {
                *parameter = shape;
            }
        }
        parameters
    };
    let is_coupled = !columns_of.is_empty();
    columns_of.push((0, columns.iter().cloned().map(Some).collect()));
    let coupled = move |joints: &[JointState<f64>], own: usize, at: usize, shapes: Shapes| {
        let is_felt = |(joint, _): &&(isize, _)| own.checked_add_signed(*joint) == Some(at);
        let felt = columns_of.iter().find(is_felt);
        // The functions name joints by their places after the effect's own.
        let of = |n: usize| {
            felt?
                .1
                .get(n)?
                .as_ref()?
                .term(joints, own, &parameters_of(shapes)[..count])
        };
        std::array::from_fn(|n| of(n).unwrap_or_else(Term::zero))
    };
    let coupled = is_coupled.then(|| -> &'static CoupledTerms { Box::leak(Box::new(coupled)) });
    let formula = Formula {
        text: text.to_owned(),
        names: parsed.names,
        kind,
        held: held_values(names, &held),
        stated: stated.clone(),
        time: expression.first_of(Signal::Time),
    };
    let effect = OwnEffect {
        description: Description {
            form: match is_coupled {
                true => Form::Coupled,
                false => Form::Columns,
            },
            name: leaked(name),
            // The same at like joints of other limbs, whose neighbours have other names.
            torque: leaked(&formula.text_at(|after| format!("{after:+}"))),
            input,
            varies,
            parameters: parameters.leak(),
            words: "a torque by a formula of the model file",
            separated_by: "the formula's variables over their whole range",
            ..Description::TORQUE
        },
        priors: priors.leak(),
        others: others.leak(),
        terms: Box::leak(Box::new(
            move |joints: &[JointState<f64>], at: usize, shapes: Shapes| {
                window_terms(&columns, joints, at, &parameters_of(shapes)[..count])
            },
        )),
        coupled,
    };
    Ok((effect, formula))
}

/// What a joint does, for [`torque`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instant {
    /// Position, rad, and velocity, rad/s.
    pub q: f64,
    /// See `q`.
    pub dq: f64,
    /// Torque that the gear transmits, N m.
    pub transmitted: f64,
    /// Temperature, °C.
    pub temperature: f64,
    /// Time since the start, s.
    pub t: f64,
}

/// Slower than this, rad/s, a simulated joint's sign of velocity is a straight line: a jump would make its motion stiff.
const SLOW: f64 = 2e-3;

/// A joint without neighbours.
const NO_JOINTS: Names = Names {
    joints: &[],
    own: 0,
};

/// A torque, N m, all of whose numbers are in the text: what a simulation hides. It sees its own joint's motion alone.
///
/// # Errors
/// [`FormulaError`]: as [`define`] has it; parameters, accelerations and other joints are refused.
pub fn torque(text: &str) -> Result<impl Fn(&Instant) -> f64 + Sync + use<>, FormulaError> {
    let torque = simulated(text, NO_JOINTS, 0)?;
    Ok(move |instant: &Instant| {
        let state = JointState {
            speed_noise: SLOW,
            load: instant.transmitted,
            temperature: instant.temperature,
            time: instant.t,
            ..JointState::reported(instant.q, instant.dq, 0.0)
        };
        columns::value(&torque, &[state], 0, &[])
    })
}

/// Torques of a joint and of the one that carries it, N m, by each one's position (rad) and velocity (rad/s).
pub type TwoTorques = Box<dyn Fn([f64; 2], [f64; 2]) -> [f64; 2] + Sync>;

/// The torques, N m, of a joint and of the one that carries it by one function of both, all of whose numbers are in the text: by each one's position,
/// rad, and velocity, rad/s. `None` of a text that is the torque of its own joint alone.
///
/// # Errors
/// As [`torque`]; other joints than these two are refused.
pub fn coupled_torque(text: &str, names: Names) -> Result<Option<TwoTorques>, FormulaError> {
    let parsed = parse(text, names)?;
    let (law, of) = Law::of(&parsed.expression);
    let others = law.others(of);
    if others.is_empty() {
        return Ok(None);
    }
    let other = |v: &expression::Variable| !matches!(v.joint, 0 | -1);
    if of.variables().iter().any(other) {
        let problem =
            FormulaProblem::Law("a simulated coupling is of a joint and the one before it");
        return Err(FormulaError::new(text, &(0..text.len()), problem));
    }
    let own = simulated(text, names, 0)?;
    let before = simulated(text, names, -1)?;
    Ok(Some(Box::new(move |joint: [f64; 2], carrier: [f64; 2]| {
        let states = [carrier, joint].map(|[q, dq]| JointState {
            speed_noise: SLOW,
            ..JointState::reported(q, dq, 0.0)
        });
        [&own, &before].map(|torque| columns::value(torque, &states, 1, &[]))
    })))
}

/// The torque of a joint so many places after the text's own, without parameters or accelerations.
fn simulated(text: &str, names: Names, joint: isize) -> Result<Expression, FormulaError> {
    let parsed = parse(text, names)?;
    let whole = 0..text.len();
    let fault = |problem| Err(FormulaError::new(text, &whole, problem));
    if !parsed.parameters.is_empty() {
        return fault(FormulaProblem::NoNumber(parsed.parameters.join(", ")));
    }
    let (law, of) = Law::of(&parsed.expression);
    if let Err(problem) = law.check(of) {
        return fault(problem);
    }
    let mut variables = of.variables().into_iter();
    if variables.any(|v| v.signal == Signal::Acceleration) {
        return fault(FormulaProblem::Acceleration);
    }
    match law.torque(of, joint) {
        Some(torque) => Ok(torque),
        None => fault(FormulaProblem::Law(NOTHING_HERE)),
    }
}

/// Why a function of several joints is none of this one.
const NOTHING_HERE: &str = "each term has to depend on the joint that the formula is at";

/// Most names of parameters in a formula, those that are held among them.
const MOST_NAMES: usize = 8;

fn leaked(text: &str) -> &'static str {
    String::from(text).leak()
}

/// The parameters that are held.
fn held_values(names: &[String], held: &[Option<f64>]) -> Vec<(String, f64)> {
    let held = names.iter().zip(held);
    held.filter_map(|(name, held)| Some((name.clone(), (*held)?)))
        .collect()
}

/// What is stated of a parameter has to be possible.
fn checked(name: &str, stated: &Stated) -> Result<(), FormulaProblem> {
    let wrong = |what| {
        Err(FormulaProblem::Parameter {
            name: name.to_owned(),
            what,
        })
    };
    let numbers = [stated.min, stated.max, stated.held];
    if numbers.into_iter().flatten().any(|x| !x.is_finite()) {
        return wrong("a bound or a value is no finite number");
    }
    let (lower, upper) = (
        stated.min.unwrap_or(f64::NEG_INFINITY),
        stated.max.unwrap_or(f64::INFINITY),
    );
    if lower >= upper {
        return wrong("`min` is not below `max`");
    }
    match stated.prior {
        Some([_, std]) if !(std.is_finite() && std > 0.0) => {
            wrong("the prior's standard deviation is not positive")
        }
        Some([mean, _]) if !(lower..=upper).contains(&mean) => {
            wrong("the prior's mean is not between its bounds")
        }
        _ => Ok(()),
    }
}

/// The expression with its held parameters as numbers.
fn with_held(e: &Expression, held: &[Option<f64>]) -> Expression {
    let of = |e: &Expression| Box::new(with_held(e, held));
    let node = match &e.node {
        Node::Parameter(n) => match held.get(*n).copied().flatten() {
            Some(value) => Node::Number(value),
            None => Node::Parameter(*n),
        },
        Node::Number(_) | Node::Variable(_) => e.node.clone(),
        Node::Negative(inner) => Node::Negative(of(inner)),
        Node::Binary(operator, left, right) => Node::Binary(*operator, of(left), of(right)),
        Node::Call(function, arguments) => Node::Call(
            *function,
            arguments.iter().map(|a| with_held(a, held)).collect(),
        ),
    };
    Expression::new(e.at.clone(), node)
}

/// The parameters' units.
fn units(
    text: &str,
    expression: &Expression,
    names: &[String],
    (of, linear): (&dyn Fn(usize) -> Stated, &[usize]),
    slides: bool,
) -> Result<Vec<Unit>, FormulaError> {
    let mut stated = Vec::new();
    for n in 0..names.len() {
        stated.push(match of(n).unit {
            None => None,
            Some(unit) => Some(Unit::parse(&unit).ok_or_else(|| {
                let problem = FormulaProblem::Unit(unit.clone());
                FormulaError::new(text, &(0..text.len()), problem)
            })?),
        });
    }
    let units = Units {
        slides,
        stated: &stated,
    };
    let found = units.of(expression, linear);
    found.map_err(|(at, problem)| FormulaError::new(text, &at, problem))
}

/// What of a joint's state it is a function of.
fn input(expression: &Expression) -> Result<Input, FormulaProblem> {
    let variables = expression.variables();
    let has = |signal| variables.iter().any(|v| v.signal == signal);
    let sees_others = variables.iter().any(|v| v.joint != 0);
    match (has(Signal::TransmittedTorque), has(Signal::Temperature)) {
        (true, true) => Err(FormulaProblem::Inputs),
        (true, false) => Ok(Input::TransmittedTorque),
        (false, true) => Ok(Input::Temperature),
        (false, false) if sees_others => Ok(Input::Limb),
        (false, false) => Ok(Input::Motion),
    }
}

/// Values that are tried of a parameter whose bounds are stated, or whose range its unit alone tells.
const TRIED: usize = 24;
/// Bounds further apart than this factor are of an unknown size, not of an unknown place.
const OF_SIZE: f64 = 8.0;
/// What a width, a time or a number is looked for in, where nothing else is stated: from what a robot's samples resolve to more than its
/// range; rad (or m), s, 1.
const WIDTHS: [f64; 2] = [0.01, 3.0];
const TIMES: [f64; 2] = [0.3, 300.0];
const NUMBERS: [f64; 2] = [0.1, 10.0];
/// Where a time constant is sought.
pub(crate) const NUMBERED_TIMES: Grid = Grid::Values {
    least: TIMES[0],
    most: TIMES[1],
    count: TRIED,
};
/// A motor's temperature, °C.
const TEMPERATURES: [f64; 2] = [0.0, 100.0];

/// Where the parameter is searched in which a formula is not linear.
fn grid(stated: &Stated, expression: &Expression, (n, unit): (usize, &Unit), site: &Site) -> Grid {
    let geometric = |[least, most]: [f64; 2]| Grid::Values {
        least,
        most,
        count: TRIED,
    };
    if let (Some(least), Some(most)) = (stated.min, stated.max) {
        return match least > 0.0 && most / least >= OF_SIZE {
            true => geometric([least, most]),
            false => Grid::Evenly {
                least,
                most,
                count: TRIED,
            },
        };
    }
    let second = Unit::parse("s").unwrap_or_default();
    let angle = Unit::parse("rad").unwrap_or_default();
    let way = match site.slides {
        true => Unit::parse("m").unwrap_or_default(),
        false => angle,
    };
    let torque = match site.slides {
        true => Unit::FORCE,
        false => Unit::TORQUE,
    };
    match place_among(expression, n) {
        Some(Signal::Position) => Grid::Positions,
        Some(Signal::Time) => Grid::Times,
        Some(Signal::Temperature) => Grid::Evenly {
            least: TEMPERATURES[0],
            most: TEMPERATURES[1],
            count: TRIED,
        },
        _ if *unit == way.over(second) => Grid::SpeedsOfMotion,
        _ if *unit == way => geometric(WIDTHS),
        _ if *unit == way.power(-1.0) => Grid::Frequencies,
        _ if unit.is(torque) => geometric([1e-3 * site.torque(), site.torque()]),
        _ if unit.is(second) => geometric(TIMES),
        // As `sin(k*q)` has it, whose k has no unit once angles are numbers.
        _ if unit.is(Unit::PLAIN) && multiplies_position(expression, n) => Grid::Frequencies,
        _ => geometric(NUMBERS),
    }
}

/// The signal that a parameter is added to or taken from.
fn place_among(expression: &Expression, n: usize) -> Option<Signal> {
    let mut found = None;
    expression.each(&mut |e| {
        if let Node::Binary(Operator::Plus | Operator::Minus, left, right) = &e.node {
            for (own, other) in [(left, right), (right, left)] {
                if let (Node::Parameter(m), Node::Variable(v)) = (&own.node, &other.node)
                    && *m == n
                {
                    found = Some(v.signal);
                }
            }
        }
    });
    found
}

/// Whether a parameter is a factor of a position of which a function is taken; one of a sum of positions is a ratio.
fn multiplies_position(expression: &Expression, n: usize) -> bool {
    let mut found = false;
    let mut look = |e: &Expression| {
        if let Node::Binary(Operator::Times, left, right) = &e.node {
            let has = |e: &Expression| e.has(&|node| *node == Node::Parameter(n));
            let moves =
                |e: &Expression| (e.variables().iter()).any(|v| v.signal == Signal::Position);
            found |= has(left) && moves(right) || has(right) && moves(left);
        }
    };
    expression.each(&mut |e| {
        if let Node::Call(_, arguments) = &e.node {
            arguments
                .iter()
                .for_each(|argument| argument.each(&mut look));
        }
    });
    found
}

/// How far its neighbours tell of a value of a grid: a frequency stands alone, a place looks like the next, a size like those of half and twice it.
fn width_of(grid: Grid) -> u8 {
    match grid {
        Grid::Harmonics | Grid::Frequencies => 0,
        Grid::Positions | Grid::Times | Grid::Evenly { .. } => 1,
        _ => 2,
    }
}

/// Whether what a grid looks for is a size.
fn grid_is_positive(grid: Grid) -> bool {
    !matches!(grid, Grid::Positions | Grid::Times | Grid::Evenly { .. })
}

#[cfg(test)]
mod tests;
