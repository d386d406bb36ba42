//! A robot that hangs by a rope: its legs move, and its trunk answers.
//!
//! The rope is tied to the trunk straight above the centre of mass of the robot in its pose. Its force is unknown and goes through the knot,
//! which takes three equations of eighteen: the moments about the knot and the joints' torques are free of it. By the same three moments
//! the trunk swings as a pendulum about the knot, which the motion of the legs drives; a rope without friction, and long enough not to
//! twist.
//!
//! There is no search but the best of some random motions of the legs, as large as the limits allow.

use nalgebra::{DMatrix, Matrix3, Rotation3, SVector, Vector3};
use proprio_core::go2::{JOINT_NAMES, JOINTS, JOINTS_PER_LEG, LEGS, Leg};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

use super::super::clearance::Clearance;
use super::super::fourier::{Basis, Ends, Motion};
use super::super::limb::{self, Limb};
use super::super::output::RATE;
use super::super::problem::JointLimits;
use super::super::{ExciteError, Settings};
use super::evolve::Course;
use super::knowledge::{Gathered, Prior, Seen};
use super::state::{Drive, Robot, State, orthonormal, whole_rows};
use super::{Supervisor, TrunkCommand};
use crate::free_base::rows::{COORDINATES, SCALE};
use crate::model::Model;

/// Random motions for each start that is asked for.
const EACH: usize = 2;
/// Instants of a period at which limits are looked at while a motion grows, and of the whole motion at which what it tells is.
const INSTANTS: usize = 40;
const TOLD: usize = 48;
/// What is kept back from limits for what lies between these instants.
const DRAWN_IN: f64 = 0.02;
/// Steps by which a motion is made smaller that is not within the limits at every sample, and how often at most.
const SMALLER: f64 = 0.97;
const SHRUNK: usize = 60;
/// A length in which distances from shapes are told, m.
const LENGTH: f64 = 0.1;
/// Height of the knot above the centre of mass, m: on a Go2's back.
const KNOT: f64 = 0.1;

/// The robot on its rope.
pub(super) struct Suspended {
    robot: Robot,
    drives: [Drive; JOINTS],
    pub(super) prior: Prior,
    limits: Vec<JointLimits>,
    legs: Vec<(Box<dyn Limb>, Clearance)>,
    distance: f64,
    uncertainty: f64,
    pose: [f64; JOINTS],
    /// Where the rope is tied, in the base's frame, m.
    knot: Vector3<f64>,
    basis: Basis,
    repeats: u32,
}

/// A motion of the legs with the trunk's answer, sample by sample.
pub(super) struct Hanging {
    pub(super) motion: Motion,
    pub(super) samples: Vec<(State, [f64; JOINTS])>,
}

impl Suspended {
    pub(super) fn new(model: &Model, settings: &Settings) -> Result<Self, ExciteError> {
        settings.check()?;
        let mut legs = Vec::new();
        for (n, own) in model.robot().limbs().iter().enumerate() {
            let limb = limb::of(model, own)
                .ok_or_else(|| ExciteError::TooLarge(own.name.clone(), own.bodies.len()))?;
            let clearance = super::super::go2::clearance(Leg::ALL[n % LEGS], false, None);
            legs.push((limb, clearance));
        }
        let robot = super::robot(model);
        // The pose of a design of four legs: each in its own quarter.
        let pose = std::array::from_fn(|j| {
            let outwards = if j / JOINTS_PER_LEG % 2 == 1 {
                0.1
            } else {
                -0.1
            };
            [outwards, 0.6, -1.5][j % JOINTS_PER_LEG]
        });
        let repeats = settings.repeats();
        let period = settings.duration / f64::from(repeats);
        let basis = Basis::new(period, settings.harmonics, Ends::Rest, INSTANTS);
        Ok(Self {
            knot: centre(&robot, &pose) + Vector3::z() * KNOT,
            drives: super::drives(model),
            prior: Prior::of(model)?,
            limits: super::joint_limits(model, &settings.margins),
            legs,
            distance: settings.margins.distance,
            uncertainty: settings.margins.uncertainty,
            robot,
            pose,
            basis,
            repeats,
        })
    }

