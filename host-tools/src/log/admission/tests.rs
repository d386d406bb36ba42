//! Motions of robots and rates of any kind: rows that no robot can have produced are left out, and no other.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::PathBuf;

use proptest::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::super::{LogError, LogReader, Problem, Selection, Warning};
use super::Cause;
use crate::model::Robot;

/// Joints of a chain without stated limits, or with.
fn urdf(joints: usize, limits: bool) -> String {
    let mut text = "<robot name=\"chain\"><link name=\"l0\"/>".to_owned();
    for n in 1..=joints {
        let limit = match limits {
            true => "<limit lower=\"-3\" upper=\"3\" effort=\"40\" velocity=\"8\"/>",
            false => "",
        };
        let kind = if limits { "revolute" } else { "continuous" };
        write!(
            text,
            "<link name=\"l{n}\"><inertial><mass value=\"1\"/><inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial></link>\
             <joint name=\"j{n}\" type=\"{kind}\"><parent link=\"l{}\"/><child link=\"l{n}\"/><axis xyz=\"0 1 0\"/>{limit}</joint>",
            n - 1
        )
        .unwrap();
    }
    text + "</robot>"
}

/// A log in memory: time, and position, velocity and torque of each joint.
#[derive(Debug, Clone)]
struct Made {
    joints: usize,
    limits: bool,
    rows: Vec<(f64, Vec<[f64; 3]>)>,
}

impl Made {
    /// Joints that swing, after a second at rest, with noise.
    fn swing(joints: usize, rate: f64, seconds: f64, noise: f64, seed: u64, limits: bool) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let count = (seconds * rate) as usize;
        let row = |k: usize| {
            let t = k as f64 / rate;
            let since = (t - 1.0).max(0.0);
            let joint = |j: usize| {
                let (pace, size) = (TAU * (0.4 + 0.7 * j as f64), 0.5 / (1.0 + j as f64));
                let q = 0.4 + size * (1.0 - (pace * since).cos());
                let dq = size * pace * (pace * since).sin();
                let tau = 3.0 * q.sin() + 0.02 * pace * pace * size * (pace * since).cos();
                [
                    q + 1e-4 * noise * normal(),
                    dq + 0.02 * noise * normal(),
                    tau + 0.05 * noise * normal(),
                ]
            };
            (t, (0..joints).map(joint).collect())
        };
        Self {
            joints,
            limits,
            rows: (0..count).map(row).collect(),
        }
    }

    /// Lines (counted from 1, the header's first) that are let in, and what is said of the others.
    fn read(&self) -> Result<(Vec<u64>, Vec<Warning>), LogError> {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| -> PathBuf { folder.path().join(name) };
        std::fs::write(path("chain.urdf"), urdf(self.joints, self.limits)).unwrap();
        let robot = Robot::from_urdf(&path("chain.urdf")).unwrap();
        let mut text = "t".to_owned();
        for n in 1..=self.joints {
            write!(text, ",q/j{n},dq/j{n},tau/j{n}").unwrap();
        }
        for (t, joints) in &self.rows {
            write!(text, "\n{t:.7}").unwrap();
            for [q, dq, tau] in joints {
                write!(text, ",{q:e},{dq:e},{tau:e}").unwrap();
            }
        }
        std::fs::write(path("log.csv"), text + "\n").unwrap();
        let mut reader = LogReader::open_of(&path("log.csv"), Selection::Everything, &robot)?;
        let mut lines = Vec::new();
        while let Some(row) = reader.next_row()? {
            lines.push(row.line);
        }
        Ok((lines, reader.finish()?))
    }

    /// The rows, by their number from 0, that are left out, and for what.
    fn left_out(&self) -> (Vec<usize>, Vec<(Cause, u64)>) {
        let (lines, warnings) = self.read().unwrap();
        let out = (0..self.rows.len()).filter(|n| !lines.contains(&(*n as u64 + 2)));
        let causes = warnings.into_iter().filter_map(|warning| match warning {
            Warning::LeftOut { cause, count, .. } => Some((cause, count)),
            _ => None,
        });
        (out.collect(), causes.collect())
    }
}

