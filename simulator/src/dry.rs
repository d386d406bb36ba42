//! Dry friction without chatter: implicit in the sign of the velocity.
//!
//! A step's new velocities w solve A w + h F(w) = r with A the inertia and F the friction: F± beyond ±[`WIDTH`], a straight
//! line between. F never falls and A is positive definite, so there is exactly one solution, whatever the step, the friction
//! and the inertia: joints stick and break away without a small step. Newton's method on the branches of F finds it in a
//! few solves; where it cycles, relaxation joint by joint takes over, which always converges.

use nalgebra::allocator::Allocator;
use nalgebra::{Cholesky, Const, DefaultAllocator, Dim, OMatrix, OVector, SMatrix, SVector};

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
    Some(relax(a, r, w, |j, right, own| {
        creeping(sizes[j], right, own)
    }))
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

/// Sweeps over the coordinates, each to what `alone` says of it while the others stay: of its place, of what is left for it and of its own
/// entry of A.
fn relax<N: Dim>(
    a: &OMatrix<f64, N, N>,
    r: &OVector<f64, N>,
    mut w: OVector<f64, N>,
    alone: impl Fn(usize, f64, f64) -> f64,
) -> OVector<f64, N>
where
    DefaultAllocator: Allocator<N, N> + Allocator<N>,
{
    for _ in 0..SWEEPS {
        let mut moved = 0.0f64;
        for j in 0..w.len() {
            let own = a[(j, j)];
            let right = r[j] - (a.row(j) * &w)[0] + own * w[j];
            let next = alone(j, right, own);
            moved = moved.max((next - w[j]).abs());
            w[j] = next;
        }
        if moved < 1e-13 {
            break;
        }
    }
    w
}

/// A coordinate alone under friction that grows over [`WIDTH`].
fn creeping(sizes: [f64; 2], right: f64, own: f64) -> f64 {
    let size = sizes[usize::from(right < 0.0)];
    let inside = right / (own + size / WIDTH);
    if inside.abs() < WIDTH {
        inside
    } else {
        (right - size * right.signum()) / own
    }
}

/// A coordinate alone under friction that holds it.
fn held([positive, negative]: [f64; 2], right: f64, own: f64) -> f64 {
    ((right - positive).max(0.0) + (right + negative).min(0.0)) / own
}

/// What the friction of a coordinate does.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Side {
    /// Holds it: w = 0.
    Held,
    /// Brakes it as it moves so: w > 0 or w < 0.
    Forwards,
    Backwards,
}

impl Side {
    fn of(w: f64) -> Self {
        if w > 0.0 {
            Self::Forwards
        } else if w < 0.0 {
            Self::Backwards
        } else {
            Self::Held
        }
    }

    /// The friction of a coordinate that moves.
    fn force(self, [positive, negative]: [f64; 2]) -> f64 {
        match self {
            Self::Held => 0.0,
            Self::Forwards => positive,
            Self::Backwards => -negative,
        }
    }

    /// Where a coordinate goes next that was found to have velocity `w`, or to need `held` to be held.
    fn next(self, w: f64, held: f64, [positive, negative]: [f64; 2]) -> Self {
        match self {
            Self::Held if held > positive => Self::Forwards,
            Self::Held if held < -negative => Self::Backwards,
            Self::Forwards if w < 0.0 => Self::Held,
            Self::Backwards if w > 0.0 => Self::Held,
            same => same,
        }
    }
}

/// [`solve`] with a sign that is none at rest: a coordinate that friction can hold has w = 0, and creeps by nothing.
///
/// Sets of held coordinates are tried in turn, each from what the one before says; where that does not end, relaxation takes over.
/// `None` if A is not positive definite.
pub(super) fn hold<N: Dim>(
    a: &OMatrix<f64, N, N>,
    r: &OVector<f64, N>,
    sizes: &[[f64; 2]],
    guess: &OVector<f64, N>,
) -> Option<OVector<f64, N>>
where
    DefaultAllocator: Allocator<N, N> + Allocator<N>,
{
    let mut sides: Vec<Side> = guess.iter().map(|w| Side::of(*w)).collect();
    let mut w = guess.clone();
    for _ in 0..NEWTON {
        let (mut matrix, mut right) = (a.clone(), r.clone());
        for (j, side) in sides.iter().enumerate() {
            right[j] -= side.force(sizes[j]);
            if *side == Side::Held && sizes[j] != [0.0; 2] {
                matrix.row_mut(j).fill(0.0);
                matrix.column_mut(j).fill(0.0);
                matrix[(j, j)] = 1.0;
                right[j] = 0.0;
            }
        }
        w = Cholesky::<f64, N>::new(matrix)?.solve(&right);
        let left = r - a * &w;
        let next = |(j, side): (usize, &Side)| match sizes[j] {
            [0.0, 0.0] => *side,
            own => side.next(w[j], left[j], own),
        };
        let next: Vec<Side> = sides.iter().enumerate().map(next).collect();
        if next == sides {
            return Some(w);
        }
        sides = next;
    }
    Some(relax(a, r, w, |j, right, own| held(sizes[j], right, own)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;
    use proptest::prelude::*;

    proptest! {
        /// What is held needs no more than friction can give, what moves is braked by all of it.
        #[test]
        fn what_friction_can_hold_it_holds(
            l in prop::array::uniform9(-1.0..1.0f64),
            r in prop::array::uniform3(-1.0..1.0f64),
            sizes in prop::array::uniform6(0.0..0.8f64),
            guess in prop::array::uniform3(-2.0..2.0f64),
        ) {
            let l = Matrix3::from_row_slice(&l);
            let a = l * l.transpose() + Matrix3::identity() * 0.2;
            let sizes = [[0.0, 0.0], [sizes[0], sizes[1]], [sizes[2], sizes[3]]];
            let (r, guess) = (SVector::from(r), SVector::from(guess));
            for w in [hold(&a, &r, &sizes, &guess).unwrap(), relax(&a, &r, guess, |j, right, own| held(sizes[j], right, own))] {
                let left = r - a * w;
                for j in 0..3 {
                    let [positive, negative] = sizes[j];
                    let wrong = match w[j] {
                        0.0 => (left[j] - positive).max(-negative - left[j]).max(0.0),
                        w if w > 0.0 => left[j] - positive,
                        _ => left[j] + negative,
                    };
                    prop_assert!(wrong.abs() < 1e-9, "{j}: {w} leaves {left}");
                }
            }
        }

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
            let relaxed = relax(&a, &r, guess, |j, right, own| creeping(sizes[j], right, own));
            prop_assert!((newton - relaxed).norm() < 1e-6, "{newton} {relaxed}");
        }
    }
}
