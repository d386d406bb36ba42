//! Ranges that are there and laws that have none.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::search::Found;
use super::*;
use crate::equation::dot::dot;

const WINDOW: f64 = 0.02;
const COUNT: usize = 1500;
const NOISE: f64 = 0.02;

/// A joint that swings with two frequencies.
fn found(seed: u64, acts: impl Fn(f64, f64, f64) -> f64) -> Option<Found> {
    let swing = |t: f64| {
        let (a, b) = (2.3 * t, 3.7 * t + 1.0);
        [
            0.7 * a.sin() + 0.5 * b.sin(),
            1.61 * a.cos() + 1.85 * b.cos(),
            -3.703 * a.sin() - 6.845 * b.sin(),
        ]
    };
    found_in(swing, seed, |t, [q, dq, _]| acts(t, q, dq))
}

/// A motion's joint, seen by the columns of gravity, inertia and a drive, with noise and what else acts.
fn found_in(
    motion: impl Fn(f64) -> [f64; 3],
    seed: u64,
    acts: impl Fn(f64, [f64; 3]) -> f64,
) -> Option<Found> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || {
        let uniform = (0..12).map(|_| f64::from(rng.next_u32()) / f64::from(u32::MAX));
        uniform.sum::<f64>() - 6.0
    };
    let t: Vec<f64> = (0..COUNT).map(|k| WINDOW * k as f64).collect();
    let [q, dq, ddq] = [0, 1, 2].map(|n| {
        let motion = &motion;
        move |t: f64| motion(t)[n]
    });
    let each = |of: &dyn Fn(f64) -> f64| t.iter().map(|&t| of(t)).collect::<Vec<f64>>();
    let columns = [
        each(&|_| 1.0),
        each(&|t| q(t).sin()),
        each(&|t| q(t).cos()),
        each(&dq),
        each(&|t| dq(t).signum()),
        each(&ddq),
    ];
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for column in columns {
        basis.extend(orthonormal(column, &basis));
    }
    let mut left: Vec<f64> = (t.iter())
        .map(|&t| acts(t, motion(t)) + NOISE * normal())
        .collect();
    // What a fit to all windows leaves.
    for b in &basis {
        let share = dot(b, &left);
        left.iter_mut().zip(b).for_each(|(x, b)| *x -= share * b);
    }
    let variables = [
        (Some(RegimeOf::Position), each(&q)),
        (Some(RegimeOf::Speed), each(&|t| dq(t).abs())),
        (Some(RegimeOf::Direction), each(&dq)),
        (Some(RegimeOf::Time), t.clone()),
        (None, envelope(&t, &each(&dq))),
        (None, envelope(&t, &each(&ddq))),
    ];
    Residual::new(left, &basis, 0.03).find(&variables, Some(NOISE * NOISE))
}

/// A sweep: its frequency is its time.
fn sweep(t: f64) -> [f64; 3] {
    let (phase, rate) = (t + 0.1 * t * t, 1.0 + 0.2 * t);
    [
        0.6 * phase.sin(),
        0.6 * rate * phase.cos(),
        0.12 * phase.cos() - 0.6 * rate * rate * phase.sin(),
    ]
}

#[test]
fn noise_lives_nowhere() {
    for seed in 0..60 {
        assert_eq!(found(seed, |_, _, _| 0.0), None, "{seed}");
        assert_eq!(found_in(sweep, seed, |_, _| 0.0), None, "{seed}");
    }
}

/// Laws that hold everywhere, with position, speed, acceleration and time.
#[test]
fn what_acts_everywhere_has_no_range() {
    type Law = fn(f64, [f64; 3]) -> f64;
    let laws: [(&str, Law); 9] = [
        ("q^3", |_, [q, ..]| 0.5 * q.powi(3)),
        ("q*sign(dq)", |_, [q, dq, _]| 0.3 * q * dq.signum()),
        ("sin(9*q)", |_, [q, ..]| 0.3 * (9.0 * q).sin()),
        ("sin(7*q)*sign(dq)", |_, [q, dq, _]| {
            0.3 * (7.0 * q).sin() * dq.signum()
        }),
        ("dq*abs(dq)", |_, [_, dq, _]| 0.05 * dq * dq.abs()),
        ("ddq*abs(dq)", |_, [_, dq, ddq]| 0.004 * ddq * dq.abs()),
        ("exp(-t/8)*sign(dq)", |t, [_, dq, _]| {
            0.3 * (-t / 8.0).exp() * dq.signum()
        }),
        ("exp(-t/8)*dq", |t, [_, dq, _]| 0.1 * (-t / 8.0).exp() * dq),
        ("t", |t, _| 0.01 * t),
    ];
    for (name, law) in laws {
        for seed in 0..3 {
            assert_eq!(found(seed, |t, q, dq| law(t, [q, dq, 0.0])), None, "{name}");
            assert_eq!(found_in(sweep, seed, law), None, "{name}, a sweep");
        }
    }
}

