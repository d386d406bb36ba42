//! The velocity check on sensors of known faults.

use super::super::{DataGates, Joint, Reading};
use super::*;
use proptest::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

/// How a sensor reports a motion.
#[derive(Debug, Clone, Copy)]
struct Sensor {
    gain: f64,
    lag: f64,
    offset: f64,
    /// Time constant of a first-order filter of the velocity, s.
    filter: f64,
}

/// A chirp to 9 Hz as a Go2 would log it: quanta, noise, 5 % repeats.
fn check(seed: u64, seconds: f64, sensor: Sensor) -> VelocityGain {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let noise = Normal::new(0.0, 0.035).unwrap();
    let mut gates = DataGates::new([Joint {
        name: "FR_hip".into(),
        effort: 23.7,
    }]);
    let round = |x: f64, quantum: f64| (x / quantum).round() * quantum;
    let phase = |t: f64| 0.6 * t + 0.5 * 56.0 / seconds * t * t;
    let frequency = |t: f64| 0.6 + 56.0 / seconds * t;
    let mut reading = None;
    for k in 0..(seconds * 500.0) as u64 {
        let t = k as f64 * 2e-3;
        // A filter turns and shrinks a sine; a chirp this slow is one at each moment.
        let (late, w) = (t - sensor.lag, frequency(t - sensor.lag));
        let (cosine, sine) = (phase(late).cos(), phase(late).sin());
        let x = w * sensor.filter;
        let filtered = 0.3 * w * (cosine + x * sine) / (1.0 + x * x);
        let new = Reading {
            q: round(0.3 * phase(t).sin(), 3.028e-5),
            dq: round(
                sensor.gain * filtered + sensor.offset + noise.sample(&mut random),
                3.876e-3,
            ),
            tau: 0.0,
            temperature: None,
        };
        if k % 20 != 7 {
            reading = Some(new);
        }
        gates.push(2000 * k, &[reading.unwrap_or(new)]);
    }
    gates.report().joints[0].velocity.unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Gain, lag and offset come back within their errors, whatever the filter.
    #[test]
    fn a_sensor_is_recognised(
        seed in 0u64..1000,
        gain in 0.8..1.25f64,
        lag in -4e-3..4e-3f64,
        offset in -0.1..0.1f64,
        filter in 0.0..4e-3f64,
    ) {
        let found = check(seed, 20.0, Sensor { gain, lag, offset, filter });
        // 9 blocks of freedom: five errors are one in a thousand; and the expansion's own error is (ω d)³/6 ≈ 2 %.
        prop_assert!((found.gain / gain - 1.0).abs() < 5.0 * found.gain_std + 0.01, "{found:?}");
        prop_assert!((found.lag - lag - filter).abs() < 5.0 * found.lag_std + 3e-4, "{found:?}");
        prop_assert!((found.offset - offset).abs() < 5.0 * found.offset_std + 5e-3, "{found:?}");
    }
}

/// A sensor without fault is never blamed, though it filters; one that reads 5 % too high always is.
#[test]
fn only_a_real_gain_is_significant() {
    let sensor = |gain| Sensor {
        gain,
        lag: 1e-3,
        offset: 0.02,
        filter: 3e-3,
    };
    for seed in 0..100 {
        let good = check(seed, 10.0, sensor(1.01));
        assert!(!good.differs_from(1.0, 12), "seed {seed}: {good:?}");
        let bad = check(seed, 10.0, sensor(1.05));
        assert!(bad.differs_from(1.0, 12), "seed {seed}: {bad:?}");
    }
}

#[test]
fn a_joint_at_rest_has_no_verdict() {
    let mut gates = DataGates::new([Joint {
        name: "FR_hip".into(),
        effort: 23.7,
    }]);
    for k in 0..10_000u64 {
        let reading = Reading {
            q: 3e-5 * (k % 3) as f64,
            dq: 0.01 * (k % 5) as f64,
            tau: 1.0,
            temperature: Some(30.0),
        };
        gates.push(2000 * k, &[reading]);
    }
    let report = gates.report();
    assert_eq!(report.joints[0].velocity, None);
    assert_eq!(report.joints[0].moving_percent, 0.0);
    assert_eq!(report.joints[0].temperature, Some([30.0, 30.0]));
}
