//! What goes wrong is recognised.

use super::*;

/// What goes wrong in each case, and the variable and shape that tell it.
type Case = (&'static str, fn(&Joint, usize) -> f64, Variable, Shape, f64);

const CASES: [Case; 9] = [
    ("offset", |_, _| 0.1, Variable::Constant, Shape::Offset, 0.1),
    (
        "friction",
        |j, k| 0.2 * j.dq[k].signum(),
        Variable::Velocity,
        Shape::Step,
        0.2,
    ),
    (
        "viscous",
        |j, k| 0.1 * j.dq[k],
        Variable::Velocity,
        Shape::Viscous,
        0.1,
    ),
    (
        "even",
        |j, k| 0.1 * j.dq[k].abs(),
        Variable::Speed,
        Shape::Even,
        0.1,
    ),
    (
        "spring",
        |j, k| 0.5 * j.q[k],
        Variable::Position,
        Shape::Spring,
        0.5,
    ),
    (
        "drift",
        |j, k| 0.02 * j.t[k],
        Variable::Time,
        Shape::Drift,
        0.02,
    ),
    (
        "load friction",
        |j, k| 0.2 * (j.tau[k] - j.residual[k]).abs() * j.dq[k].signum(),
        Variable::Load,
        Shape::LoadFriction,
        0.2,
    ),
    (
        "warmth",
        |j, k| 0.03 * (j.temperature[k] - 37.5),
        Variable::Temperature,
        Shape::Warmth,
        0.03,
    ),
    (
        "too much friction",
        |j, k| -0.2 * j.dq[k].signum(),
        Variable::Velocity,
        Shape::Step,
        -0.2,
    ),
];

#[test]
fn each_pattern_is_recognised() {
    for (name, error, variable, shape, size) in CASES {
        for noise in [HALF, COLOURED] {
            let criticism = Joint::new(1000, 3, noise).with(error).criticise();
            let strongest = criticism.patterns.first();
            let Some(found) = strongest else {
                panic!("{name}: nothing found\n{criticism}");
            };
            println!("{name}\n{criticism}");
            assert_eq!(
                (found.variable, found.shape),
                (variable, Some(shape)),
                "{name}\n{criticism}"
            );
            let [value, std] = found.size.unwrap();
            assert!(
                (value - size).abs() < 5.0 * std + 0.05 * size.abs(),
                "{name}: {value} ± {std}"
            );
            // What is seen and no more: no cause, no other shape.
            assert!(found.sentence.starts_with(&found.observation));
            for guess in ["looks like", "friction", "would fit"] {
                assert!(!found.observation.contains(guess), "{}", found.observation);
            }
        }
    }
}

/// A mean that is most of the error comes first, and what varies beside it has its share of the mean square and not of the variance.
#[test]
fn shares_are_of_the_mean_square() {
    let error = |joint: &Joint, k: usize| 2.0 + 0.5 * joint.dq[k].signum();
    let criticism = Joint::new(1000, 3, HALF).with(error).criticise();
    let share = |shape: Shape| {
        let mut all = criticism.patterns.iter();
        let found = all.find(|p| p.shape == Some(shape));
        found
            .unwrap_or_else(|| panic!("{shape:?}: {criticism}"))
            .share
    };
    assert_eq!(
        criticism.patterns[0].shape,
        Some(Shape::Offset),
        "{criticism}"
    );
    // 2² and 0.5² of their sum and the noise's 0.1².
    let whole = 4.0 + 0.25 + 0.01;
    assert!(
        (share(Shape::Offset) - 4.0 / whole).abs() < 0.03,
        "{criticism}"
    );
    assert!(
        (share(Shape::Step) - 0.25 / whole).abs() < 0.02,
        "{criticism}"
    );
}

#[test]
fn cogging_is_recognised_with_its_frequency() {
    let cog = |joint: &Joint, k: usize| 0.2 * (std::f64::consts::TAU * 12.0 * joint.q[k]).sin();
    // Slow enough for windows not to average it away.
    let mut joint = Joint::new(2000, 5, WHITE);
    joint.q = joint.t.iter().map(|t| 0.3 * (1.1 * t).sin()).collect();
    joint.dq = joint.t.iter().map(|t| 0.33 * (1.1 * t).cos()).collect();
    let criticism = joint.with(cog).criticise();
    let found = criticism
        .patterns
        .iter()
        .find(|p| p.variable == Variable::Position)
        .unwrap();
    let Some(Shape::Periodic { per_radian, .. }) = found.shape else {
        panic!("{criticism}");
    };
    assert!((per_radian - 12.0).abs() < 1.0, "{criticism}");
}

/// Both of two errors are told, each with its size.
#[test]
fn two_patterns_are_told_apart() {
    let error = |joint: &Joint, k: usize| 0.3 * joint.dq[k].signum() + 0.03 * (joint.t[k] - 10.0);
    let criticism = Joint::new(1000, 4, HALF).with(error).criticise();
    let size = |shape: Shape| {
        let found = criticism.patterns.iter().find(|p| p.shape == Some(shape));
        found
            .unwrap_or_else(|| panic!("no {shape:?}\n{criticism}"))
            .size
            .unwrap()[0]
    };
    assert!((size(Shape::Step) - 0.3).abs() < 0.05, "{criticism}");
    assert!((size(Shape::Drift) - 0.03).abs() < 0.005, "{criticism}");
    assert_eq!(criticism.patterns.len(), 2, "{criticism}");
    assert!(criticism.structure() > 0.0);
}

/// Friction with and without speed are of one variable, and neither hides the other.
#[test]
fn two_shapes_of_one_variable_are_told() {
    let error = |joint: &Joint, k: usize| 0.3 * joint.dq[k].signum() + 0.1 * joint.dq[k];
    let criticism = Joint::new(1000, 4, HALF).with(error).criticise();
    let told = criticism
        .patterns
        .iter()
        .map(|p| (p.shape, p.size.unwrap()));
    let mut told: Vec<_> = told.collect();
    told.sort_by(|a, b| a.1[0].total_cmp(&b.1[0]));
    assert_eq!(told.len(), 2, "{criticism}");
    let expected = [(Shape::Viscous, 0.1), (Shape::Step, 0.3)];
    for ((shape, [size, std]), (expected, truth)) in told.into_iter().zip(expected) {
        assert_eq!(shape, Some(expected), "{criticism}");
        assert!(
            (size - truth).abs() < 5.0 * std + 0.05 * truth,
            "{criticism}"
        );
    }
}

/// Gravity goes with position: a spring and a torque scale are told as look-alikes.
#[test]
fn look_alikes_are_told() {
    let criticism = Joint::new(1000, 4, HALF)
        .with(|joint, k| 0.8 * joint.q[k])
        .criticise();
    let found = &criticism.patterns[0];
    assert_eq!(
        (found.shape, found.alternatives.as_slice()),
        (Some(Shape::Spring), &[Shape::Gain][..]),
        "{criticism}"
    );
    let echo = criticism
        .everywhere
        .iter()
        .find(|w| w.variable == Variable::Load)
        .unwrap();
    assert_eq!(echo.echo_of, Some(Variable::Position), "{criticism}");
}

/// The same of a joint that slides: nothing is told of it in rad, and no torque.
#[test]
fn a_pattern_of_a_sliding_joint_is_told_in_its_units() {
    for (name, error, ..) in CASES {
        let joint = Joint::new(1000, 3, HALF).with(error);
        let [turning, sliding] = [false, true].map(|slides| {
            let series = Series {
                slides,
                ..joint.series()
            };
            criticise(&[series]).remove(0).patterns.remove(0).sentence
        });
        assert!(turning.contains("torque"), "{name}: {turning}");
        for word in ["torque", "rad", "N m"] {
            assert!(!sliding.contains(word), "{name}: {sliding}");
        }
    }
}

/// Nothing panics and nothing is found where there is nothing: no windows, few windows, a joint at rest, a perfect model.
#[test]
fn empty_and_silent_series_are_no_trouble() {
    for n in [0, 1, 2, 10, 200] {
        for residual in [0.0, 0.1] {
            let zero = vec![0.0; n];
            let t: Vec<f64> = (0..n).map(|k| 0.02 * k as f64).collect();
            let series = Series {
                joint: "FR_hip",
                t: &t,
                q: &zero,
                dq: &zero,
                tau: &zero,
                residual: &vec![residual; n],
                temperature: None,
                contact: Some(&zero),
                slides: false,
                noise: None,
            };
            let found = criticise(&[series]).remove(0);
            let told = found.patterns.len();
            assert!(
                told <= 1 && (residual > 0.0 || told == 0),
                "{n} {residual}: {found}"
            );
        }
    }
}

/// Friction that is another from one moment on has no mean and no pattern throughout: it is found with its moment.
#[test]
fn a_change_at_one_moment_is_found() {
    type Change = (Changing, fn(&Joint, usize) -> f64, f64);
    let changes: [Change; 3] = [
        (Changing::Friction, |j, k| 0.2 * j.dq[k].signum(), 0.2),
        (Changing::Viscous, |j, k| 0.4 * j.dq[k], 0.4),
        (Changing::Offset, |_, _| 0.2, 0.2),
    ];
    for (of, error, size) in changes {
        for (share, noise) in [(0.3, HALF), (0.55, COLOURED), (0.7, WHITE)] {
            let mut joint = Joint::new(1000, 7, noise);
            // A motion that is the same throughout: in a chirp a change of viscous friction is one of speed as well.
            joint.q = joint.t.iter().map(|t| 0.3 * (2.3 * t).sin()).collect();
            joint.dq = joint.t.iter().map(|t| 0.69 * (2.3 * t).cos()).collect();
            let begun = 20.0 * share;
            // As a fit of the whole log leaves it: less what is usual before and after.
            let changed = |joint: &Joint, k: usize| {
                let later = f64::from(u8::from(joint.t[k] > begun));
                error(joint, k) * (later - (1.0 - share))
            };
            let values: Vec<f64> = (0..joint.t.len()).map(|k| changed(&joint, k)).collect();
            for (k, value) in values.into_iter().enumerate() {
                joint.residual[k] += value;
                joint.tau[k] += value;
            }
            let criticism = joint.criticise();
            let found = criticism.patterns.iter().find_map(|p| match p.shape {
                Some(Shape::Change { of, at }) => Some((of, at, p.size.unwrap())),
                _ => None,
            });
            let Some((what, at, [value, std])) = found else {
                panic!("{of:?} at {begun}: {criticism}");
            };
            assert_eq!(what, of, "{criticism}");
            assert!((at - begun).abs() < 0.05 * 20.0, "{at} for {begun}");
            assert!(
                (value - size).abs() < 5.0 * std + 0.05 * size,
                "{value} ± {std}"
            );
        }
    }
}

/// A short log, whose single bins have few batches: all of them together show what each leaves open.
#[test]
fn a_curved_pattern_of_a_short_log_is_found() {
    let error = |joint: &Joint, k: usize| 0.5 * (30.0 * joint.q[k]).sin();
    let criticism = Joint::new(150, 3, WHITE).with(error).criticise();
    assert!(
        criticism
            .patterns
            .iter()
            .any(|p| p.variable == Variable::Position),
        "{criticism}"
    );
}
