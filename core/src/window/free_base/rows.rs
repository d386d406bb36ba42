//! The sums of a free-base window: what a sample's projector is multiplied with, and the rows that come of it.

use crate::Real;
use crate::contact::Projector;
use crate::inertia::INERTIAL;
use crate::regressor::RegressorRows;
use crate::scalar::real;
use crate::tree::Tree;

/// The rows of one closed window: mean generalised forces over the window per unit of the parameter, times the scale.
///
/// Row c belongs to velocity coordinate c: moment and force on the base in its own axes, then the joints. The rows of a window
/// with feet on the ground are linearly dependent: [`rank`](Self::rank) of them tell something.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeBaseRows<T: Real, const B: usize, const V: usize, const J: usize, const E: usize> {
    /// Start and end of the window, µs.
    pub span_us: [u64; 2],
    /// How many equations contact forces leave, of those that are not left out.
    pub rank: usize,
    /// Joints whose equations are left out: friction may hold them.
    pub resting: [bool; J],
    /// The inertial columns.
    pub inertial: RegressorRows<T, B, V>,
    /// The joints' effect columns.
    pub effects: [[[T; E]; J]; V],
    /// The columns of the accelerometer's bias, per m/s², in the IMU's axes.
    pub acceleration: [[T; 3]; V],
    /// The right-hand side.
    pub torque: [T; V],
}

impl<T: Real, const B: usize, const V: usize, const J: usize, const E: usize>
    FreeBaseRows<T, B, V, J, E>
{
    pub(super) fn zero() -> Self {
        Self {
            span_us: [0; 2],
            rank: 0,
            resting: [false; J],
            inertial: [[[T::zero(); INERTIAL]; B]; V],
            effects: [[[T::zero(); E]; J]; V],
            acceleration: [[T::zero(); 3]; V],
            torque: [T::zero(); V],
        }
    }

    pub(super) fn clear(&mut self) {
        *self = Self::zero();
    }

    /// Row c as a factor takes it: inertial columns body after body, effects joint after joint, the accelerometer's bias,
    /// torque. `row` holds 10 `B` + `E` `J` + 4 numbers.
    pub fn write_row(&self, c: usize, row: &mut [T]) {
        let inertial = self.inertial[c].as_flattened().iter();
        let effects = self.effects[c].as_flattened().iter();
        let entries = inertial
            .chain(effects)
            .chain(&self.acceleration[c])
            .chain(core::iter::once(&self.torque[c]));
        row.iter_mut()
            .zip(entries)
            .for_each(|(to, from)| *to = *from);
    }

    pub(super) fn set_mean(&mut self, sum: &Self, per_second: T) {
        for c in 0..V {
            let to = self.inertial[c].as_flattened_mut().iter_mut();
            let effects = self.effects[c].as_flattened_mut().iter_mut();
            let from = sum.inertial[c].as_flattened().iter();
            let from = from.chain(sum.effects[c].as_flattened());
            to.chain(effects)
                .zip(from)
                .for_each(|(to, from)| *to = *from * per_second);
            self.acceleration[c] = sum.acceleration[c].map(|x| x * per_second);
            self.torque[c] = sum.torque[c] * per_second;
        }
    }

    /// Adds P D `share`.
    pub(super) fn add_projected<const R: usize>(
        &mut self,
        tree: &Tree<T, B, V>,
        projector: &Projector<T, V, R>,
        share: &Share<T, B, V, J, E>,
        scale: &[T; V],
    ) {
        let directions = projector.directions();
        // Directions as they meet what is not scaled yet.
        let met: [[T; V]; R] =
            core::array::from_fn(|r| core::array::from_fn(|c| directions[r][c] * scale[c]));
        for b in 0..B {
            let column = |c: usize| &share.inertial[c][b];
            let mut parts = [[T::zero(); INERTIAL]; R];
            // Only what moves the body has entries of it.
            let mut mover = Some(b);
            while let Some(a) = mover {
                for c in tree.coordinates(a) {
                    for (part, direction) in parts.iter_mut().zip(&met) {
                        for n in 0..INERTIAL {
                            part[n] += direction[c] * column(c)[n];
                        }
                    }
                    for n in 0..INERTIAL {
                        self.inertial[c][b][n] += scale[c] * column(c)[n];
                    }
                }
                mover = tree.bodies()[a].parent;
            }
            for c in 0..V {
                let to = &mut self.inertial[c][b];
                for (part, direction) in parts.iter().zip(directions) {
                    for n in 0..INERTIAL {
                        to[n] -= direction[c] * part[n];
                    }
                }
            }
        }
        self.add_projected_joints(directions, &met, share, scale);
        for n in 0..3 {
            let column: [T; V] = core::array::from_fn(|c| share.acceleration[c][n] * scale[c]);
            project_into(directions, &column, |c, x| self.acceleration[c][n] += x);
        }
    }

    /// What acts at joints: each column has one entry before P.
    fn add_projected_joints<const R: usize>(
        &mut self,
        directions: &[[T; V]; R],
        met: &[[T; V]; R],
        share: &Share<T, B, V, J, E>,
        scale: &[T; V],
    ) {
        let base = V - J;
        for j in 0..J {
            for c in 0..V {
                let own = if c == base + j { scale[c] } else { T::zero() };
                let passes = (0..R).fold(own, |passes, r| {
                    passes - directions[r][c] * met[r][base + j]
                });
                for e in 0..E {
                    self.effects[c][j][e] += passes * share.effects[j][e];
                }
                self.torque[c] += passes * share.torque[j];
            }
        }
    }
}