/// The last rows have few ahead of them, of which none may stand for the usual noise.
#[test]
fn the_end_of_a_noisy_log_is_let_in() {
    for (joints, rate, noise, seed) in [
        (4, 2975.34, 7.0, 17029225673616282517),
        (3, 1036.958, 16.25, 5501935284099608242),
    ] {
        for seed in seed..=seed + 20 {
            let log = Made::swing(joints, rate, 600.0 / rate + 2.0, noise, seed, false);
            assert_eq!(log.left_out(), (Vec::new(), Vec::new()), "{rate} {seed}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 24, ..ProptestConfig::default() })]

    /// Whatever the robot, the rate and the noise: nothing is left out of a log in which nothing is wrong.
    #[test]
    fn nothing_is_left_out_of_a_good_log(
        joints in 1..5usize, rate in 60.0..3000.0, noise in 0.0..30.0, seed: u64, limits: bool,
    ) {
        let log = Made::swing(joints, rate, 600.0 / rate + 2.0, noise, seed, limits);
        prop_assert_eq!(log.left_out(), (Vec::new(), Vec::new()));
    }

    /// One damaged number, in any channel and anywhere, of any size from many times the usual one.
    #[test]
    fn a_damaged_number_is_left_out_alone(
        joints in 1..5usize, rate in 100.0..1000.0, noise in 0.1..3.0, seed: u64, limits: bool,
        at in 0.01..0.99, channel in 0..3usize, size in 3.0..200.0, negative: bool,
    ) {
        let mut log = Made::swing(joints, rate, 1200.0 / rate + 2.0, noise, seed, limits);
        let n = (at * log.rows.len() as f64) as usize;
        let value = if negative { -1.0 } else { 1.0 } * 10f64.powf(size);
        log.rows[n].1[seed as usize % joints][channel] = value;
        let (out, causes) = log.left_out();
        prop_assert_eq!(out, vec![n]);
        prop_assert_eq!(causes.len(), 1);
        prop_assert!(matches!(causes[0].0, Cause::Impossible | Cause::Jump), "{:?}", causes);
    }

    /// Any cells at all: an answer, and no value that is no number of any robot.
    #[test]
    fn nothing_impossible_passes(
        seed: u64, rate in 100.0..500.0,
        damage in proptest::collection::vec((0.0..1.0f64, 0..3usize, -250.0..250.0f64), 0..40),
    ) {
        let mut log = Made::swing(2, rate, 900.0 / rate, 1.0, seed, true);
        for (at, channel, size) in damage {
            let n = (at * (log.rows.len() - 1) as f64) as usize;
            log.rows[n].1[0][channel] = size.signum() * 10f64.powf(size.abs());
        }
        if let Ok((lines, _)) = log.read() {
            for line in lines {
                let row = &log.rows[line as usize - 2];
                prop_assert!(row.1.iter().flatten().all(|x| x.abs() <= super::NO_MEASUREMENT));
            }
        }
    }
}

#[test]
fn a_torque_beyond_all_others_is_named_with_its_line() {
    for (rate, limits, value) in [
        (500.0, true, 1000.0),
        (500.0, false, 1000.0),
        (100.0, true, -250.0),
    ] {
        let mut log = Made::swing(3, rate, 6.0, 1.0, 7, limits);
        log.rows[200].1[1][2] = value;
        assert_eq!(log.left_out(), (vec![200], vec![(Cause::Impossible, 1)]));
        let (_, warnings) = log.read().unwrap();
        let said = warnings[0].to_string();
        assert!(
            said.contains("line 202") && said.contains("tau/j2"),
            "{said}"
        );
    }
}

/// A velocity that its own positions do not have, though other velocities of the log are as great.
#[test]
fn a_velocity_that_no_position_follows_is_left_out() {
    let mut log = Made::swing(2, 500.0, 6.0, 0.3, 7, true);
    log.rows[700].1[0][1] = 7.0;
    assert_eq!(log.left_out(), (vec![700], vec![(Cause::Impossible, 1)]));
}

#[test]
fn zeros_before_the_first_state_are_left_out() {
    for zeros in [1, 7, 60] {
        let mut log = Made::swing(3, 200.0, 6.0, 1.0, 7, true);
        log.rows[..zeros]
            .iter_mut()
            .for_each(|row| row.1.fill([0.0; 3]));
        assert_eq!(
            log.left_out(),
            (
                (0..zeros).collect(),
                vec![(Cause::ZerosFirst, zeros as u64)]
            )
        );
        // One joint's motor answers later than the others'.
        let mut log = Made::swing(3, 200.0, 6.0, 1.0, 7, true);
        log.rows[..zeros]
            .iter_mut()
            .for_each(|row| row.1[1] = [0.0; 3]);
        assert_eq!(log.left_out().0, (0..zeros).collect::<Vec<_>>());
    }
    // Longer than what is looked ahead.
    let mut log = Made::swing(3, 200.0, 6.0, 1.0, 7, true);
    log.rows[..150]
        .iter_mut()
        .for_each(|row| row.1.fill([0.0; 3]));
    let (out, causes) = log.left_out();
    assert_eq!(causes, [(Cause::ZerosFirst, 1)]);
    assert!(
        out.iter().all(|n| (150..190).contains(n)) && out.contains(&150),
        "{out:?}"
    );
    // A simulation that begins at zero and at rest has no zeros to leave out.
    let mut log = Made::swing(3, 200.0, 6.0, 0.0, 7, true);
    for (_, joints) in &mut log.rows {
        joints.iter_mut().for_each(|joint| joint[0] -= 0.4);
    }
    log.rows[0].1.fill([0.0; 3]);
    assert_eq!(log.left_out(), (Vec::new(), Vec::new()));
}

#[test]
fn the_rows_of_a_second_publisher_are_left_out() {
    for (every, first) in [(2, 0), (5, 3), (9, 1), (5, 0)] {
        let log = Made::swing(3, 200.0, 6.0, 1.0, 7, true);
        let mut both = Made {
            rows: Vec::new(),
            ..log.clone()
        };
        let mut foreign = Vec::new();
        for (k, row) in log.rows.iter().enumerate() {
            if k % every == first {
                foreign.push(both.rows.len());
                both.rows.push((row.0 - 0.0025, vec![[-0.9, 0.0, 0.3]; 3]));
            }
            both.rows.push(row.clone());
        }
        if 3 * foreign.len() > both.rows.len() {
            let error = both.read().unwrap_err();
            assert!(
                matches!(*error.problem, Problem::TwoPublishers { .. }),
                "{error}"
            );
            continue;
        }
        let (out, causes) = both.left_out();
        assert_eq!(out, foreign, "{every} {first}");
        assert_eq!(causes, [(Cause::Jump, foreign.len() as u64)]);
        assert!(
            both.read().unwrap().1[0]
                .to_string()
                .contains("two publishers")
        );
    }
}

#[test]
fn no_row_bridges_a_seam() {
    let mut log = Made::swing(3, 200.0, 8.0, 1.0, 7, true);
    for (_, joints) in &mut log.rows[900..] {
        joints[1][0] -= 1.3;
    }
    let (out, causes) = log.left_out();
    assert_eq!(causes, [(Cause::Seam, 1)]);
    assert_eq!(out[0], 900);
    let silent = log.rows[out[out.len() - 1] + 1].0 - log.rows[899].0;
    assert!(silent > super::BRIDGED && silent < 0.1, "{silent}");
    let said = log.read().unwrap().1[0].to_string();
    assert!(
        said.contains("line 902") && said.contains("joined"),
        "{said}"
    );
}

#[test]
fn a_stamp_that_is_not_between_its_neighbours_is_left_out() {
    for (n, stamp) in [
        (0, 1.7e9),
        (300, 1.7e9),
        (300, 0.0),
        (300, 1.6),
        (0, -5000.0),
    ] {
        let mut log = Made::swing(2, 200.0, 6.0, 1.0, 7, true);
        log.rows[n].0 = stamp;
        assert_eq!(
            log.left_out(),
            (vec![n], vec![(Cause::Stamp, 1)]),
            "{n} {stamp}"
        );
    }
    // A clock that goes back for good is another recording.
    let mut log = Made::swing(2, 200.0, 6.0, 1.0, 7, true);
    log.rows[600..].iter_mut().for_each(|row| row.0 -= 2.0);
    let error = log.read().unwrap_err();
    assert!(
        matches!(*error.problem, Problem::TimeBackwards { .. }),
        "{error}"
    );
}

/// °/s and mA are other units, not damaged messages: they stay for those to see who know units.
#[test]
fn what_stays_is_not_left_out() {
    for (channel, scale) in [(1, 57.3), (2, 1000.0), (2, 0.001), (1, 0.0)] {
        for rate in [100.0, 500.0] {
            let mut log = Made::swing(3, rate, 8.0, 1.0, 7, true);
            for (_, joints) in &mut log.rows {
                joints.iter_mut().for_each(|joint| joint[channel] *= scale);
            }
            assert_eq!(
                log.left_out(),
                (Vec::new(), Vec::new()),
                "{channel} {scale} {rate}"
            );
        }
    }
}

/// A torque that leaves its neighbours for one or two rows without a motion is left out, within what the joint reaches elsewhere too.
#[test]
fn a_torque_that_leaps_for_a_moment_is_left_out() {
    for (rate, rows) in [(100.0, 1), (500.0, 1), (500.0, 2), (3000.0, 1)] {
        for size in [-4.0, 3.0, 20.0] {
            let mut log = Made::swing(2, rate, 6.0, 0.3, 7, true);
            let leaps = [0.4, 0.41, 0.7].map(|share| (share * log.rows.len() as f64) as usize);
            let leap = |at: &usize| (0..rows).map(|n| at + n).collect::<Vec<_>>();
            let expected: Vec<usize> = leaps.iter().flat_map(leap).collect();
            for n in &expected {
                log.rows[*n].1[1][2] += size;
            }
            let found = (Cause::Impossible, expected.len() as u64);
            assert_eq!(
                log.left_out(),
                (expected, vec![found]),
                "{rate} Hz, {rows} rows, {size} N m"
            );
        }
    }
}

/// A foot's touch-down, every 0.36 s: at 50 and 100 Hz its torque leaps for one row. The velocity shows it, so that only the damaged value goes.
#[test]
fn touch_downs_stay_at_every_rate() {
    for rate in [50.0, 100.0, 500.0, 1000.0] {
        let mut log = Made::swing(2, rate, 6.0, 0.3, 7, true);
        let damaged = (3.06 * rate) as usize;
        for (n, (t, joints)) in log.rows.iter_mut().enumerate() {
            for k in 0..11 {
                // The foot's speed is gone within a row, and comes back in 50 ms; the torque's pulse lasts 12 ms.
                let since = *t - (1.44 + 0.36 * f64::from(k));
                joints[0][2] += 8.0 * (1.0 - since.abs() / 0.006).max(0.0);
                if since > -1e-9 {
                    joints[0][0] += 0.6 * 0.05 * (1.0 - (-since / 0.05).exp());
                    joints[0][1] += 0.6 * (-since / 0.05).exp();
                }
            }
            if n == damaged {
                joints[1][2] += 8.0;
            }
        }
        let found = (Cause::Impossible, 1);
        assert_eq!(log.left_out(), (vec![damaged], vec![found]), "{rate} Hz");
    }
}

/// A step, a pulse of three rows, and a blow whose velocity shows stay.
#[test]
fn torques_that_a_robot_may_have_stay() {
    let damage: [fn(usize, &mut [f64; 3]); 3] = [
        |n, joint| joint[2] += if n >= 700 { 8.0 } else { 0.0 },
        |n, joint| {
            joint[2] += if (700..703).contains(&n) { 8.0 } else { 0.0 };
        },
        |n, joint| {
            joint[2] += if n == 700 { 8.0 } else { 0.0 };
            joint[1] += if n >= 700 { 1.0 } else { 0.0 };
        },
    ];
    for change in damage {
        let mut log = Made::swing(2, 500.0, 6.0, 0.3, 7, true);
        for (n, row) in log.rows.iter_mut().enumerate() {
            change(n, &mut row.1[0]);
        }
        assert_eq!(log.left_out(), (Vec::new(), Vec::new()));
    }
}
