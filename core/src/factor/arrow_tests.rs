//! The arrow against one triangle of all columns: the same misfit of every θ, the same solution, the same residual.

use super::*;
use proptest::prelude::*;
use std::prelude::rust_2024::*;
use std::vec;

const LIMBS: usize = 3;
const OWN: usize = 4;
const REST: usize = 3;
const COMMON: usize = 2;
const ALL: usize = LIMBS * OWN + REST;
const LIMB: usize = OWN + COMMON;
type Small = ArrowFactor<f64, LIMBS, OWN, REST, COMMON, { packed_len(LIMB) }, { packed_len(ALL) }>;

/// Rows over all columns and the right-hand side: which limb's, or the base's (`LIMBS`).
#[derive(Clone, Debug)]
struct Row {
    of: usize,
    numbers: Vec<f64>,
}

fn rows() -> impl Strategy<Value = Vec<Row>> {
    let row = (0..=LIMBS, prop::collection::vec(-3.0..3.0f64, ALL + 1)).prop_map(|(of, mut x)| {
        for (c, x) in x.iter_mut().enumerate() {
            let touched = c >= ALL - COMMON || (OWN * of..OWN * (of + 1)).contains(&c);
            if of < LIMBS && !touched {
                *x = 0.0;
            }
        }
        Row { of, numbers: x }
    });
    prop::collection::vec(row, 40..120)
}

/// One triangle of all columns, row by row.
fn dense(rows: &[Row]) -> Factor<f64, Vec<f64>> {
    let mut factor = Factor::in_storage(ALL, vec![0.0; packed_len(ALL)]).unwrap();
    rows.iter()
        .for_each(|row| factor.update(&mut row.numbers.clone()).unwrap());
    factor
}

/// Rows of one kind, six at a time, `part` numbers of the triangle at a time.
fn arrow(rows: &[Row], part: usize) -> Small {
    let mut arrow = Small::empty();
    for of in 0..=LIMBS {
        let own: Vec<&Row> = rows.iter().filter(|row| row.of == of).collect();
        for rows in own.chunks(ROWS) {
            let at =
                |c: usize| core::array::from_fn(|n| rows.get(n).map_or(0.0, |row| row.numbers[c]));
            if of < LIMBS {
                let columns = (OWN * of..OWN * (of + 1)).chain(ALL - COMMON..=ALL);
                let mut block: Vec<[f64; ROWS]> = columns.map(at).collect();
                arrow.fold_limb(of, &mut block).unwrap();
            } else {
                let mut block: Vec<[f64; ROWS]> = (0..=ALL).map(at).collect();
                let mut fold = Folding::from(0);
                while !fold.is_done(ALL) {
                    arrow.fold_base(&mut fold, part, &mut block).unwrap();
                }
            }
        }
    }
    arrow
}

/// The arrow's triangles rotated into one.
fn gathered(arrow: &Small, part: usize) -> Factor<f64, Vec<f64>> {
    let mut whole = Factor::in_storage(ALL, arrow.base().packed().to_vec()).unwrap();
    let mut block = vec![[0.0; ROWS]; ALL + 1];
    for limb in 0..LIMBS {
        for k in (0..=LIMB).step_by(ROWS) {
            Small::write_limb_rows(&arrow.limb(limb), limb, k, &mut block);
            // The last rows touch common columns alone.
            let mut fold = Folding::from(Small::limb_column(limb) + k.min(OWN));
            while !fold.is_done(ALL) {
                let target = Factor::in_storage(ALL, whole.storage.as_mut_slice()).unwrap();
                fold.advance(target, part, &mut block).unwrap();
            }
        }
    }
    whole
}

proptest! {
    #[test]
    #[cfg_attr(miri, ignore = "too long to interpret")]
    fn an_arrow_is_the_triangle_of_all_columns(
        rows in rows(),
        theta in prop::collection::vec(-2.0..2.0f64, ALL),
        part in 1..200usize,
    ) {
        let (dense, arrow) = (dense(&rows), arrow(&rows, part));
        let whole = gathered(&arrow, part);
        // The arrow says the misfit of any θ before it is gathered: the sum of its triangles'.
        let limbs: f64 = (0..LIMBS)
            .map(|limb| {
                let own = theta[OWN * limb..OWN * (limb + 1)].iter();
                let own: Vec<f64> = own.chain(&theta[ALL - COMMON..]).copied().collect();
                arrow.limb(limb).sum_of_squares(&own)
            })
            .sum();
        let expected = dense.sum_of_squares(&theta);
        prop_assert!((limbs + arrow.base().sum_of_squares(&theta) - expected).abs() < 1e-9 * expected);
        prop_assert!((whole.sum_of_squares(&theta) - expected).abs() < 1e-9 * expected);
        prop_assert!((whole.residual() - dense.residual()).abs() < 1e-9 * expected);
        let pivots = (0..ALL).map(|k| dense.row(k)[0].abs());
        prop_assume!(pivots.fold(f64::INFINITY, f64::min) > 1e-2);
        let [mut ours, mut theirs] = [[0.0; ALL]; 2];
        whole.solve(&mut ours).unwrap();
        dense.solve(&mut theirs).unwrap();
        for (a, b) in ours.iter().zip(theirs) {
            prop_assert!((a - b).abs() < 1e-8 * (1.0 + b.abs()), "{a} {b}");
        }
    }
}

#[test]
fn what_does_not_fit_or_is_no_number_is_refused() {
    let mut arrow = Small::empty();
    let mut block = [[1.0; ROWS]; LIMB + 1];
    assert_eq!(
        arrow.fold_limb(LIMBS, &mut block),
        Err(FactorError::Length(LIMBS))
    );
    assert!(arrow.fold_limb(0, &mut block[1..]).is_err());
    let mut infinite = [[f64::INFINITY; ROWS]; ALL + 1];
    let refused = arrow.fold_base(&mut Folding::from(0), 1000, &mut infinite);
    assert_eq!(refused, Err(FactorError::NotFinite));
    assert_eq!(arrow, Small::empty());
    assert_eq!(arrow.limb(LIMBS).columns(), 0);
}
