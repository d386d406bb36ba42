//! What effects see at each sample, under a model: the motors' motion, that of the links where gears give way or have play, and the torque
//! that the model itself expects the gears to transmit.
//!
//! Effects that depend on torque (elasticity, backlash, load-dependent friction, saturation, delay) use that one: a measured torque would
//! bring the noise that it is to explain (`design.md` §6, step 0).
//!
//! A joint's state is put together when it is asked for. Kept for all samples it would be the largest of what a fit holds, and most of it
//! is the motors' motion, which is there already.

use std::sync::Arc;

use proprio_core::effect::{Input, JointState, MAX_COLUMNS, Shapes, Term, Transmission};

use super::body::LimbBody;
use super::column::{Column, Columns, sees_other_joints};
use super::contribution::contributions;
use super::encoder::Encoder;
use super::local_line::{Line, around};
use super::motion::{Asked, Motion};
use super::recoil::Recoil;
use super::values::{Place, Values};
use crate::trajectory::Trajectory;

/// What effects see under a model: from one sample on, sample by sample, joint by joint.
#[derive(Clone, Default)]
pub(crate) struct States {
    /// The first sample.
    pub(crate) first: usize,
    /// The link's position, rad; nothing where it is not asked for.
    pub(crate) q: Vec<f64>,
    /// The link's velocity, rad/s; nothing where it is not asked for.
    pub(crate) dq: Vec<f64>,
    /// The motors' motion, as late as torques are reported, and what their encoders get wrong.
    pub(super) motors: Arc<Vec<Trajectory>>,
    pub(super) encoders: Vec<Encoder>,
    bristles: Vec<Option<Arc<Vec<f64>>>>,
    recoil: Option<Arc<Recoil>>,
    temperature: Arc<Vec<f64>>,
    /// s since the recording's start.
    time: Arc<Vec<f64>>,
    /// As [`JointState`] has them; nothing where no effect asks.
    pub(super) load: Vec<f64>,
    tau: Vec<f64>,
    pub(super) give: Vec<[f64; 2]>,
    pub(super) play: Vec<[f64; 2]>,
}

impl States {
    /// How many joints.
    fn joints(&self) -> usize {
        self.motors.len()
    }

    /// What joint j's effects see at sample k.
    pub(crate) fn joint(&self, k: usize, j: usize) -> JointState<f64> {
        let n = self.joints();
        let (at, motor) = ((k - self.first) * n + j, &self.motors[j]);
        let [q, dq, ..] = motor.state[k];
        let [q, dq] = self.encoders[j].motion([q, dq]);
        let told = |own: &[f64]| own.get(at).copied().unwrap_or_default();
        let moved = |own: &[[f64; 2]]| own.get(at).copied().unwrap_or_default();
        JointState {
            q,
            dq,
            tau: told(&self.tau),
            speed: motor.speed[k],
            speed_noise: motor.speed_noise,
            load: told(&self.load),
            give: moved(&self.give),
            play: moved(&self.play),
            presliding: self.bristles[j].as_ref().map_or(0.0, |impulse| impulse[k]),
            recoil: self
                .recoil
                .as_ref()
                .map_or([0.0; 2], |felt| felt[k * n + j]),
            temperature: self.temperature[k * n + j],
            time: self.time[k],
        }
    }

    /// The same of all joints.
    pub(crate) fn all(&self, k: usize, joints: &mut Vec<JointState<f64>>) {
        joints.clear();
        joints.extend((0..self.joints()).map(|j| self.joint(k, j)));
    }

    /// The window terms of an effect's columns at sample k.
    pub(crate) fn terms(
        &self,
        k: usize,
        (effect, joint): Place,
        shapes: Shapes,
    ) -> [Term<f64>; MAX_COLUMNS] {
        if !sees_other_joints(effect) {
            return effect.terms_among(&[self.joint(k, joint)], 0, shapes);
        }
        let mut joints = Vec::with_capacity(self.joints());
        self.all(k, &mut joints);
        effect.terms_among(&joints, joint, shapes)
    }

    /// Links that do not move, so many over all samples and joints.
    pub(super) fn still(count: usize) -> Self {
        Self {
            q: vec![0.0; count],
            dq: vec![0.0; count],
            ..Self::default()
        }
    }

