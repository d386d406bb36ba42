//! What a limb did: the joints' smooth trajectories and the windows of time in which they are judged. No torque, by type.
//!
//! [`Motion::states`] adds what a model says of it: the link's motion where gears give way or have play, and the torque that the
//! model itself expects the gears to transmit. Effects that depend on torque (elasticity, backlash, load-dependent friction,
//! saturation, delay) use that one: a measured torque would bring the noise that it is to explain (`design.md` §6, step 0).

use std::ops::Range;
use std::sync::Arc;

use proprio_core::effect::{EffectKind, Form, JointState};

use super::body::LimbBody;
use super::column::{Column, Columns};
use super::folds::Blocks;
use super::load::{Loads, REACH, around, local_line};
use super::presliding::Way;
use super::share::shares;
use super::values::Values;
use crate::model::BASE;
use crate::recording::LimbRecording;
use crate::trajectory::{Stretch, Trajectory};

/// Shortest window, s.
const WINDOW: f64 = 0.02;
/// Fewest sample periods of a window: its torque is a mean of at least as many samples.
const LEAST_PERIODS: f64 = 4.0;
/// Share of a window in which a joint may be so slow that friction may hold it, and the window still say something of its
/// friction: one sample of a Go2, which a reversal takes that friction does not hold up.
pub(crate) const MOST_REST: f64 = 0.125;
/// Effects that let a link move against its motor.
pub(crate) const LOOSE: [EffectKind; 2] = [EffectKind::Elasticity, EffectKind::Backlash];

/// A limb's motion, sample by sample.
pub(crate) struct Motion {
    /// How many joints.
    pub(crate) joints: usize,
    /// s since the recording's start.
    pub(crate) time: Vec<f64>,
    /// Samples of one motion, over which states of friction, springs and plays last: messages may be lost between them.
    pub(crate) stretches: Vec<Range<usize>>,
    /// Of each joint, at its motor.
    pub(crate) joint: Arc<Vec<Trajectory>>,
    /// Of each joint's link, where a second encoder was recorded all the time.
    pub(super) links: Vec<Option<Trajectory>>,
    /// Motor temperature, °C, sample by sample, joint by joint; not a number where not recorded.
    pub(crate) temperature: Vec<f64>,
    /// The windows, in the order of time.
    pub(crate) windows: Vec<Window>,
    /// Whether samples are so far apart that what enters by its difference is corrected at a window's ends.
    pub(super) coarse: bool,
    pub(super) loads: Loads,
}

/// A window of time.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Window {
    /// Its middle, s since the recording's start.
    pub(crate) t: f64,
    /// Its length, s.
    pub(crate) length: f64,
    /// The block of time that it belongs to.
    pub(crate) block: usize,
    /// First and last sample.
    pub(crate) samples: [usize; 2],
    /// Whether each joint moves: the torque of one at rest is whatever friction holds.
    pub(crate) moves: Vec<bool>,
}

/// What effects see at each sample, under a model: from one sample on, sample by sample, joint by joint.
#[derive(Clone, Default)]
pub(crate) struct States {
    /// The first sample.
    pub(crate) first: usize,
    /// The motor's side.
    pub(crate) states: Vec<JointState<f64>>,
    /// The link's position, rad.
    pub(crate) q: Vec<f64>,
    /// The link's velocity, rad/s.
    pub(crate) dq: Vec<f64>,
}

/// The samples that are asked for: all where not told, else no one before or after the range.
pub(crate) type Asked = Option<(Range<usize>, Vec<bool>)>;

impl Motion {
    /// A limb's motion by its recording; `velocity_gain` is each joint's reported velocity over the true one.
    pub(crate) fn of(recording: &LimbRecording, blocks: &Blocks, velocity_gain: &[f64]) -> Self {
        let n = recording.joints;
        let time = recording.seconds();
        let stretches = recording.motions();
        let period = recording.period();
        let joint = recording.trajectories(velocity_gain);
        let link = |j: usize| link(recording, j, &joint[j], (&time, &stretches), period);
        let links = (0..n).map(link).collect();
        let mut motion = Self {
            joints: n,
            time,
            stretches,
            joint,
            links,
            temperature: recording.temperature.clone(),
            windows: Vec::new(),
            coarse: false,
            loads: Loads::default(),
        };
        motion.coarse = motion.joint.iter().any(|joint| joint.is_coarse(period));
        let length = WINDOW.max(LEAST_PERIODS * period);
        motion.windows = motion.cut(recording.stretches(), blocks, length);
        motion
    }

