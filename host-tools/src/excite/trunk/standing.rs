//! The design over planted feet: what is searched, its limits, and the motion found.

use proprio_core::go2::{JOINTS, LEGS, Leg};

use super::super::clearance::Clearance;
use super::super::fourier::{Basis, Ends, Motion};
use super::super::limb::{self, Limb};
use super::super::problem::JointLimits;
use super::super::{ExciteError, Settings};
use super::evolve::{Course, Effort, search};
use super::knowledge::{Gathered, Prior};
use super::stance_constraints::{Coordinate, StanceConstraints};
use super::state::{Drive, Needed, Robot, SCALE, State, beside_feet, needed, whole_rows};
use super::{Ground, Supervisor, TrunkCommand};
use crate::model::Model;

/// Instants of a period at which a search looks at limits and at what is told.
const INSTANTS: usize = 32;
/// What a mode of a sway moves by while one of a turn moves by a radian, m.
const REACH: f64 = 0.15;
/// What is kept back from limits in the search: the rest is for what lies between its instants.
const DRAWN_IN: f64 = 0.02;
/// Steps by which a motion is made smaller that is not within the limits at every sample, and how often at most.
const SMALLER: f64 = 0.99;
const SHRUNK: usize = 100;
/// Instants a second at which a motion is checked: those of the file.
const CHECKED: f64 = super::super::output::RATE;
/// A length in which distances from shapes are told, m, and a force in which those of cones are, N: a quarter of a Go2's weight.
const LENGTH: f64 = 0.1;
const FORCE: f64 = 40.0;

/// A limit and by how much it is exceeded, as a share of it; kept where that is not positive.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Excess {
    /// What is limited, in words.
    pub(super) what: String,
    /// By how much.
    pub(super) beyond: f64,
}

/// The robot, its limits and the space of its motions.
pub(super) struct Standing {
    pub(super) robot: Robot,
    pub(super) drives: [Drive; JOINTS],
    pub(super) footing: StanceConstraints,
    pub(super) prior: Prior,
    limits: Vec<JointLimits>,
    legs: Vec<(Box<dyn Limb>, Clearance)>,
    distance: f64,
    uncertainty: f64,
    ground: Ground,
    basis: Basis,
    repeats: u32,
}

impl Standing {
    pub(super) fn new(
        model: &Model,
        settings: &Settings,
        ground: Ground,
    ) -> Result<Self, ExciteError> {
        settings.check()?;
        ground.check()?;
        let m = &settings.margins;
        let mut legs = Vec::new();
        for (n, own) in model.robot().limbs().iter().enumerate() {
            let limb = limb::of(model, own)
                .ok_or_else(|| ExciteError::TooLarge(own.name.clone(), own.bodies.len()))?;
            let mut clearance = super::super::go2::clearance(Leg::ALL[n % LEGS], false, None);
            // Knees bend backwards at all four legs: they stay apart though front ones pass the middle.
            clearance.planes.retain(|(plane, _)| plane.normal.x == 0.0);
            legs.push((limb, clearance));
        }
        let repeats = settings.repeats();
        let period = settings.duration / f64::from(repeats);
        let standing = Self {
            robot: super::robot(model),
            drives: super::drives(model),
            footing: StanceConstraints::new(ground.height),
            prior: Prior::of(model)?,
            limits: super::joint_limits(model, m),
            legs,
            distance: m.distance,
            uncertainty: m.uncertainty,
            ground,
            basis: Basis::new(period, settings.harmonics, Ends::Rest, INSTANTS),
            repeats,
        };
        standing.feasible()?;
        Ok(standing)
    }

    /// The stance itself must be within the limits.
    fn feasible(&self) -> Result<(), ExciteError> {
        let height = self.ground.height;
        let pose = |percent: f64, what: String| ExciteError::Pose {
            pose: format!("of standing {height} m high"),
            what,
            percent,
        };
        let rest = [[0.0; 3]; 6];
        let Some((state, needed)) = self.at(&rest) else {
            return Err(pose(100.0, "a leg's reach".to_owned()));
        };
        match self.worst(&rest, &state, &needed) {
            Excess { what, beyond } if beyond > 0.0 => Err(pose(100.0 * beyond, what)),
            _ => Ok(()),
        }
    }

