//! From a limb's motion to integrated rows: the momentum equation over windows, with every column of [`Columns`].
//!
//! A window's row for joint j is ([`proprio_core::window`])
//!
//! ```text
//! [W_m] − ∫ W_c dt + ∫ W_g dt  |  own effects: [boundary] + ∫ rate dt  |  d/dε of the whole prediction
//! ```
//!
//! all divided by the window's length, and by the joint's torque gain g: the columns of the *reported* torque. What changes the
//! motion (encoder_offset, elasticity, backlash, delay) or gravity (base_tilt) is in the motion that the columns are made of;
//! its own column is the derivative of the prediction there. No measured torque enters.

use nalgebra::{Rotation3, Vector3};
use proprio_core::effect::{EffectKind, JointState, MAX_COLUMNS, Term};
use proprio_core::inertia::INERTIAL;
use proprio_core::spatial::Transform;

use super::body::LimbBody;
use super::column::{Column, Columns};
use super::dot::dot;
use super::motion::{Motion, States, Window};
use super::rigid_body::{RigidBody, Slopes};
use super::values::Values;

/// Columns of a load: its mass, its first moment, and the same inertia about all axes.
const LOAD_COLUMNS: usize = 5;

/// The rows of all windows of a limb, each joint's columns side by side.
#[derive(Debug, Clone, Default)]
pub(crate) struct Rows {
    /// Where each joint's row starts in a window's numbers, and where the last one ends.
    starts: Vec<usize>,
    numbers: Vec<f64>,
}

impl Rows {
    /// The rows of `columns` at a model's values, of those windows that are `chosen`; zeros for the others.
    pub(crate) fn of(
        motion: &Motion,
        body: &LimbBody,
        values: &Values,
        columns: &Columns,
        chosen: &dyn Fn(usize) -> bool,
    ) -> Self {
        let mut starts = vec![0];
        for columns in &columns.of_joint {
            starts.push(starts[starts.len() - 1] + columns.len());
        }
        let width = starts[motion.joints];
        let mut rows = Self {
            numbers: vec![0.0; width * motion.windows.len()],
            starts,
        };
        let delays: Vec<f64> = (0..motion.joints).map(|j| values.delay(j)).collect();
        let mut done: Vec<f64> = Vec::new();
        for &delay in &delays {
            if !done.contains(&delay) {
                done.push(delay);
                let joints = (0..motion.joints).filter(|&j| delays[j] == delay);
                let pass = Pass::new(motion, body, values, columns, delay, joints.collect());
                pass.run(&mut rows, chosen);
            }
        }
        let numbers = columns.numbers(values);
        for w in (0..motion.windows.len()).filter(|&w| chosen(w)) {
            for j in 0..motion.joints {
                rows.scale(w, j, columns, values, &numbers[j]);
            }
        }
        rows
    }

    /// Puts a row of true torques to the scale of the reported one, and writes the column of that scale: the derivative of
    /// (all that the model makes of the others)/g.
    fn scale(
        &mut self,
        window: usize,
        joint: usize,
        columns: &Columns,
        values: &Values,
        numbers: &[f64],
    ) {
        let gain = values.get((EffectKind::TorqueGain, joint), 0);
        let row = self.row_mut(window, joint);
        if gain != 1.0 {
            row.iter_mut().for_each(|x| *x /= gain);
        }
        let own = columns.of_joint[joint].iter();
        if let Some(c) = own.clone().position(|c| *c == Column::Scale(joint)) {
            row[c] = 0.0;
            row[c] = -dot(numbers, row) / gain;
        }
    }

    /// A joint's columns in a window, N m per unit of each.
    pub(crate) fn row(&self, window: usize, joint: usize) -> &[f64] {
        let width = self.starts.last().copied().unwrap_or(0);
        &self.numbers[window * width..][self.starts[joint]..self.starts[joint + 1]]
    }

    fn row_mut(&mut self, window: usize, joint: usize) -> &mut [f64] {
        let width = self.starts.last().copied().unwrap_or(0);
        &mut self.numbers[window * width..][self.starts[joint]..self.starts[joint + 1]]
    }
}

/// Numbers of one instant for all joints' columns, joint after joint: what enters by its difference, and what is integrated.
#[derive(Clone)]
struct Instant {
    boundary: Vec<f64>,
    rate: Vec<f64>,
}