    /// The links' motion alone.
    pub(crate) fn links(&self) -> Self {
        Self {
            first: self.first,
            q: self.q.clone(),
            dq: self.dq.clone(),
            ..Self::default()
        }
    }

    pub(super) fn move_link(&mut self, at: usize, share: f64, [position, velocity]: [f64; 2]) {
        self.q[at] += share * position;
        self.dq[at] += share * velocity;
    }
}

impl Motion {
    /// What effects see under a model, `delay` seconds before each sample. `columns` tell which of it is asked for.
    pub(crate) fn states(
        &self,
        body: &LimbBody,
        values: &Values,
        columns: &Columns,
        delay: f64,
    ) -> States {
        let made: Vec<&Column> = columns.of_joint.iter().flatten().collect();
        self.states_of(body, values, (columns, &made), (delay, &None), true)
    }

    /// The same without the links' motion, which no effect sees.
    pub(crate) fn seen(&self, body: &LimbBody, values: &Values, columns: &Columns) -> States {
        let made: Vec<&Column> = columns.of_joint.iter().flatten().collect();
        self.states_of(body, values, (columns, &made), (0.0, &None), false)
    }

    /// The same of which only the columns `made` are asked, of the samples that are `asked` for, and of the links' motion only where
    /// `links` says so.
    pub(crate) fn states_of(
        &self,
        body: &LimbBody,
        values: &Values,
        (columns, made): (&Columns, &[&Column]),
        (delay, asked): (f64, &Asked),
        links: bool,
    ) -> States {
        let n = self.joints;
        // A drive's torque is made of all effects that the model has.
        let all: Vec<&Column> = columns.of_joint.iter().flatten().collect();
        let needs = Needs::of(values, (made, &all), links);
        let seen = if needs.torque.is_empty() { made } else { &all };
        let motors = self.late(delay);
        let range = asked
            .as_ref()
            .map_or(0..self.time.len(), |asked| asked.0.clone());
        let bristles = |j: usize| {
            let displacement = displacement(seen, j)?;
            Some(self.kept_presliding((&motors, delay), j, displacement))
        };
        let encoders: Vec<_> = values.encoders().collect();
        let mut states = States {
            first: range.start,
            bristles: (0..n).map(bristles).collect(),
            recoil: self.late_recoil(delay),
            temperature: self.temperature.clone(),
            time: self.time.clone(),
            ..States::default()
        };
        // What loads the gears moves with the links.
        let links = links || needs.load;
        if links {
            states.q.reserve_exact(n * range.len());
            states.dq.reserve_exact(n * range.len());
            for k in range {
                for (motor, encoder) in motors.iter().zip(&encoders) {
                    let [q, dq, ..] = motor.state[k];
                    let [q, dq] = encoder.motion([q, dq]);
                    states.q.push(q);
                    states.dq.push(dq);
                }
            }
        }
        (states.motors, states.encoders) = (motors.clone(), encoders);
        if needs.load {
            // Whether links are asked for or not, it is the same load where one may move: worked out once for both.
            let is_loose = |(effect, _): Place| effect.description().is_compliant();
            let loose =
                !needs.play.is_empty() || !needs.spring.is_empty() || values.places().any(is_loose);
            let load = match asked {
                None => self.load(body, values, (loose, delay)),
                Some((_, asked)) => {
                    Arc::new(self.load_of(body, (&motors, delay), values, (loose, asked)))
                }
            };
            self.fill_load(body, (&load, values), &needs, &mut states);
            if !needs.torque.is_empty() {
                self.fill_torque(&load.torque, (values, columns), &needs, &mut states);
            }
        }
        if links {
            self.measure_links((&motors, delay), &mut states);
        }
        states
    }

