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

use proprio_core::effect::{EffectKind, JointState, Shapes};
use proprio_core::inertia::INERTIAL;
use proprio_core::spatial::Transform;

use super::body::LimbBody;
use super::column::{Column, Columns, Sees};
use super::dot::dot;
use super::integrals::{Integrals, Key, Where};
use super::joint_states::States;
use super::motion::Motion;
use super::rigid_body::{RigidBody, Slopes};
use super::values::{Values, load};
use crate::parallel::each_part;

/// Windows whose rows are made one after the other; parts are made side by side.
const PART: usize = 128;

/// The rows of all windows of a limb, each joint's columns side by side.
#[derive(Debug, Clone, Default)]
pub(crate) struct Rows {
    /// Where each joint's row starts in a window's numbers, and where the last one ends.
    starts: Vec<usize>,
    numbers: Vec<f64>,
}

impl Rows {
    /// The rows of `columns` at a model's values, of those windows that are `chosen`; what is `known` already is not made again.
    pub(crate) fn of(
        motion: &Motion,
        body: &LimbBody,
        known: &Integrals,
        values: &Values,
        columns: &Columns,
        chosen: &(dyn Fn(usize) -> bool + Sync),
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
                let at = Where::of(values, delay);
                let own = rows.fill_known(known, &at, joints.collect(), values, columns);
                if own.iter().any(|own| !own.is_empty()) {
                    let is_kept =
                        |j: usize, c: usize| Key::of(&columns.of_joint[j][c], j, values).is_some();
                    let keeps =
                        (own.iter().enumerate()).any(|(j, own)| own.iter().any(|&c| is_kept(j, c)));
                    let pass = Pass::new(motion, body, values, columns, delay, own);
                    // What is kept is kept for all windows.
                    pass.run(&mut rows, &|w| keeps || chosen(w));
                    rows.keep(known, &at, &pass.own, values, columns);
                }
            }
        }
        rows.put_loads(body, values, columns);
        let numbers = columns.numbers(values);
        for j in 0..motion.joints {
            let gain = values.torque_gain(j);
            let scale = (columns.of_joint[j].iter()).position(|c| *c == Column::Scale(j));
            if gain == 1.0 && scale.is_none() {
                continue;
            }
            for w in (0..motion.windows.len()).filter(|&w| chosen(w)) {
                rows.scale((w, j), (gain, scale), &numbers[j]);
            }
        }
        rows
    }

    /// Fills in what is known of the joints' columns, and returns of each joint the others.
    fn fill_known(
        &mut self,
        known: &Integrals,
        at: &Where,
        joints: Vec<usize>,
        values: &Values,
        columns: &Columns,
    ) -> Vec<Vec<usize>> {
        let width = self.starts[columns.joints()];
        let mut own = vec![Vec::new(); columns.joints()];
        for j in joints {
            let keys: Vec<Option<Key>> = (columns.of_joint[j].iter())
                .map(|column| Key::of(column, j, values))
                .collect();
            for (c, integral) in known.get(at, &keys).into_iter().enumerate() {
                let Some(integral) = integral else {
                    own[j].extend(Some(c).filter(|_| !columns.of_joint[j][c].is_load()));
                    continue;
                };
                let places = self.numbers.iter_mut().skip(self.starts[j] + c);
                let places = places.step_by(width);
                places.zip(&*integral).for_each(|(to, from)| *to = *from);
            }
        }
        own
    }

    /// Keeps those of the columns that the motion alone makes.
    fn keep(
        &self,
        known: &Integrals,
        at: &Where,
        own: &[Vec<usize>],
        values: &Values,
        columns: &Columns,
    ) {
        let width = self.starts[columns.joints()];
        let column = |j: usize, c: usize| {
            let key = Key::of(&columns.of_joint[j][c], j, values)?;
            let numbers = self.numbers.iter().skip(self.starts[j] + c);
            let numbers = numbers.step_by(width);
            Some((key, numbers.copied().collect()))
        };
        let all = own.iter().enumerate();
        known.put(
            at,
            all.flat_map(|(j, own)| own.iter().filter_map(move |&c| column(j, c))),
        );
    }

    /// Writes the columns of loads where a model has them, each a sum of its body's own, which are there.
    pub(crate) fn put_loads(&mut self, body: &LimbBody, values: &Values, columns: &Columns) {
        for (j, own) in columns.of_joint.iter().enumerate() {
            let sum = |(c, column): (usize, &Column)| match *column {
                Column::Load { body: b, n } => {
                    let first = own.iter().position(|c| *c == Column::Inertial(b, 0))?;
                    let at = values.load_at(b, &body.coms[b]);
                    Some((c, first, load(&at, n)))
                }
                _ => None,
            };
            let sums: Vec<_> = own.iter().enumerate().filter_map(sum).collect();
            if sums.is_empty() {
                continue;
            }
            for w in 0..self.windows() {
                let row = self.row_mut(w, j);
                for (c, first, load) in &sums {
                    row[*c] = dot(load, &row[*first..first + INERTIAL]);
                }
            }
        }
    }

    /// Puts a row of true torques to the scale of the reported one, and writes the column of that scale: the derivative of
    /// (all that the model makes of the others)/g.
    fn scale(
        &mut self,
        (window, joint): (usize, usize),
        (gain, scale): (f64, Option<usize>),
        numbers: &[f64],
    ) {
        let row = self.row_mut(window, joint);
        if gain != 1.0 {
            row.iter_mut().for_each(|x| *x /= gain);
        }
        if let Some(c) = scale {
            row[c] = 0.0;
            row[c] = -dot(numbers, row) / gain;
        }
    }

    /// Of how many windows.
    pub(super) fn windows(&self) -> usize {
        let width = self.starts.last().copied().unwrap_or(0);
        self.numbers.len() / width.max(1)
    }

    /// A joint's columns in a window, N m per unit of each.
    pub(crate) fn row(&self, window: usize, joint: usize) -> &[f64] {
        let width = self.starts.last().copied().unwrap_or(0);
        &self.numbers[window * width..][self.starts[joint]..self.starts[joint + 1]]
    }

    pub(super) fn row_mut(&mut self, window: usize, joint: usize) -> &mut [f64] {
        let width = self.starts.last().copied().unwrap_or(0);
        &mut self.numbers[window * width..][self.starts[joint]..self.starts[joint + 1]]
    }
}