/// The rows of the joints whose torque is reported with one delay.
struct Pass<'a> {
    motion: &'a Motion,
    columns: &'a Columns,
    rigid: Box<dyn RigidBody>,
    base: Transform<f64>,
    states: States,
    joints: Vec<usize>,
    /// Inertial parameters per unit of each of a load's columns, body by body.
    loads: Vec<[[f64; INERTIAL]; LOAD_COLUMNS]>,
    with_slopes: bool,
}

/// Room for what is made at each sample.
struct Workspace {
    /// W_m and W_g − W_c, row-major.
    momentum: Vec<f64>,
    rate: Vec<f64>,
    slopes: Slopes,
}

impl<'a> Pass<'a> {
    fn new(
        motion: &'a Motion,
        body: &LimbBody,
        values: &Values,
        columns: &'a Columns,
        delay: f64,
        joints: Vec<usize>,
    ) -> Self {
        let needs = |c: &Column| matches!(c, Column::Motion { .. } | Column::Gravity(_));
        let at = |b: usize| values.load_at(b, &body.coms[b]);
        let of = |b: usize| std::array::from_fn(|n| load(&at(b), n));
        Self {
            motion,
            columns,
            rigid: body.loaded(values),
            base: body.base(values),
            states: motion.states(body, values, columns, delay),
            joints,
            loads: (0..motion.joints).map(of).collect(),
            with_slopes: columns.of_joint.iter().flatten().any(needs),
        }
    }

    /// Writes the joints' rows of all chosen windows.
    fn run(&self, rows: &mut Rows, chosen: &dyn Fn(usize) -> bool) {
        let n = self.motion.joints;
        let zero = vec![0.0; rows.starts[n]];
        let mut now = Instant {
            boundary: zero.clone(),
            rate: zero.clone(),
        };
        let (mut before, mut start, mut sum) = (now.clone(), zero.clone(), zero);
        let mut workspace = Workspace {
            momentum: vec![0.0; INERTIAL * n * n],
            rate: vec![0.0; INERTIAL * n * n],
            slopes: Slopes::of(n),
        };
        let mut last_sample = None;
        for (w, window) in self
            .motion
            .windows
            .iter()
            .enumerate()
            .filter(|(w, _)| chosen(*w))
        {
            let [first, last] = window.samples;
            // A window that begins where the last one ended need not look at that sample again.
            if last_sample != Some(first) {
                self.measure(first, true, &rows.starts, &mut workspace, &mut now);
            }
            start.copy_from_slice(&now.boundary);
            sum.fill(0.0);
            for k in first + 1..=last {
                std::mem::swap(&mut before, &mut now);
                self.measure(k, k == last, &rows.starts, &mut workspace, &mut now);
                let half = 0.5 * (self.motion.time[k] - self.motion.time[k - 1]);
                for (sum, (a, b)) in sum.iter_mut().zip(before.rate.iter().zip(&now.rate)) {
                    *sum += half * (a + b);
                }
            }
            last_sample = Some(last);
            for &j in &self.joints {
                let range = rows.starts[j]..rows.starts[j + 1];
                let row = rows.row_mut(w, j);
                for (x, c) in row.iter_mut().zip(range) {
                    *x = (now.boundary[c] - start[c] + sum[c]) / window.length;
                }
            }
        }
    }

    /// All columns of sample k but those of the scale; those that enter by their difference only at a window's edge.
    fn measure(
        &self,
        k: usize,
        edge: bool,
        starts: &[usize],
        workspace: &mut Workspace,
        out: &mut Instant,
    ) {
        let n = self.motion.joints;
        let at = k * n..(k + 1) * n;
        let Workspace {
            momentum,
            rate,
            slopes,
        } = workspace;
        self.rigid.regressors(
            &self.base,
            &self.states.q[at.clone()],
            &self.states.dq[at.clone()],
            edge.then_some(&mut momentum[..]),
            rate,
            self.with_slopes.then_some(slopes),
        );
        let states = &self.states.states[at];
        for &j in &self.joints {
            let row = starts[j]..starts[j + 1];
            let (boundaries, rates) = (&mut out.boundary[row.clone()], &mut out.rate[row]);
            self.measure_joint(j, states, workspace, boundaries, rates);
        }
    }

