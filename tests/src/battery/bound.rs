//! Whether a log can tell a hidden effect at all: the Cramér-Rao bound, apart from the identification's columns.
//!
//! The robot is simulated once more without noise, quanta and jitter, and sampled far more finely. The *signature* of what is hidden is the reported
//! torque minus the inverse dynamics of the reported motion by the true bodies and the known effects, as means over 20 ms:
//! whatever the effect is, that is what a model without it cannot say. What sampling and reversals leave of the robot that hides
//! nothing is taken off: it is no sign of anything. So is what the model may fit instead:
//! every inertial parameter within the CAD's uncertainty (columns by inverse dynamics of unit bodies), and viscous, Coulomb,
//! rotor inertia and bias of every joint that the model has, at any value. What is left, divided by the noise, is
//!
//! ```text
//! size / standard deviation (Cramér-Rao) = ‖L⁻¹ (1 − P) s‖,    cov(noise) = L Lᵀ
//! ```
//!
//! exactly where the torque is linear in the size, and to first order elsewhere; a shape is taken as known. The noise is the
//! same residual of a log with noise and quanta of a complete model: its variance and its covariance from window to window
//! (velocity noise enters by differences) make a tridiagonal covariance per joint. The noise of different joints is taken as
//! independent. A wrong velocity is told by the positions as well, and what they tell is added.

use nalgebra::{DMatrix, DVector, SVector, Vector3};
use proprio_core::estimator::CAD_UNCERTAINTY;
use proprio_core::go2::{self, JOINTS_PER_LEG as JOINTS, Leg};
use proprio_core::inertia::{INERTIAL, InertialParameters};
use proprio_core::spatial::Transform;
use proprio_core::tree::Tree;
use proprio_simulator::{HiddenEffect, HiddenKind, Sensors, SimulatedSample, Simulation};

use super::case::{Case, TYPICAL};

/// Samples of a window: 20 ms at 500 Hz.
const WINDOW: usize = 10;
/// How many times finer a signature is sampled: what a log's own samples leave of reversals, which come a little sooner or later
/// with what is hidden, would be as large as a small signature.
const FINER: usize = 25;
/// Friction of a joint slower than this is not known, rad/s.
const REST: f64 = 0.02;
/// Inertial parameters of a leg.
const BODIES: usize = INERTIAL * JOINTS;
/// And with the effects that a model may have.
const NUISANCES: usize = BODIES + TYPICAL.len() * JOINTS;

/// A window of a joint: what a model may fit, and what it cannot say.
#[derive(Debug, Clone, Copy)]
struct Row {
    nuisances: SVector<f64, NUISANCES>,
    torque: f64,
}

/// Windows by joint; `None` where the joint rests.
type Rows = [Vec<Option<Row>>; JOINTS];

/// Variance of a window's torque and covariance of neighbours, (N m)², by joint.
pub type Noise = [[f64; 2]; JOINTS];

/// What a log can tell of a hidden effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bound {
    /// Size over its Cramér-Rao standard deviation.
    pub snr: f64,
    /// Root mean square of the effect's torque at the joint that feels it most, N m.
    pub torque: f64,
}

/// The signature of what is hidden in a simulation.
pub struct Signature {
    rows: Rows,
    /// What positions tell beside the torques: the square of a signal-to-noise ratio.
    kinematic: f64,
}

/// The noise of a leg's windows under the true model.
pub fn noise(known: &Simulation) -> Noise {
    let even = Simulation {
        sensors: Sensors::default(),
        ..known.clone()
    };
    let rows = rows(&even, &even.effects, 1);
    rows.each_ref().map(|windows| {
        let pairs = windows.windows(2).filter_map(|w| Some((w[0]?, w[1]?)));
        let (mut variance, mut covariance, mut n) = (0.0, 0.0, 0.0);
        for (a, b) in pairs {
            variance += 0.5 * (a.torque * a.torque + b.torque * b.torque);
            covariance += a.torque * b.torque;
            n += 1.0;
        }
        // A tridiagonal matrix is positive definite up to one half.
        let most = 0.49 * variance;
        [variance / n, covariance.clamp(-most, most) / n]
    })
}

impl Signature {
    /// Of `hidden` in a robot that otherwise has what `case` knows.
    pub fn new(case: &Case, hidden: &[HiddenEffect]) -> Self {
        let known = case.known();
        let mut simulation = known.clone();
        simulation.effects.extend(hidden.iter().cloned());
        simulation.sensors = Sensors::ideal();
        simulation.rate *= FINER as f64;
        let kinematic = hidden.iter().map(|e| kinematic(e, &simulation)).sum();
        let mut torques = rows(&simulation, &known.effects, FINER);
        simulation.effects.clone_from(&known.effects);
        let without = rows(&simulation, &known.effects, FINER);
        for (row, without) in torques.iter_mut().flatten().zip(without.iter().flatten()) {
            *row = row.zip(*without).map(|(row, without)| Row {
                torque: row.torque - without.torque,
                ..row
            });
        }
        Self {
            rows: torques,
            kinematic,
        }
    }

