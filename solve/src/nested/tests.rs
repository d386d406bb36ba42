use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;

use super::*;

const FOLDS: usize = 4;
const COLUMNS: usize = INERTIAL + 3;

fn cad() -> InertialParameters<f64> {
    InertialParameters::from_com(
        1.0,
        Vector3::new(0.01, -0.02, 0.05),
        Matrix3::from_diagonal(&Vector3::new(0.01, 0.012, 0.008)),
    )
}

fn effect(lower: f64) -> Bounded {
    Bounded {
        mean: 0.1,
        std: 0.5,
        lower,
        upper: 2.0,
    }
}

/// Rows of each fold: the columns, then the torque.
fn rows(numbers: &[f64], truth: &[f64; 3]) -> Vec<Vec<Vec<f64>>> {
    let all: Vec<Vec<f64>> = (numbers.chunks_exact(COLUMNS + 1))
        .map(|x| {
            let mut row = x[..COLUMNS].to_vec();
            let body: f64 = cad().0.iter().zip(x).map(|(p, x)| p * x).sum();
            let effects: f64 = truth.iter().zip(&x[INERTIAL..]).map(|(p, x)| p * x).sum();
            row.push(body + effects + 0.05 * x[COLUMNS]);
            row
        })
        .collect();
    all.chunks(all.len() / FOLDS).map(<[_]>::to_vec).collect()
}

fn factor(rows: &[Vec<f64>]) -> HeapFactor {
    let mut factor = HeapFactor::new(rows[0].len() - 1);
    factor.fold(&mut rows.concat());
    factor
}

/// A limb of one joint with the effects `kept` of three.
fn limb(folds: &[Vec<Vec<f64>>], kept: &[usize]) -> NestedLimb {
    let columns: Vec<usize> = (0..INERTIAL)
        .chain(kept.iter().map(|k| INERTIAL + k))
        .chain([COLUMNS])
        .collect();
    let cut = |rows: &Vec<Vec<f64>>| {
        let rows: Vec<Vec<f64>> = rows
            .iter()
            .map(|row| columns.iter().map(|&c| row[c]).collect())
            .collect();
        factor(&rows)
    };
    let factors: Vec<HeapFactor> = folds.iter().map(cut).collect();
    NestedLimb {
        at_floor: 0.0,
        bodies: vec![(cad(), 0.1)],
        others: kept
            .iter()
            .map(|&k| effect(if k == 0 { 0.0 } else { -2.0 }))
            .collect(),
        effect: (0..kept.len()).map(Some).collect(),
        joints: vec![NestedJoint {
            places: (0..INERTIAL + kept.len()).map(Some).collect(),
            train: factors.clone(),
            test: factors,
        }],
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Dropping columns is the fit of a limb that never had them; and the error is that of the fold's own rows.
    #[test]
    fn leaving_out_is_never_having_had(
        numbers in prop::collection::vec(-1.0..1.0f64, (COLUMNS + 1) * 80),
        truth in prop::array::uniform3(-0.4..0.9f64),
        mask in 0usize..8,
    ) {
        let folds = rows(&numbers, &truth);
        let kept: Vec<usize> = (0..3).filter(|k| mask >> k & 1 == 1).collect();
        let nested = limb(&folds, &[0, 1, 2]).fit(&|e| mask >> e & 1 == 1).unwrap();
        let own = limb(&folds, &kept).fit(&|_| true).unwrap();
        for f in 0..FOLDS {
            let (a, b) = (nested.squares[f][0], own.squares[f][0]);
            prop_assert!((a - b).abs() < 1e-8 * (1.0 + b), "{a} {b}");
            let theta = &nested.theta[f];
            let direct: f64 = folds[f].iter().map(|row| {
                let predicted: f64 = theta.iter().zip(row).map(|(p, x)| p * x).sum();
                (row[COLUMNS] - predicted).powi(2)
            }).sum();
            prop_assert!((a - direct).abs() < 1e-9 * (1.0 + direct), "{a} {direct}");
            for k in (0..3).filter(|k| mask >> k & 1 == 0) {
                prop_assert_eq!(theta[INERTIAL + k], 0.0);
            }
        }
    }

    /// What is written is read again, and nothing else is.
    #[test]
    fn numbers_come_back(numbers in prop::collection::vec(-1.0..1.0f64, (COLUMNS + 1) * 20), cut in 0usize..400) {
        let limb = limb(&rows(&numbers, &[0.1, 0.2, 0.3]), &[0, 2]);
        let mut written = Vec::new();
        limb.write(&mut written);
        let mut from = &written[..];
        prop_assert_eq!(NestedLimb::read(&mut from), Some(limb));
        prop_assert!(from.is_empty());
        let short = &mut &written[..cut.min(written.len() - 1)];
        prop_assert_eq!(NestedLimb::read(short), None);
    }
}
