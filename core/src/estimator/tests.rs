use super::*;
use crate::go2::{ACTUATORS, Leg, leg};
use crate::spatial::Transform;
use crate::window::tests::{TRUE_EFFECTS, exact};
use crate::window::{Implausible, Push, Sample, Settings};
use std::prelude::rust_2024::*;

fn fed(which: Leg, seconds: std::ops::Range<u64>) -> LegEstimator<f64> {
    let mut estimator = LegEstimator::new(which);
    for n in seconds.start * 2_000..seconds.end * 2_000 {
        estimator.push(&exact(which, n * 500));
    }
    estimator
}

/// One leg from samples to factors at once; the application does it bit by bit.
#[derive(Clone, Debug)]
pub(crate) struct LegEstimator<T: Real> {
    window: LegWindow<T>,
    factors: LegFactors<T>,
    prior: LegPrior<T>,
}

impl<T: Real> LegEstimator<T> {
    /// A leg of a robot that hangs or stands level by its base, without data.
    pub(crate) fn new(which: Leg) -> Self {
        let window = Window::new(
            leg(which),
            Transform::identity(),
            EFFECTS,
            plausible(which),
            Settings::default(),
        );
        Self {
            window,
            factors: LegFactors::default(),
            prior: LegPrior::of(which),
        }
    }

    /// Takes the next sample; a window that it closes is folded in.
    pub(crate) fn push(&mut self, sample: &Sample<T, JOINTS_PER_LEG>) -> Push {
        let push = self.window.push(sample);
        if push == Push::Closed && self.factors.fold_window(self.window.rows()).is_err() {
            return Push::Rejected(Implausible::NotFinite);
        }
        push
    }

    /// The rows of the window closed last.
    pub(crate) fn rows(&self) -> &LegRows<T> {
        self.window.rows()
    }

    /// The data so far.
    pub(crate) fn factors(&self) -> &LegFactors<T> {
        &self.factors
    }

    /// The data so far, to forget or to merge.
    pub(crate) fn factors_mut(&mut self) -> &mut LegFactors<T> {
        &mut self.factors
    }

    /// What was taken to be true before.
    pub(crate) fn prior(&self) -> &LegPrior<T> {
        &self.prior
    }
}

