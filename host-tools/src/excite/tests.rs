//! Slopes, proofs and what a design of one leg reaches.

use nalgebra::DMatrix;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::cost::Cost;
use super::problem::Problem;
use super::setup::Setup;
use super::*;

struct Quiet;

impl Supervisor for Quiet {
    fn stop(&self) -> bool {
        false
    }

    fn progress(&self, _: usize, _: usize, _: Option<f64>) {}
}

fn setup(settings: &Settings) -> Setup {
    let model = Model::default();
    let limbs = model.robot().limbs();
    Setup::new(&model, &limbs[0], settings, true).unwrap()
}

fn small() -> Settings {
    Settings {
        harmonics: 4,
        starts: 2,
        ..Settings::default()
    }
}

fn random(n: usize, seed: u64, size: f64) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..n).map(|_| rng.random_range(-size..size)).collect()
}

/// Cost plus pushed constraints, as the optimiser sees them.
fn value(problem: &Problem, goal: &Cost, x: &[f64], pushes: &[f64]) -> f64 {
    let of = problem.evaluate(x, 0.9);
    let pushed = of.constraints.iter().zip(pushes).map(|(c, p)| c * p);
    problem.cost(&of, goal).unwrap().cost + pushed.sum::<f64>()
}

#[test]
fn slopes_by_the_unknowns_are_exact_for_every_goal() {
    use proprio_core::effect::EffectKind as E;
    let separate = |a, b| Goal::Separation {
        effects: [a, b],
        joint: Some("FR_thigh".to_owned()),
    };
    let goals = [
        Goal::Condition,
        Goal::Determinant,
        Goal::Variance(vec!["m:FR_calf".to_owned(), "coulomb:FR_hip".to_owned()]),
        separate(E::Stribeck, E::QuadraticDrag),
        separate(E::LoadFriction, E::Coulomb),
        separate(E::Armature, E::Payload),
    ];
    for goal in goals {
        let Setup { problem, goal, .. } = setup(&Settings { goal, ..small() });
        let goal = match goal {
            Cost::Condition { .. } => Cost::Condition { power: 2.0 },
            other => other,
        };
        let x = random(problem.unknowns(), 1, 0.5);
        let d = random(problem.unknowns(), 2, 1.0);
        let pushes: Vec<f64> = random(problem.constraints(), 3, 0.1)
            .iter()
            .map(|p| p.abs())
            .collect();
        let of = problem.evaluate(&x, 0.9);
        let m = problem.cost(&of, &goal).unwrap().slope;
        let slopes = problem.slopes(&of, &m, &pushes, 0.9);
        let slope: f64 = slopes.iter().zip(&d).map(|(a, b)| a * b).sum();
        let at = |h: f64| {
            let there: Vec<f64> = x.iter().zip(&d).map(|(x, d)| x + h * d).collect();
            value(&problem, &goal, &there, &pushes)
        };
        let h = 1e-6;
        let expected = (at(h) - at(-h)) / (2.0 * h);
        assert!(
            (slope - expected).abs() < 2e-5 * (1.0 + expected.abs()),
            "{goal:?}: {slope} {expected}"
        );
    }
}

#[test]
fn the_regressor_and_the_torque_are_the_cores() {
    let problem = setup(&small()).problem;
    let tree = proprio_core::go2::leg::<f64>(proprio_core::go2::Leg::FR);
    for seed in 0..20 {
        let part = |n: u64| random(3, 3 * seed + n, 4.0);
        let at = Instant {
            q: part(0),
            dq: part(1),
            ddq: part(2),
        };
        let vector = |of: &[f64]| nalgebra::Vector3::from_column_slice(of);
        let k = tree.kinematics(
            &proprio_core::spatial::Transform::identity(),
            &vector(&at.q),
            &vector(&at.dq),
        );
        let expected = tree.inverse_dynamics_regressor::<30>(&k, &vector(&at.dq), &vector(&at.ddq));
        let mut w = vec![0.0; 90];
        problem.limb.regressor(&at, &mut w);
        let found = DMatrix::from_row_slice(3, 30, &w);
        assert!((found - expected).amax() < 1e-12);
    }
}

#[test]
fn series_are_exact_integrals_at_rest_at_both_ends() {
    let problem = setup(&small()).problem;
    let motion = problem.motion(&random(problem.unknowns(), 5, 1.0), 3);
    for j in 0..3 {
        for t in [0.0, motion.period, motion.duration()] {
            let [q, dq, ddq, _] = motion.at(j, t);
            assert!((q - problem.pose[j]).abs() < 1e-12 && dq.abs() < 1e-12 && ddq.abs() < 1e-11);
        }
        let h = 1e-5;
        for n in 1..200 {
            let t = motion.duration() * f64::from(n) / 201.0;
            let [before, now, after] = [t - h, t, t + h].map(|t| motion.at(j, t));
            for d in 0..3 {
                let slope = (after[d] - before[d]) / (2.0 * h);
                assert!(
                    (slope - now[d + 1]).abs() < 1e-6 * (1.0 + now[d + 1].abs() * 100.0),
                    "{d} at {t}"
                );
            }
            for (d, value) in now.iter().enumerate().skip(1) {
                assert!(
                    value.abs()
                        <= motion.joints[j].derivative_bound(motion.period, d as i32) + 1e-9
                );
            }
        }
    }
}