/// Numbers of one instant for all columns that are made, joint after joint: what enters by its difference, and what is integrated.
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
    /// Of each joint the columns that are made.
    own: Vec<Vec<usize>>,
    made: Vec<Made>,
    with_regressors: bool,
    with_slopes: bool,
    /// The joints whose states the columns see.
    seen: Vec<usize>,
}

/// Of a joint's columns that are made those of bodies and all others, each with its place among those that are made.
#[derive(Default)]
struct Made {
    /// Where a run of the regressors' numbers begins, where it goes, and its length.
    bodies: Vec<[usize; 3]>,
    /// An effect with its shape, whose columns come from one evaluation: where each of them goes, and which it is.
    own: Vec<(EffectKind, Shapes, Vec<[usize; 2]>)>,
    others: Vec<(usize, Column)>,
}

impl Made {
    fn of(own: impl Iterator<Item = Column>) -> Self {
        let mut made = Self::default();
        for (to, column) in own.enumerate() {
            match column {
                Column::Inertial(b, parameter) => {
                    let at = b * INERTIAL + parameter;
                    match made.bodies.last_mut() {
                        Some([from, first, count])
                            if [*from + *count, *first + *count] == [at, to] =>
                        {
                            *count += 1;
                        }
                        _ => made.bodies.push([at, to, 1]),
                    }
                }
                Column::Own {
                    effect, shapes, n, ..
                } => match made.own.last_mut() {
                    Some((known, with, places)) if (*known, *with) == (effect, shapes) => {
                        places.push([to, n]);
                    }
                    _ => made.own.push((effect, shapes, vec![[to, n]])),
                },
                _ => made.others.push((to, column)),
            }
        }
        made
    }
}