/// The position of a stop to a tenth of the range, a moment to a fiftieth of the log; neither is on a grid.
#[test]
fn a_range_is_found_where_it_is() {
    let near = |edge: Option<Edge>, truth: f64, most: f64| {
        let edge = edge.unwrap();
        assert!((edge.value - truth).abs() < most, "{edge:?} {truth}");
        assert!(edge.std < most, "{edge:?}");
    };
    let (angle, time) = (0.1 * 2.4, 0.02 * WINDOW * COUNT as f64);
    for (seed, share) in [(1, 0.137), (2, 0.333), (3, 0.481), (4, 0.662), (5, 0.871)] {
        let stop = -0.4 + 0.8 * share;
        let own = found(seed, |_, q, _| 3.0 * (q - stop).max(0.0)).unwrap();
        assert_eq!(own.variable, RegimeOf::Position);
        // Where a spring beyond and gravity below are as good as gravity and a stop, the edge is what these data show.
        assert!(own.edges[1].is_none() || own.change, "{own:?}");
        near(own.edges[0].or(own.edges[1]), stop, angle);
        let moment = 6.0 + 17.0 * share;
        let change = |t: f64, _: f64, dq: f64| {
            if t > moment { 0.2 * dq.signum() } else { 0.0 }
        };
        let own = found(seed, change).unwrap();
        assert_eq!((own.variable, own.edges[1]), (RegimeOf::Time, None));
        near(own.edges[0], moment, time);
        let catches = |_: f64, q: f64, dq: f64| {
            let is_in = (stop..stop + 0.35).contains(&q);
            if is_in { 0.3 * dq.signum() } else { 0.0 }
        };
        let own = found(seed, catches).unwrap();
        assert_eq!((own.variable, own.change), (RegimeOf::Position, false));
        near(own.edges[0], stop, angle);
        near(own.edges[1], stop + 0.35, angle);
        let shakes = |t: f64, _: f64, dq: f64| {
            if dq.abs() > 1.7 {
                0.2 * (97.0 * t).sin()
            } else {
                0.0
            }
        };
        let own = found(seed, shakes).unwrap();
        assert_eq!((own.variable, own.edges[1]), (RegimeOf::Speed, None));
        near(own.edges[0], 1.7, 0.1 * 3.4);
    }
}

#[test]
fn a_direction_is_one() {
    let one_way = |_: f64, q: f64, dq: f64| if dq > 0.0 { 0.4 * (9.0 * q).sin() } else { 0.0 };
    let own = found(7, one_way).unwrap();
    assert_eq!(own.variable, RegimeOf::Direction);
    assert!(own.edges[0].is_some() && own.edges[1].is_none());
}

#[test]
fn words_and_conditions() {
    let edge = |value, std| Some(Edge { value, std });
    let regime = |of, edges| Regime::new("FR_calf", (of, false), (edges, false));
    let stop = regime(RegimeOf::Position, [edge(1.2042, 0.011), None]);
    assert_eq!(
        stop.words_with_conditions(),
        "only beyond 1.204 ±0.011 rad (`--only 'FR_calf:q>1.204'`)"
    );
    let change = regime(RegimeOf::Time, [edge(31.4, 0.02), None]);
    assert_eq!(
        change.words_with_conditions(),
        "from 31.400 ±0.020 s on (`--only 't>31.400'`)"
    );
    let spring = Regime {
        change: true,
        ..stop
    };
    assert_eq!(spring.words(), "another beyond 1.204 ±0.011 rad");
    let load = regime(RegimeOf::Load, [None, edge(4.0, 0.3)]);
    assert_eq!(
        load.words_with_conditions(),
        "only below 4.00 ±0.30 N m of load"
    );
    let one_way = regime(RegimeOf::Direction, [edge(0.0, 0.0), None]);
    assert_eq!(
        one_way.words_with_conditions(),
        "only in the positive direction (`--only 'FR_calf:dq>0'`)"
    );
}