    /// The greatest excess over limits of where joints are and how they move, with what is exceeded; torque is not asked.
    fn worst(&self, joints: &[[f64; 3]; JOINTS]) -> (f64, String) {
        let mut worst = (f64::NEG_INFINITY, String::new());
        let mut meet = |beyond: f64, what: &dyn Fn() -> String| {
            if beyond > worst.0 || beyond.is_nan() {
                worst = (beyond, what());
            }
        };
        for (j, ([q, dq, ddq], limit)) in joints.iter().zip(&self.limits).enumerate() {
            let [lower, upper] = limit.position;
            let of = |what: &str| format!("{what} of {}", JOINT_NAMES[j]);
            meet((lower - q).max(q - upper) / (upper - lower), &|| {
                of("position")
            });
            meet(dq.abs() / limit.velocity - 1.0, &|| of("velocity"));
            meet(ddq.abs() / limit.acceleration - 1.0, &|| of("acceleration"));
        }
        for (leg, (limb, clearance)) in self.legs.iter().enumerate() {
            let q: Vec<f64> = (0..3).map(|n| joints[3 * leg + n][0]).collect();
            for (n, own) in clearance
                .distances(limb.as_ref(), &q)
                .all
                .iter()
                .enumerate()
            {
                let name = || {
                    format!(
                        "the distance of {}'s {}",
                        Leg::ALL[leg].name(),
                        clearance.name(n)
                    )
                };
                meet((self.distance - own.value) / LENGTH, &name);
            }
        }
        worst
    }

    fn motion(&self, x: &[f64]) -> Motion {
        let modes = self.basis.modes();
        let own = (0..JOINTS).map(|j| {
            self.basis
                .series(&x[modes * j..modes * (j + 1)], self.pose[j])
        });
        Motion {
            period: self.basis.period,
            repeats: self.repeats,
            joints: own.collect(),
        }
    }

    /// The trunk's answer: at rest under its knot in the beginning, then by the moments about it, in steps of a sample.
    fn answered(&self, motion: Motion) -> Option<Hanging> {
        let mut state = State {
            rotation: Matrix3::identity(),
            turning: Vector3::zeros(),
            turning_rate: Vector3::zeros(),
            acceleration: Vector3::zeros(),
            q: self.pose,
            dq: [0.0; JOINTS],
            ddq: [0.0; JOINTS],
        };
        let mut samples = Vec::new();
        for n in 0..=(motion.duration() * RATE).round() as usize {
            for j in 0..JOINTS {
                [state.q[j], state.dq[j], state.ddq[j], _] = motion.at(j, n as f64 / RATE);
            }
            self.swing(&mut state)?;
            let [v, a] = state.rates();
            let needed = self
                .robot
                .inverse_dynamics(&state.kinematics(&self.robot), &v, &a);
            let torque = std::array::from_fn(|j| {
                needed[6 + j] + self.drives[j].torque(state.dq[j], state.ddq[j])
            });
            samples.push((state.clone(), torque));
            // Semi-implicit Euler: a pendulum keeps its energy.
            state.turning += state.turning_rate / RATE;
            state.rotation *= Rotation3::from_scaled_axis(state.turning / RATE).matrix();
        }
        Some(Hanging { motion, samples })
    }

    /// The accelerations of the trunk with which no moment acts about the knot: the moment is linear in them.
    fn swing(&self, state: &mut State) -> Option<()> {
        let k = state.kinematics(&self.robot);
        let w = state.turning;
        let mut moment = |rate: Vector3<f64>| {
            state.turning_rate = rate;
            state.acceleration = -rate.cross(&self.knot) - w.cross(&w.cross(&self.knot));
            let [v, a] = state.rates();
            let all = self.robot.inverse_dynamics(&k, &v, &a);
            all.fixed_rows::<3>(0) - self.knot.cross(&all.fixed_rows::<3>(3).into_owned())
        };
        let still = moment(Vector3::zeros());
        let columns = [0, 1, 2].map(|n| moment(Vector3::ith(n, 1.0)) - still);
        let rate = Matrix3::from_columns(&columns).lu().solve(&-still)?;
        moment(rate);
        Some(())
    }

    /// What the limits say of a motion at its samples.
    pub(super) fn violations(&self, hanging: &Hanging) -> Vec<String> {
        let beyond = |(n, (state, torque)): (usize, &(State, [f64; JOINTS]))| {
            let joints = std::array::from_fn(|j| [state.q[j], state.dq[j], state.ddq[j]]);
            let mut worst = self.worst(&joints);
            for (j, limit) in self.limits.iter().enumerate() {
                let needed = torque[j].abs() * (1.0 + self.uncertainty);
                let over =
                    (needed / limit.torque).max(needed * state.dq[j].abs() / limit.power) - 1.0;
                if over > worst.0 || over.is_nan() {
                    worst = (over, format!("torque or power of {}", JOINT_NAMES[j]));
                }
            }
            let (over, what) = worst;
            let t = n as f64 / RATE;
            (over > 0.0 || over.is_nan())
                .then(|| format!("{what} at {t:.3} s, by {:.2} %", 100.0 * over))
        };
        hanging
            .samples
            .iter()
            .enumerate()
            .filter_map(beyond)
            .collect()
    }

    /// Rows of a motion at instants spread over it.
    pub(super) fn rows(&self, hanging: &Hanging) -> DMatrix<f64> {
        let seconds = hanging.motion.duration() / TOLD as f64;
        let mut rows = Gathered::new(seconds);
        let basis = self.beside_rope();
        for n in 0..TOLD {
            let at = (2 * n + 1) * (hanging.samples.len() - 1) / (2 * TOLD);
            rows.add(&basis, &whole_rows(&self.robot, &hanging.samples[at].0));
        }
        rows.rows()
    }

