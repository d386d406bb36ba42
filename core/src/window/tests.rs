use super::*;
use crate::estimator::{EFFECTS, LEG_INERTIAL, LegWindow, plausible};
use crate::go2::{Leg, leg};
use proptest::prelude::*;
use std::prelude::rust_2024::*;
use std::vec;

/// Effects of each joint that the motion below contains: viscous, coulomb, armature, bias.
pub(crate) const TRUE_EFFECTS: [[f64; 4]; 3] = [
    [0.1, 0.3, 0.005, -0.1],
    [0.2, 0.2, 0.006, 0.2],
    [0.05, 0.9, 0.017, 0.05],
];

/// The exact sample at `time_us` of a leg on sums of sines, its torque from inverse dynamics and effects.
pub(crate) fn exact(which: Leg, time_us: u64) -> Sample<f64, 3> {
    let t = time_us as f64 * 1e-6;
    let tones: [[f64; 4]; 3] = [
        [0.4, 3.1, 0.2, 7.3],
        [0.5, 2.3, 0.15, 8.9],
        [0.4, 4.7, 0.1, 11.3],
    ];
    let centre = [0.0, 0.8, -1.7];
    let joint = |n: usize, order: i32| {
        let [a, w, b, u] = tones[n];
        let phase = f64::from(order) * core::f64::consts::FRAC_PI_2;
        a * w.powi(order) * (w * t + phase).sin() + b * u.powi(order) * (u * t + 1.0 + phase).sin()
    };
    let (q, v, a) = (
        SVector::from_fn(|n, _| centre[n] + joint(n, 0)),
        SVector::from_fn(|n, _| joint(n, 1)),
        SVector::from_fn(|n, _| joint(n, 2)),
    );
    let tree = leg::<f64>(which);
    let k = tree.kinematics(&Transform::identity(), &q, &v);
    let mut tau = tree.inverse_dynamics(&k, &v, &a);
    for n in 0..3 {
        let [viscous, coulomb, armature, bias] = TRUE_EFFECTS[n];
        let sign = (v[n] / 0.035).clamp(-1.0, 1.0);
        tau[n] += viscous * v[n] + coulomb * sign + armature * a[n] + bias;
    }
    Sample {
        time_us,
        q: q.into(),
        dq: v.into(),
        tau: tau.into(),
    }
}

fn window(which: Leg) -> LegWindow<f64> {
    let settings = Settings::default();
    Window::new(
        leg(which),
        Transform::identity(),
        EFFECTS,
        plausible(which),
        settings,
    )
}

type LegRows = Rows<f64, 3, LEG_INERTIAL, 4>;

fn rows_of(samples: impl IntoIterator<Item = Sample<f64, 3>>) -> (Vec<LegRows>, Vec<Push>) {
    let mut window = window(Leg::FR);
    let (mut rows, mut pushes) = (vec![], vec![]);
    for sample in samples {
        pushes.push(window.push(&sample));
        if pushes.last() == Some(&Push::Closed) {
            rows.push(*window.rows());
        }
    }
    (rows, pushes)
}

