use super::*;
use crate::go2::{Leg, leg};
use crate::inertia::NAMES;
use std::prelude::rust_2024::*;
use std::{format, vec};

fn of<T: Real>(which: Leg, joint: usize) -> BaseParameters<T, Vec<T>> {
    let columns = INERTIAL * (3 - joint);
    let storage = vec![T::zero(); packed_len(columns)];
    let mut row = vec![T::zero(); columns + 1];
    BaseParameters::of_joint::<3, 3, 30>(&leg::<T>(which), joint, storage, &mut row).unwrap()
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_leg_has_as_many_base_parameters_as_it_should_in_both_scalars() {
    for which in Leg::ALL {
        for (joint, rank) in [15, 14, 7].into_iter().enumerate() {
            let (double, single) = (of::<f64>(which, joint), of::<f32>(which, joint));
            assert_eq!(
                (double.rank(), single.rank()),
                (rank, rank),
                "{which:?} {joint}"
            );
            for r in 0..rank {
                assert_eq!(double.independent(r), single.independent(r));
                for (a, b) in double.combination(r).iter().zip(single.combination(r)) {
                    assert!(
                        (a - f64::from(*b)).abs() < 1e-4 * (1.0 + a.abs()),
                        "{a} {b}"
                    );
                }
            }
        }
    }
}

/// W = W_i P in states that the analysis has not seen: other speeds, other tilts.
#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn the_independent_columns_give_all_others() {
    let mut states = States(77);
    for which in Leg::ALL {
        for joint in 0..3 {
            let base = of::<f64>(which, joint);
            let (mut row, mut back) = (vec![0.0; base.columns() + 1], vec![0.0; base.columns()]);
            for _ in 0..200 {
                states.write_row::<f64, 3, 3, 30>(&leg(which), joint, &mut row);
                let independent: Vec<f64> = (0..base.rank())
                    .map(|r| row[base.independent(r).unwrap()])
                    .collect();
                back.fill(0.0);
                base.expand(0, &independent, &mut back);
                for (a, b) in row.iter().zip(&back) {
                    assert!((a - b).abs() < 1e-10 * (1.0 + a.abs()), "{a} {b}");
                }
            }
        }
    }
}

/// The calf's torque: known in closed form, for its axis is y and its torque does not see the mass nor hy.
#[test]
fn the_calf_is_written_out_as_in_the_textbook() {
    let base = of::<f64>(Leg::FL, 2);
    let written: Vec<String> = (0..base.rank())
        .map(|r| {
            let terms = base.combination(r).iter().enumerate();
            terms
                .filter(|(_, c)| **c != 0.0)
                .map(|(n, c)| format!("{c:+.3} {}", NAMES[r + n]))
                .collect::<Vec<_>>()
                .join(" ")
        })
        .collect();
    let expected = [
        "+1.000 hx",
        "+1.000 hz",
        "+1.000 Ixx -1.000 Izz",
        "+1.000 Ixy",
        "+1.000 Ixz",
        "+1.000 Iyy",
        "+1.000 Iyz",
    ];
    assert_eq!(written, expected);
}

/// The marginal says of β what the prior says: mean P φ and covariance P Σ Pᵀ.
#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn the_marginal_has_the_priors_mean_and_covariance() {
    let tree = leg::<f64>(Leg::RR);
    for joint in 0..3 {
        let base = of::<f64>(Leg::RR, joint);
        let (columns, rank) = (base.columns(), base.rank());
        let mut prior = Factor::in_storage(columns, vec![0.0; packed_len(columns)]).unwrap();
        for b in joint..3 {
            let body = tree.bodies()[b].inertia.prior(0.1).unwrap();
            prior.place(INERTIAL * (b - joint), &body).unwrap();
        }
        let mut marginal = Factor::in_storage(rank, vec![0.0; packed_len(rank)]).unwrap();
        let (mut work, mut row) = (vec![0.0; packed_len(columns)], vec![0.0; columns + 1]);
        base.marginal(&prior, &mut marginal, &mut work, &mut row)
            .unwrap();

        let (mut phi, mut beta, mut expected) =
            (vec![0.0; columns], vec![0.0; rank], vec![0.0; rank]);
        prior.solve(&mut phi).unwrap();
        marginal.solve(&mut beta).unwrap();
        base.base_of(&phi, &mut expected);
        let (mut variance, mut scratch) = (vec![0.0; rank], vec![0.0; rank]);
        marginal.variances(&mut variance, &mut scratch).unwrap();
        for r in 0..rank {
            // P Σ Pᵀ = ‖P R⁻¹‖² row by row.
            let mut sum = 0.0;
            for j in 0..columns {
                let mut column = vec![0.0; columns];
                prior.inverse_column(j, &mut column).unwrap();
                let terms = base.combination(r).iter().zip(&column[r..=j.max(r)]);
                let entry: f64 = terms.map(|(c, x)| c * x).sum();
                sum += if j >= r { entry * entry } else { 0.0 };
            }
            assert!((variance[r] / sum - 1.0).abs() < 1e-8, "{joint} {r}");
            let error = (beta[r] - expected[r]).abs() / variance[r].sqrt();
            assert!(error < 1e-8, "{joint} {r}: {error}");
        }
    }
}

/// Data that move one joint alone determine less than the structure would allow.
#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_poor_motion_determines_fewer_combinations() {
    let tree = leg::<f64>(Leg::FR);
    let mut factor = Factor::in_storage(30, vec![0.0; packed_len(30)]).unwrap();
    for n in 0..200 {
        let t = 0.01 * f64::from(n);
        let q = SVector::from([t.sin(), 0.8, -1.7]);
        let v = SVector::from([t.cos(), 0.0, 0.0]);
        let a = SVector::from([-t.sin(), 0.0, 0.0]);
        let w = tree.inverse_dynamics_regressor::<30>(
            &tree.kinematics(&Transform::identity(), &q, &v),
            &v,
            &a,
        );
        let mut row: Vec<f64> = w.row(0).iter().copied().chain([0.0]).collect();
        factor.update(&mut row).unwrap();
    }
    assert_eq!(BaseParameters::of_factor(factor, 1e-8).rank(), 3);
}