/// Room for what is made at each sample.
struct Workspace {
    /// W_m and W_g − W_c, row-major.
    momentum: Vec<f64>,
    rate: Vec<f64>,
    slopes: Slopes,
    /// What the joints' effects see; of joints that no column sees, what they saw at the first sample.
    states: Vec<JointState<f64>>,
}

impl<'a> Pass<'a> {
    fn new(
        motion: &'a Motion,
        body: &LimbBody,
        values: &Values,
        columns: &'a Columns,
        delay: f64,
        own: Vec<Vec<usize>>,
    ) -> Self {
        let made: Vec<&Column> = (own.iter().zip(&columns.of_joint))
            .flat_map(|(own, columns)| own.iter().map(|&c| &columns[c]))
            .collect();
        let any = |is: fn(&&Column) -> bool| made.iter().copied().any(|c| is(&c));
        let with_regressors = any(|c| matches!(c, Column::Inertial(..)));
        let with_slopes = any(|c| matches!(c, Column::Motion { .. } | Column::Gravity(_)));
        let links = with_regressors || with_slopes;
        let sees = |j: usize| (own[j].iter().map(|&c| columns.of_joint[j][c].sees())).max();
        let all = (0..motion.joints).any(|j| sees(j) == Some(Sees::All));
        let seen = (0..motion.joints).filter(|&j| all || sees(j) == Some(Sees::Own));
        let of_joint = own.iter().zip(&columns.of_joint);
        Self {
            motion,
            columns,
            rigid: body.loaded(values),
            base: body.base(values),
            with_regressors,
            with_slopes,
            seen: seen.collect(),
            states: motion.states_of(body, values, (columns, &made), (delay, &None), links),
            made: of_joint
                .map(|(own, columns)| Made::of(own.iter().map(|&c| columns[c])))
                .collect(),
            own,
        }
    }

    /// Writes the joints' rows of all chosen windows.
    fn run(&self, rows: &mut Rows, chosen: &(dyn Fn(usize) -> bool + Sync)) {
        let width = rows.starts[self.motion.joints];
        let of_joint = self.own.iter().zip(&rows.starts);
        let places: Vec<usize> = of_joint
            .flat_map(|(own, first)| own.iter().map(move |c| first + c))
            .collect();
        each_part(rows.numbers.chunks_mut(width * PART), |n, numbers| {
            self.run_part(PART * n, numbers.chunks_exact_mut(width), &places, chosen);
        });
    }