    /// Cuts stretches without a gap into windows of at least this length (s) that lie within a block.
    fn cut(
        &self,
        stretches: impl Iterator<Item = Range<usize>>,
        blocks: &Blocks,
        length: f64,
    ) -> Vec<Window> {
        let mut windows = Vec::new();
        for stretch in stretches {
            let mut first = stretch.start;
            for k in stretch {
                // Sample times are whole microseconds.
                if self.time[k] - self.time[first] < length - 1e-7 {
                    continue;
                }
                let [start, end] = [first, k].map(|k| (self.time[k] * 1e6).round() as u64);
                if let Some(block) = blocks.of_window(start, end) {
                    windows.push(Window {
                        t: 0.5 * (self.time[first] + self.time[k]),
                        length: self.time[k] - self.time[first],
                        block,
                        samples: [first, k],
                        moves: self
                            .joint
                            .iter()
                            .map(|joint| self.moves(joint, first, k))
                            .collect(),
                    });
                }
                first = k;
            }
        }
        windows
    }

    /// Whether a joint is not held up for long between two samples.
    fn moves(&self, joint: &Trajectory, first: usize, last: usize) -> bool {
        let resting = (first + 1..=last).filter(|&k| joint.speed[k].abs() < joint.rest);
        let rest: f64 = resting.map(|k| self.time[k] - self.time[k - 1]).sum();
        rest < MOST_REST * (self.time[last] - self.time[first])
    }

    /// The samples that a model's torque in the chosen windows depends on: those within, and what smooths the load there; of a link
    /// that moves against its motor all that came before without a gap. All, if most windows are chosen.
    pub(crate) fn asked(&self, values: &Values, chosen: &dyn Fn(usize) -> bool) -> Asked {
        let count = (0..self.windows.len()).filter(|w| chosen(*w)).count();
        if 4 * count >= 3 * self.windows.len() {
            return None;
        }
        let is_loose = values.places().any(|place| LOOSE.contains(&place.0));
        let mut asked = vec![false; self.time.len()];
        let mut range: Option<Range<usize>> = None;
        for (_, window) in self.windows.iter().enumerate().filter(|(w, _)| chosen(*w)) {
            let [first, last] = window.samples;
            let (begin, end) = (
                self.time[first] - 2.0 * REACH,
                self.time[last] + 2.0 * REACH,
            );
            let mut from = self.time[..first].partition_point(|t| *t < begin);
            if is_loose {
                let stretch = self.stretches.partition_point(|s| s.end <= first);
                from = from.min(self.stretches.get(stretch).map_or(first, |s| s.start));
            }
            let to = last + self.time[last..].partition_point(|t| *t <= end);
            // Those next to the window's ends, however far apart samples are.
            let (from, to) = (from.min(first.saturating_sub(1)), to.max(last + 2));
            let to = to.min(self.time.len());
            let known = range.clone().unwrap_or(from..to);
            range = Some(known.start.min(from)..known.end.max(to));
            // A link's past is long, and that of the window before is told already.
            let told = asked[from..to].iter().rposition(|asked| *asked);
            let new = if is_loose {
                told.map_or(from, |n| from + n)
            } else {
                from
            };
            asked[new..to].fill(true);
        }
        Some((range.unwrap_or(0..0), asked))
    }

    /// What effects see under a model, `delay` seconds before each sample. `columns` tell which of it is asked for.
    pub(crate) fn states(
        &self,
        body: &LimbBody,
        values: &Values,
        columns: &Columns,
        delay: f64,
    ) -> States {
        let made: Vec<&Column> = columns.of_joint.iter().flatten().collect();
        self.states_for(&made, body, values, columns, delay)
    }

    /// The same of which only the columns `made` are asked.
    pub(crate) fn states_for(
        &self,
        made: &[&Column],
        body: &LimbBody,
        values: &Values,
        columns: &Columns,
        delay: f64,
    ) -> States {
        self.states_of(body, values, (columns, made), (delay, &None))
    }