/// The solution at once; the microcontroller goes step by step.
pub(crate) fn solved<T: Real>(estimator: &LegEstimator<T>) -> LegSolver<T> {
    let mut solver = LegSolver::default();
    solver.start(estimator.prior(), estimator.factors());
    while !solver.advance().unwrap() {}
    solver
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn exact_data_give_the_true_effects_and_a_small_residual() {
    for which in Leg::ALL {
        let estimator = fed(which, 0..20);
        let solution = solved(&estimator);
        for joint in 0..JOINTS_PER_LEG {
            for e in 0..EFFECTS.len() {
                let value = solution.values()[LEG.effect_index(joint, e)];
                let error = (value - TRUE_EFFECTS[joint][e]).abs();
                assert!(
                    error < 5e-3,
                    "{} {}: {error}",
                    which.joint_names()[joint],
                    EFFECTS[e].name()
                );
            }
            let windows = estimator.factors().windows();
            let rms =
                (estimator.factors().sum_of_squares(joint, solution.values()) / windows).sqrt();
            assert!(rms < 5e-3, "{rms}");
        }
    }
}

#[test]
fn without_data_the_solution_is_the_prior() {
    let estimator = LegEstimator::<f64>::new(Leg::RL);
    let solution = solved(&estimator);
    let cad = leg::<f64>(Leg::RL).parameters::<LEG_INERTIAL>();
    for k in 0..LEG_INERTIAL {
        assert!((solution.values()[k] - cad[k]).abs() < 1e-9);
    }
    let armature = solution.values()[LEG.effect_index(2, 2)];
    assert!((armature - ACTUATORS[2].armature()).abs() < 1e-9);
    let mass = solution.std()[0] / cad[0];
    assert!((mass - CAD_UNCERTAINTY).abs() < 1e-6, "{mass}");
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn what_a_motion_does_not_show_keeps_the_prior() {
    // A leg that hangs still shows gravity and bias together, nothing else.
    let mut estimator = LegEstimator::<f64>::new(Leg::FR);
    for n in 0..2_000_u64 {
        let wiggle = if n % 2 == 0 { 1e-5 } else { 0.0 };
        let sample = Sample {
            time_us: n * 2_000,
            q: [wiggle, 0.8, -1.7],
            dq: [0.0; 3],
            tau: [-0.6, 0.9, 1.3],
        };
        estimator.push(&sample);
    }
    let solution = solved(&estimator);
    let prior = solved(&LegEstimator::<f64>::new(Leg::FR));
    let (mean, std) = (prior.values(), prior.std());
    for joint in 0..JOINTS_PER_LEG {
        for e in [0, 2] {
            let k = LEG.effect_index(joint, e);
            assert!(
                (solution.values()[k] - mean[k]).abs() < 0.02 * std[k],
                "{}",
                EFFECTS[e].name()
            );
            assert!(solution.std()[k] > 0.98 * std[k]);
        }
    }
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn halves_merge_to_the_whole() {
    let mut window = LegEstimator::<f64>::new(Leg::FL);
    let (mut even, mut odd) = (LegFactors::default(), LegFactors::default());
    let mut windows = 0;
    for n in 0..20_000 {
        if window.push(&exact(Leg::FL, n * 500)) == Push::Closed {
            windows += 1;
            let half = if windows % 2 == 0 {
                &mut even
            } else {
                &mut odd
            };
            half.fold_window(window.rows()).unwrap();
        }
    }
    odd.merge(&even, &mut [0.0; LEG.columns(0) + 1]).unwrap();
    let mut merged = LegEstimator::new(Leg::FL);
    *merged.factors_mut() = odd;
    let (a, b) = (solved(&merged), solved(&window));
    for k in 0..LEG_PARAMETERS {
        assert!((a.values()[k] - b.values()[k]).abs() < 1e-9 * (1.0 + b.values()[k].abs()));
        assert!((a.std()[k] - b.std()[k]).abs() < 1e-9 * (1.0 + b.std()[k]));
    }
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn the_number_of_steps_does_not_depend_on_the_data() {
    let steps = |estimator: &LegEstimator<f64>| {
        let mut solver = LegSolver::default();
        solver.start(estimator.prior(), estimator.factors());
        (1..).find(|_| solver.advance().unwrap()).unwrap()
    };
    assert_eq!(
        steps(&LegEstimator::new(Leg::FR)),
        steps(&fed(Leg::FR, 0..2))
    );
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn f32_agrees_with_f64() {
    let mut single = LegEstimator::<f32>::new(Leg::FR);
    for n in 0..10_000_u64 {
        let s = exact(Leg::FR, n * 2_000);
        let narrow = |x: [f64; 3]| x.map(|x| x as f32);
        let sample = Sample {
            time_us: s.time_us,
            q: narrow(s.q),
            dq: narrow(s.dq),
            tau: narrow(s.tau),
        };
        single.push(&sample);
    }
    let mut double = LegEstimator::<f64>::new(Leg::FR);
    (0..10_000).for_each(|n| {
        double.push(&exact(Leg::FR, n * 2_000));
    });
    let (a, b) = (solved(&single), solved(&double));
    for k in 0..LEG_PARAMETERS {
        let sigmas = (f64::from(a.values()[k]) - b.values()[k]).abs() / b.std()[k];
        assert!(sigmas < 0.2, "parameter {k}: {sigmas} sigma");
    }
}

/// The columns of a leg are dependent; how the rows were gathered must not show in the noise all the same.
#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn the_noise_does_not_depend_on_how_the_rows_were_gathered() {
    let mut window = LegEstimator::<f64>::new(Leg::RR);
    let mut single = LegFactors::<f32>::default();
    let mut parts = [LegFactors::default(); 5];
    let mut state = 3_u64;
    for n in 0..10_000 {
        let mut sample = exact(Leg::RR, n * 2_000);
        for tau in &mut sample.tau {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            *tau += 0.3 * ((state >> 33) as f64 / f64::from(1 << 30) - 1.0);
        }
        if window.push(&sample) == Push::Closed {
            let rows = *window.window.rows();
            parts[(n / 2_500) as usize % 5].fold_window(&rows).unwrap();
            let narrow = LegRows {
                span_us: rows.span_us,
                inertial: rows.inertial.map(|x| x as f32),
                effects: rows.effects.map(|e| e.map(|x| x as f32)),
                torque: rows.torque.map(|x| x as f32),
            };
            single.fold_window(&narrow).unwrap();
        }
    }
    let mut merged = parts[4];
    for part in &parts[..4] {
        merged.merge(part, &mut [0.0; LEG.columns(0) + 1]).unwrap();
    }
    for joint in 0..JOINTS_PER_LEG {
        let noise = window.factors().noise(joint);
        assert!((merged.noise(joint) / noise - 1.0).abs() < 1e-6, "{joint}");
        assert!(
            (f64::from(single.noise(joint)) / noise - 1.0).abs() < 1e-3,
            "{joint}"
        );
    }
}
