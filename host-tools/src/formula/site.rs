//! The joint at which a formula acts, as far as it decides whether the formula can be: the range of its motion.

use std::ops::Range;

use proprio_core::effect::{Grid, JointState};

use super::columns::value;
use super::error::FormulaProblem;
use super::expression::{Expression, Function, Node, Operator, Scope, Signal, Variable};
use super::law::{AtJoint, Law};
use super::{Kind, Names};

/// Points of the range at which a formula is tried; a fifth of them at rest or at the range's middle.
const POINTS: usize = 400;
/// Where a robot states no limits: a turn to each side (rad), a metre, a speed (rad/s) and a torque (N m) that few joints exceed. They are
/// the range of a check and the width of a prior, nothing more.
const TURN: f64 = std::f64::consts::PI;
const METRE: f64 = 1.0;
const SPEED: f64 = 20.0;
const TORQUE: f64 = 1000.0;
/// The longest log that a formula over time is tried on, s, and the temperatures of motors, °C.
const LONGEST: f64 = 3600.0;
const WARMEST: f64 = 120.0;
/// A share of two numbers to which their sum is rounding: of some tens of operations, each to 1.1e-16.
const CANCELLED: f64 = 1e-14;
/// Far beyond what rounding leaves of numbers of a robot's size.
const ACTS: f64 = 1e-6;
/// A share of the greatest power that is rounding.
const ROUNDING: f64 = 1e-9;

/// A joint, as a formula needs to know it.
#[derive(Debug, Clone, Copy)]
pub struct Site<'a> {
    /// The limb's joints and the formula's own.
    pub names: Names<'a>,
    /// Whether it slides.
    pub slides: bool,
    /// Its stops, rad or m; infinite where it has none.
    pub limits: [f64; 2],
    /// Its greatest torque, N m (or N), and speed, rad/s (or m/s); infinite where they are not stated.
    pub effort: f64,
    /// See `effort`.
    pub velocity: f64,
}

/// What is asked of a point: the states of the limb's joints, and a set of parameters.
type At<'a> = dyn Fn(&[JointState<f64>], &[f64]) -> bool + 'a;

/// A number of a sequence that fills the unit interval evenly (van der Corput's, in this base).
fn corput(mut n: usize, base: usize) -> f64 {
    let (mut x, mut scale) = (0.0, 1.0);
    while n > 0 {
        scale /= base as f64;
        x += scale * (n % base) as f64;
        n /= base;
    }
    x
}