    /// The columns of joint j.
    fn measure_joint(
        &self,
        j: usize,
        states: &[JointState<f64>],
        workspace: &Workspace,
        boundaries: &mut [f64],
        rates: &mut [f64],
    ) {
        let width = INERTIAL * self.motion.joints;
        let (momentum, rate) = (
            &workspace.momentum[j * width..],
            &workspace.rate[j * width..],
        );
        let slopes = &workspace.slopes;
        // An effect's columns stand side by side and come from one evaluation.
        let mut known: Option<(EffectKind, f64, [Term<f64>; MAX_COLUMNS])> = None;
        for (c, column) in self.columns.of_joint[j].iter().enumerate() {
            (boundaries[c], rates[c]) = match *column {
                Column::Inertial(b, parameter) => {
                    let at = b * INERTIAL + parameter;
                    (momentum[at], rate[at])
                }
                Column::Load { body, n } => {
                    let (load, at) = (&self.loads[body][n], body * INERTIAL);
                    (dot(load, &momentum[at..]), dot(load, &rate[at..]))
                }
                Column::Own {
                    joint,
                    effect,
                    shape,
                    n,
                } => {
                    let terms = match known {
                        Some((same, with, terms)) if (same, with) == (effect, shape) => terms,
                        _ => effect.terms(&states[joint], shape),
                    };
                    known = Some((effect, shape, terms));
                    (terms[n].boundary, terms[n].rate)
                }
                Column::Motion { joint, effect } => {
                    slopes.along(joint, effect.motion(&states[joint]), j)
                }
                Column::Gravity(axis) => (0.0, slopes.by_base(axis, j)),
                Column::Lateness => (-states[j].tau, 0.0),
                // Made of the others when the window closes.
                Column::Scale(_) => (0.0, 0.0),
            };
        }
    }
}

/// Half of what a joint's torque jumps by when it turns round in a window, N m: its dry friction, whichever effects make it;
/// `None` where it does not turn round.
pub(crate) fn jump(
    columns: &[Column],
    numbers: &[f64],
    motion: &Motion,
    window: &Window,
    joint: usize,
) -> Option<f64> {
    let trajectory = &motion.joint[joint];
    let speed = |k: usize| trajectory.speed[k];
    let [first, last] = window.samples;
    let slow = (first..=last).find(|&k| speed(k).abs() < trajectory.rest);
    let turn = || (first..last).find(|&k| speed(k) * speed(k + 1) <= 0.0);
    let at = slow.or_else(turn)?;
    let towards = |sign: f64| {
        let [q, dq, ..] = trajectory.state[at];
        let state = JointState {
            speed: sign * trajectory.speed_noise,
            speed_noise: trajectory.speed_noise,
            temperature: motion.temperature[at * motion.joints + joint],
            ..JointState::reported(q, dq, 0.0)
        };
        let rate = |(column, value): (&Column, &f64)| match *column {
            Column::Own {
                effect, shape, n, ..
            } => value * effect.terms(&state, shape)[n].rate,
            _ => 0.0,
        };
        columns.iter().zip(numbers).map(rate).sum::<f64>()
    };
    Some((0.5 * (towards(1.0) - towards(-1.0))).abs())
}

/// The inertial parameters of a point mass of 1 kg at `com` (n = 0), or how they change with its first moment (1 kg m) along
/// x, y or z (n = 1 to 3), or the same inertia about all axes (n = 4).
pub(crate) fn load(com: &Vector3<f64>, n: usize) -> [f64; INERTIAL] {
    if n == 4 {
        return [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0];
    }
    let (mass, away) = match n {
        0 => (1.0, *com),
        n => (0.0, Vector3::ith(n - 1, 1.0)),
    };
    // The inertia |c|² 1 − c cᵀ, or its derivative along `away`.
    let share = if n == 0 { 0.5 } else { 1.0 };
    let spread = com * away.transpose() + away * com.transpose();
    let inertia = (nalgebra::Matrix3::identity() * spread.trace() - spread) * share;
    let i = |r: usize, c: usize| inertia[(r, c)];
    [
        mass,
        away.x,
        away.y,
        away.z,
        i(0, 0),
        i(0, 1),
        i(0, 2),
        i(1, 1),
        i(1, 2),
        i(2, 2),
    ]
}

/// A base turned about its own axes by a small rotation vector, rad.
pub(crate) fn turned(base: &Transform<f64>, by: &Vector3<f64>) -> Transform<f64> {
    Transform {
        rotation: base.rotation * Rotation3::new(*by).matrix(),
        translation: base.translation,
    }
}