    /// The robot with its trunk there and what that takes; none where a leg does not reach.
    fn at(&self, trunk: &[Coordinate; 6]) -> Option<(State, Needed)> {
        let state = self.footing.state(trunk)?;
        let needed = needed(&self.robot, &self.drives, &state, self.ground.friction)?;
        Some((state, needed))
    }

    /// The limit that is exceeded the most, or that is nearest.
    fn worst(&self, trunk: &[Coordinate; 6], state: &State, needed: &Needed) -> Excess {
        let mut worst = (f64::NEG_INFINITY, Limit::None);
        let mut meet = |beyond: f64, limit: Limit| {
            if beyond > worst.0 || beyond.is_nan() {
                worst = (beyond, limit);
            }
        };
        for (j, limit) in self.limits.iter().enumerate() {
            let (q, dq) = (state.q[j], state.dq[j]);
            let torque = needed.torque[j].abs() * (1.0 + self.uncertainty);
            let [lower, upper] = limit.position;
            meet(
                (lower - q).max(q - upper) / (upper - lower),
                Limit::Joint("position", j),
            );
            meet(dq.abs() / limit.velocity - 1.0, Limit::Joint("velocity", j));
            meet(
                state.ddq[j].abs() / limit.acceleration - 1.0,
                Limit::Joint("acceleration", j),
            );
            meet(torque / limit.torque - 1.0, Limit::Joint("torque", j));
            meet(
                (torque * dq.abs()) / limit.power - 1.0,
                Limit::Joint("power", j),
            );
        }
        for (leg, force) in needed.feet.iter().enumerate() {
            let aside = force.x.hypot(force.y);
            meet(
                (self.ground.least_load - force.z) / FORCE,
                Limit::Foot("normal force", leg),
            );
            let beyond = (aside - self.ground.friction * force.z) / FORCE;
            meet(beyond, Limit::Foot("friction cone", leg));
        }
        for (what, height) in self.footing.heights(trunk, state) {
            meet((self.distance - height) / LENGTH, Limit::Floor(what));
        }
        for (leg, (limb, clearance)) in self.legs.iter().enumerate() {
            let distances = clearance
                .distances(limb.as_ref(), &State::leg(&state.q, leg))
                .all;
            for (n, distance) in distances.iter().enumerate() {
                meet(
                    (self.distance - distance.value) / LENGTH,
                    Limit::Shape(leg, n),
                );
            }
        }
        Excess {
            beyond: worst.0,
            what: self.told(worst.1),
        }
    }

    fn told(&self, limit: Limit) -> String {
        let leg = |leg: usize| Leg::ALL[leg].name();
        match limit {
            Limit::None => String::new(),
            Limit::Joint(what, j) => {
                format!("{what} of {}", proprio_core::go2::JOINT_NAMES[j])
            }
            Limit::Foot(what, n) => format!("{what} of {}", leg(n)),
            Limit::Floor(what) => format!("the distance of {what} to the floor"),
            Limit::Shape(n, k) => {
                format!("the distance of {}'s {}", leg(n), self.legs[n].1.name(k))
            }
        }
    }

    /// Coordinates at instant s of a search.
    fn sampled(&self, x: &[f64], s: usize) -> [Coordinate; 6] {
        let modes = self.basis.modes();
        std::array::from_fn(|c| {
            let own = self.basis.at(&x[modes * c..modes * (c + 1)], 0.0, s);
            own.map(|value| value * reach(c))
        })
    }

    /// The motion of these unknowns: series of [`super::TRUNK_COORDINATES`].
    fn motion(&self, x: &[f64]) -> Motion {
        let modes = self.basis.modes();
        let series = (0..6).map(|c| {
            let own: Vec<f64> = x[modes * c..modes * (c + 1)]
                .iter()
                .map(|x| x * reach(c))
                .collect();
            self.basis.series(&own, 0.0)
        });
        Motion {
            period: self.basis.period,
            repeats: self.repeats,
            joints: series.collect(),
        }
    }