    /// What of this signature neither the model of `case` nor the signatures of `others` can say.
    pub fn bound(&self, case: &Case, noise: &Noise, others: &[&Self]) -> Bound {
        let fitted = fitted(case);
        let width = fitted.len() + others.len() + 1;
        let mut whitened: Vec<DVector<f64>> = prior(case.leg, &fitted, width);
        let mut torque = 0.0f64;
        for joint in 0..JOINTS {
            let (mut square, mut n) = (0.0, 0.0);
            let mut before: Option<(DVector<f64>, f64)> = None;
            for (k, row) in self.rows[joint].iter().enumerate() {
                let rivals: Option<Vec<f64>> = others
                    .iter()
                    .map(|other| other.rows[joint].get(k).copied().flatten())
                    .map(|row| Some(row?.torque))
                    .collect();
                let (Some(row), Some(rivals)) = (row, rivals) else {
                    before = None;
                    continue;
                };
                square += row.torque * row.torque;
                n += 1.0;
                let values = fitted.iter().map(|&c| row.nuisances[c]);
                let all = values.chain(rivals).chain([row.torque]);
                let row = DVector::from_iterator(width, all);
                // Cholesky factor of a tridiagonal covariance, row by row.
                let [variance, covariance] = noise[joint];
                let (row, left) = match &before {
                    None => (row, variance),
                    Some((last, pivot)) => (
                        row - last * (covariance / pivot),
                        variance - covariance * covariance / pivot,
                    ),
                };
                whitened.push(&row / left.sqrt());
                before = Some((row, left));
            }
            torque = torque.max((square / f64::max(n, 1.0)).sqrt());
        }
        let rows = whitened.len();
        let matrix = DMatrix::from_fn(rows, width, |r, c| whitened[r][c]);
        let left = matrix.qr().r()[(width - 1, width - 1)];
        Bound {
            snr: left.hypot(self.kinematic.sqrt()),
            torque,
        }
    }
}

/// The columns that the model of a case may fit.
fn fitted(case: &Case) -> Vec<usize> {
    let known = case.known().effects;
    let has = |kind: HiddenKind, place: usize| {
        known
            .iter()
            .any(|e| e.kind() == kind && e.joint().is_some_and(|j| j.place() == place))
    };
    let mut fitted: Vec<usize> = (0..BODIES).collect();
    for place in 0..JOINTS {
        for (n, kind) in TYPICAL.into_iter().enumerate() {
            if has(kind, place) {
                fitted.push(BODIES + place * TYPICAL.len() + n);
            }
        }
    }
    fitted
}

/// The CAD's knowledge of the inertial parameters: rows of unit noise.
fn prior(leg: Leg, fitted: &[usize], width: usize) -> Vec<DVector<f64>> {
    let mut rows = Vec::new();
    for (b, body) in go2::leg::<f64>(leg).bodies().iter().enumerate() {
        let Some(factor) = body.inertia.prior(CAD_UNCERTAINTY) else {
            continue;
        };
        for k in 0..INERTIAL {
            let mut row = DVector::zeros(width);
            // A row of the triangle: its entries from the diagonal on, the right-hand side last.
            for (n, value) in factor.row(k).iter().take(INERTIAL - k).enumerate() {
                let column = b * INERTIAL + k + n;
                debug_assert_eq!(fitted[column], column);
                row[column] = *value;
            }
            rows.push(row);
        }
    }
    rows
}

/// Windows of a simulated log under the true bodies and `known` effects; `finer` samples stand for one of the log.
fn rows(simulation: &Simulation, known: &[HiddenEffect], finer: usize) -> Rows {
    let samples: Vec<SimulatedSample> = simulation.samples().map_while(Result::ok).collect();
    let leg = simulation.legs[0];
    let tree = go2::leg::<f64>(leg).with_inertia(&simulation.bodies(leg));
    let units: Vec<Tree<f64, JOINTS, JOINTS>> = (0..BODIES)
        .map(|c| {
            let mut bodies = [InertialParameters::zero(); JOINTS];
            bodies[c / INERTIAL].0[c % INERTIAL] = 1.0;
            go2::leg(leg).with_inertia(&bodies)
        })
        .collect();
    let size = |kind: HiddenKind, place: usize| {
        let here = |e: &&HiddenEffect| {
            e.kind() == kind && e.joint().is_some_and(|joint| joint.place() == place)
        };
        known.iter().rfind(here).map_or(0.0, |e| e.values()[0])
    };
    let sizes: [[f64; TYPICAL.len()]; JOINTS] =
        std::array::from_fn(|place| TYPICAL.map(|kind| size(kind, place)));
    let mut rows: Rows = std::array::from_fn(|_| Vec::new());
    let window = |first: usize| -> [Option<Row>; JOINTS] {
        let zero = Row {
            nuisances: SVector::zeros(),
            torque: 0.0,
        };
        let mut sum = [Some(zero); JOINTS];
        // As far before the first of the log's samples as after the last.
        let first = first - finer / 2;
        for k in first..first + WINDOW * finer {
            let in_log = k % finer == 0;
            let at = |x: &[f64]| Vector3::from_column_slice(&x[..JOINTS]);
            let (q, dq) = (at(&samples[k].q), at(&samples[k].dq));
            let step = samples[k + 1].t - samples[k - 1].t;
            let ddq = (at(&samples[k + 1].dq) - at(&samples[k - 1].dq)) / step;
            let kinematics = tree.kinematics(&Transform::identity(), &q, &dq);
            let rigid = tree.inverse_dynamics(&kinematics, &dq, &ddq);
            let columns: Vec<Vector3<f64>> = (units.iter().filter(|_| in_log))
                .map(|unit| unit.inverse_dynamics(&kinematics, &dq, &ddq))
                .collect();
            for joint in 0..JOINTS {
                if in_log && dq[joint].abs() < REST {
                    sum[joint] = None;
                }
                let Some(row) = &mut sum[joint] else { continue };
                let own = [dq[joint], dq[joint].signum(), ddq[joint], 1.0];
                row.torque += samples[k].tau[joint] - rigid[joint];
                for (n, x) in own.into_iter().enumerate() {
                    row.torque -= sizes[joint][n] * x;
                    if in_log {
                        row.nuisances[BODIES + joint * TYPICAL.len() + n] += x / WINDOW as f64;
                    }
                }
                for (c, column) in columns.iter().enumerate() {
                    row.nuisances[c] += column[joint] / WINDOW as f64;
                }
            }
        }
        for row in sum.iter_mut().flatten() {
            row.torque /= (WINDOW * finer) as f64;
        }
        sum
    };
    let mut first = finer;
    while first + WINDOW * finer < samples.len() {
        for (joint, row) in window(first).into_iter().enumerate() {
            rows[joint].push(row);
        }
        first += WINDOW * finer;
    }
    rows
}