    /// An orthonormal basis of the scaled equations that no force at the knot reaches.
    fn beside_rope(&self) -> DMatrix<f64> {
        let mut free = DMatrix::zeros(COORDINATES, JOINTS + 3);
        for n in 0..3 {
            let turn = Vector3::ith(n, 1.0);
            let moves = -turn.cross(&self.knot);
            for r in 0..3 {
                (free[(r, n)], free[(3 + r, n)]) = (turn[r], moves[r]);
            }
        }
        (0..JOINTS).for_each(|j| free[(6 + j, 3 + j)] = 1.0);
        orthonormal(free, &SCALE)
    }

    /// The best of random motions, each as large as the limits allow at every sample.
    pub(super) fn design(
        &self,
        settings: &Settings,
        supervisor: &dyn Supervisor,
    ) -> Result<(Hanging, Seen), ExciteError> {
        let mut random = ChaCha8Rng::seed_from_u64(settings.seed);
        let of = EACH * settings.starts;
        let mut best: Option<(Hanging, Seen)> = None;
        for n in 0..of {
            if supervisor.stop() && best.is_some() {
                break;
            }
            let x: Vec<f64> = (0..self.unknowns())
                .map(|_| StandardNormal.sample(&mut random))
                .collect();
            let found = self.largest(&x).and_then(|x| self.within(x));
            let seen = found.and_then(|own| Some((self.prior.seen(&self.rows(&own))?, own)));
            if let Some((seen, own)) = seen
                && best
                    .as_ref()
                    .is_none_or(|(_, known)| seen.log_det > known.log_det)
            {
                best = Some((own, seen));
            }
            let cost = best.as_ref().map(|(_, seen)| -seen.log_det);
            supervisor.progress(n + 1, of, cost);
        }
        best.ok_or_else(|| ExciteError::NoMotion {
            limb: "the legs".to_owned(),
            what: self.worst(&self.pose.map(|q| [q, 0.0, 0.0])).1,
            joint: None,
        })
    }

    /// The motion made smaller until every sample is within the limits.
    fn within(&self, mut x: Vec<f64>) -> Option<Hanging> {
        for _ in 0..SHRUNK {
            let hanging = self.answered(self.motion(&x))?;
            if self.violations(&hanging).is_empty() {
                return Some(hanging);
            }
            x.iter_mut().for_each(|x| *x *= SMALLER);
        }
        None
    }
}

impl Hanging {
    /// The reference at `t` seconds.
    pub(super) fn command(&self, t: f64) -> Option<TrunkCommand> {
        let (state, tau) = self.samples.get((t * RATE).round() as usize)?;
        Some(TrunkCommand {
            q: state.q,
            dq: state.dq,
            ddq: state.ddq,
            tau: *tau,
        })
    }

    /// How far the trunk tilts at most, rad.
    pub(super) fn tilt(&self) -> f64 {
        let tilts = self
            .samples
            .iter()
            .map(|(state, _)| state.rotation[(2, 2)].clamp(-1.0, 1.0).acos());
        tilts.fold(0.0, f64::max)
    }
}

/// The robot's centre of mass in the base's frame, m: by gravity's moment about its origin, level and on either side.
fn centre(robot: &Robot, pose: &[f64; JOINTS]) -> Vector3<f64> {
    let placed = robot.placements(
        &proprio_core::spatial::Transform::identity(),
        &SVector::from_fn(|k, _| if k < 6 { 0.0 } else { pose[k - 6] }),
    );
    let (mut mass, mut moment) = (0.0, Vector3::zeros());
    for (b, body) in robot.bodies().iter().enumerate() {
        let mut at = body.inertia.first_moment() / body.inertia.mass();
        let mut next = Some(b);
        while let Some(own) = next.filter(|own| *own > 0) {
            let from = &placed.from_parent[own];
            at = from.translation + from.rotation * at;
            next = robot.bodies()[own].parent;
        }
        mass += body.inertia.mass();
        moment += at * body.inertia.mass();
    }
    moment / mass
}

impl Course for Suspended {
    fn unknowns(&self) -> usize {
        JOINTS * self.basis.modes()
    }

    fn is_within(&self, x: &[f64]) -> bool {
        let modes = self.basis.modes();
        (0..INSTANTS).all(|s| {
            let joint = |j: usize| {
                self.basis
                    .at(&x[modes * j..modes * (j + 1)], self.pose[j], s)
            };
            self.worst(&std::array::from_fn(joint)).0 <= -DRAWN_IN
        })
    }

    /// Not searched.
    fn cost(&self, _: &[f64]) -> Option<f64> {
        None
    }
}