    /// Limits that the motion exceeds at the samples of a period, each with when.
    pub(super) fn violations(&self, motion: &Motion) -> Vec<(f64, Excess)> {
        let count = (motion.period * CHECKED).ceil() as usize;
        let excess = |n: usize| {
            let t = (n as f64 / CHECKED).min(motion.period);
            let trunk = coordinates(motion, t);
            let excess = match self.at(&trunk) {
                Some((state, needed)) => self.worst(&trunk, &state, &needed),
                None => Excess {
                    what: "a leg's reach".to_owned(),
                    beyond: 1.0,
                },
            };
            (excess.beyond > 0.0 || excess.beyond.is_nan()).then_some((t, excess))
        };
        (0..=count).filter_map(excess).collect()
    }

    /// The robot and what it takes at `t` seconds of a motion that is within the limits.
    pub(super) fn moment(&self, motion: &Motion, t: f64) -> Option<(State, Needed)> {
        self.at(&coordinates(motion, t))
    }

    /// Joints and feet at `t`, for the file.
    pub(super) fn command(&self, motion: &Motion, t: f64) -> Option<TrunkCommand> {
        let (state, needed) = self.moment(motion, t)?;
        Some(TrunkCommand {
            q: state.q,
            dq: state.dq,
            ddq: state.ddq,
            tau: needed.torque,
        })
    }

    /// Rows of a whole motion, from `instants` of its period.
    pub(super) fn rows(&self, states: &[State]) -> Option<nalgebra::DMatrix<f64>> {
        let seconds = self.basis.period * f64::from(self.repeats) / states.len() as f64;
        let mut rows = Gathered::new(seconds);
        for state in states {
            rows.add(
                &beside_feet(&self.robot, state, &SCALE)?,
                &whole_rows(&self.robot, state),
            );
        }
        Some(rows.rows())
    }

    /// The best motion that a search finds, made smaller until every sample is within the limits.
    pub(super) fn design(
        &self,
        settings: &Settings,
        supervisor: &dyn Supervisor,
    ) -> Result<Motion, ExciteError> {
        let effort = Effort {
            starts: EACH * settings.starts,
            generations: GENERATIONS,
        };
        let none = || ExciteError::NoMotion {
            limb: "the trunk".to_owned(),
            what: self.nearest_limit(),
            joint: None,
        };
        let found = search(self, settings.seed, effort, supervisor).ok_or_else(none)?;
        let mut x = found.x;
        for _ in 0..SHRUNK {
            let motion = self.motion(&x);
            if self.violations(&motion).is_empty() {
                return Ok(motion);
            }
            x.iter_mut().for_each(|x| *x *= SMALLER);
        }
        Err(none())
    }

    /// What is nearest to its limit at rest.
    fn nearest_limit(&self) -> String {
        let rest = [[0.0; 3]; 6];
        let at = self.at(&rest);
        at.map_or_else(String::new, |(state, needed)| {
            self.worst(&rest, &state, &needed).what
        })
    }
}

/// Random motions for each start that is asked for, and generations after them.
const EACH: usize = 8;
const GENERATIONS: usize = 120;

/// A limit before it is put into words.
#[derive(Debug, Clone, Copy)]
enum Limit {
    None,
    Joint(&'static str, usize),
    Foot(&'static str, usize),
    Floor(&'static str),
    Shape(usize, usize),
}

/// What one unknown of a coordinate stands for.
fn reach(coordinate: usize) -> f64 {
    if coordinate < 3 { REACH } else { 1.0 }
}

/// The trunk's coordinates at `t` seconds.
pub(super) fn coordinates(motion: &Motion, t: f64) -> [Coordinate; 6] {
    std::array::from_fn(|c| {
        let [place, rate, second, _] = motion.at(c, t);
        [place, rate, second]
    })
}

impl Course for Standing {
    fn unknowns(&self) -> usize {
        6 * self.basis.modes()
    }

    fn is_within(&self, x: &[f64]) -> bool {
        (0..INSTANTS).all(|s| {
            let trunk = self.sampled(x, s);
            let at = self.at(&trunk);
            at.is_some_and(|(state, needed)| {
                self.worst(&trunk, &state, &needed).beyond <= -DRAWN_IN
            })
        })
    }

    fn cost(&self, x: &[f64]) -> Option<f64> {
        let states: Option<Vec<State>> = (0..INSTANTS)
            .map(|s| self.footing.state(&self.sampled(x, s)))
            .collect();
        let seen = self.prior.seen(&self.rows(&states?)?)?;
        Some(-seen.log_det)
    }
}
