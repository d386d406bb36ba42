//! Three equations for the same parameters, so that a user can compare them on one log.
//!
//! - *momentum*: [W_m] − ∫ W_c dt + ∫ W_g dt + effects = ∫ τ dt over windows ([`proprio_core::window`]); no acceleration.
//! - *energy*: Δh θ + ∫ friction · q̇ dt = ∫ τᵀ q̇ dt, one row per window of a limb, h the regressor of kinetic and potential
//!   energy (Gautier & Khalil 1988); no acceleration either, but a sum over all joints, whose errors mix.
//! - *inverse dynamics*: W(q, q̇, q̈) θ + effects = τ at the middle of each window, q̇, q̈ and τ from a straight line through the
//!   samples around it, which is filtered differentiation without a phase (Savitzky & Golay 1964).
//!
//! Corrections of sensors and of the base are those of the momentum fit; here they are held.

use proprio_core::effect::Term;
use proprio_core::inertia::INERTIAL;

use super::data::{Data, Rows};
use crate::criticism::column::Column;
use crate::criticism::limb::LimbCriticism;
use crate::criticism::motion::local_line;
use crate::criticism::windows::Window;

/// Which equation.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Method {
    /// Integrated momentum.
    #[default]
    Momentum,
    /// Differences of energy.
    Energy,
    /// Torques at instants, with accelerations from filtered differentiation.
    InverseDynamics,
}

/// The rows of a limb by energy or inverse dynamics; windows and blocks are the momentum equation's.
pub(crate) fn data(criticism: &LimbCriticism, method: Method) -> Data {
    let (n, width) = (criticism.recording.joints, criticism.columns.entries.len());
    let groups = if method == Method::Energy { 1 } else { n };
    let mut rows = vec![vec![Vec::new(); groups]; criticism.blocks.count()];
    criticism.rows().for_each_window(|window| {
        let block = window.block;
        match method {
            Method::Energy => {
                if window.moves.iter().any(|moves| *moves) {
                    rows[block][0].push(energy_row(criticism, window));
                }
            }
            _ => {
                let all = torque_rows(criticism, window);
                for (joint, row) in all
                    .into_iter()
                    .enumerate()
                    .filter(|(j, _)| window.moves[*j])
                {
                    rows[block][joint].push(row);
                }
            }
        }
    });
    let block = |groups: &Vec<Vec<Vec<f64>>>| {
        groups
            .iter()
            .map(|rows| Rows::of_rows(rows, width))
            .collect()
    };
    Data {
        blocks: rows.iter().map(block).collect(),
    }
}

/// The term of an effect's own column at sample k.
fn term(criticism: &LimbCriticism, column: &Column, k: usize) -> Option<(usize, Term<f64>)> {
    match *column {
        Column::Own {
            joint,
            effect,
            shape,
            n,
        } => {
            let state = &criticism.motion.states[k * criticism.recording.joints + joint];
            Some((joint, effect.terms(state, shape)[n]))
        }
        _ => None,
    }
}

/// Mean power over a window, W, per unit of each parameter, and that of the motors.
fn energy_row(criticism: &LimbCriticism, window: &Window) -> Vec<f64> {
    let (n, [first, last]) = (criticism.recording.joints, window.samples);
    let width = criticism.columns.entries.len();
    let (limb, mut row) = (criticism.rows(), vec![0.0; width + 1]);
    let time = |k: usize| 1e-6 * criticism.recording.time_us[k] as f64;
    let speed = |k: usize, joint: usize| criticism.motion.dq[k * n + joint];
    let mut energy = [vec![0.0; INERTIAL * n], vec![0.0; INERTIAL * n]];
    for (energy, k) in energy.iter_mut().zip([first, last]) {
        let at = k * n..(k + 1) * n;
        limb.body.energy_regressor(
            &limb.base,
            &criticism.motion.q[at.clone()],
            &criticism.motion.dq[at],
            energy,
        );
    }
    for (e, entry) in criticism.columns.entries.iter().enumerate() {
        if let Column::Inertial(b, p) = entry.column {
            row[e] = energy[1][INERTIAL * b + p] - energy[0][INERTIAL * b + p];
            continue;
        }
        for k in first + 1..=last {
            let (Some((joint, before)), Some((_, now))) = (
                term(criticism, &entry.column, k - 1),
                term(criticism, &entry.column, k),
            ) else {
                break;
            };
            let (slow, fast) = (speed(k - 1, joint), speed(k, joint));
            row[e] += 0.5 * (slow + fast) * (now.boundary - before.boundary)
                + 0.5 * (time(k) - time(k - 1)) * (slow * before.rate + fast * now.rate);
        }
    }
    for k in first + 1..=last {
        for joint in 0..n {
            let scale = criticism.corrections.torque_scale[joint];
            let power =
                |k: usize| criticism.motion.states[k * n + joint].tau / scale * speed(k, joint);
            row[width] += 0.5 * (time(k) - time(k - 1)) * (power(k - 1) + power(k));
        }
    }
    let length = time(last) - time(first);
    row.iter_mut().for_each(|x| *x /= length);
    row
}

/// Torque at a window's middle, N m, per unit of each parameter, and that measured; joint by joint.
fn torque_rows(criticism: &LimbCriticism, window: &Window) -> Vec<Vec<f64>> {
    let (n, [first, last]) = (criticism.recording.joints, window.samples);
    let width = criticism.columns.entries.len();
    let times: Vec<f64> = (first..=last)
        .map(|k| 1e-6 * criticism.recording.time_us[k] as f64)
        .collect();
    let middle = (last - first) / 2;
    let line = |x: &dyn Fn(usize) -> f64| {
        let x: Vec<f64> = (first..=last).map(x).collect();
        local_line(&times, &x, middle, 4)
    };
    let of = |x: &[f64]| -> Vec<[f64; 2]> { (0..n).map(|j| line(&|k| x[k * n + j])).collect() };
    let (q, dq) = (of(&criticism.motion.q), of(&criticism.motion.dq));
    let part = |x: &[[f64; 2]], p: usize| -> Vec<f64> { x.iter().map(|x| x[p]).collect() };
    let limb = criticism.rows();
    let mut regressor = vec![0.0; n * INERTIAL * n];
    limb.body.torque_regressor(
        &limb.base,
        [&part(&q, 0), &part(&dq, 0), &part(&dq, 1)],
        &mut regressor,
    );
    (0..n)
        .map(|j| {
            let mut row = vec![0.0; width + 1];
            for (e, entry) in criticism.columns.entries.iter().enumerate() {
                row[e] = match entry.column {
                    Column::Inertial(b, p) => regressor[j * INERTIAL * n + INERTIAL * b + p],
                    Column::Own { joint, .. } if joint == j => {
                        let at = |k: usize| {
                            term(criticism, &entry.column, k).map_or(Term::zero(), |(_, term)| term)
                        };
                        line(&|k| at(k).boundary)[1] + line(&|k| at(k).rate)[0]
                    }
                    _ => 0.0,
                };
            }
            let scale = criticism.corrections.torque_scale[j];
            row[width] = line(&|k| criticism.motion.states[k * n + j].tau / scale)[0];
            row
        })
        .collect()
}