/// Greatest difference between the rows times the true parameters and the torque, N m.
fn misfit(rows: &[LegRows]) -> f64 {
    let theta = leg::<f64>(Leg::FR).parameters::<LEG_INERTIAL>();
    let error = |row: &LegRows, b: usize| {
        let effects: f64 = (0..4).map(|e| row.effects[b][e] * TRUE_EFFECTS[b][e]).sum();
        ((row.inertial * theta)[b] + effects - row.torque[b]).abs()
    };
    rows.iter()
        .flat_map(|row| (0..3).map(move |b| error(row, b)))
        .fold(0.0, f64::max)
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn rows_hold_the_momentum_equation_to_the_order_of_the_trapezium() {
    let error = |period_us: u64| {
        let (rows, _) = rows_of((0..1_000_000 / period_us).map(|n| exact(Leg::FR, n * period_us)));
        misfit(&rows)
    };
    // Coulomb friction bends within a sample, so that the order is below two at a reversal.
    let (coarse, fine, finest) = (error(2_000), error(500), error(100));
    assert!(
        coarse < 0.08 && fine < coarse / 3.0 && finest < coarse / 10.0,
        "{coarse} {fine} {finest}"
    );
}

proptest! {
    #[test]
    #[cfg_attr(miri, ignore = "too long to interpret")]
    fn jitter_costs_no_more_than_coarse_samples(steps in prop::collection::vec(500..4_000u64, 200)) {
        let mut time = 0;
        let (rows, _) = rows_of(steps.iter().map(|step| { time += step; exact(Leg::FR, time) }));
        prop_assert!(rows.len() > 5);
        prop_assert!(misfit(&rows) < 0.3);
    }

    #[test]
    #[cfg_attr(miri, ignore = "too long to interpret")]
    fn repeated_and_late_samples_change_nothing(faults in prop::collection::vec(0..4u8, 100)) {
        let clean = (0..100).map(|n| exact(Leg::FR, n * 2_000));
        let mut faulty = vec![];
        for (sample, fault) in clean.clone().zip(&faults) {
            faulty.push(sample);
            match fault {
                // The host read the same message again, a little later.
                1 => faulty.push(Sample { time_us: sample.time_us + 700, ..sample }),
                // The same time stamp with other numbers.
                2 => faulty.push(Sample { q: [0.0, 0.5, -1.5], ..sample }),
                // An old message overtaken by a new one.
                3 => faulty.push(exact(Leg::FR, sample.time_us.saturating_sub(3_000))),
                _ => {}
            }
        }
        let (expected, _) = rows_of(clean);
        let (rows, pushes) = rows_of(faulty);
        prop_assert_eq!(rows, expected);
        let count = |push| pushes.iter().filter(|p| **p == push).count();
        prop_assert_eq!(count(Push::Repeated), faults.iter().filter(|f| **f == 1).count());
        prop_assert_eq!(count(Push::Late), faults.iter().filter(|f| **f > 1).count());
    }

    #[test]
    #[cfg_attr(miri, ignore = "too long to interpret")]
    fn no_number_makes_a_row_that_is_not_finite(
        readings in prop::collection::vec((0..20_000u64, prop::array::uniform9(any::<f64>())), 1..60),
    ) {
        let mut window = window(Leg::FR);
        let mut time_us = 0;
        for (step, r) in readings {
            time_us += step;
            // Fold wild numbers into the plausible range half of the time, so that windows do close.
            let tame = |x: f64| if step % 2 == 0 && x.is_finite() { x.sin() } else { x };
            let r = r.map(tame);
            let sample = Sample { time_us, q: [r[0], r[1], r[2]], dq: [r[3], r[4], r[5]], tau: [r[6], r[7], r[8]] };
            if window.push(&sample) == Push::Closed {
                let rows = window.rows();
                prop_assert!(rows.inertial.iter().all(|x| x.is_finite()));
                prop_assert!(rows.effects.iter().flatten().chain(&rows.torque).all(|x| x.is_finite()));
            }
        }
    }
}

#[test]
fn a_gap_is_not_bridged() {
    let before = (0..25).map(|n| exact(Leg::FR, n * 2_000));
    let hours = 4 * 3_600_000_000;
    let after = (0..25).map(|n| exact(Leg::FR, hours + n * 2_000));
    let (rows, pushes) = rows_of(before.chain(after));
    assert_eq!(pushes.iter().filter(|p| **p == Push::Gap).count(), 1);
    let spans: Vec<_> = rows.iter().map(|r| r.span_us).collect();
    assert_eq!(
        spans,
        [
            [0, 20_000],
            [20_000, 40_000],
            [hours, hours + 20_000],
            [hours + 20_000, hours + 40_000]
        ]
    );
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_clock_that_is_set_back_loses_the_open_window_and_no_other() {
    // By less than a gap that is bridged, by more than a window, by nearly all. By less than two samples it is taken for an
    // overtaken message.
    for back in [5_000, 9_999, 30_000, 1_000_000, 4_999_000] {
        let late = |n: u64| Sample {
            time_us: n * 2_000 - back,
            ..exact(Leg::FR, n * 2_000)
        };
        let (before, after) = (2_500, 25);
        let samples = (0..before).map(|n| exact(Leg::FR, n * 2_000));
        let samples = samples.chain((before..before + after).map(late));
        let (rows, pushes) = rows_of(samples);
        let count = |push| pushes.iter().filter(|p| **p == push).count();
        assert_eq!((count(Push::Late), count(Push::Gap)), (1, 1), "{back}");
        // 25 samples, the first of them late: two windows of ten steps.
        let set_back = (before + 1) * 2_000 - back;
        assert_eq!(rows.len(), 249 + 2, "{back}");
        let spans = [249, 250].map(|n: usize| rows[n].span_us);
        let ends = [set_back, set_back + 20_000, set_back + 40_000];
        assert_eq!(spans, [[ends[0], ends[1]], [ends[1], ends[2]]], "{back}");
        assert!(misfit(&rows) < 0.08, "{back}: {}", misfit(&rows));
    }
}

#[test]
fn implausible_samples_are_rejected_by_name() {
    let mut window = window(Leg::FR);
    let good = exact(Leg::FR, 0);
    let mut check = |sample: Sample<f64, 3>, reason| {
        assert_eq!(window.push(&sample), Push::Rejected(reason));
    };
    check(
        Sample {
            q: [f64::NAN, 0.8, -1.7],
            ..good
        },
        Implausible::NotFinite,
    );
    check(
        Sample {
            tau: [f64::INFINITY, 0.0, 0.0],
            ..good
        },
        Implausible::NotFinite,
    );
    check(
        Sample {
            q: [0.0, 46.0, -97.0],
            ..good
        },
        Implausible::Position,
    );
    check(
        Sample {
            dq: [0.0, 0.0, 60.0],
            ..good
        },
        Implausible::Speed,
    );
    check(
        Sample {
            tau: [0.0, -60.0, 0.0],
            ..good
        },
        Implausible::Torque,
    );
    assert_eq!(window.push(&good), Push::Used);
}