impl Site<'_> {
    /// The greatest torque, or what stands for it.
    pub(super) fn torque(&self) -> f64 {
        Some(self.effort)
            .filter(|x| x.is_finite() && *x > 0.0)
            .unwrap_or(TORQUE)
    }

    fn speed(&self) -> f64 {
        Some(self.velocity)
            .filter(|x| x.is_finite() && *x > 0.0)
            .unwrap_or(SPEED)
    }

    fn positions(&self) -> [f64; 2] {
        let far = if self.slides { METRE } else { TURN };
        match self.limits {
            [lower, upper] if lower.is_finite() && upper.is_finite() && lower < upper => {
                [lower, upper]
            }
            _ => [-far, far],
        }
    }

    /// The range of a grid's values here.
    pub(super) fn range(&self, grid: Grid) -> [f64; 2] {
        let [from, to] = self.positions();
        match grid {
            Grid::Positions => [from, to],
            Grid::Times => [0.0, LONGEST],
            Grid::Frequencies => [0.5 * TURN / (to - from), 32.0 * TURN / (to - from)],
            Grid::SpeedsOfMotion | Grid::SpeedsAboveNoise => [0.01 * self.speed(), self.speed()],
            Grid::Values { least, most, .. } | Grid::Evenly { least, most, .. } => [least, most],
            _ => [1e-3 * (to - from), to - from],
        }
    }

    /// Three values of a grid.
    pub(super) fn examples(&self, grid: Grid) -> [f64; 3] {
        let [least, most] = self.range(grid);
        [0.2, 0.5, 0.8].map(|share| least + share * (most - least))
    }

    /// The states of the limb's joints at one of the points.
    fn point(&self, n: usize) -> Vec<JointState<f64>> {
        let [from, to] = self.positions();
        let joint = |j: usize| {
            let base = |of: usize| [2, 3, 5, 7, 11, 13, 17, 19][(of + 3 * j) % 8];
            let share = |of: usize| corput(n + 1, base(of));
            // Standstill and zero are where formulas break.
            let at_rest = n.is_multiple_of(5);
            let q = match n.is_multiple_of(10) && from <= 0.0 && to >= 0.0 {
                true => 0.0,
                false => from + share(0) * (to - from),
            };
            let dq = if at_rest {
                0.0
            } else {
                self.speed() * (2.0 * share(1) - 1.0)
            };
            JointState {
                temperature: WARMEST * share(4),
                time: LONGEST * corput(n, 23),
                load: self.torque() * (2.0 * share(2) - 1.0),
                speed_noise: 1e-3 * self.speed(),
                ..JointState::reported(q, dq, 0.0)
            }
        };
        (0..self.names.joints.len().max(1)).map(joint).collect()
    }

    /// Whether the formula is finite at every point, with each of these sets of parameters.
    pub(super) fn check_finite(
        &self,
        expression: &Expression,
        factors: &[Expression],
        sets: &[Vec<f64>],
    ) -> Result<(), (Range<usize>, FormulaProblem)> {
        let mut denominators = Vec::new();
        expression.each(&mut |e| match &e.node {
            Node::Binary(Operator::Over, _, by) => denominators.push((**by).clone()),
            Node::Call(Function::Log, arguments) => denominators.extend(arguments.first().cloned()),
            _ => {}
        });
        let own = self.names.own;
        for parameters in sets {
            let mut signs = vec![[false; 2]; denominators.len()];
            for n in 0..POINTS {
                let joints = self.point(n);
                let at = |e: &Expression| self.value(e, &joints, parameters);
                for (e, signs) in denominators.iter().zip(&mut signs) {
                    let x = at(e);
                    signs[0] |= x <= 0.0;
                    signs[1] |= x >= 0.0;
                    if *signs == [true; 2] || !x.is_finite() {
                        let problem = FormulaProblem::NotFinite(self.words(e, &joints[own]));
                        return Err((e.at.clone(), problem));
                    }
                }
                if let Some(e) = factors.iter().find(|e| !at(e).is_finite()) {
                    let problem = FormulaProblem::NotFinite(self.words(e, &joints[own]));
                    return Err((e.at.clone(), problem));
                }
            }
        }
        Ok(())
    }

    /// Where the text of one of these is zero, if all of them are at every point, with each of these sets of parameters. Of temperature and time the
    /// range is this program's own guess, and a torque may act on a small part of any range: beside the points of the range those count at which a
    /// signal is a number of the text, a parameter, or between two of them.
    pub(super) fn zero(&self, all: &[&Expression], sets: &[Vec<f64>]) -> Option<Range<usize>> {
        // Nearly every formula is seen to act at the first points.
        let acts = |e: &&Expression| {
            let first = (1..5).map(|n| self.point(n));
            let mut values = first.flat_map(|joints| {
                let of = |set: &Vec<f64>| self.value(e, &joints, set);
                sets.iter().map(of).collect::<Vec<f64>>()
            });
            values.any(|value| value.abs() > ACTS)
        };
        if all.iter().any(acts) {
            return None;
        }
        let mut points: Vec<Vec<JointState<f64>>> = (0..POINTS).map(|n| self.point(n)).collect();
        points.extend(self.marked(all, sets));
        let found = all.iter().map(|e| self.zero_part(e, &points, sets));
        let found: Option<Vec<Range<usize>>> = found.collect();
        found?.into_iter().next()
    }

    /// The part of an expression that makes it zero at these points: of a sum that cancels what rounding leaves is zero too.
    fn zero_part(
        &self,
        e: &Expression,
        points: &[Vec<JointState<f64>>],
        sets: &[Vec<f64>],
    ) -> Option<Range<usize>> {
        let everywhere = |is_zero: &At| {
            let mut tried = points
                .iter()
                .flat_map(|joints| sets.iter().map(move |set| (joints, set)));
            tried
                .all(|(joints, set)| is_zero(joints, set))
                .then(|| e.at.clone())
        };
        match &e.node {
            Node::Negative(of) => self.zero_part(of, points, sets),
            Node::Binary(Operator::Times, left, right) => {
                let part = [left, right]
                    .into_iter()
                    .find_map(|part| self.zero_part(part, points, sets));
                // Of two that are never both at work.
                part.or_else(|| everywhere(&|joints, set| self.value(e, joints, set) == 0.0))
            }
            Node::Binary(Operator::Over, of, _) => self.zero_part(of, points, sets),
            Node::Binary(Operator::Plus | Operator::Minus, left, right) => {
                everywhere(&|joints, set| {
                    let [sum, a, b] = [e, &**left, &**right].map(|e| self.value(e, joints, set));
                    sum.abs() <= CANCELLED * (a.abs() + b.abs())
                })
            }
            _ => everywhere(&|joints, set| self.value(e, joints, set) == 0.0),
        }
    }

    /// Points of the range at which one signal of all joints is a number that these expressions name, or that lies between two of them, or beyond.
    fn marked(&self, all: &[&Expression], sets: &[Vec<f64>]) -> Vec<Vec<JointState<f64>>> {
        let mut named = vec![0.0];
        named.extend(sets.iter().flatten());
        for e in all {
            e.each(&mut |e| {
                if let Node::Number(x) = e.node {
                    named.extend([x, -x]);
                }
            });
        }
        named.sort_by(f64::total_cmp);
        named.dedup();
        let between = named.windows(2).map(|two| 0.5 * (two[0] + two[1]));
        let between: Vec<f64> = between.collect();
        let beyond = named.iter().map(|x| x + x.abs().max(1.0));
        let beyond: Vec<f64> = beyond.collect();
        let marks = named.into_iter().chain(between).chain(beyond);
        let points = marks.enumerate().flat_map(|(n, mark)| {
            let with = move |change: fn(&mut JointState<f64>, f64)| {
                // None of these is at rest.
                let mut joints = self.point(5 * n + 1);
                joints.iter_mut().for_each(|joint| change(joint, mark));
                joints
            };
            // Stops give way: a torque may act beyond the limits alone.
            let signals: [fn(&mut JointState<f64>, f64); 5] = [
                |joint, x| joint.q = x,
                |joint, x| (joint.dq, joint.speed) = (x, x),
                |joint, x| joint.load = x,
                |joint, x| joint.temperature = x,
                |joint, x| joint.time = x,
            ];
            signals.map(with)
        });
        points.collect()
    }

    /// A value in which accelerations are one.
    fn value(&self, e: &Expression, joints: &[JointState<f64>], parameters: &[f64]) -> f64 {
        let is_accelerated = |node: &Node| {
            matches!(
                node,
                Node::Variable(Variable {
                    signal: Signal::Acceleration,
                    ..
                })
            )
        };
        if !e.has(&is_accelerated) {
            return value(e, joints, self.names.own, parameters);
        }
        let place = |joint: isize| {
            let at = self.names.own.checked_add_signed(joint);
            at.and_then(|n| joints.get(n))
                .map_or(f64::NAN, |state| state.q)
        };
        e.value(&Scope {
            variable: &|v: Variable| match v.signal {
                Signal::Acceleration => self.speed(),
                _ => place(v.joint),
            },
            direction: &|_| 1.0,
            parameters,
        })
    }

    /// A point in words, by the variables that an expression has.
    fn words(&self, e: &Expression, state: &JointState<f64>) -> String {
        let of = |v: Variable| {
            let value = match v.signal {
                Signal::Position => state.q,
                Signal::Velocity => state.dq,
                Signal::Acceleration => return None,
                Signal::TransmittedTorque => state.load,
                Signal::Temperature => state.temperature,
                Signal::Time => state.time,
            };
            let (name, _) = Signal::ALL.iter().find(|(_, own)| *own == v.signal)?;
            Some(format!("{name} = {value:.3}"))
        };
        let own = e.variables().into_iter().filter(|v| v.joint == 0);
        let all: Vec<String> = own.filter_map(of).collect();
        match all.is_empty() {
            true => "a point of the joint's range".to_owned(),
            false => format!("{}, or between there and its opposite", all.join(", ")),
        }
    }

    /// The bounds of each linear parameter that its kind allows.
    pub(super) fn bounds_of(
        &self,
        kind: Kind,
        factors: &[Expression],
        sets: &[Vec<f64>],
    ) -> Result<Vec<[f64; 2]>, FormulaProblem> {
        let free = [f64::NEG_INFINITY, f64::INFINITY];
        let wrong = |why: String| FormulaProblem::Kind {
            kind: kind.name(),
            why,
        };
        match kind {
            Kind::Free | Kind::Motor => Ok(vec![free; factors.len()]),
            Kind::Conservative => {
                let is_own = |v: &Variable| v.signal == Signal::Position && v.joint == 0;
                match factors
                    .iter()
                    .flat_map(Expression::variables)
                    .find(|v| !is_own(v))
                {
                    None => Ok(vec![free; factors.len()]),
                    Some(_) => Err(wrong(
                        "it depends on more than the position of its own joint".to_owned(),
                    )),
                }
            }
            Kind::Dissipative => (factors.iter())
                .map(|factor| self.one_sign(kind, &[(0, factor)], sets))
                .collect(),
        }
    }

    /// The same of torques of several joints by one function: of the own one what each parameter multiplies, and of the others.
    pub(super) fn bounds_of_law(
        &self,
        (law, kind): (Law, Kind),
        (own, others): (&[Expression], &[AtJoint]),
        sets: &[Vec<f64>],
    ) -> Result<Vec<[f64; 2]>, FormulaProblem> {
        let wrong = |why: &str| {
            Err(FormulaProblem::Kind {
                kind: kind.name(),
                why: why.to_owned(),
            })
        };
        match (law, kind) {
            (Law::Dissipation, Kind::Free | Kind::Dissipative) => {}
            (Law::Dissipation, _) => return wrong("it is a dissipation function"),
            (_, Kind::Free | Kind::Conservative) => {
                return Ok(vec![[f64::NEG_INFINITY, f64::INFINITY]; own.len()]);
            }
            _ => return wrong("it is a potential"),
        }
        let of = |n: usize| {
            let others = others.iter();
            let others = others.filter_map(|(joint, all)| Some((*joint, all.get(n)?.as_ref()?)));
            let all: Vec<(isize, &Expression)> =
                std::iter::once((0, &own[n])).chain(others).collect();
            self.one_sign(Kind::Dissipative, &all, sets)
        };
        (0..own.len()).map(of).collect()
    }

    /// The bounds of a parameter that multiplies these torques of joints, so that they take energy and give none.
    fn one_sign(
        &self,
        kind: Kind,
        torques: &[(isize, &Expression)],
        sets: &[Vec<f64>],
    ) -> Result<[f64; 2], FormulaProblem> {
        let [gained, lost] = self.power(torques, sets);
        let most = gained.1.max(lost.1);
        match (gained.1 <= ROUNDING * most, lost.1 <= ROUNDING * most) {
            (true, _) => Ok([0.0, f64::INFINITY]),
            (_, true) => Ok([f64::NEG_INFINITY, 0.0]),
            _ => Err(FormulaProblem::Kind {
                kind: kind.name(),
                why: format!("it gives energy at {} and takes it at {}", gained.0, lost.0),
            }),
        }
    }

    /// The greatest power that torques of joints give to the motion and the greatest that it takes, each with where.
    fn power(&self, torques: &[(isize, &Expression)], sets: &[Vec<f64>]) -> [(String, f64); 2] {
        let mut most = [(String::new(), 0.0), (String::new(), 0.0)];
        let own = self.names.own;
        for parameters in sets {
            for n in 0..POINTS {
                let joints = self.point(n);
                // The torque that the motor has to give beyond the rest: positive power is taken from the motion.
                let power = |(joint, torque): &(isize, &Expression)| {
                    let at = own.checked_add_signed(*joint);
                    let speed = at
                        .and_then(|at| joints.get(at))
                        .map_or(0.0, |state| state.dq);
                    self.value(torque, &joints, parameters) * speed
                };
                let taken: f64 = torques.iter().map(power).sum();
                let of = usize::from(taken > 0.0);
                if taken.abs() > most[of].1 {
                    let [q, dq] = [joints[own].q, joints[own].dq];
                    most[of] = (format!("q = {q:.2}, dq = {dq:.2}"), taken.abs());
                }
            }
        }
        most
    }

    /// What a parameter may be that multiplies this: as much as the drive's whole torque.
    pub(super) fn room(&self, factor: &Expression, sets: &[Vec<f64>]) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for parameters in sets {
            for n in 0..POINTS {
                let x = self.value(factor, &self.point(n), parameters);
                sum += x * x;
                count += 1.0;
            }
        }
        let size = f64::sqrt(sum / count);
        self.torque() / size.max(f64::MIN_POSITIVE)
    }
}