    /// The same of the samples that are `asked` for.
    pub(crate) fn states_of(
        &self,
        body: &LimbBody,
        values: &Values,
        (columns, made): (&Columns, &[&Column]),
        (delay, asked): (f64, &Asked),
    ) -> States {
        let n = self.joints;
        let needs = Needs::of(values, made);
        // A drive's torque is made of all effects that the model has.
        let all: Vec<&Column> = columns.of_joint.iter().flatten().collect();
        let seen = if needs.torque { &all } else { made };
        let joints = self.late(delay);
        let range = asked
            .as_ref()
            .map_or(0..self.time.len(), |asked| asked.0.clone());
        let bristles = |j: usize| {
            let displacement = displacement(seen, j)?;
            Some(self.kept_presliding((&joints, delay), j, displacement))
        };
        let bristles: Vec<Option<Arc<Vec<f64>>>> = (0..n).map(bristles).collect();
        let (offsets, room) = (values.offsets(), n * range.len());
        let mut states = States {
            first: range.start,
            q: Vec::with_capacity(room),
            dq: Vec::with_capacity(room),
            states: Vec::with_capacity(room),
        };
        for k in range {
            for (j, joint) in joints.iter().enumerate() {
                let [q, dq, ..] = joint.state[k];
                let q = q - offsets[j];
                states.q.push(q);
                states.dq.push(dq);
                states.states.push(JointState {
                    speed: joint.speed[k],
                    speed_noise: joint.speed_noise,
                    give: [0.0; 2],
                    play: [0.0; 2],
                    presliding: bristles[j].as_ref().map_or(0.0, |impulse| impulse[k]),
                    temperature: self.temperature[k * n + j],
                    ..JointState::reported(q, dq, 0.0)
                });
            }
        }
        if needs.load {
            let loose = !needs.play.is_empty() || !needs.spring.is_empty();
            let load = match asked {
                None => self.load(body, values, (loose, delay)),
                Some((_, asked)) => {
                    Arc::new(self.load_of(body, (&joints, delay), values, (loose, asked)))
                }
            };
            self.fill_load(&load, values, &needs, &mut states);
        }
        if needs.torque {
            self.fill_torque(values, columns, &mut states);
        }
        self.measure_links((&joints, delay), &mut states);
        states
    }

    /// What the bristles of a joint that moves so have transmitted at each sample since the gap before it, per N m of presliding friction
    /// with this displacement (rad), s.
    pub(crate) fn presliding(&self, joint: &Trajectory, displacement: f64) -> Vec<f64> {
        let ways = self.ways(joint);
        let impulse = ways.iter().flat_map(|way| way.impulse(displacement));
        impulse.collect()
    }

    /// The way of a joint that moves so, stretch by stretch.
    pub(crate) fn ways(&self, joint: &Trajectory) -> Vec<Way> {
        let of = |stretch: &Range<usize>| {
            Way::of(&self.time[stretch.clone()], &joint.state[stretch.clone()])
        };
        self.stretches.iter().map(of).collect()
    }

    /// The motor's torque at each sample: what the gear transmits and what the model's effects add, before it is reported.
    fn fill_torque(&self, values: &Values, columns: &Columns, states: &mut States) {
        let (n, first) = (self.joints, states.first);
        let states = &mut states.states;
        let mut shares = shares(columns, values);
        for (j, own) in shares.iter_mut().enumerate() {
            // What is beyond a limit is not given.
            own.retain(|share| share.effect != EffectKind::Saturation);
            for stretch in &self.stretches {
                let stretch = stretch.start.max(first)..stretch.end.min(first + states.len() / n);
                let at = |k: usize| {
                    let mut sum = [0.0; 2];
                    for share in &*own {
                        let [boundary, rate] = &mut sum;
                        share.add(j, &states[(k - first) * n..], [boundary, rate]);
                    }
                    sum
                };
                let terms: Vec<[f64; 2]> = stretch.clone().map(at).collect();
                for (i, k) in stretch.clone().enumerate() {
                    let (before, after) = (i.saturating_sub(1), (i + 1).min(terms.len() - 1));
                    let span = self.time[stretch.start + after] - self.time[stretch.start + before];
                    let slope = (terms[after][0] - terms[before][0]) / span.max(f64::MIN_POSITIVE);
                    let state = &mut states[(k - first) * n + j];
                    state.tau = state.load + slope + terms[i][1];
                }
            }
        }
    }
}