    /// The motor's torque at each sample: what the gear transmits and what the model's effects add, before it is reported.
    ///
    /// What the gear transmits, `load`, is smoothed by parabolas: a lag's column is as large as the torque that it is of, and lines take away 3 % of
    /// a torque of 7 Hz.
    fn fill_torque(
        &self,
        load: &[f64],
        (values, columns): (&Values, &Columns),
        needs: &Needs,
        states: &mut States,
    ) {
        let (n, first) = (self.joints, states.first);
        let mut shares = contributions(columns, values);
        // What is beyond a limit is not given.
        shares
            .iter_mut()
            .for_each(|own| own.retain(|share| !share.effect.description().is_limit()));
        let mut tau = vec![0.0; states.q.len()];
        let mut joints = Vec::with_capacity(n);
        for stretch in self.stretches_within(&(first..first + states.q.len() / n)) {
            let mut terms = vec![[0.0; 2]; n * stretch.len()];
            for (k, terms) in stretch.clone().zip(terms.chunks_exact_mut(n)) {
                states.all(k, &mut joints);
                for &j in &needs.torque {
                    let [boundary, rate] = &mut terms[j];
                    for share in &shares[j] {
                        share.add(j, &joints, [&mut *boundary, &mut *rate]);
                    }
                }
            }
            for (i, k) in stretch.clone().enumerate() {
                let (before, after) = (i.saturating_sub(1), (i + 1).min(stretch.len() - 1));
                let span = self.time[stretch.start + after] - self.time[stretch.start + before];
                let half = around(&self.time[stretch.clone()], i);
                let through = Line::about(&self.time, k, half).parabola();
                for &j in &needs.torque {
                    let change = terms[after * n + j][0] - terms[before * n + j][0];
                    let slope = change / span.max(f64::MIN_POSITIVE);
                    let at = (k - first) * n + j;
                    tau[at] = through.value(load, (j, n)) + slope + terms[i * n + j][1];
                }
            }
        }
        states.tau = tau;
    }
}

/// Which of what effects see costs a pass of its own.
pub(super) struct Needs {
    load: bool,
    /// Whether an effect sees it.
    pub(super) smooth: bool,
    /// Joints whose motors' torque is asked for.
    torque: Vec<usize>,
    /// Joints whose links move in a play or may.
    pub(super) play: Vec<usize>,
    /// Joints whose links hang on a spring or may.
    pub(super) spring: Vec<usize>,
    /// Those of them of which the change with the spring is asked for.
    pub(super) give: Vec<usize>,
}

impl Needs {
    /// What the columns `made`, of `all`, ask for, and the links' motion where it is asked for.
    fn of(values: &Values, (made, all): (&[&Column], &[&Column]), links: bool) -> Self {
        let sees_load = |column: &&Column| match column {
            Column::Own { effect, .. } | Column::Coupled { effect, .. } => {
                effect.description().input == Input::TransmittedTorque
            }
            _ => false,
        };
        let asks = |of: Transmission, at: usize| {
            (made.iter()).any(|column| match column {
                Column::Motion { joint, effect, .. } => {
                    *joint == at && effect.description().transmission() == Some(of)
                }
                _ => false,
            })
        };
        let has = |of: Transmission, at: usize| {
            (values.places()).any(|(effect, joint)| {
                joint == at && effect.description().transmission() == Some(of)
            })
        };
        let joints = |is: &dyn Fn(usize) -> bool| -> Vec<usize> {
            (0..values.bodies.len()).filter(|j| is(*j)).collect()
        };
        // Effects see the motors' motion: where links are is for the bodies alone, and dear.
        let moves = |of: Transmission| joints(&|j| links && (has(of, j) || asks(of, j)));
        let (play, spring) = (moves(Transmission::Backlash), moves(Transmission::Spring));
        let torque = joints(&|at| {
            (made.iter()).any(|column| match column {
                Column::Own { joint, effect, .. } => {
                    *joint == at && effect.description().input == Input::MotorTorque
                }
                // A delay that all joints share has a column at each.
                Column::Delay => true,
                _ => false,
            })
        });
        let loose = !play.is_empty() || !spring.is_empty();
        Self {
            load: !torque.is_empty() || loose || made.iter().any(sees_load),
            smooth: all.iter().any(sees_load),
            torque,
            play,
            spring,
            give: joints(&|j| asks(Transmission::Spring, j)),
        }
    }
}

/// The displacement of a joint's presliding friction, rad, if it has a column.
fn displacement(columns: &[&Column], at: usize) -> Option<f64> {
    columns.iter().find_map(|column| match **column {
        Column::Own {
            joint,
            effect,
            shapes,
            ..
        } if joint == at && effect.description().input == Input::Bristles => Some(shapes[0]),
        _ => None,
    })
}
