//! Rows of a robot that walks against the simulation of [`crate::window::FreeBaseWindow`]'s tests, and against that window's own.

use super::columns::{COLUMNS, OWN, TRUNK, inertial_parameters};
use super::leg::INERTIA;
use super::window::{Advance, JOINT_ROW, Ready, WalkRows, WalkWindow};
use super::*;
use crate::window::FreeBaseSample;
use crate::window::free_base::tests::{Case, case, example};
use proptest::prelude::*;
use std::prelude::rust_2024::*;
use std::vec;

fn ready(sample: &FreeBaseSample<f64, 12, 4>) -> Ready<f64> {
    Ready {
        time_us: sample.joints.time_us,
        q: sample.joints.q,
        dq: sample.joints.dq,
        tau: sample.joints.tau,
        gyro: sample.gyro,
        acc: sample.acc,
        down: sample.down,
    }
}

fn rows_of(case: &Case, samples: &[FreeBaseSample<f64, 12, 4>]) -> Vec<WalkRows<f64>> {
    let mut window = WalkWindow::new(&case.tree(), case.imu, 20_000);
    let (mut all, mut rows) = (vec![], WalkRows::zero());
    for sample in samples {
        if window.advance(&ready(sample), sample.loaded, &mut rows, true) == Advance::Closed {
            all.push(rows.clone());
        }
    }
    all
}

/// The true parameters of all columns.
fn truth(case: &Case) -> [f64; COLUMNS] {
    let mut theta = inertial_parameters(&case.tree());
    for j in 0..12 {
        for (e, x) in case.effects(j).into_iter().enumerate() {
            theta[OWN * (j / 3) + INERTIA + 4 * (j % 3) + e] = x;
        }
    }
    theta[COLUMNS - 3..].copy_from_slice(case.bias.as_slice());
    theta
}

/// Greatest misfits under the truth: of the base's rows, of the joints'.
fn misfit(case: &Case, rows: &WalkRows<f64>) -> [f64; 2] {
    let theta = truth(case);
    let base = (0..6).map(|r| {
        let columns = rows.base.iter().map(|column| column[r]);
        let left: f64 = columns.clone().zip(theta).map(|(w, x)| w * x).sum();
        (left - rows.base[COLUMNS][r]).abs()
    });
    let joints = rows.joints.iter().enumerate().map(|(j, row)| {
        let first = OWN * (j / 3);
        let own = INERTIA + 4 * (j % 3);
        let theta = theta[first..first + INERTIA]
            .iter()
            .chain(&theta[first + own..first + own + 4])
            .chain(&theta[COLUMNS - 3..]);
        let left: f64 = row.iter().zip(theta).map(|(w, x)| w * x).sum();
        (left - row[JOINT_ROW - 1]).abs()
    });
    [base.fold(0.0, f64::max), joints.fold(0.0, f64::max)]
}

#[test]
fn the_first_of_the_trunks_columns_is_the_robots_mass() {
    let robot = go2::free::<f64>();
    let mass: f64 = robot.bodies().iter().map(|body| body.inertia.mass()).sum();
    assert!((inertial_parameters(&robot)[TRUNK] - mass).abs() < 1e-12);
}

#[test]
fn the_misfit_is_that_of_the_trapezium() {
    for (n, loaded) in [[true; 4], [false; 4], [true, false, false, true]]
        .into_iter()
        .enumerate()
    {
        let case = example(n, loaded);
        let [coarse, fine] = [20, 5].map(|every| {
            let rows = rows_of(&case, &case.samples(200, every));
            misfit(&case, &rows[0])
        });
        std::println!("{loaded:?} misfits of 2 ms {coarse:?}, of 0.5 ms {fine:?}");
        for k in 0..2 {
            assert!(coarse[k] < 0.05 && fine[k] < 0.15 * coarse[k] + 1e-9);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn rows_hold_with_any_forces_at_any_feet(case in case()) {
        let rows = rows_of(&case, &case.samples(400, 2));
        // A straight leg's window has no rows.
        prop_assert!(rows.len() == 2 || case.straight || rows.len() < 2);
        for rows in &rows {
            let misfit = misfit(&case, rows);
            prop_assert!(misfit[0] < 0.03 && misfit[1] < 0.03, "{misfit:?}");
        }
    }
}