/// Hands out P x, entry by entry.
fn project_into<T: Real, const V: usize, const R: usize>(
    directions: &[[T; V]; R],
    x: &[T; V],
    mut add: impl FnMut(usize, T),
) {
    let mut projected = *x;
    for direction in directions {
        let part = (0..V).fold(T::zero(), |sum, c| sum + direction[c] * x[c]);
        for c in 0..V {
            projected[c] -= direction[c] * part;
        }
    }
    projected.iter().enumerate().for_each(|(c, x)| add(c, *x));
}

/// What one sample's projector is multiplied with: half of the difference of what is integrated by parts from the sample before
/// to the one after, and the rates times half the time between them.
#[derive(Clone, Debug)]
pub(super) struct Share<T: Real, const B: usize, const V: usize, const J: usize, const E: usize> {
    inertial: RegressorRows<T, B, V>,
    /// Of each joint's own row.
    pub(super) effects: [[T; E]; J],
    pub(super) acceleration: [[T; 3]; V],
    /// Of each joint's own row.
    pub(super) torque: [T; J],
    /// The half differences of the last step, which the next sample's projector is multiplied with as well.
    half_momentum: RegressorRows<T, B, V>,
    half_boundary: [[T; E]; J],
}

impl<T: Real, const B: usize, const V: usize, const J: usize, const E: usize> Share<T, B, V, J, E> {
    pub(super) fn zero() -> Self {
        let nothing = [[[T::zero(); INERTIAL]; B]; V];
        Self {
            inertial: nothing,
            effects: [[T::zero(); E]; J],
            acceleration: [[T::zero(); 3]; V],
            torque: [T::zero(); J],
            half_momentum: nothing,
            half_boundary: [[T::zero(); E]; J],
        }
    }

    /// Adds half of what W_m changed by since the last sample.
    pub(super) fn add_half_difference(
        &mut self,
        before: &RegressorRows<T, B, V>,
        now: &RegressorRows<T, B, V>,
    ) {
        let flat =
            |rows: &'_ RegressorRows<T, B, V>, n: usize| rows.as_flattened().as_flattened()[n];
        let halves = self.half_momentum.as_flattened_mut().as_flattened_mut();
        let sums = self.inertial.as_flattened_mut().as_flattened_mut();
        for (n, (half, sum)) in halves.iter_mut().zip(sums).enumerate() {
            *half = (flat(now, n) - flat(before, n)) * real(0.5);
            *sum += *half;
        }
    }

    /// Adds half of what the effects' boundary terms changed by.
    pub(super) fn add_effects(&mut self, before: &[[T; E]; J], now: &[[T; E]; J]) {
        for j in 0..J {
            for e in 0..E {
                self.half_boundary[j][e] = (now[j][e] - before[j][e]) * real(0.5);
                self.effects[j][e] += self.half_boundary[j][e];
            }
        }
    }

    /// Takes the Coriolis-transpose regressor off, for `duration` (s).
    pub(super) fn add_coriolis(&mut self, coriolis: &RegressorRows<T, B, V>, duration: T) {
        let rates = coriolis.as_flattened().as_flattened();
        let sums = self.inertial.as_flattened_mut().as_flattened_mut();
        for (sum, rate) in sums.iter_mut().zip(rates) {
            *sum -= *rate * duration;
        }
    }

    /// Begins the next sample's share with its half of the step's differences.
    pub(super) fn keep_differences(&mut self) {
        self.inertial = self.half_momentum;
        self.effects = self.half_boundary;
        self.acceleration = [[T::zero(); 3]; V];
        self.torque = [T::zero(); J];
    }
}
