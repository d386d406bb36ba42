//! A step's new velocities under dry friction, by its rule of stiction: a joint that friction can hold is held.
//!
//! They solve A w + F(w) = r with A the inertia, and of each joint F the impulse of what resists it where it moves forwards, or that where it
//! moves backwards; at rest it is whatever between them holds the joint (Moreau 1988, "Unilateral contact and dry friction in finite freedom
//! dynamics": the law at the step's end, so that nothing chatters). Where the sides are as guessed it is one linear solve; else the joints
//! are relaxed in turn, which converges where friction resists.

use nalgebra::{DMatrix, DVector};

/// Most sweeps over the joints, and the change of a velocity that ends them, rad/s.
const SWEEPS: usize = 200;
const SETTLED: f64 = 1e-11;

/// w of A w + F(w) = r; `sides` of each joint are F forwards and backwards, N m s, and `guess` is a velocity on the side where it may be. None
/// if A is singular.
pub(super) fn solve(
    a: &DMatrix<f64>,
    r: &DVector<f64>,
    sides: &[[f64; 2]],
    guess: &[f64],
) -> Option<DVector<f64>> {
    let forwards = |w: f64| w >= 0.0;
    let side = |j: usize| sides[j][usize::from(!forwards(guess[j]))];
    let right = DVector::from_fn(r.len(), |j, _| r[j] - side(j));
    let mut w = a.clone().lu().solve(&right)?;
    let holds = |j: usize| sides[j][0] == sides[j][1] || forwards(guess[j]) == forwards(w[j]);
    if (0..r.len()).all(holds) {
        return Some(w);
    }
    for _ in 0..SWEEPS {
        let mut moved = 0.0f64;
        for j in 0..r.len() {
            let free =
                r[j] - (0..r.len()).map(|k| a[(j, k)] * w[k]).sum::<f64>() + a[(j, j)] * w[j];
            let next = alone(free, sides[j], a[(j, j)], guess[j]);
            moved = moved.max((next - w[j]).abs());
            w[j] = next;
        }
        if moved < SETTLED {
            break;
        }
    }
    Some(w)
}

/// A joint's velocity while the others stay: on the side where it is if it stays there, else on the other, else none.
fn alone(free: f64, [forwards, backwards]: [f64; 2], inertia: f64, guess: f64) -> f64 {
    let forth = Some((free - forwards) / inertia).filter(|w| *w > 0.0);
    let back = Some((free - backwards) / inertia).filter(|w| *w < 0.0);
    let found = if guess >= 0.0 {
        forth.or(back)
    } else {
        back.or(forth)
    };
    found.unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;
    use proptest::prelude::*;

    proptest! {
        /// What moves is resisted by all of its friction, what is at rest needs no more than that.
        #[test]
        fn what_friction_can_hold_it_holds(
            l in prop::array::uniform9(-1.0..1.0f64),
            r in prop::array::uniform3(-1.0..1.0f64),
            sizes in prop::array::uniform6(0.0..0.8f64),
            guess in prop::array::uniform3(-2.0..2.0f64),
        ) {
            let l = Matrix3::from_row_slice(&l);
            let a = l * l.transpose() + Matrix3::identity() * 0.2;
            let a = DMatrix::from_fn(3, 3, |i, j| a[(i, j)]);
            let r = DVector::from_column_slice(&r);
            let sides = [0, 1, 2].map(|j| [sizes[j], -sizes[3 + j]]);
            let w = solve(&a, &r, &sides, &guess).unwrap();
            let left = &r - &a * &w;
            for j in 0..3 {
                let [forwards, backwards] = sides[j];
                let wrong = match w[j] {
                    0.0 => (left[j] - forwards).max(backwards - left[j]).max(0.0),
                    w if w > 0.0 => left[j] - forwards,
                    _ => left[j] - backwards,
                };
                prop_assert!(wrong.abs() < 1e-9, "{j}: {w} leaves {left}");
            }
        }
    }
}