/// What positions tell of a wrong velocity: the sum over samples of its square over its noise's.
fn kinematic(effect: &HiddenEffect, simulation: &Simulation) -> f64 {
    let (HiddenKind::VelocityGain, Some(joint)) = (effect.kind(), effect.joint()) else {
        return 0.0;
    };
    let place = joint.place();
    let wrong = 1.0 - 1.0 / effect.values()[0];
    let variance = go2::VELOCITY_NOISE[place].powi(2) + go2::quanta(place)[1].powi(2) / 12.0;
    let samples = simulation.samples().map_while(Result::ok).step_by(FINER);
    samples
        .map(|s| (wrong * s.dq[place]).powi(2) / variance)
        .sum()
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix3;
    use proprio_core::go2::JointId;

    use super::*;

    fn snr(case: &Case, hidden: &[HiddenEffect]) -> f64 {
        let noise = noise(&case.known());
        let signature = Signature::new(case, hidden);
        signature.bound(case, &noise, &[]).snr
    }

    #[test]
    fn nothing_hidden_shows_nothing() {
        let case: Case = "payload:RR_thigh:0:1".parse().unwrap();
        assert_eq!(snr(&case, &[]), 0.0);
    }

    /// Else it would be of something that the size does not change.
    #[test]
    fn what_shows_grows_with_the_size() {
        let hidden = |kind, joint: &str, value| {
            let joint = JointId::from_name(joint);
            HiddenEffect::new(kind, joint, value).unwrap()
        };
        let case: Case = "payload:RR_thigh:0:1".parse().unwrap();
        for (kind, joint, value) in [
            (HiddenKind::Payload, "RR_thigh", 0.05),
            (HiddenKind::EncoderOffset, "RR_calf", 0.01),
            (HiddenKind::Spring, "RR_hip", 0.1),
        ] {
            let of = |value| Case {
                hidden: vec![hidden(kind, joint, value)],
                ..case.clone()
            };
            let (small, large) = (of(value), of(2.0 * value));
            let ratio = snr(&large, &large.hidden) / snr(&small, &small.hidden);
            assert!((ratio - 2.0).abs() < 0.2, "{kind:?}: {ratio}");
        }
    }

    /// A load is a change of the inertial parameters, and its signature their columns: told without a simulation of it.
    #[test]
    fn what_shows_of_a_load_is_what_its_inertial_parameters_show() {
        for name in [
            "payload:RL_calf:0:1",
            "payload:RR_thigh:1:1",
            "payload:FL_hip:0:1",
        ] {
            let case: Case = name.parse().unwrap();
            let noise = noise(&case.known());
            let mut signature = Signature::new(&case, &case.hidden);
            let simulated = signature.bound(&case, &noise, &[]).snr;
            let load = &case.hidden[0];
            let (mass, place) = (
                load.values()[0],
                Vector3::from_column_slice(&load.values()[1..4]),
            );
            let phi = InertialParameters::from_com(mass, place, Matrix3::zeros());
            let first = INERTIAL * load.joint().unwrap().place();
            for row in signature.rows.iter_mut().flatten().flatten() {
                row.torque = row.nuisances.fixed_rows::<INERTIAL>(first).dot(&phi.0);
            }
            let exact = signature.bound(&case, &noise, &[]).snr;
            assert!(
                (simulated / exact - 1.0).abs() < 0.05,
                "{name}: {simulated} {exact}"
            );
        }
    }
}