    /// The same of the windows from `begin` on whose `rows` these are; `places` are those of the columns that are made.
    fn run_part<'r>(
        &self,
        begin: usize,
        rows: impl Iterator<Item = &'r mut [f64]>,
        places: &[usize],
        chosen: &dyn Fn(usize) -> bool,
    ) {
        let n = self.motion.joints;
        let zero = vec![0.0; places.len()];
        let mut now = Instant {
            boundary: zero.clone(),
            rate: zero.clone(),
        };
        let (mut before, mut near) = (now.clone(), now.clone());
        let (mut start, mut end, mut sum) = (zero.clone(), zero.clone(), zero);
        let mut workspace = Workspace {
            momentum: vec![0.0; INERTIAL * n * n],
            rate: vec![0.0; INERTIAL * n * n],
            slopes: Slopes::of(n),
            states: Vec::with_capacity(n),
        };
        let mut last_sample = None;
        let windows = self.motion.windows[begin..].iter();
        let parts = windows.zip(rows).enumerate();
        for (_, (window, row)) in parts.filter(|(w, _)| chosen(begin + w)) {
            let [first, last] = window.samples;
            // A window that begins where the last one ended need not look at that sample again.
            if last_sample != Some(first) {
                self.measure(first, true, &mut workspace, &mut now);
            }
            self.boundary(first, &mut workspace, (&now, &mut near), &mut start);
            sum.fill(0.0);
            for k in first + 1..=last {
                std::mem::swap(&mut before, &mut now);
                self.measure(k, k == last, &mut workspace, &mut now);
                let half = 0.5 * (self.motion.time[k] - self.motion.time[k - 1]);
                for (sum, (a, b)) in sum.iter_mut().zip(before.rate.iter().zip(&now.rate)) {
                    *sum += half * (a + b);
                }
            }
            last_sample = Some(last);
            self.boundary(last, &mut workspace, (&now, &mut near), &mut end);
            for (i, &place) in places.iter().enumerate() {
                row[place] = (end[i] - start[i] + sum[i]) / window.length;
            }
        }
    }

    /// What enters by its difference at a window's end, which is sample k and measured `now`; `near` is room for the samples next to it.
    fn boundary(
        &self,
        k: usize,
        workspace: &mut Workspace,
        (now, near): (&Instant, &mut Instant),
        out: &mut [f64],
    ) {
        out.copy_from_slice(&now.boundary);
        let Some([before, at, after]) = self.motion.end_weights(k) else {
            return;
        };
        out.iter_mut().for_each(|out| *out *= at);
        for (k, weight) in [(k - 1, before), (k + 1, after)] {
            self.measure(k, true, workspace, near);
            let near = near.boundary.iter();
            out.iter_mut()
                .zip(near)
                .for_each(|(out, near)| *out += weight * near);
        }
    }

    /// All columns of sample k but those of loads and of the scale; those that enter by their difference only at a window's edge.
    fn measure(&self, k: usize, edge: bool, workspace: &mut Workspace, out: &mut Instant) {
        let n = self.motion.joints;
        let at = k * n..(k + 1) * n;
        let Workspace {
            momentum,
            rate,
            slopes,
            states,
        } = workspace;
        if self.with_regressors || self.with_slopes {
            let motion = [&self.states.q[at.clone()], &self.states.dq[at]];
            if self.with_regressors {
                let momentum = edge.then_some(&mut momentum[..]);
                let slopes = self.with_slopes.then_some(slopes);
                (self.rigid).regressors(&self.base, motion, momentum, rate, slopes);
            } else {
                let [q, dq] = motion;
                self.rigid.slopes(&self.base, q, dq, slopes);
            }
        }
        match (states.is_empty(), &self.seen[..]) {
            (_, []) => {}
            (true, _) => self.states.all(k, states),
            (false, seen) => (seen.iter()).for_each(|&j| states[j] = self.states.joint(k, j)),
        }
        let (mut boundaries, mut rates) = (&mut out.boundary[..], &mut out.rate[..]);
        for (j, own) in self.own.iter().enumerate() {
            let boundary = boundaries.split_off_mut(..own.len()).unwrap_or_default();
            let rate = rates.split_off_mut(..own.len()).unwrap_or_default();
            self.measure_joint(j, workspace, boundary, rate);
        }
    }

    /// The columns of joint j.
    fn measure_joint(
        &self,
        j: usize,
        workspace: &Workspace,
        boundaries: &mut [f64],
        rates: &mut [f64],
    ) {
        let first = j * INERTIAL * self.motion.joints;
        let (slopes, states) = (&workspace.slopes, &workspace.states[..]);
        for &[from, to, count] in &self.made[j].bodies {
            let from = first + from..first + from + count;
            boundaries[to..to + count].copy_from_slice(&workspace.momentum[from.clone()]);
            rates[to..to + count].copy_from_slice(&workspace.rate[from]);
        }
        for (effect, shapes, places) in &self.made[j].own {
            let terms = effect.terms_among(states, j, *shapes);
            for &[to, n] in places {
                (boundaries[to], rates[to]) = (terms[n].boundary, terms[n].rate);
            }
        }
        for (to, column) in &self.made[j].others {
            (boundaries[*to], rates[*to]) = match *column {
                Column::Coupled { .. } => {
                    let term = self.columns.term(column, j, states);
                    term.map_or((0.0, 0.0), |term| (term.boundary, term.rate))
                }
                Column::Motion { joint, effect, n } => {
                    slopes.along(joint, effect.motion(&states[joint], n), j)
                }
                Column::Gravity(axis) => (0.0, slopes.by_base(axis, j)),
                Column::Delay => (-states[j].tau, 0.0),
                // Made apart from these, or of all others when all windows are.
                Column::Inertial(..)
                | Column::Own { .. }
                | Column::Load { .. }
                | Column::Scale(_)
                | Column::Shape { .. }
                | Column::Sensor(_) => (0.0, 0.0),
            };
        }
    }
}
