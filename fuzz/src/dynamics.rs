//! Logs of an arm, damaged in any way, through all that is asked of logs.
//!
//! The first three bytes say how many samples (in steps of four, or one by one below 64), at which rate, and how the joints are driven; then come
//! damages of six bytes: where, which column, what kind, and a number's mantissa and exponent.

use std::fmt::Write;
use std::path::PathBuf;

use proprio_core::effect::EffectKind;
use proprio_host::compare::{ValuesFrom, compare};
use proprio_host::detect::mismatch::mismatches;
use proprio_host::diagnose::diagnose;
use proprio_host::identify::{FitOptions, fit_model};
use proprio_host::model::{Model, Robot};
use proprio_host::recording::Recording;

use super::file;

const JOINTS: [&str; 2] = ["shoulder", "elbow"];

const ARM: &[u8] = br#"<robot name="arm"><link name="base"/>
<link name="upper"><inertial><origin xyz="0.01 0 0.15"/><mass value="1.5"/><inertia ixx="0.012" ixy="0" ixz="0" iyy="0.012" iyz="0" izz="0.002"/></inertial></link>
<link name="fore"><inertial><origin xyz="0 0.01 0.12"/><mass value="0.9"/><inertia ixx="0.006" ixy="0" ixz="0" iyy="0.006" iyz="0" izz="0.001"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="40" velocity="8"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0 0 0.3"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="40" velocity="8"/></joint>
</robot>"#;

/// Samples of time, and of position, velocity and torque of both joints.
type Row = [f64; 7];

/// What the commands make of a log.
///
/// # Panics
/// If a number that is told is not finite.
pub fn dynamics(bytes: &[u8]) {
    let Some(log) = log(bytes) else {
        return;
    };
    let robot = Robot::from_urdf(&file("arm.urdf", ARM)).expect("an arm");
    let mut model = Model::new(robot);
    for joint in 0..JOINTS.len() {
        for effect in EffectKind::PLAIN {
            model.add_effect(effect, joint);
        }
    }
    let Ok(recording) = Recording::read(&[log], &model, |_, _| ()) else {
        return;
    };
    for wrong in mismatches(&recording, &model) {
        std::hint::black_box(wrong.to_string());
    }
    if let Ok(fitted) = fit_model(&recording, &model, FitOptions::default()) {
        assert!(fitted.rms.is_finite(), "{}", fitted.rms);
        std::hint::black_box(fitted.other_bodies(&model));
    }
    if let Ok(diagnosis) = diagnose(&recording, &model) {
        assert!(
            diagnosis.held_out_rms.is_finite(),
            "{}",
            diagnosis.held_out_rms
        );
    }
    if let Ok(compared) = compare(&recording, &model, ValuesFrom::Auto) {
        std::hint::black_box(compared.text(true));
    }
}

/// The log that bytes stand for; none of too few bytes.
fn log(bytes: &[u8]) -> Option<PathBuf> {
    let ([count, rate, drive], damages) = bytes.split_first_chunk::<3>()?;
    let count = match usize::from(*count) {
        few @ ..64 => few,
        many => 4 * many,
    };
    let period = [0.001, 0.002, 0.005, 0.01, 0.02][usize::from(*rate) % 5];
    let mut rows: Vec<Row> = (0..count).map(|k| row(k as f64 * period, *drive)).collect();
    for damage in damages.chunks_exact(6) {
        spoil(&mut rows, [0, 1, 2, 3, 4, 5].map(|n| damage[n]));
    }
    let mut text = "t".to_owned();
    for joint in JOINTS {
        write!(text, ",q/{joint},dq/{joint},tau/{joint}").ok()?;
    }
    for row in rows {
        let cells: Vec<String> = row.iter().map(|x| format!("{x:e}")).collect();
        write!(text, "\n{}", cells.join(",")).ok()?;
    }
    Some(file("dynamics.csv", text.as_bytes()))
}

fn row(t: f64, drive: u8) -> Row {
    let mut row = [t, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    for joint in 0..JOINTS.len() {
        let pace = 1.0 + f64::from(drive % 16) + 1.7 * joint as f64;
        let size = 2.0 / (1.0 + pace);
        let (sine, cosine) = (pace * t + joint as f64).sin_cos();
        let (q, dq) = (size * sine, size * pace * cosine);
        let tau = 4.0 * q.sin() + 0.3 * dq.signum() - 0.05 * pace * pace * q;
        row[1 + 3 * joint..4 + 3 * joint].copy_from_slice(&[q, dq, tau]);
    }
    row
}

/// One damage: a cell, a column from somewhere on, rows repeated, exchanged or left out.
fn spoil(rows: &mut Vec<Row>, [at, column, kind, low, high, exponent]: [u8; 6]) {
    if rows.is_empty() {
        return;
    }
    let n = usize::from(at) * (rows.len() - 1) / 255;
    let column = usize::from(column) % 7;
    let mantissa = f64::from(i16::from_le_bytes([low, high])) / 1024.0;
    let number = mantissa * 10f64.powi(i32::from(exponent) - 30);
    match kind % 6 {
        0 => rows[n][column] = number,
        1 => rows[n..].iter_mut().for_each(|row| row[column] *= number),
        2 => rows[n..].iter_mut().for_each(|row| row[column] += number),
        3 => {
            let row = rows[n];
            rows.insert(n, row);
        }
        4 => {
            let last = rows.len() - 1;
            rows.swap(n, (n + 1).min(last));
        }
        _ => drop(rows.remove(n)),
    }
}

/// Good logs of many lengths, and each kind of damage.
pub fn seeds() -> Vec<Vec<u8>> {
    let good = |count: u8, rate: u8| vec![count, rate, 5];
    let few = [1, 2, 3, 5, 10, 20, 40, 63].map(|count| good(count, 3));
    let long = [(200, 3), (250, 1), (130, 4), (250, 2)].map(|(count, rate)| good(count, rate));
    let damaged = (0..6).flat_map(|kind| {
        (0..7).map(move |column| {
            let mut bytes = vec![200, 3, 5];
            bytes.extend([100, column, kind, 0, 4, 30 + 40 * kind]);
            bytes.extend([180, column, kind, 0, 4, 36]);
            bytes
        })
    });
    few.into_iter().chain(long).chain(damaged).collect()
}
