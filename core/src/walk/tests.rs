//! Rows of a robot that walks against the simulation of [`crate::window::FreeBaseWindow`]'s tests, and against that window's own.

use super::columns::{COLUMNS, OWN, TRUNK, inertial_parameters};
use super::leg::INERTIA;
use super::pose::Ready;
use super::rows::{JOINT_ROW, SCALE, WalkRows};
use super::window::{Advance, WalkWindow};
use super::*;
use crate::window::free_base::tests::{Case, case, example};
use crate::window::{FreeBasePush, FreeBaseSample};
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
    let mut window = Box::new(WalkWindow::unset());
    window.begin(&case.tree(), &case.imu, 20_000);
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
#[cfg_attr(miri, ignore = "too long to interpret")]
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

/// What the rows say of wrong parameters is what those of the projector say: as much information, in two thirds of the rows or fewer.
#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn the_rows_tell_what_the_projected_ones_do() {
    use crate::inertia::InertialParameters;
    for n in 0..12 {
        let mut case = example(n, core::array::from_fn(|leg| (n + leg) % 3 != 0));
        case.scale = core::array::from_fn(|c| if c < 6 { SCALE[c / 3] } else { 1.0 });
        let samples = case.samples(200, 4);
        let ours = &rows_of(&case, &samples)[0];
        let mut theirs = case.window();
        let closed = samples
            .iter()
            .filter(|s| theirs.push(s) == FreeBasePush::Closed);
        assert_eq!(closed.count(), 1);
        // Another robot's bodies.
        let other = go2::free::<f64>();
        let bodies = core::array::from_fn(|b| {
            let turned = other.bodies()[(b + n) % 13].inertia.0;
            InertialParameters(other.bodies()[b].inertia.0 + turned * 0.2)
        });
        let other = other.with_inertia(&bodies);
        let (columns, standard) = (inertial_parameters(&other), other.parameters::<130>());
        let own = |row: [f64; COLUMNS + 1]| {
            let predicted = columns.iter().zip(row).map(|(x, w)| x * w);
            (predicted.sum::<f64>() - row[COLUMNS]).powi(2)
        };
        let base = (0..6).map(|r| own(core::array::from_fn(|c| ours.base[c][r])));
        let joints = (0..12).map(|j| {
            let mut row = [0.0; COLUMNS + 1];
            row[OWN * (j / 3)..][..INERTIA].copy_from_slice(&ours.joints[j][..INERTIA]);
            row[COLUMNS] = ours.joints[j][JOINT_ROW - 1];
            own(row)
        });
        let ours: f64 = base.chain(joints).sum();
        let rows = theirs.rows();
        let theirs = (0..18).map(|c| {
            let row = rows.inertial[c].as_flattened().iter();
            let predicted = row.zip(&standard).map(|(w, x)| w * x).sum::<f64>();
            (predicted - rows.torque[c]).powi(2)
        });
        let theirs: f64 = theirs.sum();
        std::println!("{n}: {ours:.4} {theirs:.4}");
        assert!((ours / theirs - 1.0).abs() < 0.1, "{n}: {ours} {theirs}");
    }
}

/// Without data the solution is the CAD: of the columns, and of the trunk apart from what the legs hand to it.
#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn the_prior_is_the_cads() {
    fn check<T: Real>(tolerance: f64) {
        let (mut walker, mut memory) = (
            Box::new(Walker::<T>::unset()),
            Box::new(WalkMemory::<T>::new()),
        );
        let robot = go2::free::<T>();
        walker
            .begin(&mut memory, &Transform::from_translation(Vector3::zeros()))
            .unwrap();
        walker.solve();
        while !walker.step(&mut memory) {}
        let double = |x: T| nalgebra::try_convert::<T, f64>(x).unwrap();
        let cad = inertial_parameters(&robot);
        let inertial = (0..COLUMNS).filter(|c| *c >= TRUNK || c % OWN < INERTIA);
        for c in inertial {
            let (found, expected) = (double(walker.parameters()[c]), double(cad[c]));
            assert!(
                (found - expected).abs() < tolerance * (1.0 + expected.abs()),
                "{c}: {found} {expected}"
            );
        }
        let estimate = walker.estimate(&memory);
        for (found, expected) in estimate.trunk.iter().zip(&robot.bodies()[0].inertia.0) {
            assert!(
                (double(*found - *expected)).abs() < tolerance * (1.0 + double(*expected).abs())
            );
        }
        // Twelve bodies of 10 % and a trunk of 30 %.
        let squares = robot.bodies().iter().enumerate().map(|(b, body)| {
            let relative = if b == 0 { 0.3 } else { 0.1 };
            (relative * double(body.inertia.mass())).powi(2)
        });
        let std = squares.sum::<f64>().sqrt();
        assert!(
            (double(estimate.mass[1]) / std - 1.0).abs() < 0.1 + tolerance,
            "{:?} {std}",
            estimate.mass
        );
    }
    check::<f64>(1e-6);
    check::<f32>(3e-2);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    #[cfg_attr(miri, ignore = "too long to interpret")]
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
