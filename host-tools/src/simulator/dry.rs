//! Dry friction without chatter: implicit in the sign of the velocity.
//!
//! A step's new velocities w solve A w + h F(w) = r with A the inertia and F the friction: F± beyond ±[`WIDTH`], a straight
//! line between. F never falls and A is positive definite, so there is exactly one solution, whatever the step, the friction
//! and the inertia: joints stick and break away without a small step. Newton's method on the branches of F finds it in a
//! few solves; where it cycles, relaxation joint by joint takes over, which always converges.

use nalgebra::{Cholesky, Const, SMatrix, SVector};

/// The sign of a velocity is a straight line within this speed, rad/s; the sensor's noise is thirty times as large.
pub(super) const WIDTH: f64 = 5e-4;
/// Newton's steps before relaxation takes over, and the most sweeps of that.
const NEWTON: usize = 12;
const SWEEPS: usize = 2000;

/// Sign of a velocity, −1 to 1.
pub(super) fn sign(dq: f64) -> f64 {
    (dq / WIDTH).clamp(-1.0, 1.0)
}

/// Friction of sizes [positive, negative] at velocity `dq`, N m.
pub(super) fn friction(sizes: [f64; 2], dq: f64) -> f64 {
    sizes[usize::from(dq < 0.0)] * sign(dq)
}

/// w of A w + F(w) = r, where F's `sizes` [positive, negative] have the step's length in them; `guess` starts it.
///
/// `None` if A is not positive definite.
pub(super) fn solve<const N: usize>(
    a: &SMatrix<f64, N, N>,
    r: &SVector<f64, N>,
    sizes: &[[f64; 2]; N],
    guess: &SVector<f64, N>,
) -> Option<SVector<f64, N>> {
    let mut w = *guess;
    for _ in 0..NEWTON {
        let (mut matrix, mut right) = (*a, *r);
        for j in 0..N {
            let [slope, offset] = branch(sizes[j], w[j]);
            matrix[(j, j)] += slope;
            right[j] -= offset;
        }
        let next = Cholesky::<f64, Const<N>>::new(matrix)?.solve(&right);
        let same = (0..N).all(|j| branch(sizes[j], w[j]) == branch(sizes[j], next[j]));
        w = next;
        if same {
            return Some(w);
        }
    }
    Some(relax(a, r, sizes, w))
}

/// Slope and offset of the straight piece of F at w.
fn branch(sizes: [f64; 2], w: f64) -> [f64; 2] {
    let size = sizes[usize::from(w < 0.0)];
    if w.abs() < WIDTH {
        [size / WIDTH, 0.0]
    } else {
        [0.0, size * w.signum()]
    }
}

fn relax<const N: usize>(
    a: &SMatrix<f64, N, N>,
    r: &SVector<f64, N>,
    sizes: &[[f64; 2]; N],
    mut w: SVector<f64, N>,
) -> SVector<f64, N> {
    for _ in 0..SWEEPS {
        let mut moved = 0.0f64;
        for j in 0..N {
            let own = a[(j, j)];
            let right = r[j] - (a.row(j) * w)[0] + own * w[j];
            let size = sizes[j][usize::from(right < 0.0)];
            let inside = right / (own + size / WIDTH);
            let next = if inside.abs() < WIDTH {
                inside
            } else {
                (right - size * right.signum()) / own
            };
            moved = moved.max((next - w[j]).abs());
            w[j] = next;
        }
        if moved < 1e-13 {
            break;
        }
    }
    w
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn both_methods_find_the_solution(
            l in prop::array::uniform9(-1.0..1.0f64),
            r in prop::array::uniform3(-1.0..1.0f64),
            sizes in prop::array::uniform6(0.0..0.8f64),
            guess in prop::array::uniform3(-2.0..2.0f64),
        ) {
            let l = Matrix3::from_row_slice(&l);
            let a = l * l.transpose() + Matrix3::identity() * 0.2;
            let sizes = [0, 1, 2].map(|j| [sizes[j], sizes[3 + j]]);
            let (r, guess) = (SVector::from(r), SVector::from(guess));
            let residual = |w: &SVector<f64, 3>| {
                let f = SVector::<f64, 3>::from_fn(|j, _| friction(sizes[j], w[j]));
                (a * w + f - r).norm()
            };
            let newton = solve(&a, &r, &sizes, &guess).unwrap();
            prop_assert!(residual(&newton) < 1e-9, "{}", residual(&newton));
            let relaxed = relax(&a, &r, &sizes, guess);
            prop_assert!((newton - relaxed).norm() < 1e-6, "{newton} {relaxed}");
        }
    }
}