/// The trajectory of a link by its own encoder; its velocity by the motor's, and by how the two move against each other.
fn link(
    recording: &LimbRecording,
    joint: usize,
    motor: &Trajectory,
    (time, stretches): (&[f64], &[Range<usize>]),
    period: f64,
) -> Option<Trajectory> {
    let n = recording.joints;
    let q: Vec<f64> = (recording.q_link.iter().skip(joint).step_by(n).copied()).collect();
    if q.is_empty() || q.iter().any(|q| !q.is_finite()) {
        return None;
    }
    let twist: Vec<f64> = (q.iter().zip(&motor.state))
        .map(|(q, motor)| q - motor[0])
        .collect();
    let velocity = |stretch: &Range<usize>| {
        let (t, twist) = (&time[stretch.clone()], &twist[stretch.clone()]);
        let slope = |k: usize| local_line(t, twist, k, around(t, k))[1];
        let motor = motor.state[stretch.clone()].iter().enumerate();
        motor
            .map(|(k, motor)| motor[1] + slope(k))
            .collect::<Vec<_>>()
    };
    let dq: Vec<f64> = stretches.iter().flat_map(velocity).collect();
    let of = |s: &Range<usize>| Stretch {
        t: &time[s.clone()],
        q: &q[s.clone()],
        dq: &dq[s.clone()],
    };
    Some(Trajectory::of(
        &stretches.iter().map(of).collect::<Vec<_>>(),
        period,
    ))
}

/// Which of what effects see costs a pass of its own.
pub(super) struct Needs {
    load: bool,
    torque: bool,
    /// Joints whose links move in a play or may.
    pub(super) play: Vec<usize>,
    /// Joints whose links hang on a spring or may.
    pub(super) spring: Vec<usize>,
    /// Those of them of which the change with the spring is asked for.
    pub(super) give: Vec<usize>,
}

impl Needs {
    /// What the columns `made` and the links' motion ask for.
    fn of(values: &Values, made: &[&Column]) -> Self {
        let own = |effects: &[EffectKind]| {
            (made.iter()).any(|column| match column {
                Column::Own { effect, .. } | Column::Motion { effect, .. } => {
                    effects.contains(effect)
                }
                _ => false,
            })
        };
        let asks =
            |effect: EffectKind, joint: usize| made.contains(&&Column::Motion { joint, effect });
        let joints = |is: &dyn Fn(usize) -> bool| -> Vec<usize> {
            (0..values.bodies.len()).filter(|j| is(*j)).collect()
        };
        let loose = |effect: EffectKind| joints(&|j| values.has((effect, j)) || asks(effect, j));
        let (play, spring) = (loose(EffectKind::Backlash), loose(EffectKind::Elasticity));
        let late = [EffectKind::Delay, EffectKind::Saturation];
        let torque = made.contains(&&Column::Lateness) || own(&late);
        let links = !play.is_empty() || !spring.is_empty();
        Self {
            load: torque || links || own(&[EffectKind::LoadFriction]),
            torque,
            play,
            spring,
            give: joints(&|j| asks(EffectKind::Elasticity, j)),
        }
    }
}

/// The displacement of a joint's presliding friction, rad, if it has a column.
fn displacement(columns: &[&Column], at: usize) -> Option<f64> {
    columns.iter().find_map(|column| match **column {
        Column::Own {
            joint,
            effect: EffectKind::Presliding,
            shape,
            ..
        } if joint == at => Some(shape),
        _ => None,
    })
}

/// Whether an effect enters by a derivative of the prediction, taken where its value is.
pub(crate) fn is_derivative(effect: EffectKind) -> bool {
    effect == EffectKind::Delay
        || matches!(
            effect.description().form,
            Form::Motion | Form::Scale | Form::Gravity
        )
}

/// Whether an effect is one of all joints at `joint`.
pub(crate) fn is_shared(joint: usize) -> bool {
    joint == BASE
}
