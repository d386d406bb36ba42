//! Three equations for the same parameters, so that a user can compare them on one log.
//!
//! - *momentum*: [W_m] − ∫ W_c dt + ∫ W_g dt + effects = ∫ τ dt over windows ([`proprio_core::window`]); no acceleration.
//! - *energy*: Δh θ + ∫ friction · q̇ dt = ∫ τᵀ q̇ dt, one row per window of a limb, h the regressor of kinetic and potential
//!   energy (Gautier & Khalil 1988); no acceleration either, but a sum over all joints, whose errors mix.
//! - *inverse dynamics*: W(q, q̇, q̈) θ + effects = τ at the middle of each window, on the smooth trajectory.
//!
//! What is a derivative is taken from the momentum fit; here it is held.

use proprio_core::effect::{JointState, Term};
use proprio_core::inertia::INERTIAL;
use proprio_core::spatial::Transform;

use super::groups::{Group, Groups};
use super::limb_data::LimbData;
use crate::equation::column::{Column, Columns};
use crate::equation::joint_states::States;
use crate::equation::local_line::local_line;
use crate::equation::motion::Window;
use crate::equation::rigid_body::RigidBody;
use crate::equation::values::Values;

/// Which equation.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Method {
    /// Integrated momentum.
    #[default]
    Momentum,
    /// Differences of energy.
    Energy,
    /// Torques at instants.
    InverseDynamics,
}

/// What both equations are made of.
struct Other<'a> {
    data: &'a LimbData<'a>,
    columns: &'a Columns,
    rigid: Box<dyn RigidBody>,
    base: Transform<f64>,
    states: States,
    /// What effects see, sample by sample, joint by joint.
    seen: Vec<JointState<f64>>,
    /// Torque gain of each joint.
    gain: Vec<f64>,
}

/// The rows of a limb by energy or inverse dynamics; windows and blocks are the momentum equation's.
pub(super) fn data(data: &LimbData, values: &Values, columns: &Columns, method: Method) -> Groups {
    let (n, width) = (data.joints(), columns.entries.len());
    let states = data.motion.states(&data.body, values, columns, 0.0);
    let samples = 0..data.motion.time.len();
    let other = Other {
        data,
        columns,
        rigid: data.body.loaded(values),
        base: data.body.base(values),
        seen: samples
            .flat_map(|k| (0..n).map(move |j| (k, j)))
            .map(|(k, j)| states.joint(k, j))
            .collect(),
        states,
        gain: (0..n).map(|j| values.torque_gain(j)).collect(),
    };
    let groups = if method == Method::Energy { 1 } else { n };
    let mut rows = vec![vec![Vec::new(); groups]; data.blocks.count()];
    for (w, window) in data.motion.windows.iter().enumerate() {
        if method == Method::Energy {
            if (0..n).any(|j| data.counts(w, j)) {
                rows[window.block][0].push(other.energy_row(window));
            }
            continue;
        }
        for (j, row) in other.torque_rows(window).into_iter().enumerate() {
            if data.counts(w, j) {
                rows[window.block][j].push(row);
            }
        }
    }
    let block = |groups: &Vec<Vec<Vec<f64>>>| {
        groups
            .iter()
            .map(|rows| Group::of_rows(rows, width))
            .collect()
    };
    Groups {
        blocks: rows.iter().map(block).collect(),
    }
}

impl Other<'_> {
    /// The term of an effect's column at a joint at sample k.
    fn term(&self, column: &Column, joint: usize, k: usize) -> Option<Term<f64>> {
        let n = self.data.joints();
        let states = &self.seen[k * n..(k + 1) * n];
        self.columns.term(column, joint, states)
    }

    fn measured(&self, k: usize, joint: usize) -> f64 {
        self.data.recording.tau[k * self.data.joints() + joint] * self.gain[joint]
    }

    /// Mean power over a window, W, per unit of each parameter, and that of the motors.
    fn energy_row(&self, window: &Window) -> Vec<f64> {
        let (n, [first, last]) = (self.data.joints(), window.samples);
        let width = self.columns.entries.len();
        let mut row = vec![0.0; width + 1];
        let time = &self.data.motion.time;
        let speed = |k: usize, joint: usize| self.states.dq[k * n + joint];
        let mut energy = [vec![0.0; INERTIAL * n], vec![0.0; INERTIAL * n]];
        for (energy, k) in energy.iter_mut().zip([first, last]) {
            let at = k * n..(k + 1) * n;
            self.rigid.energy_regressor(
                &self.base,
                &self.states.q[at.clone()],
                &self.states.dq[at],
                energy,
            );
        }
        for (e, entry) in self.columns.entries.iter().enumerate() {
            if let Column::Inertial(b, p) = entry.column {
                row[e] = energy[1][INERTIAL * b + p] - energy[0][INERTIAL * b + p];
                continue;
            }
            for (joint, k) in (0..n).flat_map(|joint| (first + 1..=last).map(move |k| (joint, k))) {
                let term = |k: usize| self.term(&entry.column, joint, k);
                let (Some(before), Some(now)) = (term(k - 1), term(k)) else {
                    continue;
                };
                let (slow, fast) = (speed(k - 1, joint), speed(k, joint));
                row[e] += 0.5 * (slow + fast) * (now.boundary - before.boundary)
                    + 0.5 * (time[k] - time[k - 1]) * (slow * before.rate + fast * now.rate);
            }
        }
        for k in first + 1..=last {
            for joint in 0..n {
                let power = |k: usize| self.measured(k, joint) * speed(k, joint);
                row[width] += 0.5 * (time[k] - time[k - 1]) * (power(k - 1) + power(k));
            }
        }
        row.iter_mut().for_each(|x| *x /= window.length);
        row
    }

    /// Torque at a window's middle, N m, per unit of each parameter, and that measured; joint by joint.
    fn torque_rows(&self, window: &Window) -> Vec<Vec<f64>> {
        let (n, [first, last]) = (self.data.joints(), window.samples);
        let width = self.columns.entries.len();
        let times = &self.data.motion.time[first..=last];
        let middle = (last - first) / 2;
        let line = |x: &dyn Fn(usize) -> f64| {
            let x: Vec<f64> = (first..=last).map(x).collect();
            local_line(times, &x, middle, 4)
        };
        let of = |x: &[f64]| -> Vec<[f64; 2]> { (0..n).map(|j| line(&|k| x[k * n + j])).collect() };
        let (q, dq) = (of(&self.states.q), of(&self.states.dq));
        let part = |x: &[[f64; 2]], p: usize| -> Vec<f64> { x.iter().map(|x| x[p]).collect() };
        let mut regressor = vec![0.0; n * INERTIAL * n];
        let motion: [&[f64]; 3] = [&part(&q, 0), &part(&dq, 0), &part(&dq, 1)];
        self.rigid
            .torque_regressor(&self.base, motion, &mut regressor);
        let row = |j: usize| {
            let mut row = vec![0.0; width + 1];
            for (e, entry) in self.columns.entries.iter().enumerate() {
                row[e] = match entry.column {
                    Column::Inertial(b, p) => regressor[j * INERTIAL * n + INERTIAL * b + p],
                    ref column => {
                        let at = |k: usize| self.term(column, j, k).unwrap_or(Term::zero());
                        line(&|k| at(k).boundary)[1] + line(&|k| at(k).rate)[0]
                    }
                };
            }
            row[width] = line(&|k| self.measured(k, j))[0];
            row
        };
        (0..n).map(row).collect()
    }
}