/// A motion within the limits at samples is proved, one that is beyond is refused by the name of the limit; the proof agrees
/// with 10 000 samples a second.
#[test]
fn proofs_agree_with_a_dense_check() {
    let problem = setup(&small()).problem;
    let (mut within, mut beyond) = (0, 0);
    for seed in 0..30 {
        let size = 0.05 * 1.15f64.powi(seed as i32);
        let motion = problem.motion(&random(problem.unknowns(), seed, size), 1);
        let violations = proof::violations(&problem, &motion);
        let densest = proof::densest(&problem, &motion, 1e4);
        if violations.is_empty() {
            assert!(densest <= 0.0, "{densest}");
            within += 1;
        } else {
            // Between two samples a limit may be touched, but not by much.
            assert!(densest > -1e-4, "{densest} {violations:?}");
            beyond += 1;
        }
    }
    assert!(within > 5 && beyond > 5, "{within} {beyond}");
}

/// One leg, 10 s, as the command designs it but with fewer starts: well-conditioned, within all limits at 10 kHz and, with
/// parameters off by their uncertainty, within the torque limits.
#[test]
fn a_leg_is_excited_within_its_limits() {
    let model = Model::default();
    let limbs = &model.robot().limbs()[..1];
    let settings = Settings {
        starts: 8,
        seed: 4,
        ..Settings::default()
    };
    let designs = design(&model, limbs, &settings, &Quiet).unwrap();
    let found = &designs[0];
    assert!(found.violations.is_empty(), "{:?}", found.violations);
    assert!(found.dense_check(1e4) <= 0.0);
    assert_eq!(found.measures.rank, 17);
    let m = found.measures;
    assert!(m.condition_number < 16.0, "{m:?}");
    // No random motion comes near it.
    let random = RandomMotions::new(&model, &limbs[0], &settings).unwrap();
    let best = (0..300)
        .filter_map(|n| random.condition_number(n))
        .fold(f64::INFINITY, f64::min);
    assert!(best > 1.5 * m.condition_number, "{best} {m:?}");
    let one = random.motion(7).unwrap();
    assert!(one.dense_check(1e4) <= 0.0 && one.measures.rank == 17);
    assert!(
        found
            .history
            .windows(2)
            .all(|w| w[1].cost < w[0].cost && w[1].seconds >= w[0].seconds)
    );
    off_by_the_uncertainty(found, settings.margins.uncertainty);
}

#[test]
fn the_same_seed_gives_the_same_motion_however_threads_are_scheduled() {
    let model = Model::default();
    let limbs = &model.robot().limbs()[..1];
    let motion = || {
        design(&model, limbs, &small(), &Quiet).unwrap()[0]
            .motion
            .clone()
    };
    assert_eq!(motion(), motion());
}

/// Torques of inertias and friction each off by up to `share` stay within the limits.
fn off_by_the_uncertainty(design: &LimbDesign, share: f64) {
    let problem = &design.problem;
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    for _ in 0..20 {
        let off: Vec<f64> = problem
            .theta
            .iter()
            .map(|x| x * (1.0 + rng.random_range(-share..share)))
            .collect();
        let known: Vec<f64> = problem
            .known
            .iter()
            .map(|(_, value)| value * rng.random_range(-share..share))
            .collect();
        for k in 0..500 {
            let t = design.motion.period * f64::from(k) / 500.0;
            let command = design.command(t);
            let at = Instant {
                q: command.q,
                dq: command.dq,
                ddq: command.ddq,
            };
            let mut w = vec![0.0; 90];
            problem.limb.regressor(&at, &mut w);
            for c in 0..3 {
                let change: f64 = (0..30)
                    .map(|p| w[30 * c + p] * (off[p] - problem.theta[p]))
                    .sum();
                let friction: f64 = problem
                    .known
                    .iter()
                    .zip(&known)
                    .filter(|((column, _), _)| column.joint == c)
                    .map(|((column, _), off)| {
                        off * column.term([at.q[c], at.dq[c], at.ddq[c]], 0.0).value
                    })
                    .sum();
                assert!(
                    (command.tau[c] + change + friction).abs() <= problem.limits.joints[c].torque
                );
            }
        }
    }
}

#[test]
fn what_leaves_no_motion_is_named() {
    let model = Model::default();
    let limbs = &model.robot().limbs()[..1];
    let error = |settings: Settings| {
        design(&model, limbs, &settings, &Quiet)
            .unwrap_err()
            .to_string()
    };
    let margins = Margins::default();
    let pose = error(Settings {
        pose: vec![("FR_calf".to_owned(), -3.0)],
        ..small()
    });
    assert!(pose.contains("position of FR_calf"), "{pose}");
    let stops = error(Settings {
        margins: Margins {
            position: 1.2,
            ..margins
        },
        ..small()
    });
    assert!(stops.contains("FR_hip cannot move"), "{stops}");
    // Holding the leg takes more than a hundredth of the motors' torque.
    let weak = error(Settings {
        margins: Margins {
            torque: 0.01,
            ..margins
        },
        ..small()
    });
    assert!(weak.contains("torque of FR_"), "{weak}");
    let unknown = error(Settings {
        pose: vec![("FR_knee".to_owned(), 0.0)],
        ..small()
    });
    assert!(unknown.contains("FR_knee"), "{unknown}");
    for (settings, what) in [
        (
            Settings {
                duration: 0.0,
                ..small()
            },
            "duration",
        ),
        (
            Settings {
                margins: Margins {
                    velocity: f64::NAN,
                    ..margins
                },
                ..small()
            },
            "speed",
        ),
        (
            Settings {
                harmonics: 1,
                ..small()
            },
            "waves",
        ),
        (
            Settings {
                goal: Goal::Variance(vec!["m:FR_foot".to_owned()]),
                ..small()
            },
            "m:FR_foot",
        ),
    ] {
        let error = error(settings);
        assert!(error.contains(what), "{error}");
    }
}
