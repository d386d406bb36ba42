use super::*;
use proptest::prelude::*;
use std::prelude::rust_2024::*;

const P: usize = 6;
const NUISANCE: usize = 2;

fn factor(rows: &[[f64; P + 1]]) -> Factor<f64, [f64; packed_len(P)]> {
    let mut factor = Factor::new::<P>();
    rows.iter()
        .for_each(|row| factor.update(&mut row.clone()).unwrap());
    factor
}

proptest! {
    /// A subset's fit is the fit to the subset's columns alone.
    #[test]
    fn a_fit_of_a_subset_is_the_fit_without_the_other_columns(
        rows in prop::collection::vec(prop::array::uniform7(-5.0..5.0f64), 12..40), subset in 0u32..16, of in 0usize..4,
    ) {
        let whole = factor(&rows);
        let (mut theta, mut work) = ([0.0; P], [0.0; work_len(4)]);
        let nested = Nested::new(whole.view(), NUISANCE);
        let found = nested.fit(subset, of, &mut theta, &mut work).unwrap();

        let columns: Vec<usize> = (0..P).filter(|c| *c < NUISANCE || subset >> (c - NUISANCE) & 1 == 1).collect();
        let m = columns.len();
        let mut selected = Factor::in_storage(m, std::vec![0.0; packed_len(m)]).unwrap();
        selected.select_from(&whole, &columns, &mut std::vec![0.0; m + 1]).unwrap();
        let (mut expected, mut variance, mut scratch) = (std::vec![0.0; m], std::vec![0.0; m], std::vec![0.0; m]);
        selected.solve(&mut expected).unwrap();
        selected.variances(&mut variance, &mut scratch).unwrap();
        for (n, c) in columns.iter().enumerate() {
            prop_assert!((theta[*c] - expected[n]).abs() < 1e-6 * (1.0 + expected[n].abs()));
            if *c == NUISANCE + of {
                prop_assert!((found.value() - expected[n]).abs() < 1e-6 * (1.0 + expected[n].abs()));
                prop_assert!((found.std() / variance[n].sqrt() - 1.0).abs() < 1e-6);
            }
        }
        prop_assert!((0..P).all(|c| columns.contains(&c) || theta[c] == 0.0));
    }
}

/// An effect that is there gains what it explains; one that is not gains nothing beyond chance.
#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn an_effect_that_is_there_gains_and_another_does_not() {
    let mut state = 5_u64;
    let mut noise = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 33) as f64 / f64::from(1 << 30) - 1.0
    };
    let mut folds = [Factor::<f64, [f64; packed_len(P)]>::new::<P>(); 2];
    for n in 0..4000 {
        let mut row: [f64; P + 1] = core::array::from_fn(|_| noise());
        row[P] = 2.0 * row[0] - row[1] + 0.5 * row[2] + 0.8 * row[3] + 0.3 * noise();
        folds[n / 500 % 2].update(&mut row).unwrap();
    }
    let (active, mut work) = (0b0001, [0.0; work_len(4)]);
    let judge = |n: usize, work: &mut [f64]| {
        let (mut held, mut found) = (HeldOut::<f64, 2>::NONE, Finding::NONE);
        for fold in 0..2 {
            let nested = Nested::new(folds[fold].view(), NUISANCE);
            let mut theta = [0.0; P];
            nested.fit(active, n, &mut theta, work).unwrap();
            held.without[fold] = folds[1 - fold].sum_of_squares(&theta);
            found = found.plus(nested.fit(active | 1 << n, n, &mut theta, work).unwrap());
            held.with[fold] = folds[1 - fold].sum_of_squares(&theta);
        }
        (held, found)
    };
    let (there, found) = judge(1, &mut work);
    assert!(there.gain() > 0.8, "{}", there.gain());
    assert!(there.gain_error() < 0.05);
    assert!((found.value() - 0.8).abs() < 0.02);
    for n in [2, 3] {
        let (absent, found) = judge(n, &mut work);
        assert!(absent.gain().abs() < 2e-3, "{}", absent.gain());
        assert!(found.value().abs() < 0.1);
    }
}
